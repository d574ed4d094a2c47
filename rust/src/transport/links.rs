//! Conductances between the voxels of a pore space, never stored as a list of links.
//!
//! A row of voxels touches the same voxels of the row beside it in runs, along which both count on by
//! one: a run is found by its bits and then worked on like a slice.

use std::ops::Range;

use half::f16;

use super::compact::widen;
use super::pore::{PoreSpace, Rows};
use crate::bits::{WORD, take_run};
use crate::monitor::Monitor;
use crate::volume::Boundary;

/// How well the voxels of a pore space conduct.
pub(super) trait Conductances: Sync {
    /// The pore space.
    fn space(&self) -> &PoreSpace;
    /// Conductance from a voxel to the next along an axis.
    fn after<T: Real>(&self, axis: usize, voxel: usize) -> T;
    /// Conductance from a voxel of the first plane of an open volume to the inlet.
    fn inlet(&self, voxel: usize) -> f32;
    /// Conductance from a voxel of the last plane of an open volume to the outlet.
    fn outlet(&self, voxel: usize) -> f32;
}

/// Conductances that are a matrix to multiply by.
pub(super) trait Operator: Conductances {
    /// [`gather`] with the widest instructions of the processor.
    fn gather(&self, rows: Range<usize>, values: &[f16], inflow: &mut Vec<f32>);
    /// Writes the sums of the conductances of some voxels, that of [`ground`] included.
    fn diagonals(&self, voxels: Range<usize>, out: &mut Vec<f32>);
}

/// A number in single precision, enough to precondition with, or in double precision.
pub(super) trait Real:
    Copy + Default + std::ops::AddAssign + std::ops::Mul<Output = Self>
{
    /// The one of a number's two forms that is this.
    fn either(single: f32, double: f64) -> Self;
    fn from_single(value: f32) -> Self;
}

impl Real for f32 {
    #[inline(always)]
    fn either(single: f32, _: f64) -> Self {
        single
    }

    #[inline(always)]
    fn from_single(value: f32) -> Self {
        value
    }
}

impl Real for f64 {
    #[inline(always)]
    fn either(_: f32, double: f64) -> Self {
        double
    }

    #[inline(always)]
    fn from_single(value: f32) -> Self {
        Self::from(value)
    }
}

/// Conductance from a voxel of a row to inlet and outlet.
pub(super) fn ground(links: &impl Conductances, row: usize, voxel: usize) -> f32 {
    let [before, after] = links.space().open_ends(row);
    let inlet = if before { links.inlet(voxel) } else { 0.0 };
    inlet + if after { links.outlet(voxel) } else { 0.0 }
}

/// Writes what [`Operator::diagonals`] writes for all voxels, converted.
pub(super) fn all_diagonals<T: Send>(
    links: &impl Conductances,
    convert: impl Fn(f32) -> T + Sync,
    diagonals: &mut [T],
    monitor: &Monitor<'_>,
) {
    let space = links.space();
    space.parts.map(diagonals, monitor, |rows, first, diagonals| {
        let mut inflow: Vec<f32> = Vec::new();
        gather(links, rows.clone(), None, &mut inflow);
        for row in rows {
            for voxel in space.voxels_of(row..row + 1) {
                let sum = inflow[voxel - first] + ground(links, row, voxel);
                diagonals[voxel - first] = convert(sum);
            }
        }
    });
}

/// Writes the sums of conductance · value at the other end over the links of the voxels of some rows;
/// without values those of the conductances.
#[inline(always)]
pub(super) fn gather<T: Real>(
    links: &impl Conductances,
    rows: Range<usize>,
    values: Option<&[f16]>,
    inflow: &mut Vec<T>,
) {
    let space = links.space();
    let voxels = space.voxels_of(rows.clone());
    inflow.clear();
    inflow.resize(voxels.len(), T::default());
    // All of a part at once: one by one, in runs of a few, conversion takes longer than all the rest.
    let mut wide = Vec::new();
    let take = |range: Range<usize>, wide: &mut Vec<f32>| {
        if let Some(values) = values {
            widen(&values[range], wide);
        } else {
            wide.clear();
            wide.resize(range.len(), 1.0);
        }
    };
    for axis in [0, 1] {
        for after in [false, true] {
            for (piece, beside) in space.beside(rows.clone(), axis, after) {
                if beside == piece.start {
                    continue; // a volume of one row, which touches itself
                }
                let beside = beside..beside + piece.len();
                let range = space.voxels_of(beside.clone());
                take(range.clone(), &mut wide);
                for (voxel, other, length) in shared(space.bits_of(piece), space.bits_of(beside)) {
                    let owner = if after { voxel } else { other };
                    let inflow = &mut inflow[voxel - voxels.start..];
                    add(inflow, &wide[other - range.start..][..length], links, axis, owner);
                }
            }
        }
    }
    take(voxels.clone(), &mut wide);
    for (voxel, _, length) in pairs(space.bits_of(rows.clone())) {
        let (at, end) = (voxel - voxels.start, voxel - voxels.start + length);
        add(&mut inflow[at..], &wide[at + 1..=end], links, 2, voxel);
        add(&mut inflow[at + 1..], &wide[at..end], links, 2, voxel);
    }
    if space.boundary == Boundary::Open {
        return;
    }
    for [last, first] in rows.filter_map(|row| space.wrapping(row)) {
        if last != first {
            let [first, last] = [first, last].map(|voxel| voxel - voxels.start);
            add(&mut inflow[last..], &wide[first..=first], links, 2, last + voxels.start);
            add(&mut inflow[first..], &wide[last..=last], links, 2, last + voxels.start);
        }
    }
}

/// Adds what comes over links along an axis; `owner` is the first of those at the ends that come
/// before the others.
#[inline(always)]
fn add<T: Real>(
    inflow: &mut [T],
    others: &[f32],
    links: &impl Conductances,
    axis: usize,
    owner: usize,
) {
    // Runs are short: few are as long as the vectors that a loop is made of by itself.
    let inflow = &mut inflow[..others.len()];
    let done = add_by::<8, T>(inflow, others, links, axis, owner);
    let done =
        done + add_by::<4, T>(&mut inflow[done..], &others[done..], links, axis, owner + done);
    add_by::<1, T>(&mut inflow[done..], &others[done..], links, axis, owner + done);
}

/// The same for as many as are in whole groups of N; returns how many.
#[inline(always)]
fn add_by<const N: usize, T: Real>(
    inflow: &mut [T],
    others: &[f32],
    links: &impl Conductances,
    axis: usize,
    owner: usize,
) -> usize {
    let groups = inflow.as_chunks_mut::<N>().0.iter_mut().zip(others.as_chunks::<N>().0);
    let done = groups.len() * N;
    for (k, (inflow, others)) in groups.enumerate() {
        for i in 0..N {
            inflow[i] += links.after::<T>(axis, owner + N * k + i) * T::from_single(others[i]);
        }
    }
    done
}

/// The runs of voxels that rows share with those beside them: the first voxel, that beside it, and
/// how many.
#[inline(always)]
pub(super) fn shared<'a>(own: Rows<'a>, beside: Rows<'a>) -> Runs<'a> {
    Runs { own, beside, pairs: false, word: 0, bits: 0 }.begin()
}

/// The runs of voxels that have a next one in their row: the first, that next to it, and how many.
#[inline(always)]
pub(super) fn pairs(own: Rows<'_>) -> Runs<'_> {
    Runs { own, beside: own, pairs: true, word: 0, bits: 0 }.begin()
}

/// Runs of voxels; a struct with plain loops, for closures that are not inlined would be compiled for
/// the baseline.
pub(super) struct Runs<'a> {
    own: Rows<'a>,
    beside: Rows<'a>,
    pairs: bool,
    /// The word that is looked at, and what is left of its bits.
    word: usize,
    bits: u64,
}

impl Runs<'_> {
    #[inline(always)]
    fn begin(mut self) -> Self {
        self.bits = self.bits_of(0);
        self
    }

    #[inline(always)]
    fn bits_of(&self, word: usize) -> u64 {
        let Some(&bits) = self.own.words.get(word) else { return 0 };
        if self.pairs {
            let ends = self.own.full.is_some_and(|per_row| (word + 1).is_multiple_of(per_row));
            let next = self.own.words.get(word + 1).map_or(0, |next| next << (WORD - 1));
            let next = if ends { 0 } else { next };
            bits & (bits >> 1 | next)
        } else {
            bits & self.beside.words[word]
        }
    }
}

impl Iterator for Runs<'_> {
    type Item = (usize, usize, usize);

    #[inline(always)]
    fn next(&mut self) -> Option<Self::Item> {
        while self.bits == 0 {
            self.word += 1;
            if self.word >= self.own.words.len() {
                return None;
            }
            self.bits = self.bits_of(self.word);
        }
        let (start, length) = take_run(&mut self.bits);
        let below = (1 << start) - 1;
        let number =
            |row: Rows<'_>| row.firsts[self.word] + (row.words[self.word] & below).count_ones();
        let voxel = number(self.own);
        let other = if self.pairs { voxel + 1 } else { number(self.beside) };
        Some((voxel as usize, other as usize, length))
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array3;

    use super::*;
    use crate::rng::Key;
    use crate::transport::finest::Cycle;

    /// Conductances that differ from link to link.
    struct Uneven<'a>(&'a PoreSpace);

    impl Conductances for Uneven<'_> {
        fn space(&self) -> &PoreSpace {
            self.0
        }

        fn after<T: Real>(&self, axis: usize, voxel: usize) -> T {
            T::from_single(1.0 + Key::new(1).unit((3 * voxel + axis) as u64))
        }

        fn inlet(&self, voxel: usize) -> f32 {
            self.after(0, voxel + self.0.len())
        }

        fn outlet(&self, voxel: usize) -> f32 {
            self.after(0, voxel)
        }
    }

    impl Operator for Uneven<'_> {
        fn gather(&self, rows: Range<usize>, values: &[f16], inflow: &mut Vec<f32>) {
            gather(self, rows, Some(values), inflow);
        }

        fn diagonals(&self, voxels: Range<usize>, out: &mut Vec<f32>) {
            let places =
                (0..self.0.rows()).flat_map(|row| (0..self.0.shape[2]).map(move |x| [row, x]));
            let of_place = |at: [usize; 2]| {
                let voxel = self.0.number(at)?;
                let links: f32 = neighbours(self, at).map(|(conductance, _)| conductance).sum();
                Some(links + ground(self, at[0], voxel))
            };
            let all: Vec<f32> = places.filter_map(of_place).collect();
            out.clear();
            out.extend_from_slice(&all[voxels]);
        }
    }

    /// The links of a voxel to others: conductance, number.
    fn neighbours<'a>(
        links: &'a Uneven<'_>,
        at: [usize; 2],
    ) -> impl Iterator<Item = (f32, usize)> + 'a {
        let space = links.0;
        let voxel = space.number(at).unwrap();
        (0..6).filter_map(move |side| {
            let (axis, after) = (side / 2, side % 2 == 1);
            let other = space.number(space.place_beside(at, axis, after)?)?;
            let conductance = links.after(axis, if after { voxel } else { other });
            (other != voxel).then_some((conductance, other))
        })
    }

    fn spaces() -> impl Iterator<Item = PoreSpace> {
        let shapes = [(1, 1, 1), (3, 4, 2), (2, 1, 63), (4, 3, 64), (3, 2, 65), (2, 3, 130)];
        let boundaries = [Boundary::Open, Boundary::Periodic];
        shapes.into_iter().flat_map(move |shape| {
            boundaries.into_iter().map(move |boundary| {
                let mut i = 0;
                let solid = Array3::from_shape_simple_fn(shape, || {
                    i += 1;
                    Key::new(2).unit(i) < 0.2
                });
                PoreSpace::new(solid.view(), boundary, &Monitor::silent()).unwrap()
            })
        })
    }

    #[test]
    fn runs_gather_what_single_links_do() {
        for space in spaces() {
            let links = Uneven(&space);
            let values: Vec<f16> =
                (0..space.len()).map(|i| f16::from_f32(Key::new(3).unit(i as u64))).collect();
            let mut inflow = Vec::new();
            // All rows at once, and row by row.
            links.gather(0..space.rows(), &values, &mut inflow);
            assert_eq!(inflow.len(), space.len());
            for row in 0..space.rows() {
                let mut of_row = Vec::new();
                links.gather(row..row + 1, &values, &mut of_row);
                assert_eq!(of_row, inflow[space.voxels_of(row..row + 1)]);
                for x in 0..space.shape[2] {
                    let Some(voxel) = space.number([row, x]) else { continue };
                    let each = neighbours(&links, [row, x]);
                    let expected: f32 = each.map(|(c, other)| c * values[other].to_f32()).sum();
                    assert!((inflow[voxel] - expected).abs() < 1e-5, "{:?}", space.shape);
                }
            }
            let mut expected = Vec::new();
            links.diagonals(0..space.len(), &mut expected);
            let mut found = vec![0.0; space.len()];
            all_diagonals(&links, |sum| sum, &mut found, &Monitor::silent());
            assert_eq!(found.len(), expected.len());
            assert!(found.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-5));
        }
    }

    #[test]
    fn a_cycle_over_the_voxels_is_symmetric_and_positive() {
        for space in spaces().filter(|space| !space.is_empty()) {
            let n = space.len();
            let links = Uneven(&space);
            let mut cycle = Cycle::new(&links, &Monitor::silent()).unwrap();
            let [a, b] = [4, 5].map(|seed| {
                (0..n).map(|i| Key::new(seed).unit(i as u64) - 0.5).collect::<Vec<f32>>()
            });
            let mut cycled = |right: &[f32]| -> Vec<f32> {
                let write = |voxels, out: &mut Vec<f32>| {
                    out.clear();
                    out.extend_from_slice(&right[voxels]);
                };
                let [mut solution, mut other] = [0, 1].map(|_| vec![f16::NAN; n]);
                let vectors = [&mut solution[..], &mut other];
                let scale = cycle.run(&links, write, vectors, &Monitor::silent());
                solution.iter().map(|x| scale as f32 * x.to_f32()).collect()
            };
            let (of_a, of_b) = (cycled(&a), cycled(&b));
            let product = |a: &[f32], b: &[f32]| -> f64 {
                a.iter().zip(b).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum()
            };
            let scale = (product(&of_a, &a) * product(&of_b, &b)).sqrt();
            let difference = product(&of_a, &b) - product(&a, &of_b);
            // What is kept in 16 bits is rounded.
            assert!(difference.abs() <= 1e-3 * scale, "{:?}", space.shape);
            assert!(product(&of_a, &a) >= 0.0 && product(&of_b, &b) >= 0.0);
        }
    }
}
