//! Local thickness of Hildebrand and Rüegsegger (1997): the diameter of the largest ball inside a
//! phase that contains a voxel.
//!
//! The ball of a voxel holds the voxels nearer to its centre than the nearest voxel outside
//! (`diameters`). Most lie in the ball of a neighbour (`steps`) that is as thick (`ridge`), if that is
//! large enough (`needed`). The others, which are kept by place (`cells`), paint what does not,
//! thickest first (`paint`), plane by plane (`sections`). Tiles do not depend on each other, so that
//! neither the result nor the work depends on the threads.

mod cells;
mod diameters;
mod needed;
mod paint;
mod ridge;
mod sections;
mod steps;

use bytemuck::Pod;
use ndarray::{ArrayView3, ArrayViewMut3};
use rayon::prelude::*;

use self::cells::Cells;
use self::diameters::Balls;
use self::sections::Discs;
use self::steps::Steps;
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
/// Memory besides `out`: 10 bytes a ball that is kept, of which there is one for five to ten voxels of
/// blobs and of foams. If a radius is above 127 voxels, or voxels are no cubes, 4 bytes a voxel and 16
/// a ball.
pub fn local_thickness(
    phase: ArrayView3<'_, bool>,
    voxel_size: [f64; 3],
    boundary: Boundary,
    out: ArrayViewMut3<'_, f32>,
    monitor: &Monitor<'_>,
) -> Result<()> {
    let Aligned { phase, voxel_size, mut out } = Aligned::new(phase, voxel_size, out)?;
    if phase.iter().all(|&inside| inside) {
        out.fill(f32::INFINITY);
        return Ok(());
    }
    let space = Space::new(voxel_size, boundary);
    if !space.cubic || !fill::<u16>(&space, phase, out.view_mut(), monitor)? {
        fill::<f32>(&space, phase, out, monitor)?;
    }
    Ok(())
}

/// False if squares are too large to be kept, in which case `out` is of no use.
fn fill<T: Lane + Kept<T> + Pod>(
    space: &Space,
    phase: ArrayView3<'_, bool>,
    mut out: ArrayViewMut3<'_, f32>,
    monitor: &Monitor<'_>,
) -> Result<bool> {
    let room = out.as_slice_mut().unwrap_or_default();
    let mut more = Vec::new();
    let Some(balls) = Balls::<T>::new(phase, space, room, &mut more, monitor)? else {
        return Ok(false);
    };
    let slabs = ridge::ridge(&balls, space, monitor)?;
    drop(more);
    let cells = Cells::new(slabs, phase.dim(), space);
    let discs = if space.cubic { Discs::of_cubes(cells.reach()) } else { Discs::none() };
    let work = paint::Work::default;
    paint::tiles(out).into_par_iter().try_for_each_init(work, |work, (origin, out)| {
        paint::fill(work, (&cells, &discs), phase, space, origin, out, monitor)
    })?;
    Ok(true)
}

/// Where voxels are, in units in which most squared distances are whole numbers.
struct Space {
    /// Edges of a voxel: 2 for cubes, so that half a voxel is a whole number too.
    size: [f64; 3],
    /// One by each edge.
    by_edge: [f32; 3],
    /// The unit's length.
    unit: f64,
    cubic: bool,
    steps: Steps,
    boundary: Boundary,
}

impl Space {
    fn new(voxel_size: [f64; 3], boundary: Boundary) -> Self {
        let (shortest, edges) = relative(voxel_size);
        let size = edges.map(|edge| 2.0 * edge);
        Self {
            size,
            by_edge: size.map(|edge| (1.0 / edge) as f32),
            unit: 0.5 * shortest,
            cubic: size.iter().all(|edge| (edge - 2.0).abs() < f64::EPSILON),
            steps: Steps::new(size),
            boundary,
        }
    }

    /// Diameter of a ball, by its rank: where a voxel has the edge 2, half a voxel is the unit. That of
    /// none is 0.
    #[inline(always)]
    fn diameter(&self, rank: f32) -> f32 {
        if self.cubic { (rank.sqrt().max(1.0) - 1.0) * (2.0 * self.unit as f32) } else { rank }
    }

    /// Takes so much off the square of a ball that no rounding reaches the voxels outside: between
    /// voxels that are cubes, squares are multiples of 4.
    fn inside(&self, square: f32) -> f32 {
        if self.cubic { square - 2.0 } else { square * (1.0 - 1e-6) }
    }

    fn lattice(&self, half: [bool; 3]) -> Lattice {
        Lattice { size: self.size, half, boundary: self.boundary, limit: f32::INFINITY }
    }
}

#[cfg(test)]
mod tests;
