//! Slices stacked sixteen deep, so that one instruction treats a pixel of each.
//!
//! Perpendicular to whatever axis, a filter then walks over rows and columns of vectors: nothing is
//! loaded across their edges. Columns that a filter skips are kept apart, so that those it looks at
//! are neighbours in memory and every loop runs over a whole row.

use std::ops::{Deref, DerefMut};

use rayon::prelude::*;

use super::distribution::Range;
use crate::volume::Shape;

/// Slices in a stack: a cache line.
pub(super) const LANES: usize = 16;

/// Products that are added to a sum each time it is loaded.
const TERMS: usize = 8;

/// Sums that a row is added to at once, and rows that are added to them.
const SUMS: usize = 4;

/// Numbers of a row that a kernel takes at a time, so that they stay in the innermost cache.
const BLOCK: usize = 128 * LANES;

/// Numbers of which the first lies at the start of a cache line: vectors across two lines cost twice.
#[derive(Debug, Default)]
pub(super) struct Aligned {
    values: Vec<f32>,
    start: usize,
    len: usize,
}

impl Aligned {
    /// Makes room for so many numbers, in the same memory if it suffices; their values are any.
    pub fn resize(&mut self, len: usize) {
        if self.values.len() < len + LANES {
            self.values = vec![0.0; len + LANES];
        }
        // Memory that cannot be aligned is only slower.
        self.start = self.values.as_ptr().align_offset(LANES * size_of::<f32>()).min(LANES);
        self.len = len;
    }
}

impl Deref for Aligned {
    type Target = [f32];

    fn deref(&self) -> &[f32] {
        &self.values[self.start..self.start + self.len]
    }
}

impl DerefMut for Aligned {
    fn deref_mut(&mut self) -> &mut [f32] {
        &mut self.values[self.start..self.start + self.len]
    }
}

/// Positions along an axis that are looked at: from a first one on, every `step`-th.
#[derive(Debug, Clone, Copy)]
pub(super) struct Positions {
    pub first: usize,
    pub step: usize,
    pub count: usize,
}

impl Positions {
    /// Those of an axis of `n`.
    pub fn new(n: usize, first: usize, step: usize) -> Self {
        let first = first % n.min(step);
        Self { first, step, count: (n - first).div_ceil(step) }
    }

    /// Which of them a place is, if it is one.
    fn find(&self, place: usize) -> Option<usize> {
        let beyond = place.checked_sub(self.first)?;
        beyond.is_multiple_of(self.step).then_some(beyond / self.step)
    }
}

/// How the slices perpendicular to an axis lie in the stacks of a volume.
#[derive(Debug, Clone, Copy)]
pub(super) struct Layout {
    shape: Shape,
    /// The axis across the slices, that of their rows and that of their columns.
    axes: [usize; 3],
    /// Edge of the filters.
    edge: usize,
    /// Every how many rows and columns a filter is applied.
    step: usize,
}

impl Layout {
    pub fn new(shape: Shape, axis: usize, edge: usize, step: usize) -> Self {
        let axes = [[0, 1, 2], [1, 0, 2], [2, 0, 1]][axis];
        Self { shape, axes, edge, step }
    }

    /// Number of slices, of rows and of columns.
    fn sizes(&self) -> [usize; 3] {
        self.axes.map(|a| self.shape[a])
    }

    /// Steps in the volume from slice to slice, row to row and column to column.
    fn strides(&self) -> [usize; 3] {
        let [_, ny, nx] = self.shape;
        self.axes.map(|a| [ny * nx, nx, 1][a])
    }

    pub fn rows(&self) -> usize {
        self.sizes()[1]
    }

    pub fn columns(&self) -> usize {
        self.sizes()[2]
    }

    /// Number of stacks.
    pub fn stacks(&self) -> usize {
        self.sizes()[0].div_ceil(LANES)
    }

    /// Slices of a stack that exist.
    pub fn lanes(&self, stack: usize) -> usize {
        LANES.min(self.sizes()[0] - stack * LANES)
    }

    /// Rows and columns at which a filter with this phase is applied.
    pub fn positions(&self, phase: [usize; 2]) -> [Positions; 2] {
        let [_, rows, columns] = self.sizes();
        [Positions::new(rows, phase[0], self.step), Positions::new(columns, phase[1], self.step)]
    }

    /// Columns a step apart, together with what a filter reaches beyond the last one.
    fn kept(&self) -> usize {
        (self.columns() + self.edge - 1).div_ceil(self.step)
    }

    /// Where a column lies in a row.
    fn place(&self, column: usize) -> usize {
        (column % self.step * self.kept() + column / self.step) * LANES
    }

    /// Numbers in a row of a stack.
    pub fn pitch(&self) -> usize {
        self.step * self.kept() * LANES
    }

    /// Numbers in a row of responses to one filter: zeros as far as a filter reaches, then the
    /// responses, then zeros.
    pub fn response_pitch(&self) -> usize {
        (self.edge + self.kept()) * LANES
    }

    /// The responses in such a row.
    pub fn responses(&self, columns: Positions) -> std::ops::Range<usize> {
        self.edge * LANES..(self.edge + columns.count) * LANES
    }

    /// Stacks the slices of a volume.
    pub fn gather(&self, volume: &[f32], out: &mut Aligned) {
        let (rows, columns) = (self.rows(), self.columns());
        let [across, down, along] = self.strides();
        out.resize(self.stacks() * self.rows() * self.pitch());
        out.par_chunks_exact_mut(self.pitch()).enumerate().for_each(|(row, out)| {
            let (stack, row) = (row / rows, row % rows);
            let first = stack * LANES * across + row * down;
            let lanes = self.lanes(stack);
            for c in 0..columns {
                let (there, missing) = out[self.place(c)..][..LANES].split_at_mut(lanes);
                let first = first + c * along;
                for (l, v) in there.iter_mut().enumerate() {
                    *v = volume[first + l * across];
                }
                missing.fill(0.0);
            }
            for c in columns..self.step * self.kept() {
                let from = self.place(c % columns);
                out.copy_within(from..from + LANES, self.place(c));
            }
        });
    }

    /// Adds `weight` times the stacks to a volume; what lies beyond the last column goes to the first.
    pub fn scatter(&self, stacks: &[f32], weight: f32, volume: &mut [f32]) {
        let [_, ny, nx] = self.shape;
        let [across, down, along] = self.strides();
        let (columns, beyond) = (self.columns(), self.step * self.kept());
        // A part of the volume is one row of all stacks, or all rows of one stack.
        let stacked = self.axes[0] == 0;
        let planes = if stacked { LANES } else { 1 };
        volume.par_chunks_mut(planes * ny * nx).enumerate().for_each(|(part, volume)| {
            let all = [self.stacks(), self.rows()];
            let [own_stacks, own_rows] =
                [0, 1].map(|i| if stacked == (i == 0) { part..part + 1 } else { 0..all[i] });
            for stack in own_stacks {
                for row in own_rows.clone() {
                    let from = &stacks[(stack * self.rows() + row) * self.pitch()..];
                    let first = if stacked { row * down } else { stack * LANES * across };
                    for c in 0..beyond {
                        let first = first + c % columns * along;
                        let from = &from[self.place(c)..][..self.lanes(stack)];
                        for (l, v) in from.iter().enumerate() {
                            volume[first + l * across] += weight * v;
                        }
                    }
                }
            }
        });
    }

    /// Correlates filters, each given by its taps row after row, with a row of a stack: one row of
    /// responses to each.
    pub fn correlate<'a>(
        &self,
        stack: &[f32],
        row: usize,
        columns: Positions,
        filters: impl Iterator<Item = (&'a [f32], &'a mut [f32])>,
    ) {
        let numbers = columns.count * LANES;
        let from: Vec<&[f32]> = (0..self.edge * self.edge)
            .map(|i| {
                let row = (row + i / self.edge) % self.rows() * self.pitch();
                &stack[row + self.place(columns.first + i % self.edge)..][..numbers]
            })
            .collect();
        let (taps, sums): (Vec<_>, Vec<_>) = filters
            .map(|(taps, out)| {
                out.fill(0.0);
                (taps, &mut out[self.responses(columns)])
            })
            .unzip();
        add_all_products(sums, &from, |k, t| taps[k][t]);
    }

    /// Adds to a row of a stack what the corrections of the responses ask for, the adjoint of
    /// [`Self::correlate`]: `filters` gives the taps of each, and its corrections in a row of
    /// responses.
    pub fn spread<'a>(
        &self,
        corrections: impl Fn(usize, usize) -> &'a [f32],
        row: usize,
        [rows, columns]: [Positions; 2],
        filters: &[&[f32]],
        out: &mut [f32],
    ) {
        let edge = self.edge;
        let numbers = self.kept() * LANES;
        let mut terms = Vec::with_capacity(edge * edge * filters.len());
        for (phase, out) in out.chunks_exact_mut(numbers).enumerate() {
            terms.clear();
            for j in 0..edge {
                let Some(from) = rows.find((row + edge * self.rows() - j) % self.rows()) else {
                    continue;
                };
                for (k, taps) in filters.iter().enumerate() {
                    let from = corrections(from, k);
                    for (i, &tap) in taps[j * edge..][..edge].iter().enumerate() {
                        let place = columns.first + i;
                        if place % self.step == phase {
                            let start = (edge - place / self.step) * LANES;
                            terms.push((tap, &from[start..start + numbers]));
                        }
                    }
                }
            }
            add_products(out, terms.iter().copied());
        }
    }
}

/// Adds rows, each times its factor.
pub(super) fn add_products<'a>(
    out: &mut [f32],
    terms: impl Iterator<Item = (f32, &'a [f32])> + Clone,
) {
    let n = out.len();
    for start in (0..n).step_by(BLOCK) {
        let block = start..n.min(start + BLOCK);
        let mut terms = terms.clone().peekable();
        while let Some(&(_, any)) = terms.peek() {
            let mut factors = [0.0; TERMS];
            let mut from = [&any[block.clone()]; TERMS];
            for (i, (factor, row)) in terms.by_ref().take(TERMS).enumerate() {
                (factors[i], from[i]) = (factor, &row[block.clone()]);
            }
            accumulate(&mut out[block.clone()], factors, from);
        }
    }
}

#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
fn accumulate(out: &mut [f32], t: [f32; TERMS], from: [&[f32]; TERMS]) {
    let n = out.len();
    let [a, b, c, d, e, f, g, h] = from.map(|row| &row[..n]);
    for x in 0..n {
        let first = t[0] * a[x] + t[1] * b[x] + t[2] * c[x] + t[3] * d[x];
        let second = t[4] * e[x] + t[5] * f[x] + t[6] * g[x] + t[7] * h[x];
        out[x] += first + second;
    }
}

/// Adds the same rows to several, each time with other factors: `factor` of a sum and a term. Sums are
/// taken four at a time, so that a row that is loaded serves four.
pub(super) fn add_all_products(
    mut sums: Vec<&mut [f32]>,
    terms: &[&[f32]],
    factor: impl Fn(usize, usize) -> f32,
) {
    for (first, sums) in sums.chunks_mut(SUMS).enumerate() {
        let first = first * SUMS;
        if let [a, b, c, d] = sums {
            let n = a.len();
            for block in (0..n).step_by(BLOCK).map(|start| start..n.min(start + BLOCK)) {
                for (t, from) in terms.chunks(SUMS).enumerate() {
                    // The last few terms are filled up with nothing.
                    let rows =
                        std::array::from_fn(|i| &from.get(i).unwrap_or(&from[0])[block.clone()]);
                    let factors = std::array::from_fn(|i| {
                        let of =
                            |s| if i < from.len() { factor(first + s, t * SUMS + i) } else { 0.0 };
                        std::array::from_fn(of)
                    });
                    let [a, b, c, d] = [&mut *a, b, c, d].map(|sum| &mut sum[block.clone()]);
                    accumulate_four([a, b, c, d], factors, rows);
                }
            }
        } else {
            for (s, sum) in sums.iter_mut().enumerate() {
                add_products(
                    sum,
                    terms.iter().enumerate().map(|(t, &row)| (factor(first + s, t), row)),
                );
            }
        }
    }
}

/// `t` by row, then by sum.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
fn accumulate_four(sums: [&mut [f32]; SUMS], t: [[f32; SUMS]; SUMS], from: [&[f32]; SUMS]) {
    let n = from[0].len();
    let [a, b, c, d] = from.map(|row| &row[..n]);
    let [p, q, r, s] = sums.map(|sum| &mut sum[..n]);
    for x in 0..n {
        let v = [a[x], b[x], c[x], d[x]];
        let of = |s: usize| t[0][s] * v[0] + t[1][s] * v[1] + t[2][s] * v[2] + t[3][s] * v[3];
        p[x] += of(0);
        q[x] += of(1);
        r[x] += of(2);
        s[x] += of(3);
    }
}

/// The sum of the squares of a row.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
pub(super) fn sum_of_squares(values: &[f32]) -> f64 {
    let mut sums = [0.0f32; LANES];
    for v in values.as_chunks::<LANES>().0 {
        for l in 0..LANES {
            sums[l] += v[l] * v[l];
        }
    }
    sums.iter().map(|&sum| f64::from(sum)).sum()
}

/// The range of the slices of a stack that exist.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
pub(super) fn range(values: &[f32], lanes: usize) -> Range {
    let (mut low, mut high) = ([f32::INFINITY; LANES], [f32::NEG_INFINITY; LANES]);
    for v in values.as_chunks::<LANES>().0 {
        for l in 0..LANES {
            low[l] = if v[l] < low[l] { v[l] } else { low[l] };
            high[l] = if v[l] > high[l] { v[l] } else { high[l] };
        }
    }
    let low = low[..lanes].iter().copied().fold(f32::INFINITY, f32::min);
    let high = high[..lanes].iter().copied().fold(f32::NEG_INFINITY, f32::max);
    Range { low, high }
}
