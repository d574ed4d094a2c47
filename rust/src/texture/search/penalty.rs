//! What keeps the output from repeating or copying the exemplar.

use super::Scene;
use crate::texture::lattice::Links;
use crate::texture::match_map::{Match, MatchMap};
use crate::texture::neighbourhoods::Neighbourhoods;

/// How often each window of the exemplar was used in the pass before (zhang_2017 §4.2, after Chen &
/// Wang 2010).
pub struct IndexHistogram {
    weights: Vec<f32>,
}

impl IndexHistogram {
    /// Counts the uses. The paper's weight is `w_d = 1 + max(0, H − θ)` with H the share of the sites
    /// that use a window and θ = 1 / |exemplar|: literally, H stays so small that it does nothing.
    /// `normalised` measures the excess in units of θ: `1 + max(0, H / θ − 1)`.
    pub fn new(previous: &MatchMap, set: &Neighbourhoods<'_>, normalised: bool) -> Self {
        let mut weights = vec![0.0f32; set.len()];
        let mut sites = 0.0f32;
        for m in previous.matches.iter().filter(|m| m.is_some()) {
            weights[set.index(m.moved([0; 3], set.limit(m.orientation)))] += 1.0;
            sites += 1.0;
        }
        let theta = 1.0 / set.len() as f32;
        for w in &mut weights {
            let share = *w / sites.max(1.0);
            let excess = if normalised { share / theta - 1.0 } else { share - theta };
            *w = 1.0 + excess.max(0.0);
        }
        Self { weights }
    }

    /// The factor on the distance of a window.
    #[inline(always)]
    pub fn weight(&self, index: usize) -> f32 {
        self.weights[index]
    }
}

/// The price of continuing a verbatim copy: it trades structure for novelty.
///
/// A candidate pays `cost` for each of the six sites `reach` voxels away along the axes whose match
/// in the pass before continues it, i.e. has the same orientation and the same offset to the output
/// within one voxel. It is added: a copy has a distance near zero, so that a factor would do nothing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RunPenalty {
    /// Distance of the sites that are compared, in voxels of the level.
    pub reach: usize,
    /// Price per continuing site, in squared descriptor units.
    pub cost: f32,
}

/// Where the copies at the six far sites would continue at this site.
pub struct Continuations {
    orientation: [i32; LANES],
    /// Along each axis.
    origin: [[i32; LANES]; 3],
}

/// Far sites, and two that are none, so that all are compared at once.
const LANES: usize = 8;

/// No orientation.
const NOWHERE: i32 = -1;

impl Continuations {
    /// Looks the six sites up.
    pub(super) fn new(scene: &Scene<'_>, links: [&Links; 3]) -> Self {
        let [_, ny, nx] = scene.previous.lattice.sites();
        let own = links.map(|l| l.own);
        let mut expected = Self { orientation: [NOWHERE; LANES], origin: [[0; LANES]; 3] };
        for i in 0..6 {
            let (axis, side) = (i / 2, i % 2);
            let Some(far) = links[axis].far[side] else { continue };
            let mut at = own;
            at[axis] = far;
            let found = scene.previous.matches[(at[0].index * ny + at[1].index) * nx + at[2].index];
            expected.orientation[i] = i32::from(found.orientation);
            for (a, origin) in expected.origin.iter_mut().enumerate() {
                origin[i] = i32::from(found.origin[a]) + at[a].step;
            }
        }
        expected
    }

    /// How many of the six sites a candidate continues.
    #[inline(always)]
    pub(super) fn count(&self, candidate: Match) -> f32 {
        let orientation = i32::from(candidate.orientation);
        let [z, y, x] = candidate.origin.map(i32::from);
        let mut count = 0;
        for i in 0..LANES {
            // At most one voxel off along each axis.
            let off = (self.origin[0][i] - z).abs().max((self.origin[1][i] - y).abs());
            let off = off.max((self.origin[2][i] - x).abs());
            count += i32::from(off <= 1 && self.orientation[i] == orientation);
        }
        count as f32
    }
}
