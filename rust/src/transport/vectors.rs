//! Vectors that are summed alike by any number of threads.

use std::ops::Range;

use rayon::prelude::*;

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
