//! Finding, for each window of the output, its best match in the exemplar (zhang_2017 §4.2).
//!
//! Three backends behind one trait: [`BruteForce`] looks at every window and is the oracle of the
//! tests, [`KdTree`] is the paper's, [`Coherent`] continues what neighbouring windows found.

mod brute_force;
mod coherent;
mod kd_tree;
pub mod penalty;

pub use brute_force::BruteForce;
pub use coherent::Coherent;
pub use kd_tree::KdTree;

use super::lattice::{Lattice, Links, links};
use super::match_map::{Match, MatchMap};
use super::neighbourhoods::Neighbourhoods;
use super::parameters::Backend;
use crate::error::Result;
use crate::rng::Key;
use crate::volume::position;
use penalty::{Continuations, IndexHistogram, RunPenalty};

/// What every site of a pass sees: the exemplar's windows and the frozen results of the pass before.
pub struct Scene<'a> {
    /// The candidates.
    pub neighbourhoods: &'a Neighbourhoods<'a>,
    /// The match map of the pass before.
    pub previous: &'a MatchMap,
    /// The windows to match now.
    pub lattice: &'a Lattice,
    /// Random numbers of this pass.
    pub key: Key,
    links: [Vec<Links>; 3],
    histogram: Option<IndexHistogram>,
    run: Option<RunPenalty>,
}

impl<'a> Scene<'a> {
    /// Relates the lattice of this pass to the map of the pass before.
    pub fn new(
        neighbourhoods: &'a Neighbourhoods<'a>,
        previous: &'a MatchMap,
        lattice: &'a Lattice,
        histogram: Option<IndexHistogram>,
        run: Option<RunPenalty>,
        key: Key,
    ) -> Self {
        let reach = run.map_or(0, |r| r.reach);
        let links = std::array::from_fn(|a| links(lattice, &previous.lattice, a, reach));
        Self { neighbourhoods, previous, lattice, key, links, histogram, run }
    }

    /// A site and what it sees.
    fn site(&'a self, index: usize, query: &'a [i16]) -> Site<'a> {
        let at = position(self.lattice.sites(), index);
        let links: [&Links; 3] = std::array::from_fn(|a| &self.links[a][at[a]]);
        let run = self.run.map(|run| (run.cost, Continuations::new(self, links)));
        Site { scene: self, index, query, links, run }
    }

    /// The match of a site of the previous map, continued to here.
    fn continued(&self, [z, y, x]: [usize; 3], step: [i32; 3]) -> Option<Match> {
        let [_, ny, nx] = self.previous.lattice.sites();
        let found = self.previous.matches[(z * ny + y) * nx + x];
        found.is_some().then(|| found.moved(step, self.neighbourhoods.limit(found.orientation)))
    }
}

/// One window of the output, looking for its match.
struct Site<'a> {
    scene: &'a Scene<'a>,
    index: usize,
    query: &'a [i16],
    links: [&'a Links; 3],
    run: Option<(f32, Continuations)>,
}

impl Site<'_> {
    /// Cost of a candidate: the descriptor distance, raised for windows that are used too often, plus
    /// the penalty for continuing a verbatim copy.
    #[inline(always)]
    fn cost(&self, distance: i32, candidate: Match, at: usize) -> f32 {
        let mut cost = distance as f32;
        if let Some(histogram) = &self.scene.histogram {
            cost *= histogram.weight(at);
        }
        if let Some((penalty, continuations)) = &self.run {
            cost += penalty * continuations.count(candidate);
        }
        cost
    }
}

/// A way to find matches. All backends minimise the same cost.
pub trait Search: Sync {
    /// Finds the matches of the sites `first..first + out.len()`, whose descriptors lie one after the
    /// other in `queries`. Sites outside the domain arrive as they are and are left alone:
    /// `active` says which ones count.
    fn search(
        &self,
        scene: &Scene<'_>,
        first: usize,
        queries: &[i16],
        active: &[bool],
        out: &mut [Match],
    );

    /// Whether matches get better when the same pass is searched again.
    fn improves(&self) -> bool {
        false
    }
}

/// Makes a backend ready to search an exemplar's windows.
///
/// # Errors
/// If the backend cannot take these windows, or its parameters are out of range.
pub fn prepare(backend: Backend, set: &Neighbourhoods<'_>) -> Result<Box<dyn Search>> {
    Ok(match backend {
        Backend::BruteForce => Box::new(BruteForce),
        Backend::KdTree(candidates) => Box::new(KdTree::new(set, candidates)?),
        Backend::Coherent => Box::new(Coherent),
    })
}

/// Squared Euclidean distance of two descriptors, whose length is a multiple of 16.
#[inline(always)]
fn squared_distance(a: &[i16], b: &[i16]) -> i32 {
    let mut sums = [0i32; 16];
    for (a, b) in a.chunks_exact(16).zip(b.chunks_exact(16)) {
        for i in 0..16 {
            let d = i32::from(a[i]) - i32::from(b[i]);
            sums[i] += d * d;
        }
    }
    sums.iter().sum()
}

#[cfg(test)]
mod tests;
