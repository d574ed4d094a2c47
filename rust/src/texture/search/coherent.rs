//! Propagation and random sampling (PatchMatch, Barnes et al. 2009), from a frozen map.

use super::{Scene, Search, Site, squared_distance};
use crate::texture::match_map::Match;

/// Radii, in voxels, of the random samples around a site's own match.
const LOCAL_RADII: [usize; 2] = [8, 2];

/// Candidates of a site: own, 6 neighbours, 2 local and 1 global random sample.
const CANDIDATES: usize = 10;

/// Evaluates the site's own match, the continuations of its six neighbours' matches and three random
/// samples, all read from the map of the pass before.
///
/// The neighbours' updates are not seen within a pass, so sites may be visited in any order.
pub struct Coherent;

impl Search for Coherent {
    fn search(
        &self,
        scene: &Scene<'_>,
        first: usize,
        queries: &[i16],
        active: &[bool],
        out: &mut [Match],
    ) {
        propagate(scene, first, queries, active, out);
    }

    fn improves(&self) -> bool {
        true
    }
}

/// Sites whose candidates are looked up together: a look-up waits for memory, many wait at once.
const GROUP: usize = 16;

#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn propagate(scene: &Scene<'_>, first: usize, queries: &[i16], active: &[bool], out: &mut [Match]) {
    let set = scene.neighbourhoods;
    let dims = set.dims();
    let mut sites: Vec<Site<'_>> = Vec::with_capacity(GROUP);
    let mut lists: Vec<Candidate> = Vec::with_capacity(GROUP * CANDIDATES);
    for from in (0..out.len()).step_by(GROUP) {
        sites.clear();
        lists.clear();
        for i in (from..out.len().min(from + GROUP)).filter(|&i| active[i]) {
            let site = scene.site(first + i, &queries[i * dims..(i + 1) * dims]);
            let (found, count) = candidates(&site);
            let before = lists.len();
            for &found in &found[..count] {
                let at = set.index(found);
                if lists[before..].iter().all(|other| other.at != at) {
                    lists.push(Candidate { site: sites.len(), found, at, distance: 0 });
                }
            }
            sites.push(site);
        }
        for candidate in &mut lists {
            let query = sites[candidate.site].query;
            candidate.distance = squared_distance(query, set.descriptor(candidate.at));
        }
        let mut least = [f32::INFINITY; GROUP];
        for candidate in &lists {
            let site = &sites[candidate.site];
            let cost = site.cost(candidate.distance, candidate.found, candidate.at);
            if cost < least[candidate.site] {
                least[candidate.site] = cost;
                out[site.index - first] = candidate.found;
            }
        }
    }
}

/// A window that a site may match.
struct Candidate {
    /// Which site of the group.
    site: usize,
    found: Match,
    at: usize,
    distance: i32,
}

#[inline(always)]
fn candidates(site: &Site<'_>) -> ([Match; CANDIDATES], usize) {
    let scene = site.scene;
    let set = scene.neighbourhoods;
    let key = scene.key.with(site.index as u64);
    let mut list = [Match::NONE; CANDIDATES];
    let mut count = 0;
    let mut add = |m: Match| {
        list[count] = m;
        count += 1;
    };
    let own = site.links.map(|l| l.own);
    let from = |at: [crate::texture::lattice::Neighbour; 3]| {
        scene.continued(at.map(|n| n.index), at.map(|n| n.step))
    };
    let kept = from(own);
    if let Some(kept) = kept {
        add(kept);
    }
    for axis in 0..3 {
        for side in 0..2 {
            let mut at = own;
            at[axis] = site.links[axis].beside[side];
            if let Some(m) = from(at) {
                add(m);
            }
        }
    }
    if let Some(kept) = kept {
        let limit = set.limit(kept.orientation);
        for (k, radius) in LOCAL_RADII.into_iter().enumerate() {
            let step = std::array::from_fn(|a| {
                key.below((3 * k + a) as u64, 2 * radius + 1) as i32 - radius as i32
            });
            add(kept.moved(step, limit));
        }
    }
    add(set.match_at(key.below(6, set.len())));
    (list, count)
}
