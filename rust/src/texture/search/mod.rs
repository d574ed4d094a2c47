//! Finding, for each window of the output, its best match in the exemplar (zhang_2017 §4.2).
//!
//! Three backends behind one trait: [`BruteForce`] looks at every window and is the oracle of the
//! tests, [`KdTree`] is the paper's, [`Coherent`] continues what neighbouring windows found.

pub mod annealing;
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
use annealing::Heat;
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
    heat: Option<Heat>,
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
        Self { neighbourhoods, previous, lattice, key, links, histogram, run, heat: None }
    }

    /// The same with a random choice among the candidates of coherent search.
    #[must_use]
    pub fn heated(self, heat: Option<Heat>) -> Self {
        Self { heat, ..self }
    }

    /// Relations of a site to the map of the pass before, along each axis.
    #[inline(always)]
    fn links(&self, [z, y, x]: [usize; 3]) -> [&Links; 3] {
        [&self.links[0][z], &self.links[1][y], &self.links[2][x]]
    }

    /// A site and what it sees.
    fn site(&'a self, index: usize, query: &'a [i16]) -> Site<'a> {
        let run = self.run.map(|run| {
            let mut continuations = Continuations::none();
            let place = position(self.lattice.sites(), index);
            continuations.look_up(0, self, self.links(place));
            (run.cost, continuations)
        });
        Site { scene: self, index, query, run }
    }

    /// The match of a site of the previous map, continued to here.
    #[inline(always)]
    fn continued(&self, at: [usize; 3], step: [i32; 3]) -> Option<Match> {
        let found = self.previous.at(at);
        found.is_some().then(|| found.moved(step, self.neighbourhoods.limit(found.orientation)))
    }

    /// The descriptor distance of a window, raised if it is used too often.
    #[inline(always)]
    fn weighted(&self, distance: i32, window: usize) -> f32 {
        let weight = self.histogram.as_ref().map_or(1.0, |histogram| histogram.weight(window));
        weight * distance as f32
    }
}

/// One window of the output, looking for its match.
struct Site<'a> {
    scene: &'a Scene<'a>,
    index: usize,
    query: &'a [i16],
    run: Option<(f32, Continuations<1>)>,
}

impl Site<'_> {
    /// Cost of a candidate: the weighted distance, plus the penalty for continuing a verbatim copy.
    #[inline(always)]
    fn cost(&self, distance: i32, candidate: Match, at: usize) -> f32 {
        let cost = self.scene.weighted(distance, at);
        let Some((penalty, continuations)) = &self.run else { return cost };
        let [count] = continuations.count(&[candidate]);
        cost + penalty * count as f32
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

/// Squared Euclidean distance of two descriptors, whose length is a multiple of 16 and whose
/// differences fit 16 bits.
#[inline(always)]
fn squared_distance(a: &[i16], b: &[i16]) -> i32 {
    let mut sums = [0i32; 8];
    for (a, b) in a.as_chunks::<16>().0.iter().zip(b.as_chunks::<16>().0) {
        let d: [i16; 16] = std::array::from_fn(|i| a[i].wrapping_sub(b[i]));
        for (i, sum) in sums.iter_mut().enumerate() {
            // A pair in one instruction.
            let (even, odd) = (i32::from(d[2 * i]), i32::from(d[2 * i + 1]));
            *sum += even * even + odd * odd;
        }
    }
    sums.iter().sum()
}

#[cfg(test)]
mod tests;
