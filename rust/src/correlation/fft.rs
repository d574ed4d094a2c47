//! What the Fourier kernels share.

use rustfft::num_complex::Complex32;

/// Rows that are transformed before they are written out transposed: 16 complex numbers are two
/// cache lines, so that neither side of the transposition wastes what it loads.
pub(super) const ROWS: usize = 16;

/// The smallest length from `n` on whose transform is fast: a multiple of 4 with no other factors
/// than 2, 3 and at most one 5. Further 5s and 7s cost more than the padding they save (100
/// points take 1.8 ns a point, 108 take 0.9).
pub(super) fn fast_length(n: usize) -> usize {
    let is_fast = |mut m: usize| {
        for factor in [2, 3] {
            while m.is_multiple_of(factor) {
                m /= factor;
            }
        }
        m == 1 || m == 5
    };
    let mut quarter = n.div_ceil(4).max(1);
    while !is_fast(quarter) {
        quarter += 1;
    }
    4 * quarter
}

/// Writes up to [`ROWS`] rows of `length` as columns `start..` of a matrix with rows of `stride`.
pub(super) fn write_columns(
    rows: &[Complex32],
    length: usize,
    columns: &mut [Complex32],
    stride: usize,
    start: usize,
) {
    let count = rows.len() / length;
    for (k, out) in columns.chunks_exact_mut(stride).enumerate().take(length) {
        for (i, value) in out[start..start + count].iter_mut().enumerate() {
            *value = rows[i * length + k];
        }
    }
}

/// The plans make their own buffers, so that a transform cannot fail.
pub(super) fn transformed(result: std::result::Result<(), realfft::FftError>) {
    debug_assert!(result.is_ok(), "{result:?}");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fast_lengths_cover_what_is_asked_for() {
        let expected = [(0, 4), (1, 4), (100, 108), (306, 320), (450, 480), (512, 512)];
        for (n, length) in expected {
            assert_eq!(fast_length(n), length, "{n}");
        }
    }

    #[test]
    fn columns_are_the_rows_transposed() {
        let rows: Vec<_> = (0..6).map(|i| Complex32::new(i as f32, 0.0)).collect();
        let mut columns = vec![Complex32::default(); 3 * 4];
        write_columns(&rows, 3, &mut columns, 4, 1);
        let real: Vec<_> = columns.iter().map(|c| c.re).collect();
        assert_eq!(real, [0.0, 0.0, 3.0, 0.0, 0.0, 1.0, 4.0, 0.0, 0.0, 2.0, 5.0, 0.0]);
    }
}
