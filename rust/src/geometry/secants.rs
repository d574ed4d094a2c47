//! Test lines along the directions of the lattice: what stereology measures a phase with.

use ndarray::ArrayView3;

use super::changes::phase_changes;
use super::directions::{direction_weights, lattice_directions, length};
use super::packed::Step;
use crate::error::{Error, Result};
use crate::monitor::Monitor;
use crate::volume::Boundary;

/// All lines along one direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Secant {
    /// From voxel to voxel.
    pub step: Step,
    /// Length of the step.
    pub length: f64,
    /// Steps that the lines have in total.
    pub pairs: u64,
    /// Changes of phase on the lines.
    pub changes: u64,
    /// Weight of the direction in a mean over all directions.
    pub weight: f64,
}

impl Secant {
    /// Changes of phase per length of a line.
    pub fn density(&self) -> f64 {
        self.changes as f64 / (self.pairs as f64 * self.length)
    }
}

/// Longest reach: steps get so long that they miss what lies between.
pub const MAX_REACH: usize = 3;

/// Lines along all directions of the lattice whose components are at most `reach`, as far as the
/// volume holds such steps.
///
/// # Errors
/// If the volume is empty or `reach` is not 1, 2 or 3.
pub fn secants(
    solid: ArrayView3<'_, bool>,
    reach: usize,
    voxel_size: [f64; 3],
    boundary: Boundary,
    monitor: &Monitor<'_>,
) -> Result<Vec<Secant>> {
    if !(1..=MAX_REACH).contains(&reach) {
        return Err(Error::parameter("reach", reach, format!("must be from 1 to {MAX_REACH}")));
    }
    let steps = lattice_directions(reach);
    let found = phase_changes(solid, &steps, boundary, monitor)?;
    let (steps, found): (Vec<_>, Vec<_>) =
        steps.into_iter().zip(found).filter(|(_, found)| found.pairs > 0).unzip();
    let weights = direction_weights(&steps, voxel_size);
    let secants = steps.into_iter().zip(found).zip(weights).map(|((step, found), weight)| Secant {
        step,
        length: length(step, voxel_size),
        pairs: found.pairs,
        changes: found.changes,
        weight,
    });
    Ok(secants.collect())
}
