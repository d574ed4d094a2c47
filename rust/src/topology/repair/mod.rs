//! Changes of a phase that keep its topology, or change it where that is wanted.

pub mod branches;
pub mod connect;
mod grid;
mod recount;
mod scene;

use ndarray::{ArrayView3, ArrayViewMut3};

use self::scene::Scene;
use super::labelling::Connectivity;
use crate::error::{Error, Result};
use crate::monitor::Monitor;
use crate::volume::Boundary;

/// Gives a phase a number of voxels along its surface: it loses those of the lowest scores, or gains
/// those of the highest beside it. Only free voxels change, and only where the topology stays. Returns
/// how many voxels are missing at the end, negative if there are too many.
///
/// Peak memory: 5 bytes a voxel, and 16 a voxel of the surface.
pub fn recount(
    mut phase: ArrayViewMut3<'_, bool>,
    score: ArrayView3<'_, f32>,
    free: Option<ArrayView3<'_, bool>>,
    (connectivity, boundary): (Connectivity, Boundary),
    wanted: usize,
    monitor: &Monitor<'_>,
) -> Result<i64> {
    check(phase.dim(), score, free, connectivity)?;
    let mut scene = Scene::new(phase.view(), free, connectivity, boundary).scored(score);
    let missing = recount::restore(&mut scene, wanted, monitor)?;
    for (voxel, at) in phase.iter_mut().zip(0..) {
        *voxel = scene.phase(at);
    }
    Ok(missing)
}

fn check(
    shape: (usize, usize, usize),
    score: ArrayView3<'_, f32>,
    free: Option<ArrayView3<'_, bool>>,
    connectivity: Connectivity,
) -> Result<()> {
    if score.dim() != shape {
        return Err(Error::parameter("score.shape", score.dim(), "must be that of the phase"));
    }
    if let Some(free) = free.filter(|free| free.dim() != shape) {
        return Err(Error::parameter("free.shape", free.dim(), "must be that of the phase"));
    }
    if let Some(value) = score.iter().find(|value| !value.is_finite()) {
        return Err(Error::parameter("score", value, "must be finite"));
    }
    if connectivity == Connectivity::Edges {
        // There is no connectivity of the other phase that goes with it.
        return Err(Error::parameter("connectivity", 18, "must be 6 or 26"));
    }
    Ok(())
}
