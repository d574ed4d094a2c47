//! Local thickness of Hildebrand and Rüegsegger (1997): the diameter of the largest ball inside a
//! phase that contains a voxel.
//!
//! The ball of a voxel holds the voxels nearer to its centre than the nearest voxel outside
//! (`diameters`). Most lie in the ball of a neighbour that is as thick, or nearly so (`ridge`). The
//! others, which are kept by place (`cells`), paint what does not, thickest first (`paint`), plane by
//! plane (`sections`). Tiles do not depend on each other, so that neither the result nor the work
//! depends on the threads.

mod cells;
mod diameters;
mod paint;
mod ridge;
mod sections;

use ndarray::{ArrayView3, ArrayViewMut3};
use rayon::prelude::*;

use self::cells::Cells;
use self::diameters::Balls;
use self::sections::Discs;
use super::distance::transform::{Kept, Lattice};
use super::distance::window::Lane;
use super::distance::{Aligned, relative};
use crate::error::Result;
use crate::monitor::Monitor;
use crate::volume::Boundary;

/// Writes the local thickness of each voxel of a phase, in the unit of the voxel size; 0 outside.
///
/// The surface is taken to lie half a voxel nearer than the nearest voxel outside, and a ball may be
/// centred on a voxel or half-way between voxels: the diameter of a voxel's ball is the largest of
/// those centred on it or half a voxel beside it, so that a slab of t voxels has the thickness t
/// whether t is odd or even. If no voxel is outside, the thickness is infinite. `out` is contiguous,
/// in the memory order of the phase.
///
/// Memory: 6 bytes a voxel besides `out` (12 if a radius is above 127 voxels, 16 if voxels are no
/// cubes), and then 24 bytes a ball that is kept: one in five voxels of blobs and of foams.
pub fn local_thickness(
    phase: ArrayView3<'_, bool>,
    voxel_size: [f64; 3],
    boundary: Boundary,
    out: ArrayViewMut3<'_, f32>,
    monitor: &Monitor<'_>,
) -> Result<()> {
    let Aligned { phase, voxel_size, mut out } = Aligned::new(phase, voxel_size, out)?;
    let space = Space::new(voxel_size, boundary);
    if space.is_cubic()
        && let Some(balls) = Balls::<u16>::new(phase, &space, monitor)?
    {
        return fill(balls, &space, phase, out, monitor);
    }
    match Balls::<f32>::new(phase, &space, monitor)? {
        // Either all voxels have someone outside, or none has.
        Some(balls) if balls.reach.first() == Some(&f32::INFINITY) => out.fill(f32::INFINITY),
        Some(balls) => fill(balls, &space, phase, out, monitor)?,
        None => (),
    }
    Ok(())
}

fn fill<T: Lane + Kept<T>>(
    balls: Balls<T>,
    space: &Space,
    phase: ArrayView3<'_, bool>,
    out: ArrayViewMut3<'_, f32>,
    monitor: &Monitor<'_>,
) -> Result<()> {
    let slabs = ridge::ridge(&balls, space, monitor)?;
    drop(balls);
    let cells = Cells::new(slabs, phase.dim(), space);
    let discs = if space.is_cubic() { Discs::of_cubes(cells.reach()) } else { Discs::none() };
    paint::tiles(out).into_par_iter().try_for_each(|(origin, out)| {
        paint::fill((&cells, &discs), phase, space, origin, out, monitor)
    })
}

/// Where voxels are, in units in which most squared distances are whole numbers.
struct Space {
    /// Edges of a voxel: 2 for cubes, so that half a voxel is a whole number too.
    size: [f64; 3],
    /// The unit's length.
    unit: f64,
    boundary: Boundary,
}

impl Space {
    fn new(voxel_size: [f64; 3], boundary: Boundary) -> Self {
        let (shortest, edges) = relative(voxel_size);
        Self { size: edges.map(|edge| 2.0 * edge), unit: 0.5 * shortest, boundary }
    }

    fn is_cubic(&self) -> bool {
        self.size.iter().all(|edge| (edge - 2.0).abs() < f64::EPSILON)
    }

    /// Diameter of a ball, by its rank: where a voxel has the edge 2, half a voxel is the unit.
    fn diameter(&self, rank: f32) -> f32 {
        if self.is_cubic() { (rank.sqrt() - 1.0) * (2.0 * self.unit as f32) } else { rank }
    }

    fn lattice(&self, half: [bool; 3]) -> Lattice {
        Lattice { size: self.size, half, boundary: self.boundary, limit: f32::INFINITY }
    }
}

#[cfg(test)]
mod tests;
