//! The part of a pore space that carries a flow from face to face.

use std::ops::Range;

use ndarray::ArrayView3;
use rayon::prelude::*;

use super::vectors::Parts;
use crate::bits::{WORD, pack_row};
use crate::error::{Error, Result};
use crate::monitor::Monitor;
use crate::volume::{Boundary, Shape, index, position, voxels};

/// Voxels of a search after which it looks whether it is to stop.
const PATIENCE: usize = 1 << 16;

/// Voxels that one thread handles at a time: what is gathered for them stays in its cache.
pub(super) const PART: usize = 1 << 12;

/// The voxels of the components that percolate along axis 0, numbered in C order.
///
/// With an open boundary a component percolates if it touches the first and the last plane; with a
/// periodic one if it comes back to itself shifted by the volume. Kept are a bit a voxel and a
/// number a word of bits, from which the neighbours of a voxel follow.
pub struct PoreSpace {
    /// Edges of the volume.
    pub shape: Shape,
    /// What lies beyond its faces.
    pub boundary: Boundary,
    /// Voxels of the whole pore, percolating or not.
    pub pore: usize,
    /// The percolating voxels, rows of whole words.
    words: Vec<u64>,
    /// The number of the first voxel of each word, and of one more.
    firsts: Vec<u32>,
    /// Rows in parts of some [`PART`] voxels.
    pub(super) parts: Parts,
}

/// Rows: percolating voxels, bit by bit, and the number of the first of each word.
#[derive(Clone, Copy)]
pub(super) struct Rows<'a> {
    pub words: &'a [u64],
    pub firsts: &'a [u32],
    /// Words a row, if rows fill their last words: else no bit has a next one in the next row.
    pub full: Option<usize>,
}

impl PoreSpace {
    /// Finds the percolating part of the voxels that are not solid.
    ///
    /// Peak memory: 5 bytes a voxel, 9 with a periodic boundary; then 1.5 bits a voxel.
    pub fn new(
        solid: ArrayView3<'_, bool>,
        boundary: Boundary,
        monitor: &Monitor<'_>,
    ) -> Result<Self> {
        let (n0, n1, n2) = solid.dim();
        let shape = [n0, n1, n2];
        // One plane more is the inlet of a flow, one number more no voxel at all.
        if u32::try_from(voxels(shape) + n1 * n2 + 1).is_err() {
            return Err(Error::parameter("shape", shape, "must have less than 2^32 voxels"));
        }
        let mut states: Vec<u8> = Vec::with_capacity(voxels(shape));
        for plane in solid.outer_iter() {
            monitor.check()?;
            states.extend(plane.iter().map(|&s| if s { SOLID } else { PORE }));
        }
        let pore = states.par_iter().filter(|&&n| n == PORE).count();
        mark_percolating(&mut states, shape, boundary, monitor)?;
        let per_row = n2.div_ceil(WORD);
        let mut words = vec![0u64; n0 * n1 * per_row];
        let rows = words.par_chunks_mut(per_row.max(1)).zip(states.par_chunks(n2.max(1)));
        rows.for_each(|(words, states)| {
            let flowing: Vec<bool> = states.iter().map(|&state| state == FLOWING).collect();
            pack_row(&flowing, words);
        });
        let mut firsts = Vec::with_capacity(words.len() + 1);
        firsts.push(0);
        let mut count = 0;
        firsts.extend(words.iter().map(|word| {
            count += word.count_ones();
            count
        }));
        let of = |row: usize| {
            let [first, end] = [row, row + 1].map(|row| firsts[row * per_row] as usize);
            first..end
        };
        let parts = Parts::new(n0 * n1, PART, of);
        Ok(Self { shape, boundary, pore, words, firsts, parts })
    }

    /// Number of percolating voxels.
    pub fn len(&self) -> usize {
        self.firsts.last().map_or(0, |&count| count as usize)
    }

    /// Whether nothing percolates.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Number of rows along axis 2.
    pub(super) fn rows(&self) -> usize {
        self.shape[0] * self.shape[1]
    }

    /// The numbers of the voxels of some rows.
    pub(super) fn voxels_of(&self, rows: Range<usize>) -> Range<usize> {
        let per_row = self.shape[2].div_ceil(WORD);
        self.firsts[rows.start * per_row] as usize..self.firsts[rows.end * per_row] as usize
    }

    /// The voxels of some rows.
    pub(super) fn bits_of(&self, rows: Range<usize>) -> Rows<'_> {
        let per_row = self.shape[2].div_ceil(WORD);
        let words = rows.start * per_row..rows.end * per_row;
        Rows {
            words: &self.words[words.clone()],
            firsts: &self.firsts[words],
            full: self.shape[2].is_multiple_of(WORD).then_some(per_row),
        }
    }

    /// The pieces of some rows that have rows before or after them along axis 0 or 1, in one order:
    /// the rows of a piece, and the first of those beside them.
    pub(super) fn beside(
        &self,
        rows: Range<usize>,
        axis: usize,
        after: bool,
    ) -> impl Iterator<Item = (Range<usize>, usize)> + '_ {
        let [_, n1, _] = self.shape;
        let planes = rows.start / n1..rows.end.div_ceil(n1);
        planes.flat_map(move |plane| {
            let own = rows.start.max(plane * n1)..rows.end.min((plane + 1) * n1);
            // Along axis 1 the row at the end has another beside it than the others' next one.
            let cut = match (axis, after) {
                (0, _) => own.start,
                (_, false) => own.start.max(plane * n1 + 1).min(own.end),
                (_, true) => own.end.min((plane + 1) * n1 - 1).max(own.start),
            };
            let pieces = [own.start..cut, cut..own.end];
            pieces.into_iter().filter(|piece| !piece.is_empty()).filter_map(move |piece| {
                let beside = self.row_beside(piece.start, axis, after)?;
                Some((piece, beside))
            })
        })
    }

    /// The row before or after one along axis 0 or 1; none beyond an open border. Through a periodic
    /// one it may be the row itself.
    pub(super) fn row_beside(&self, row: usize, axis: usize, after: bool) -> Option<usize> {
        self.rows_beside(row)[2 * axis + usize::from(after)]
    }

    /// The rows before and after one along axis 0, and along axis 1.
    #[inline(always)]
    pub(super) fn rows_beside(&self, row: usize) -> [Option<usize>; 4] {
        let [n0, n1, _] = self.shape;
        let (z, y) = (row / n1, row % n1);
        let along_0 = |z: usize| z * n1 + y;
        let along_1 = |y: usize| z * n1 + y;
        [
            self.step(z, n0, false).map(along_0),
            self.step(z, n0, true).map(along_0),
            self.step(y, n1, false).map(along_1),
            self.step(y, n1, true).map(along_1),
        ]
    }

    /// The last and the first voxel of a row that a periodic border links; they may be the same.
    pub(super) fn wrapping(&self, row: usize) -> Option<[usize; 2]> {
        let (last, first) = (self.number([row, self.shape[2] - 1])?, self.number([row, 0])?);
        (self.boundary == Boundary::Periodic).then_some([last, first])
    }

    #[inline(always)]
    fn step(&self, at: usize, n: usize, after: bool) -> Option<usize> {
        if after { self.boundary.after(at, n) } else { self.boundary.before(at, n) }
    }

    /// Whether the first and the last plane of an open volume are a row's.
    pub(super) fn open_ends(&self, row: usize) -> [bool; 2] {
        let plane = row / self.shape[1];
        let open = self.boundary == Boundary::Open;
        [open && plane == 0, open && plane + 1 == self.shape[0]]
    }

    /// The number of the voxel at a place, if it percolates.
    pub(super) fn number(&self, [row, x]: [usize; 2]) -> Option<usize> {
        let Rows { words, firsts, .. } = self.bits_of(row..row + 1);
        let (word, bit) = (x / WORD, 1 << (x % WORD));
        let below = words[word] & (bit - 1);
        (words[word] & bit != 0).then(|| firsts[word] as usize + below.count_ones() as usize)
    }

    /// The place before or after another along an axis; none beyond an open border.
    pub(super) fn place_beside(
        &self,
        [row, x]: [usize; 2],
        axis: usize,
        after: bool,
    ) -> Option<[usize; 2]> {
        match axis {
            2 => Some([row, self.step(x, self.shape[2], after)?]),
            _ => Some([self.row_beside(row, axis, after)?, x]),
        }
    }
}

/// States of a voxel.
const SOLID: u8 = 0;
const PORE: u8 = 1;
const FOUND: u8 = 2;
const FLOWING: u8 = 3;

/// The voxel on a side of `at`, before and after it along axes 0, 1, 2, and by how many volumes the step wraps along axis 0.
fn step(at: Shape, side: usize, shape: Shape, boundary: Boundary) -> Option<(Shape, i32)> {
    let axis = side / 2;
    let mut to = at;
    let mut wraps = 0;
    if side.is_multiple_of(2) {
        if at[axis] > 0 {
            to[axis] -= 1;
        } else {
            (to[axis], wraps) = (shape[axis] - 1, -1);
        }
    } else if at[axis] + 1 < shape[axis] {
        to[axis] += 1;
    } else {
        (to[axis], wraps) = (0, 1);
    }
    let inside = wraps == 0 || boundary == Boundary::Periodic;
    inside.then_some((to, if axis == 0 { wraps } else { 0 }))
}

/// Floods every component of [`PORE`] and marks those that percolate as [`FLOWING`].
fn mark_percolating(
    states: &mut [u8],
    shape: Shape,
    boundary: Boundary,
    monitor: &Monitor<'_>,
) -> Result<()> {
    let periodic = boundary == Boundary::Periodic;
    let plane = shape[1] * shape[2];
    // By how many volumes the flood has gone along axis 0 when it reached a voxel.
    let mut wound = vec![0i32; if periodic { states.len() } else { 0 }];
    let mut component: Vec<u32> = Vec::new();
    // Every component that percolates with an open boundary begins in the first plane.
    let starts = if periodic { states.len() } else { plane.min(states.len()) };
    for start in 0..starts {
        if start.is_multiple_of(PATIENCE) {
            monitor.check()?;
        }
        if states[start] != PORE {
            continue;
        }
        states[start] = FOUND;
        component.clear();
        component.push(start as u32);
        let mut percolates = false;
        let mut next = 0;
        while let Some(&from) = component.get(next) {
            let from = from as usize;
            next += 1;
            if next.is_multiple_of(PATIENCE) {
                monitor.check()?;
            }
            percolates |= !periodic && from + plane >= states.len();
            let at = position(shape, from);
            for side in 0..6 {
                let Some((to, wraps)) = step(at, side, shape, boundary) else { continue };
                let to = index(shape, to);
                if states[to] == PORE {
                    states[to] = FOUND;
                    component.push(to as u32);
                    if periodic {
                        wound[to] = wound[from] + wraps;
                    }
                } else if periodic && states[to] == FOUND {
                    percolates |= wound[to] != wound[from] + wraps;
                }
            }
        }
        if percolates {
            for &voxel in &component {
                states[voxel as usize] = FLOWING;
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use ndarray::Array3;

    use super::*;

    fn flowing(solid: &Array3<bool>, boundary: Boundary) -> usize {
        PoreSpace::new(solid.view(), boundary, &Monitor::silent()).unwrap().len()
    }

    #[test]
    fn only_what_reaches_both_faces_carries() {
        let mut solid = Array3::from_elem((5, 4, 4), true);
        solid.slice_mut(ndarray::s![..4, 0, 0]).fill(false);
        assert_eq!(flowing(&solid, Boundary::Open), 0);
        solid[[4, 0, 0]] = false;
        solid[[2, 3, 3]] = false;
        assert_eq!(flowing(&solid, Boundary::Open), 5);
        assert_eq!(flowing(&solid, Boundary::Periodic), 5);
    }

    #[test]
    fn a_periodic_pore_must_meet_itself() {
        // Reaches both faces, but at places that do not meet.
        let mut solid = Array3::from_elem((4, 4, 4), true);
        for (z, y) in [(0, 0), (1, 0), (1, 1), (1, 2), (2, 2), (3, 2)] {
            solid[[z, y, 0]] = false;
        }
        assert_eq!(flowing(&solid, Boundary::Open), 6);
        assert_eq!(flowing(&solid, Boundary::Periodic), 0);
        // Going on round axis 1 brings it back to where it began.
        solid[[3, 3, 0]] = false;
        solid[[3, 0, 0]] = false;
        assert_eq!(flowing(&solid, Boundary::Periodic), 8);
    }

    #[test]
    fn a_helix_of_two_turns_percolates() {
        // One volume on, the pore is half a volume aside: it takes two to come back.
        let mut solid = Array3::from_elem((2, 4, 1), true);
        for (z, y) in [(0, 0), (1, 0), (1, 1), (1, 2), (0, 2), (1, 3)] {
            solid[[z, y, 0]] = false;
        }
        assert_eq!(flowing(&solid, Boundary::Periodic), 6);
    }

    #[test]
    fn a_ring_across_the_flow_does_not_percolate() {
        let mut solid = Array3::from_elem((3, 4, 4), true);
        solid.slice_mut(ndarray::s![1, 2, ..]).fill(false);
        assert_eq!(flowing(&solid, Boundary::Periodic), 0);
    }

    #[test]
    fn no_voxel_and_no_pore() {
        for boundary in [Boundary::Open, Boundary::Periodic] {
            assert_eq!(flowing(&Array3::from_elem((0, 3, 3), false), boundary), 0);
            assert_eq!(flowing(&Array3::from_elem((3, 3, 3), true), boundary), 0);
            assert_eq!(flowing(&Array3::from_elem((1, 1, 1), false), boundary), 1);
        }
    }
}
