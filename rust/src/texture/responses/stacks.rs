//! Slices stacked sixteen deep, so that one instruction treats a pixel of each.
//!
//! Perpendicular to whatever axis, a filter then walks over rows and columns of vectors: nothing is
//! loaded across their edges, and positions may be left out at no cost.

use rayon::prelude::*;

use super::distribution::Range;
use crate::volume::{Shape, voxels};

/// Slices in a stack.
pub(super) const LANES: usize = 16;

/// Filters that are applied together, so that each vector is loaded once for all of them.
pub(super) const GROUP: usize = 4;

/// A pixel of the slices of a stack.
type Vector = [f32; LANES];

/// How the slices perpendicular to an axis lie in the stacks of a volume.
#[derive(Debug, Clone, Copy)]
pub(super) struct Layout {
    shape: Shape,
    /// The axis across the slices, that of their rows and that of their columns.
    axes: [usize; 3],
    /// Edge of the filters.
    pub edge: usize,
}

impl Layout {
    pub fn new(shape: Shape, axis: usize, edge: usize) -> Self {
        let axes = [[0, 1, 2], [1, 0, 2], [2, 0, 1]][axis];
        Self { shape, axes, edge }
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

    /// Numbers in a row of a stack: what a filter reaches beyond the last column is repeated.
    pub fn pitch(&self) -> usize {
        (self.columns() + self.edge - 1) * LANES
    }

    /// Numbers in all stacks.
    pub fn len(&self) -> usize {
        self.stacks() * self.rows() * self.pitch()
    }

    /// Stacks the slices of a volume.
    pub fn gather(&self, volume: &[f32]) -> Vec<f32> {
        let (rows, columns) = (self.rows(), self.columns());
        let [across, down, along] = self.strides();
        let mut out = vec![0.0; self.len()];
        out.par_chunks_exact_mut(self.pitch()).enumerate().for_each(|(row, out)| {
            let (stack, row) = (row / rows, row % rows);
            let first = stack * LANES * across + row * down;
            for (c, out) in out.chunks_exact_mut(LANES).take(columns).enumerate() {
                for (l, v) in out.iter_mut().take(self.lanes(stack)).enumerate() {
                    *v = volume[first + l * across + c * along];
                }
            }
            for c in columns..columns + self.edge - 1 {
                let from = c % columns * LANES;
                out.copy_within(from..from + LANES, c * LANES);
            }
        });
        out
    }

    /// Adds `weight` times the stacks to a volume.
    pub fn scatter(&self, stacks: &[f32], weight: f32, volume: &mut [f32]) {
        let [nz, ny, nx] = self.shape;
        let planes = if self.axes[0] == 0 { LANES } else { 1 };
        let [across, down, along] = self.strides();
        let columns = self.columns();
        volume.par_chunks_mut(planes * ny * nx).enumerate().for_each(|(part, volume)| {
            // All of a stack's slices, or a row of all stacks.
            let rows = if self.axes[0] == 0 { 0..self.rows() } else { part..part + 1 };
            let part_stacks = if self.axes[0] == 0 { part..part + 1 } else { 0..self.stacks() };
            for stack in part_stacks {
                for row in rows.clone() {
                    let from = &stacks[(stack * self.rows() + row) * self.pitch()..];
                    let from = &from[..self.pitch()];
                    let first = if self.axes[0] == 0 { row * down } else { stack * LANES * across };
                    for (c, from) in from.chunks_exact(LANES).enumerate() {
                        let first = first + c % columns * along;
                        for (l, v) in from.iter().take(self.lanes(stack)).enumerate() {
                            volume[first + l * across] += weight * v;
                        }
                    }
                }
            }
        });
        debug_assert_eq!(volume.len(), voxels([nz, ny, nx]));
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
    pub fn find(&self, place: usize) -> Option<usize> {
        let beyond = place.checked_sub(self.first)?;
        beyond.is_multiple_of(self.step).then_some(beyond / self.step)
    }
}

/// Taps of a group of filters, row after row.
pub(super) type Taps = [[f32; GROUP]];

fn vectors(values: &[f32]) -> &[Vector] {
    values.as_chunks().0
}

fn vectors_mut(values: &mut [f32]) -> &mut [Vector] {
    values.as_chunks_mut().0
}

/// Correlates a group of filters with the rows of a stack, as far as the filters reach, at some
/// columns: filter after filter.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
pub(super) fn correlate(rows: &[&[f32]], taps: &Taps, columns: Positions, out: &mut [f32]) {
    let edge = rows.len();
    let out = vectors_mut(out);
    for m in 0..columns.count {
        let mut sums = [[0.0f32; LANES]; GROUP];
        let first = columns.first + m * columns.step;
        for (row, taps) in rows.iter().zip(taps.chunks_exact(edge)) {
            for (v, taps) in vectors(row)[first..first + edge].iter().zip(taps) {
                for k in 0..GROUP {
                    for l in 0..LANES {
                        sums[k][l] += taps[k] * v[l];
                    }
                }
            }
        }
        for (k, sums) in sums.iter().enumerate() {
            out[k * columns.count + m] = *sums;
        }
    }
}

/// Adds to a row of a stack what the corrections of one row of responses, made by one row of the
/// filters, ask for: the adjoint of [`correlate`].
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
pub(super) fn spread(corrections: &[f32], taps: &Taps, columns: Positions, row: &mut [f32]) {
    let edge = taps.len();
    let row = vectors_mut(row);
    let corrections = vectors(corrections);
    let n = columns.count;
    for m in 0..n {
        let first = columns.first + m * columns.step;
        let d: [Vector; GROUP] = std::array::from_fn(|k| corrections[k * n + m]);
        for (sum, taps) in row[first..first + edge].iter_mut().zip(taps) {
            for l in 0..LANES {
                let mut add = 0.0;
                for k in 0..GROUP {
                    add += taps[k] * d[k][l];
                }
                sum[l] += add;
            }
        }
    }
}

/// The range of the lanes that exist.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
pub(super) fn range(values: &[f32], lanes: usize) -> Range {
    let (mut low, mut high) = ([f32::INFINITY; LANES], [f32::NEG_INFINITY; LANES]);
    for v in vectors(values) {
        for l in 0..LANES {
            low[l] = low[l].min(v[l]);
            high[l] = high[l].max(v[l]);
        }
    }
    let low = low[..lanes].iter().copied().fold(f32::INFINITY, f32::min);
    let high = high[..lanes].iter().copied().fold(f32::NEG_INFINITY, f32::max);
    Range { low, high }
}
