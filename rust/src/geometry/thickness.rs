//! Local thickness of Hildebrand and Rüegsegger (1997): the diameter of the largest ball inside a
//! phase that contains a voxel.
//!
//! The ball of a voxel holds the voxels nearer to its centre than the nearest voxel outside. Only
//! balls that no neighbour's ball holds matter (`ridge`); each block of the volume is then painted
//! with those that reach it, thickest first, until it is full (`paint`). Blocks do not depend on
//! each other, so that neither the result nor the work depends on the number of threads.

mod balls;
mod diameters;
mod paint;
mod ridge;

use ndarray::{Array3, ArrayView3, ArrayViewMut3};
use rayon::prelude::*;

use self::balls::Cells;
use super::distance::transform::{Lattice, squared_distances};
use super::distance::{Aligned, outside, relative};
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
/// Memory: 8 bytes a voxel besides `out`, 12 if the voxels are not cubes, and 20 bytes a ball.
pub fn local_thickness(
    phase: ArrayView3<'_, bool>,
    voxel_size: [f64; 3],
    boundary: Boundary,
    out: ArrayViewMut3<'_, f32>,
    monitor: &Monitor<'_>,
) -> Result<()> {
    let Aligned { phase, voxel_size, mut out } = Aligned::new(phase, voxel_size, out)?;
    let space = Space::new(voxel_size, boundary);
    let mut reach = Array3::zeros(phase.dim());
    let lattice = space.lattice([false; 3]);
    squared_distances(outside(phase), &lattice, reach.view_mut(), |_, _| (), monitor)?;
    // Either all voxels have someone outside, or none has.
    if reach.first() == Some(&f32::INFINITY) {
        out.fill(f32::INFINITY);
        return Ok(());
    }
    let diameters = diameters::largest_nearby(phase, &space, &reach, out.view_mut(), monitor)?;
    let balls = ridge::ridge(&reach, &diameters, &space, monitor)?;
    drop((reach, diameters));
    let cells = Cells::new(balls, phase.dim(), &space);
    paint::tiles(out, paint::TILE)
        .into_par_iter()
        .try_for_each(|(origin, out)| paint::fill(&cells, phase, &space, origin, out, monitor))
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

    fn lattice(&self, half: [bool; 3]) -> Lattice {
        Lattice { size: self.size, half, boundary: self.boundary, limit: f32::INFINITY }
    }
}

#[cfg(test)]
mod tests;
