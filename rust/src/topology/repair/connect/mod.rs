//! A phase made one piece: small islands are erased, the others joined by bridges where a score is
//! nearest to the phase, and the number of voxels is restored along the surface.

mod bridges;
mod queue;

use ndarray::{Array3, ArrayView3, ArrayViewMut3};

use self::bridges::Toll;
use super::recount;
use super::scene::Scene;
use crate::error::{Error, Result};
use crate::monitor::Monitor;
use crate::topology::labelling::{Connectivity, label};
use crate::volume::Boundary;

/// The thickest bridge: those of structures that fit a volume are far below.
const WIDEST: f64 = 32.0;

/// What a piece is, and how it is made.
#[derive(Debug, Clone, Copy)]
pub struct Options {
    /// By faces, with a topology in which the other phase touches by corners, or the other way round.
    pub connectivity: Connectivity,
    /// What lies beyond the border.
    pub boundary: Boundary,
    /// Islands of fewer voxels are erased, unless they hold a voxel that is not free.
    pub smallest: u64,
    /// Thickness of bridges in voxels, from 1 to 32.
    pub width: f64,
}

/// What became of the components of a phase.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Outcome {
    /// Islands that were erased.
    pub erased: usize,
    /// Islands that are now part of another component.
    pub joined: usize,
    /// Islands that no free voxels lead to.
    pub apart: usize,
    /// Voxels that the phase lacks of what it had; negative if it has more.
    pub missing: i64,
}

/// Writes a phase whose islands are erased or joined to the largest component into `connected`.
///
/// High scores belong to the phase. A bridge follows the path on which they lie least below the cut:
/// the score that as many free voxels reach as the phase has. All bridges together are the cheapest,
/// as in a minimum spanning tree of the components. They are thickened, and the surplus is taken from
/// the lowest scores of the surface, or the deficit added at the highest, by voxels that leave the
/// topology as it is. Voxels that are not `free` stay as they are. A phase of one piece is unchanged.
///
/// Peak memory: 15 bytes a voxel, 8 a voxel of an island, and 4 a voxel for scores not in C order.
pub fn connect(
    phase: ArrayView3<'_, bool>,
    score: ArrayView3<'_, f32>,
    free: Option<ArrayView3<'_, bool>>,
    options: &Options,
    mut connected: ArrayViewMut3<'_, bool>,
    monitor: &Monitor<'_>,
) -> Result<Outcome> {
    super::check(phase.dim(), score, free, options.connectivity)?;
    if !(1.0..=WIDEST).contains(&options.width) {
        let allowed = format!("must be from 1 to {WIDEST}");
        return Err(Error::parameter("width", options.width, allowed));
    }
    if connected.dim() != phase.dim() {
        return Err(Error::parameter("output.shape", connected.dim(), "must be that of the phase"));
    }
    connected.assign(&phase);
    let Options { connectivity, boundary, smallest, width } = *options;
    let mut labels = Array3::zeros(phase.dim());
    let sizes = label(phase, connectivity, boundary, labels.view_mut(), monitor)?;
    if sizes.len() < 2 {
        return Ok(Outcome::default());
    }
    let mut labels = labels.into_raw_vec_and_offset().0;
    let mut scene = Scene::new(phase, free, connectivity, boundary).scored(score);
    let wanted = scene.size();
    let toll = Toll::new(&scene);
    let largest = largest(&sizes);
    let erased = erase(&mut scene, &mut labels, &sizes, largest, smallest);
    let apart = sizes.len() - 1 - erased;
    let mut joined = 0;
    if apart > 0 {
        let path;
        (path, joined) = bridges::join(&mut scene, labels, largest, toll, monitor)?;
        bridges::thicken(&mut scene, &path, width, monitor)?;
    }
    let missing = recount::restore(&mut scene, wanted, monitor)?;
    for (voxel, at) in connected.iter_mut().zip(0..) {
        *voxel = scene.phase(at);
    }
    Ok(Outcome { erased, joined, apart: apart - joined, missing })
}

/// Label of the largest component; of several, of the first.
fn largest(sizes: &[u64]) -> u32 {
    let most = sizes.iter().max();
    sizes.iter().zip(1..).find(|(size, _)| Some(*size) == most).map_or(0, |(_, label)| label)
}

/// Takes the small islands out of the phase. Returns how many there were.
fn erase(
    scene: &mut Scene<'_>,
    labels: &mut [u32],
    sizes: &[u64],
    largest: u32,
    smallest: u64,
) -> usize {
    let small = sizes.iter().zip(1..).map(|(&size, label)| size < smallest && label != largest);
    let mut goes: Vec<bool> = small.collect();
    for (at, &label) in labels.iter().enumerate() {
        if label > 0 && !scene.free(at) {
            goes[label as usize - 1] = false;
        }
    }
    for (at, label) in labels.iter_mut().enumerate() {
        if *label > 0 && goes[*label as usize - 1] {
            *label = 0;
            scene.take(at);
        }
    }
    goes.into_iter().filter(|&goes| goes).count()
}

#[cfg(test)]
mod tests;
