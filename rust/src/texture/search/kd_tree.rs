//! The paper's search: a kd-tree, whose candidates are ranked again by the full cost.

use std::num::NonZero;

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;

use super::{Scene, Search, Site, squared_distance};
use crate::error::{Error, Result};
use crate::texture::match_map::Match;
use crate::texture::neighbourhoods::Neighbourhoods;

/// Leading components in the tree. A kd-tree slows down steeply with dimensions: over 800 k windows of
/// edge 8, for 20 neighbours, 6 dimensions answer 5 times as many queries as 8 and 22 times as many as
/// 12; at window 4 all three contain the best window.
const TREE_DIMS: usize = 6;

/// Nearest windows in the tree's dimensions, over the paper's number of candidates, that are compared
/// in all dimensions. With 4 × 10 the root mean square distance of what is found is within 15 % of the
/// exact search's at window 8, and equal at window 4.
const OVERSAMPLING: usize = 4;

/// kd-tree over the leading components (kiddo), re-ranked in all components to `candidates`, of which
/// the one with the lowest penalised cost wins (zhang_2017 §4.2, k = 10).
///
/// Windows that are equal in the tree's dimensions are one point of it: binary exemplars have tens of
/// thousands of windows without an interface, all of which a query there would visit.
///
/// Memory: at most 40 bytes a window.
pub struct KdTree {
    tree: ImmutableKdTree<f32, TREE_DIMS>,
    /// Windows, those of one point together, and where the windows of each point begin.
    windows: Vec<u32>,
    starts: Vec<u32>,
    candidates: usize,
    nearest: usize,
}

impl KdTree {
    /// Builds the tree.
    ///
    /// # Errors
    /// If `candidates` is 0, or there are more windows than a u32 counts.
    pub fn new(set: &Neighbourhoods<'_>, candidates: usize) -> Result<Self> {
        if candidates == 0 {
            return Err(Error::parameter("candidates", candidates, "must be at least 1"));
        }
        let count = u32::try_from(set.len()).map_err(|_| {
            Error::parameter("exemplar", set.len(), "has too many windows for a kd-tree")
        })?;
        let point = |window: u32| &set.descriptor(window as usize)[..TREE_DIMS];
        let mut windows: Vec<u32> = (0..count).collect();
        windows.par_sort_unstable_by(|&a, &b| point(a).cmp(point(b)).then(a.cmp(&b)));
        let mut starts = Vec::new();
        let mut points = Vec::new();
        for (i, &window) in windows.iter().enumerate() {
            if i == 0 || point(windows[i - 1]) != point(window) {
                starts.push(i as u32);
                points.push(leading(point(window)));
            }
        }
        starts.push(count);
        let tree = ImmutableKdTree::new_from_slice(&points).map_err(|e| {
            Error::parameter("search", "kd-tree", format!("could not be built: {e:?}"))
        })?;
        let nearest = candidates.saturating_mul(OVERSAMPLING);
        Ok(Self { tree, windows, starts, candidates, nearest })
    }

    /// Windows near a query, with their distances in all dimensions: the nearest points' windows, of
    /// a point with many of them as many as are ranked, spread over the exemplar.
    fn near(&self, site: &Site<'_>) -> Vec<(i32, usize)> {
        let set = site.scene.neighbourhoods;
        let key = site.scene.key.with(site.index as u64);
        let points = self.nearest.min(self.starts.len() - 1);
        let Some(points) = NonZero::new(points) else { return Vec::new() };
        let mut found = Vec::with_capacity(self.nearest);
        let query = leading(site.query);
        let nearest = self.tree.query(&query).nearest_n::<SquaredEuclidean<f32>>(points).execute();
        for point in nearest.into_iter().map(|n| n.item as usize) {
            let room = self.nearest - found.len();
            if room == 0 {
                break;
            }
            let range = self.starts[point] as usize..self.starts[point + 1] as usize;
            let equal = &self.windows[range];
            let taken = equal.len().min(self.candidates).min(room);
            let first = key.below(point as u64, equal.len());
            found.extend((0..taken).map(|i| {
                let at = equal[(first + i * equal.len() / taken) % equal.len()] as usize;
                (squared_distance(site.query, set.descriptor(at)), at)
            }));
        }
        found
    }
}

fn leading(descriptor: &[i16]) -> [f32; TREE_DIMS] {
    std::array::from_fn(|d| f32::from(descriptor[d]))
}

impl Search for KdTree {
    fn search(
        &self,
        scene: &Scene<'_>,
        first: usize,
        queries: &[i16],
        active: &[bool],
        out: &mut [Match],
    ) {
        let set = scene.neighbourhoods;
        let dims = set.dims();
        for (i, found) in out.iter_mut().enumerate().filter(|(i, _)| active[*i]) {
            let site = scene.site(first + i, &queries[i * dims..(i + 1) * dims]);
            let mut ranked = self.near(&site);
            ranked.sort_unstable();
            ranked.truncate(self.candidates);
            let mut best = f32::INFINITY;
            for (distance, at) in ranked {
                let candidate = set.match_at(at);
                let cost = site.cost(distance, candidate, at);
                if cost < best {
                    best = cost;
                    *found = candidate;
                }
            }
        }
    }
}
