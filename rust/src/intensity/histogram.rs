//! Histogram matching: values are replaced by the exemplar's values of the same rank.

use rayon::prelude::*;

use super::order::{Bits, Kind};

/// Bins of the output's cumulative histogram. 4096 bins on a field of 256 levels resolve a
/// sixteenth of a level, below what a blend of patches leaves of a value.
const BINS: usize = 4096;

/// Voxels a task counts: large enough to hide the merging of its histogram.
const CHUNK: usize = 1 << 16;

/// The quantile function of an exemplar's values.
#[derive(Debug, Clone)]
pub struct Quantiles(Vec<f32>);

impl Quantiles {
    /// Quantiles of `values`, which must not be empty.
    pub fn new(values: &[f32]) -> Self {
        let mut sorted = values.to_vec();
        sorted.par_sort_unstable_by(f32::total_cmp);
        let last = sorted.len() - 1;
        Self((0..=BINS).map(|i| sorted[(i * last + BINS / 2) / BINS]).collect())
    }

    /// Value at probability `p` in `0..=1`, linear between quantiles.
    fn at(&self, p: f32) -> f32 {
        let x = p.clamp(0.0, 1.0) * BINS as f32;
        let i = (x as usize).min(BINS - 1);
        let t = x - i as f32;
        self.0[i] + t * (self.0[i + 1] - self.0[i])
    }

    /// Gives `values` this distribution without changing their order.
    ///
    /// Only the values that `counts` selects (all without it) are counted; all are mapped.
    /// Deterministic for any number of threads: the histogram is made of integers.
    pub fn match_values(&self, values: &mut [f32], counts: Option<&[bool]>) {
        let Some((low, high)) = range(values, counts) else { return };
        if low >= high {
            values.fill(self.at(0.5));
            return;
        }
        let scale = BINS as f32 / (high - low);
        let mut cumulative = histogram(values, counts, low, scale);
        let total: u64 = cumulative.iter().sum();
        let mut before = 0u64;
        for c in &mut cumulative {
            before += std::mem::replace(c, before);
        }
        cumulative.push(total);
        let lut: Vec<f32> =
            cumulative.iter().map(|&c| self.at((c as f64 / total as f64) as f32)).collect();
        values.par_chunks_mut(CHUNK).for_each(|chunk| {
            for v in chunk {
                let x = ((*v - low) * scale).clamp(0.0, BINS as f32);
                let i = (x as usize).min(BINS - 1);
                let t = x - i as f32;
                *v = lut[i] + t * (lut[i + 1] - lut[i]);
            }
        });
    }
}

/// Smallest and largest of the selected values; none where nothing is selected.
fn range(values: &[f32], selected: Option<&[bool]>) -> Option<(f32, f32)> {
    let (low, high) = values
        .par_chunks(CHUNK)
        .enumerate()
        .map(|(c, chunk)| {
            let on = selected.map(|s| &s[c * CHUNK..]);
            chunk
                .iter()
                .enumerate()
                .filter(|(i, _)| on.is_none_or(|s| s[*i]))
                .fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), (_, &v)| {
                    (low.min(v), high.max(v))
                })
        })
        .reduce(|| (f32::INFINITY, f32::NEG_INFINITY), |a, b| (a.0.min(b.0), a.1.max(b.1)));
    (low <= high).then_some((low, high))
}

fn histogram(values: &[f32], selected: Option<&[bool]>, low: f32, scale: f32) -> Vec<u64> {
    values
        .par_chunks(CHUNK)
        .enumerate()
        .map(|(c, chunk)| {
            let on = selected.map(|s| &s[c * CHUNK..]);
            let mut counts = vec![0u64; BINS];
            for (i, &v) in chunk.iter().enumerate() {
                if on.is_none_or(|s| s[i]) {
                    counts[(((v - low) * scale) as usize).min(BINS - 1)] += 1;
                }
            }
            counts
        })
        .reduce(
            || vec![0; BINS],
            |mut a, b| {
                a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
                a
            },
        )
}

/// Unsigned integer whose order is that of the (finite) floats.
pub(super) fn ordered_bits(value: f32) -> u32 {
    value.to_bits().key(Kind::Float)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Key;

    fn noise(seed: u64, n: usize) -> Vec<f32> {
        (0..n as u64).map(|i| Key::new(seed).unit(i)).collect()
    }

    #[test]
    fn matching_reproduces_the_distribution_and_keeps_the_order() {
        let target: Vec<f32> = noise(1, 20_000).iter().map(|v| 200.0 * v * v).collect();
        let mut values: Vec<f32> = noise(2, 30_000).iter().map(|v| 5.0 - 3.0 * v).collect();
        let before = values.clone();
        Quantiles::new(&target).match_values(&mut values, None);
        let mut order: Vec<usize> = (0..values.len()).collect();
        order.sort_by(|&a, &b| before[a].total_cmp(&before[b]));
        assert!(order.windows(2).all(|w| values[w[0]] <= values[w[1]]));
        let mut sorted = target.clone();
        sorted.sort_by(f32::total_cmp);
        for q in [0.05, 0.25, 0.5, 0.75, 0.95] {
            let got = values[order[(q * 30_000.0) as usize]];
            assert!((got - sorted[(q * 20_000.0) as usize]).abs() < 1.0, "{q}: {got}");
        }
    }

    #[test]
    fn constant_and_empty_values() {
        let q = Quantiles::new(&[1.0, 2.0, 3.0]);
        let mut constant = vec![7.0; 5];
        q.match_values(&mut constant, None);
        assert_eq!(constant, [2.0; 5]);
        q.match_values(&mut [], None);
        let mut unselected = vec![7.0; 2];
        q.match_values(&mut unselected, Some(&[false, false]));
        assert_eq!(unselected, [7.0; 2]);
    }

    #[test]
    fn unselected_values_are_mapped_but_not_counted() {
        let mut values = vec![0.0, 1.0, 2.0, 3.0, 100.0];
        let counts = [true, true, true, true, false];
        Quantiles::new(&[10.0, 20.0]).match_values(&mut values, Some(&counts));
        assert_eq!((values[0], values[4]), (10.0, 20.0));
    }

    #[test]
    fn ordered_bits_keep_the_order() {
        let values = [f32::MIN, -1.5, -0.0, 0.0, 1e-30, 2.0, f32::MAX];
        assert!(values.windows(2).all(|w| ordered_bits(w[0]) <= ordered_bits(w[1])));
        assert_eq!(ordered_bits(-0.0), ordered_bits(0.0));
    }
}
