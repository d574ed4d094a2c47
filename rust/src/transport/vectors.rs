//! Vectors that are summed alike by any number of threads.

use std::ops::Range;

use rayon::prelude::*;

use crate::error::Result;
use crate::monitor::Monitor;

/// Values that one thread handles at a time; sums are made of chunks, so that this is part of the
/// result. Smaller vectors are not worth a second thread.
pub(super) const CHUNK: usize = 1 << 13;

/// Sum of `term(chunk)` over the chunks of `0..n`.
pub(super) fn sum(n: usize, term: impl Fn(Range<usize>) -> f64 + Sync) -> f64 {
    let part = |chunk: usize| term(chunk * CHUNK..((chunk + 1) * CHUNK).min(n));
    let chunks = n.div_ceil(CHUNK);
    if chunks <= 1 {
        return if n == 0 { 0.0 } else { part(0) };
    }
    (0..chunks).into_par_iter().map(part).collect::<Vec<_>>().iter().sum()
}

/// Terms that are added side by side, so that they fill vectors.
const LANES: usize = 8;
/// Terms that are added in single precision.
const SHORT: usize = 8 * LANES;

/// Sums of the terms of `0..n`; to be inlined where there are vectors to fill.
#[inline(always)]
pub(super) fn summed<const N: usize>(n: usize, term: impl Fn(usize) -> [f32; N]) -> [f64; N] {
    let mut totals = [0.0; N];
    for start in (0..n).step_by(SHORT) {
        let end = (start + SHORT).min(n);
        let whole = start + (end - start) / LANES * LANES;
        let mut sums = [[0.0f32; LANES]; N];
        for first in (start..whole).step_by(LANES) {
            for i in first..first + LANES {
                let terms = term(i);
                for k in 0..N {
                    sums[k][i - first] += terms[k];
                }
            }
        }
        for i in whole..end {
            let terms = term(i);
            for k in 0..N {
                sums[k][i - whole] += terms[k];
            }
        }
        for k in 0..N {
            totals[k] += f64::from(sums[k].iter().sum::<f32>());
        }
    }
    totals
}

/// Scalar product.
#[cfg(test)]
pub(super) fn dot<T: Copy + Into<f64> + Sync>(a: &[T], b: &[T]) -> f64 {
    sum(a.len(), |range| {
        a[range.clone()].iter().zip(&b[range]).map(|(&a, &b)| a.into() * b.into()).sum()
    })
}

/// Calls `work(first index, chunk)` for the chunks of a slice.
///
/// Chunks are left out once the caller wants to stop; the values are then of no use.
pub(super) fn for_chunks<T: Send>(
    values: &mut [T],
    monitor: &Monitor<'_>,
    work: impl Fn(usize, &mut [T]) + Sync,
) {
    if values.len() <= CHUNK {
        work(0, values);
    } else {
        values.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, values)| {
            if monitor.check().is_ok() {
                work(chunk * CHUNK, values);
            }
        });
    }
}

/// Calls `take` with what `work` makes of each of some parts, in their order.
///
/// A few parts are worked on at a time, for what is left of many small vectors is lost for large ones.
pub(super) fn in_order<R: Send>(
    parts: usize,
    work: impl Fn(usize) -> Result<R> + Sync,
    mut take: impl FnMut(R),
) -> Result<()> {
    let at_once = 4 * rayon::current_num_threads();
    for start in (0..parts).step_by(at_once) {
        let batch = start..(start + at_once).min(parts);
        let made = batch.into_par_iter().map(&work).collect::<Result<Vec<_>>>()?;
        made.into_iter().for_each(&mut take);
    }
    Ok(())
}

/// Rows cut into parts that one thread handles at a time: sums are made of parts, so that they are
/// part of a result.
pub(super) struct Parts {
    /// Rows of each part, and what is theirs of a vector that holds the values row by row.
    parts: Vec<(Range<usize>, Range<usize>)>,
}

impl Parts {
    /// Cuts `rows` into parts of `size` values at least; `of` are the values of a row.
    pub fn new(rows: usize, size: usize, of: impl Fn(usize) -> Range<usize>) -> Self {
        let mut parts = Vec::new();
        let mut first = 0;
        for row in 0..rows {
            let (start, end) = (of(first).start, of(row).end);
            if end - start >= size || row + 1 == rows {
                parts.push((first..row + 1, start..end));
                first = row + 1;
            }
        }
        Self { parts }
    }

    /// Calls `work(rows, number of their first value, values)` for the parts of a vector; what it
    /// returns is in the order of the parts.
    ///
    /// Once the caller wants to stop, parts are left out; the values are then of no use.
    pub fn map<T: Send, R: Send + Default>(
        &self,
        mut values: &mut [T],
        monitor: &Monitor<'_>,
        work: impl Fn(Range<usize>, usize, &mut [T]) -> R + Sync,
    ) -> Vec<R> {
        let pieces: Vec<_> = self
            .parts
            .iter()
            .map(|(_, own)| {
                let (piece, rest) = std::mem::take(&mut values).split_at_mut(own.len());
                values = rest;
                piece
            })
            .collect();
        let run = |((rows, own), piece): (&(Range<usize>, Range<usize>), _)| {
            let goes_on = monitor.check().is_ok();
            if goes_on { work(rows.clone(), own.start, piece) } else { R::default() }
        };
        self.parts.par_iter().zip(pieces).map(run).collect()
    }

    /// The sum of `term(rows, their values)` over the parts, always added in one order.
    pub fn sum(&self, term: impl Fn(Range<usize>, Range<usize>) -> f64 + Sync) -> f64 {
        let terms = self.parts.par_iter().map(|(rows, own)| term(rows.clone(), own.clone()));
        terms.collect::<Vec<_>>().iter().sum()
    }
}
