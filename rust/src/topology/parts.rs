//! Phases without some of their components.

use ndarray::{ArrayView3, ArrayViewMut3};

use super::forest::Forest;
use super::labelling::{Connectivity, paint};
use crate::error::Result;
use crate::monitor::Monitor;
use crate::volume::Boundary;

/// Which components stay.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Keep {
    /// Those of so many voxels or more.
    AtLeast(u64),
    /// The largest; of several, the one whose first voxel comes first in C order.
    Largest,
}

/// Writes the true voxels of the components that stay into `kept`, which must be false.
///
/// Peak memory: 1 bit a voxel and 12 bytes a run.
pub fn keep_parts(
    solid: ArrayView3<'_, bool>,
    keep: Keep,
    connectivity: Connectivity,
    boundary: Boundary,
    kept: ArrayViewMut3<'_, bool>,
    monitor: &Monitor<'_>,
) -> Result<()> {
    let forest = Forest::<u64>::grow(solid, true, connectivity, boundary, monitor)?;
    let sizes = &forest.tallies;
    let stays: Vec<bool> = match keep {
        Keep::AtLeast(size) => sizes.iter().map(|&voxels| voxels >= size).collect(),
        Keep::Largest => {
            let largest = sizes.iter().max();
            let first = sizes.iter().position(|voxels| Some(voxels) == largest);
            (0..sizes.len()).map(|component| Some(component) == first).collect()
        }
    };
    paint(&forest, kept, |component| stays[component as usize].then_some(true))
}
