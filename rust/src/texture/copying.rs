//! How much of the output is a verbatim copy, read off the match map.

use super::match_map::MatchMap;
use crate::volume::{Boundary, position, voxels};

/// A copied block larger than the cube of this edge counts as a copy.
pub const COPY_EDGE: usize = 12;

/// Verbatim copying in a match map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Copying {
    /// Share of the sites in copied blocks of more than 12³ voxels.
    pub copy_fraction: f64,
    /// Edge, in voxels, of the volume-weighted mean copied block.
    pub mean_copied_block: f64,
}

/// Groups neighbouring sites whose matches continue each other exactly.
///
/// A block is a 6-connected set of sites with the same orientation and the same offset between output
/// and exemplar; its volume is the number of its sites times the volume of a lattice cell.
pub fn copying(map: &MatchMap) -> Copying {
    let lattice = &map.lattice;
    let sites = lattice.sites();
    let n = voxels(sites);
    let mut parent: Vec<u32> = (0..n as u32).collect();
    let offset = |site: usize, origin: [usize; 3]| -> [i32; 3] {
        std::array::from_fn(|a| i32::from(map.matches[site].origin[a]) - origin[a] as i32)
    };
    for site in 0..n {
        let m = map.matches[site];
        if !m.is_some() {
            continue;
        }
        let at = position(sites, site);
        let origin: [usize; 3] = std::array::from_fn(|a| lattice.origins[a][at[a]]);
        for a in 0..3 {
            let last = at[a] + 1 == sites[a];
            if sites[a] == 1 || (last && lattice.boundary == Boundary::Open) {
                continue;
            }
            let (mut next, mut there) = (at, origin);
            next[a] = (at[a] + 1) % sites[a];
            there[a] = lattice.origins[a][next[a]] + if last { lattice.shape[a] } else { 0 };
            let other = crate::volume::index(sites, next);
            let same = map.matches[other].orientation == m.orientation
                && offset(other, there) == offset(site, origin);
            if same {
                let (a, b) = (root(&mut parent, site), root(&mut parent, other));
                parent[a.max(b)] = a.min(b) as u32;
            }
        }
    }
    let mut size = vec![0u32; n];
    let mut matched = 0usize;
    for site in (0..n).filter(|&s| map.matches[s].is_some()) {
        size[root(&mut parent, site)] += 1;
        matched += 1;
    }
    let cell = voxels(lattice.shape) as f64 / n.max(1) as f64;
    let matched = matched.max(1) as f64;
    let threshold = COPY_EDGE.pow(3) as f64;
    let copied: f64 = size.iter().map(|&s| f64::from(s)).filter(|s| s * cell > threshold).sum();
    let weighted: f64 = size.iter().map(|&s| f64::from(s).powi(2)).sum();
    Copying {
        copy_fraction: copied / matched,
        mean_copied_block: (weighted / matched * cell).cbrt(),
    }
}

fn root(parent: &mut [u32], mut i: usize) -> usize {
    while parent[i] as usize != i {
        parent[i] = parent[parent[i] as usize];
        i = parent[i] as usize;
    }
    i
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture::lattice::Lattice;
    use crate::texture::match_map::{Match, product};

    fn map_of(source: impl Fn([usize; 3]) -> [usize; 3], boundary: Boundary) -> MatchMap {
        let lattice = Lattice::new([32; 3], [4; 3], [2; 3], [0; 3], boundary);
        let matches = product(&lattice.origins)
            .map(|o| Match { orientation: 0, origin: source(o).map(|v| v as u16) })
            .collect();
        MatchMap { lattice, matches }
    }

    #[test]
    fn one_copy_fills_the_volume() {
        let all = copying(&map_of(|o| o, Boundary::Open));
        assert!((all.copy_fraction - 1.0).abs() < 1e-12);
        assert!((all.mean_copied_block - 32.0).abs() < 1e-9);
    }

    #[test]
    fn a_tiling_by_blocks_has_their_edge() {
        let tiles = copying(&map_of(|o| o.map(|v| v % 16 + 40 * (v / 16)), Boundary::Periodic));
        assert!((tiles.mean_copied_block - 16.0).abs() < 1e-9, "{tiles:?}");
        assert!((tiles.copy_fraction - 1.0).abs() < 1e-12);
        let small = copying(&map_of(|o| o.map(|v| v % 8 + 40 * (v / 8)), Boundary::Periodic));
        assert!((small.mean_copied_block - 8.0).abs() < 1e-9, "{small:?}");
        assert!(small.copy_fraction < 1e-12);
    }

    #[test]
    fn nothing_matched_is_nothing_copied() {
        let mut map = map_of(|o| o, Boundary::Open);
        map.matches.fill(Match::NONE);
        assert_eq!(copying(&map), Copying { copy_fraction: 0.0, mean_copied_block: 0.0 });
    }
}
