//! The paper's search: a kd-tree, whose candidates are ranked again by the full cost.

use std::num::NonZero;

use kiddo::{ImmutableKdTree, SquaredEuclidean};

use super::{Scene, Search, squared_distance};
use crate::error::{Error, Result};
use crate::texture::match_map::Match;
use crate::texture::neighbourhoods::Neighbourhoods;

/// Leading components in the tree. A kd-tree slows down steeply with dimensions: at 166 k windows and
/// two threads an exact search for 32 neighbours answers 34 k queries a second in 8 dimensions, 2.9 k
/// in 16 and 1.1 k in 32.
const TREE_DIMS: usize = 8;

/// Nearest windows in the tree's dimensions, over the paper's number of candidates, that are compared
/// in all dimensions. With 6 × 10 the best of all windows is among them for nine queries in ten.
const OVERSAMPLING: usize = 6;

/// kd-tree over the leading components (kiddo), re-ranked in all components to `candidates`, of which
/// the one with the lowest penalised cost wins (zhang_2017 §4.2, k = 10).
///
/// Memory: 36 bytes a window.
pub struct KdTree {
    tree: ImmutableKdTree<f32, TREE_DIMS>,
    candidates: usize,
    nearest: NonZero<usize>,
}

impl KdTree {
    /// Builds the tree.
    ///
    /// # Errors
    /// If `candidates` is 0.
    pub fn new(set: &Neighbourhoods<'_>, candidates: usize) -> Result<Self> {
        let bad = || Error::parameter("candidates", candidates, "must be at least 1");
        let nearest =
            NonZero::new(candidates.saturating_mul(OVERSAMPLING).min(set.len())).ok_or_else(bad)?;
        let points: Vec<[f32; TREE_DIMS]> =
            set.descriptors().chunks_exact(set.dims()).map(leading).collect();
        let tree = ImmutableKdTree::new_from_slice(&points).map_err(|e| {
            Error::parameter("search", "kd-tree", format!("could not be built: {e:?}"))
        })?;
        Ok(Self { tree, candidates, nearest })
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
            let mut ranked: Vec<(i32, usize)> = self
                .tree
                .query(&leading(site.query))
                .nearest_n::<SquaredEuclidean<f32>>(self.nearest)
                .execute()
                .into_iter()
                .map(|n| {
                    (squared_distance(site.query, set.descriptor(n.item as usize)), n.item as usize)
                })
                .collect();
            ranked.sort_unstable();
            ranked.truncate(self.candidates);
            let mut best = f32::INFINITY;
            for (distance, at) in ranked {
                let candidate = set.match_at(at);
                let cost = site.penalised(distance, candidate, at);
                if cost < best {
                    best = cost;
                    *found = candidate;
                }
            }
        }
    }
}
