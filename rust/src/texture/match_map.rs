//! Where in the exemplar each window of the output comes from.

use super::field::Field;
use super::lattice::Lattice;
use crate::rng::Key;
use crate::volume::{Boundary, Shape, voxels};

/// A window of the exemplar: its origin (z, y, x) in the exemplar under an orientation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Match {
    /// Index into the orientations of the run.
    pub orientation: u16,
    /// Origin of the window in the oriented exemplar.
    pub origin: [u16; 3],
}

impl Match {
    /// Marks a site outside the domain, which has no match.
    pub const NONE: Self = Self { orientation: u16::MAX, origin: [0; 3] };

    /// Whether the site has a match.
    pub const fn is_some(self) -> bool {
        self.orientation != u16::MAX
    }

    /// All of it in one number.
    #[inline(always)]
    pub(super) const fn packed(self) -> u64 {
        let [z, y, x] = self.origin;
        (self.orientation as u64) << 48 | (z as u64) << 32 | (y as u64) << 16 | x as u64
    }

    /// The match that continues this one `step` voxels on, pushed inside an exemplar whose largest
    /// window origin is `limit`.
    #[must_use]
    pub fn moved(self, step: [i32; 3], limit: Shape) -> Self {
        Self {
            origin: std::array::from_fn(|a| {
                (i32::from(self.origin[a]) + step[a]).clamp(0, limit[a] as i32) as u16
            }),
            ..self
        }
    }
}

/// A lattice with the match of each site, in C order of the sites.
#[derive(Debug, Clone, PartialEq)]
pub struct MatchMap {
    /// The windows.
    pub lattice: Lattice,
    /// Their matches.
    pub matches: Vec<Match>,
}

impl MatchMap {
    /// The match of a site.
    #[inline(always)]
    pub(super) fn at(&self, [z, y, x]: [usize; 3]) -> Match {
        let [_, ny, nx] = self.lattice.sites();
        self.matches[(z * ny + y) * nx + x]
    }

    /// The map on a grid of twice the resolution, for an output of this shape.
    #[must_use]
    pub fn doubled(&self, shape: Shape) -> Self {
        let matches =
            self.matches.iter().map(|m| Match { origin: m.origin.map(|o| 2 * o), ..*m }).collect();
        Self { lattice: self.lattice.doubled(shape), matches }
    }
}

/// The initial state: the output tiled with random cubic blocks of the exemplar (zhang_2017 §5.1).
///
/// `block` is at most the exemplar's and the output's shortest edge.
pub fn random_blocks(
    exemplar: &Field,
    shape: Shape,
    block: usize,
    boundary: Boundary,
    key: Key,
) -> (Field, MatchMap) {
    let lattice = Lattice::new(shape, [block; 3], [block; 3], [0; 3], boundary);
    let [sz, sy, sx] = lattice.sites();
    let mut field = Field::zeros(shape, exemplar.channels());
    let mut matches = Vec::with_capacity(sz * sy * sx);
    let from = exemplar.shape();
    for (site, [oz, oy, ox]) in product(&lattice.origins).enumerate() {
        let key = key.with(site as u64);
        let origin: [usize; 3] = std::array::from_fn(|a| key.below(a as u64, from[a] - block + 1));
        matches.push(Match { orientation: 0, origin: origin.map(|o| o as u16) });
        for c in 0..exemplar.channels() {
            for z in 0..block {
                for y in 0..block {
                    for x in 0..block {
                        let to = [(oz + z) % shape[0], (oy + y) % shape[1], (ox + x) % shape[2]];
                        field.channel_mut(c)[crate::volume::index(shape, to)] = exemplar.channel(c)
                            [crate::volume::index(
                                from,
                                [origin[0] + z, origin[1] + y, origin[2] + x],
                            )];
                    }
                }
            }
        }
    }
    debug_assert_eq!(matches.len(), voxels(lattice.sites()));
    (field, MatchMap { lattice, matches })
}

/// Random matches, for a volume that was not made of blocks of the exemplar; `limits` holds the largest
/// window origin under each orientation.
pub fn random_matches(lattice: Lattice, limits: &[Shape], key: Key) -> MatchMap {
    let matches = (0..voxels(lattice.sites()))
        .map(|site| {
            let key = key.with(site as u64);
            let orientation = key.below(3, limits.len());
            let limit = limits[orientation];
            let origin = std::array::from_fn(|a| key.below(a as u64, limit[a] + 1) as u16);
            Match { orientation: orientation as u16, origin }
        })
        .collect();
    MatchMap { lattice, matches }
}

/// All combinations of the origins, in C order.
pub fn product(origins: &[Vec<usize>; 3]) -> impl Iterator<Item = [usize; 3]> + '_ {
    origins[0].iter().flat_map(move |&z| {
        origins[1].iter().flat_map(move |&y| origins[2].iter().map(move |&x| [z, y, x]))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn random_matches_are_windows_of_the_exemplar_and_use_all_of_it() {
        let lattice = Lattice::new([40; 3], [4; 3], [2; 3], [0; 3], Boundary::Periodic);
        let limits = [[3, 5, 7], [0, 2, 1]];
        let map = random_matches(lattice.clone(), &limits, Key::new(1));
        assert_eq!(map.matches.len(), voxels(lattice.sites()));
        let mut seen = [[[false; 8]; 3]; 2];
        for m in &map.matches {
            let limit = limits[usize::from(m.orientation)];
            for (axis, (&origin, &most)) in m.origin.iter().zip(&limit).enumerate() {
                assert!(usize::from(origin) <= most);
                seen[usize::from(m.orientation)][axis][usize::from(origin)] = true;
            }
        }
        for (seen, limit) in seen.iter().zip(&limits) {
            for (seen, &most) in seen.iter().zip(limit) {
                assert!(seen[..=most].iter().all(|&s| s));
            }
        }
        assert_eq!(map, random_matches(lattice.clone(), &limits, Key::new(1)));
        assert_ne!(map, random_matches(lattice, &limits, Key::new(2)));
    }
}
