//! The 26 neighbours of a voxel as one word, and what removing the voxel would do to the topology.
//!
//! Bit 9·(dz + 1) + 3·(dy + 1) + (dx + 1) is the neighbour (dz, dy, dx); the voxel itself, bit 13,
//! is not looked at.

use std::sync::LazyLock;
use std::sync::atomic::{AtomicU64, Ordering};

/// A neighbourhood.
pub(super) type Word = u32;

const ALL: Word = (1 << 27) - 1;
/// The voxel itself.
pub(super) const CENTRE: Word = 1 << 13;
/// Those of the lowest and of the highest x, and y.
const X: [Word; 2] = [0o111_111_111, 0o444_444_444];
const Y: [Word; 2] = [0o007_007_007, 0o700_700_700];
/// Those that share a face with the voxel, in opposite pairs.
const FACES: [[Word; 2]; 3] = [[1 << 4, 1 << 22], [1 << 10, 1 << 16], [1 << 12, 1 << 14]];
const FACE: Word = 0o020_252_020;
/// Those that share a face or an edge with it.
const FACE_OR_EDGE: Word = 0o272_757_272;

/// Whether exactly one neighbour is solid: the end of a curve.
#[inline(always)]
pub(super) const fn is_curve_end(neighbours: Word) -> bool {
    (neighbours & !CENTRE).is_power_of_two()
}

/// Whether the solid is one voxel thick along an axis: two opposite faces are void.
#[inline(always)]
pub(super) const fn is_surface_end(neighbours: Word) -> bool {
    let mut axis = 0;
    while axis < 3 {
        if neighbours & (FACES[axis][0] | FACES[axis][1]) == 0 {
            return true;
        }
        axis += 1;
    }
    false
}

/// Whether removing the voxel changes no component, tunnel or cavity of the solid (26 neighbours)
/// or of the void (6 neighbours): its solid neighbours hang together, and the void faces hang
/// together within the 18 neighbours. With the first, the second says that the Euler number stays.
pub(super) const fn is_simple(neighbours: Word) -> bool {
    let solid = neighbours & ALL & !CENTRE;
    if solid == 0 || !is_connected(solid) {
        return false;
    }
    let void = !solid & FACE_OR_EDGE;
    let faces = void & FACE;
    let mut reached = faces & faces.wrapping_neg();
    loop {
        let more = reached | (void & touch_by_faces(reached));
        if more == reached {
            return faces != 0 && reached & faces == faces;
        }
        reached = more;
    }
}

/// Whether the solid neighbours hang together, if there are any.
pub(super) const fn is_connected(neighbours: Word) -> bool {
    let solid = neighbours & ALL & !CENTRE;
    let mut reached = solid & solid.wrapping_neg();
    loop {
        let more = solid & grown(reached);
        if more == reached {
            return reached == solid;
        }
        reached = more;
    }
}

/// With all their own neighbours.
const fn grown(set: Word) -> Word {
    let set = set | (set & !X[1]) << 1 | (set & !X[0]) >> 1;
    let set = set | (set & !Y[1]) << 3 | (set & !Y[0]) >> 3;
    set | set << 9 | set >> 9
}

const fn touch_by_faces(set: Word) -> Word {
    let x = (set & !X[1]) << 1 | (set & !X[0]) >> 1;
    let y = (set & !Y[1]) << 3 | (set & !Y[0]) >> 3;
    x | y | set << 9 | set >> 9
}

/// Answers of a rule, remembered: two bits for each of the 2²⁶ neighbourhoods, 16 MB. Few kinds of
/// neighbourhood are common, so that asking again is several times as fast as the rule itself.
pub(super) struct Memory {
    rule: fn(Word) -> bool,
    /// Bit 2i: the answer for neighbourhood i is known. Bit 2i + 1: it is yes.
    answers: Box<[AtomicU64]>,
}

/// `is_simple`, remembered.
pub(super) static SIMPLE: LazyLock<Memory> = LazyLock::new(|| Memory::of(is_simple));
/// `is_connected`, remembered.
pub(super) static CONNECTED: LazyLock<Memory> = LazyLock::new(|| Memory::of(is_connected));

impl Memory {
    fn of(rule: fn(Word) -> bool) -> Self {
        Self { rule, answers: (0..1 << 21).map(|_| AtomicU64::new(0)).collect() }
    }

    /// The rule's answer.
    #[inline(always)]
    pub(super) fn ask(&self, neighbours: Word) -> bool {
        let index = (neighbours & (CENTRE - 1)) | (neighbours >> 14 << 13);
        let known = self.answers[(index >> 5) as usize].load(Ordering::Relaxed);
        let found = known >> (2 * (index & 31));
        if found & 1 == 1 { found & 2 != 0 } else { self.learn(neighbours, index) }
    }

    #[cold]
    fn learn(&self, neighbours: Word, index: Word) -> bool {
        let answer = (self.rule)(neighbours);
        let bits = (1 | u64::from(answer) << 1) << (2 * (index & 31));
        self.answers[(index >> 5) as usize].fetch_or(bits, Ordering::Relaxed);
        answer
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Key;

    fn place(bit: i32) -> [i32; 3] {
        [bit / 9 - 1, bit / 3 % 3 - 1, bit % 3 - 1]
    }

    /// Number of components among bits whose places differ by at most `most` steps in all and by at
    /// most one along each axis.
    fn components(set: Word, most: i32) -> usize {
        let mut left: Vec<i32> = (0..27).filter(|b| set >> b & 1 == 1).collect();
        let mut found = 0;
        while let Some(first) = left.pop() {
            found += 1;
            let mut stack = vec![first];
            while let Some(a) = stack.pop() {
                left.retain(|&b| {
                    let steps = [0, 1, 2].map(|i| (place(a)[i] - place(b)[i]).abs());
                    let touch = steps.iter().all(|&s| s < 2) && steps.iter().sum::<i32>() <= most;
                    if touch {
                        stack.push(b);
                    }
                    !touch
                });
            }
        }
        found
    }

    /// Euler number of the union of closed voxels: corners − edges + faces − voxels.
    fn euler(set: Word) -> i32 {
        let mut cells = std::collections::BTreeSet::new();
        for bit in (0..27).filter(|b| set >> b & 1 == 1) {
            let at = place(bit).map(|i| 2 * i + 1);
            for d in 0..27 {
                let step = place(d);
                cells.insert([0, 1, 2].map(|i| at[i] + step[i]));
            }
        }
        cells
            .iter()
            .map(|c| 1 - 2 * (c.iter().filter(|i| i.rem_euclid(2) == 1).count() as i32 % 2))
            .sum()
    }

    #[test]
    fn simple_is_connected_and_euler_invariant() {
        let key = Key::new(3);
        for i in 0..20_000 {
            // Every density, so that sparse and full neighbourhoods are common.
            let density = key.with(1).unit(i);
            let word = (0..27u64)
                .fold(0, |word: Word, b| word | Word::from(key.with(2 + b).unit(i) < density) << b)
                & !CENTRE;
            assert_eq!(is_connected(word), components(word, 3) <= 1, "{word:o}");
            let keeps = components(word, 3) == 1 && euler(word) == euler(word | CENTRE);
            assert_eq!(is_simple(word), keeps, "{word:o}");
            for _ in 0..2 {
                assert_eq!(SIMPLE.ask(word), keeps);
                assert_eq!(CONNECTED.ask(word | CENTRE), is_connected(word));
            }
        }
    }

    #[test]
    fn known_neighbourhoods() {
        assert!(!is_simple(0) && is_connected(0) && !is_curve_end(0) && is_surface_end(0));
        assert!(!is_simple(ALL) && !is_surface_end(ALL) && !is_curve_end(ALL));
        assert!(is_simple(1) && is_curve_end(1 | CENTRE));
        // The voxel bridges two neighbours, or closes a ring.
        assert!(!is_simple(1 << 12 | 1 << 14) && !is_connected(1 << 12 | 1 << 14));
        let ring = 0o000_757_000;
        assert!(is_connected(ring) && !is_simple(ring) && is_surface_end(ring));
        assert_eq!(FACES.as_flattened().iter().fold(0, |all, f| all | f), FACE);
    }
}
