//! Propagation and random sampling (PatchMatch, Barnes et al. 2009), from a frozen map.

use super::penalty::Continuations;
use super::{Scene, Search, squared_distance};
use crate::texture::lattice::Links;
use crate::texture::match_map::Match;
use crate::volume::{Shape, position};

/// Radii, in voxels, of the random samples around a site's own match.
const LOCAL_RADII: [usize; 2] = [8, 2];

/// Candidates of a site: own, 6 neighbours, 2 local and 1 global random sample.
const CANDIDATES: usize = 10;

/// Which of a site's random numbers chooses among its candidates; those before make them.
const CHOICE: u64 = 4;

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

/// Sites that are searched side by side: what does not look anything up runs in their lanes, and what
/// does waits for many places of the memory at once.
const GROUP: usize = 16;

#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn propagate(scene: &Scene<'_>, first: usize, queries: &[i16], active: &[bool], out: &mut [Match]) {
    let set = scene.neighbourhoods;
    let dims = set.dims();
    let mut wanted = Vec::with_capacity(GROUP * CANDIDATES);
    let mut place = position(scene.lattice.sites(), first);
    for from in (0..out.len()).step_by(GROUP) {
        let lanes = from..out.len().min(from + GROUP);
        let mut tried = [[Match::NONE; GROUP]; CANDIDATES];
        let mut continuations = Continuations::<GROUP>::none();
        for (lane, at) in lanes.clone().enumerate() {
            if active[at] {
                let links = scene.links(place);
                candidates(scene, first + at, links, |c, found| tried[c][lane] = found);
                if scene.run.is_some() {
                    continuations.look_up(lane, scene, links);
                }
            }
            place = following(place, scene.lattice.sites());
        }
        wanted.clear();
        for c in 0..CANDIDATES {
            for (lane, new) in unlike(&tried[c], &tried[..c]).iter().enumerate() {
                if *new {
                    wanted.push((c, lane, set.index(tried[c][lane])));
                }
            }
        }
        // All descriptors are on their way from memory before the first is needed.
        let touched = wanted.iter().fold(0, |sum, &(_, _, at)| sum ^ set.descriptor(at)[0]);
        std::hint::black_box(touched);
        let mut costs = [[f32::INFINITY; GROUP]; CANDIDATES];
        for &(c, lane, at) in &wanted {
            let query = &queries[(from + lane) * dims..][..dims];
            costs[c][lane] = scene.weighted(squared_distance(query, set.descriptor(at)), at);
        }
        if let Some(heat) = &scene.heat {
            for lane in 0..lanes.len() {
                let bits = scene.key.with((first + from + lane) as u64).bits(CHOICE);
                for (c, costs) in costs.iter_mut().enumerate() {
                    costs[lane] -= heat.discount(bits, c);
                }
            }
        }
        let mut least = [f32::INFINITY; GROUP];
        let mut best = [0; GROUP];
        for (c, costs) in costs.iter_mut().enumerate() {
            if let Some(run) = scene.run {
                let counts = continuations.count(&tried[c]);
                for (cost, count) in costs.iter_mut().zip(counts) {
                    *cost += run.cost * count as f32;
                }
            }
            for lane in 0..GROUP {
                let better = costs[lane] < least[lane];
                least[lane] = if better { costs[lane] } else { least[lane] };
                best[lane] = if better { c } else { best[lane] };
            }
        }
        for (lane, at) in lanes.enumerate().filter(|(_, at)| active[*at]) {
            out[at] = tried[best[lane]][lane];
        }
    }
}

/// The next site in C order.
#[inline(always)]
const fn following([z, y, x]: [usize; 3], [_, ny, nx]: Shape) -> [usize; 3] {
    if x + 1 < nx {
        [z, y, x + 1]
    } else if y + 1 < ny {
        [z, y + 1, 0]
    } else {
        [z + 1, 0, 0]
    }
}

/// Which lanes hold a match that none of the others has.
#[inline(always)]
fn unlike(own: &[Match; GROUP], others: &[[Match; GROUP]]) -> [bool; GROUP] {
    let mut new = [false; GROUP];
    for lane in 0..GROUP {
        new[lane] = own[lane].packed() != Match::NONE.packed();
    }
    for other in others {
        for lane in 0..GROUP {
            new[lane] &= own[lane].packed() != other[lane].packed();
        }
    }
    new
}

/// Calls `add(number, match)` for the candidates of a site.
#[inline(always)]
fn candidates(
    scene: &Scene<'_>,
    index: usize,
    links: [&Links; 3],
    mut add: impl FnMut(usize, Match),
) {
    let set = scene.neighbourhoods;
    let key = scene.key.with(index as u64);
    let own = links.map(|l| l.own);
    let kept = scene.continued(own.map(|n| n.index), own.map(|n| n.step));
    for axis in 0..3 {
        for side in 0..2 {
            let mut at = own;
            at[axis] = links[axis].beside[side];
            if let Some(m) = scene.continued(at.map(|n| n.index), at.map(|n| n.step)) {
                add(1 + 2 * axis + side, m);
            }
        }
    }
    if let Some(kept) = kept {
        add(0, kept);
        let limit = set.limit(kept.orientation);
        for (k, radius) in LOCAL_RADII.into_iter().enumerate() {
            let [z, y, x, _] = key.below_each(k as u64, [2 * radius + 1; 4]);
            let step = [z, y, x].map(|n| n as i32 - radius as i32);
            add(7 + k, kept.moved(step, limit));
        }
    }
    // Every orientation has as many windows.
    let orientation = key.below(2, set.views().len()) as u16;
    let [nz, ny, nx] = set.limit(orientation).map(|n| n + 1);
    let [z, y, x, _] = key.below_each(3, [nz, ny, nx, 1]);
    add(9, Match { orientation, origin: [z, y, x].map(|n| n as u16) });
}
