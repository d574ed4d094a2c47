//! Vectors that are summed alike by any number of threads.

use rayon::prelude::*;

use crate::monitor::Monitor;

/// Values that one thread handles at a time; sums are made of chunks, so that this is part of the
/// result. Smaller vectors are not worth a second thread.
pub(super) const CHUNK: usize = 1 << 13;

/// Sum of `term(chunk)` over the chunks of `0..n`.
pub(super) fn sum(n: usize, term: impl Fn(std::ops::Range<usize>) -> f64 + Sync) -> f64 {
    let part = |chunk: usize| term(chunk * CHUNK..((chunk + 1) * CHUNK).min(n));
    let chunks = n.div_ceil(CHUNK);
    if chunks <= 1 {
        return if n == 0 { 0.0 } else { part(0) };
    }
    (0..chunks).into_par_iter().map(part).collect::<Vec<_>>().iter().sum()
}

/// Scalar product.
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
    for_chunks_of_two(values, &mut [], monitor, |first, values, _: &mut [()]| work(first, values));
}

/// Calls `work(first index, chunk, chunk)` for the chunks of two slices of one length, or of one
/// slice if the second is empty.
pub(super) fn for_chunks_of_two<T: Send, U: Send>(
    values: &mut [T],
    others: &mut [U],
    monitor: &Monitor<'_>,
    work: impl Fn(usize, &mut [T], &mut [U]) + Sync,
) {
    if values.len() <= CHUNK {
        work(0, values, others);
    } else if others.is_empty() {
        values.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, values)| {
            if monitor.check().is_ok() {
                work(chunk * CHUNK, values, &mut []);
            }
        });
    } else {
        let pairs = values.par_chunks_mut(CHUNK).zip(others.par_chunks_mut(CHUNK));
        pairs.enumerate().for_each(|(chunk, (values, others))| {
            if monitor.check().is_ok() {
                work(chunk * CHUNK, values, others);
            }
        });
    }
}
