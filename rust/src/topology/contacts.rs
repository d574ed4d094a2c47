//! Which runs touch.

use super::labelling::Connectivity;
use super::runs::{PlaneRows, RowBits, Run};
use crate::bits::WORD;

/// Unites the runs of a plane with each other, if they are not yet, and with those of the plane
/// below.
///
/// With 26 neighbours, two runs need not be united where a third row holds a voxel that touches
/// both: rows straight above each other are always looked at, and all else follows from below.
#[multiversion::multiversion(targets("x86_64+avx2+bmi1+bmi2+popcnt", "x86_64+popcnt"))]
pub(super) fn unite_plane(
    connectivity: Connectivity,
    plane: PlaneRows<'_>,
    within: bool,
    below: Option<PlaneRows<'_>>,
    parents: &mut [u32],
) {
    let reaches = [connectivity.reach(1), connectivity.reach(2)];
    let bridged = connectivity == Connectivity::Corners;
    for y in 0..plane.rows() {
        let Some(row) = plane.row(y) else { continue };
        let beneath = |y: Option<usize>, steps: usize| {
            let reach = reaches[steps - 1]?;
            Some((below?.row(y.filter(|&y| y < plane.rows())?)?, reach))
        };
        let before = y.checked_sub(1);
        let beside = || Some((plane.row(before.filter(|_| within)?)?, reaches[0]?));
        let others = [beneath(Some(y), 1), beside(), beneath(before, 2), beneath(Some(y + 1), 2)];
        unite_row(row, others, bridged, parents);
    }
}

/// Unites the runs of a row with those of the row beneath it, the row beside it, and the rows
/// beneath to both sides: of each, its reach.
#[inline(always)]
fn unite_row(
    row: RowBits<'_>,
    others: [Option<(RowBits<'_>, u32)>; 4],
    bridged: bool,
    parents: &mut [u32],
) {
    let mut this = Scan { next: row.first, ..Scan::default() };
    let mut scans = [Scan::default(); 4];
    for (scan, other) in scans.iter_mut().zip(others) {
        scan.next = other.map_or(0, |(other, _)| other.first);
    }
    for (i, &word) in row.words.iter().enumerate() {
        this.enter(word);
        for k in 0..4 {
            if let Some((other, _)) = others[k] {
                scans[k].enter(other.words[i]);
            }
        }
        let beneath = scans[0].word | scans[0].shifted;
        let beside = scans[1].word | scans[1].shifted;
        let bridges = [0, beneath, beneath | beside, beneath];
        for k in 0..4 {
            let Some((_, reach)) = others[k] else { continue };
            let mut contacts = this.contacts(&scans[k], reach);
            if bridged {
                contacts &= !bridges[k];
            }
            while contacts != 0 {
                let at = contacts.trailing_zeros();
                contacts &= contacts - 1;
                unite(parents, this.run(at), scans[k].run(at));
            }
        }
        this.leave();
        for scan in &mut scans {
            scan.leave();
        }
    }
}

/// A row, word by word.
#[derive(Clone, Copy, Default)]
struct Scan {
    word: u64,
    /// The voxels before those of the word.
    shifted: u64,
    /// Where runs start.
    starts: u64,
    /// Number of the first run that starts in the word.
    next: u32,
    /// The last voxel of the word before, in the lowest bit.
    last: u64,
}

impl Scan {
    #[inline(always)]
    fn enter(&mut self, word: u64) {
        self.word = word;
        self.shifted = word << 1 | self.last;
        self.starts = word & !self.shifted;
    }

    #[inline(always)]
    fn leave(&mut self) {
        self.next += self.starts.count_ones();
        self.last = self.word >> (WORD - 1);
    }

    /// A bit for each pair of runs that touch: where they begin to lie over each other, and, with a
    /// reach of 1, where one begins at the other's end. There, neither has a later run yet.
    #[inline(always)]
    fn contacts(&self, other: &Self, reach: u32) -> u64 {
        let over = self.word & other.word & !(self.shifted & other.shifted);
        if reach == 0 {
            return over;
        }
        let after = self.starts & other.shifted & !other.word;
        let before = other.starts & self.shifted & !self.word;
        over | after | before
    }

    /// Number of the last run that starts at a place or before.
    #[inline(always)]
    fn run(&self, at: u32) -> u32 {
        let started = self.starts & (u64::MAX >> (WORD as u32 - 1 - at));
        self.next + started.count_ones() - 1
    }
}

/// Calls `touch` for each pair of runs that lie within `reach` of each other.
#[inline(always)]
pub(super) fn for_each_contact(
    a: &[Run],
    b: &[Run],
    reach: u32,
    mut touch: impl FnMut(usize, usize),
) {
    let (mut i, mut j) = (0, 0);
    while let (Some(&[start_a, end_a]), Some(&[start_b, end_b])) = (a.get(i), b.get(j)) {
        if start_a < end_b + reach && start_b < end_a + reach {
            touch(i, j);
        }
        // Without a branch, which could not be foretold.
        let a_ends_first = end_a < end_b;
        i += usize::from(a_ends_first);
        j += usize::from(!a_ends_first);
    }
}

/// Joins two trees; the smaller root wins.
#[inline(always)]
fn unite(parents: &mut [u32], a: u32, b: u32) {
    // Most runs that touch have been united already, by way of a third.
    if parents[a as usize] == parents[b as usize] {
        return;
    }
    let (a, b) = (root(parents, a), root(parents, b));
    if a < b {
        parents[b as usize] = a;
    } else {
        parents[a as usize] = b;
    }
}

/// Root of a tree; halves the path to it on the way.
#[inline(always)]
fn root(parents: &mut [u32], mut run: u32) -> u32 {
    loop {
        let parent = parents[run as usize];
        if parent == run {
            return run;
        }
        let grandparent = parents[parent as usize];
        parents[run as usize] = grandparent;
        run = grandparent;
    }
}
