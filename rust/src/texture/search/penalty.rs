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

/// Far sites: two along each axis.
const FAR: usize = 6;

/// No orientation.
const NOWHERE: i32 = -1;

/// Where the copies at the six far sites of each of N sites would continue.
pub(super) struct Continuations<const N: usize> {
    orientation: [[i32; N]; FAR],
    /// Along each axis.
    origin: [[[i32; N]; 3]; FAR],
}

impl<const N: usize> Continuations<N> {
    /// Nothing to continue.
    pub(super) const fn none() -> Self {
        Self { orientation: [[NOWHERE; N]; FAR], origin: [[[0; N]; 3]; FAR] }
    }

    /// Looks the far sites of one site up.
    #[inline(always)]
    pub(super) fn look_up(&mut self, lane: usize, scene: &Scene<'_>, links: [&Links; 3]) {
        let own = links.map(|l| l.own);
        for i in 0..FAR {
            let (axis, side) = (i / 2, i % 2);
            let Some(far) = links[axis].far[side] else { continue };
            let mut at = own;
            at[axis] = far;
            let found = scene.previous.at(at.map(|n| n.index));
            self.orientation[i][lane] = i32::from(found.orientation);
            for (a, origin) in self.origin[i].iter_mut().enumerate() {
                origin[lane] = i32::from(found.origin[a]) + at[a].step;
            }
        }
    }

    /// How many of its six far sites each candidate continues.
    #[inline(always)]
    pub(super) fn count(&self, candidates: &[Match; N]) -> [i32; N] {
        let [mut orientation, mut z, mut y, mut x] = [[0; N]; 4];
        for (lane, m) in candidates.iter().enumerate() {
            orientation[lane] = i32::from(m.orientation);
            [z[lane], y[lane], x[lane]] = m.origin.map(i32::from);
        }
        let mut counts = [0; N];
        for (far, origin) in self.orientation.iter().zip(&self.origin) {
            for lane in 0..N {
                // At most one voxel off along each axis.
                let off = (origin[0][lane] - z[lane]).abs().max((origin[1][lane] - y[lane]).abs());
                let off = off.max((origin[2][lane] - x[lane]).abs());
                counts[lane] += i32::from(off <= 1) & i32::from(far[lane] == orientation[lane]);
            }
        }
        counts
    }
}
