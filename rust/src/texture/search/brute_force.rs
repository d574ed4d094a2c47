//! Exact search by looking at everything.

use super::{Scene, Search, squared_distance};
use crate::texture::match_map::Match;

/// Compares every window of the exemplar. The cost is exact, penalties included; ties go to the
/// first window. The oracle of the tests, and usable on small exemplars.
pub struct BruteForce;

impl Search for BruteForce {
    fn search(
        &self,
        scene: &Scene<'_>,
        first: usize,
        queries: &[i16],
        active: &[bool],
        out: &mut [Match],
    ) {
        scan(scene, first, queries, active, out);
    }
}

#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn scan(scene: &Scene<'_>, first: usize, queries: &[i16], active: &[bool], out: &mut [Match]) {
    let set = scene.neighbourhoods;
    let dims = set.dims();
    for (i, found) in out.iter_mut().enumerate().filter(|(i, _)| active[*i]) {
        let site = scene.site(first + i, &queries[i * dims..(i + 1) * dims]);
        let mut best = f32::INFINITY;
        for (at, descriptor) in set.descriptors().chunks_exact(dims).enumerate() {
            let distance = squared_distance(site.query, descriptor);
            // Penalties only raise a cost.
            if (distance as f32) < best {
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
