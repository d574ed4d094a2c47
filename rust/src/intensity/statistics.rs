//! Moments of gray values, and their numbers in equal bins.

use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::monitor::Monitor;

/// A gray value as a number.
pub trait Gray: Copy + Send + Sync {
    /// The nearest double.
    fn number(self) -> f64;
}

macro_rules! gray {
    ($($number:ty),*) => {$(
        impl Gray for $number {
            #[allow(clippy::cast_lossless)]
            #[inline(always)]
            fn number(self) -> f64 {
                self as f64
            }
        }
    )*};
}

gray!(u8, i8, u16, i16, u32, i32, u64, i64, f32, f64);

/// Values that are summed one after the other: chunks do not depend on the number of threads.
const CHUNK: usize = 1 << 16;

/// Mean, spread and range of gray values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moments {
    /// Mean.
    pub mean: f64,
    /// Mean squared difference from the mean.
    pub variance: f64,
    /// Smallest value.
    pub minimum: f64,
    /// Largest value.
    pub maximum: f64,
}

/// Moments of some values, at least one.
///
/// Memory: 8 bytes for each 65 536 values.
pub fn moments<T: Gray>(values: &[T], monitor: &Monitor<'_>) -> Result<Moments> {
    if values.is_empty() {
        return Err(Error::parameter("values", 0, "must hold voxels"));
    }
    let n = values.len() as f64;
    let chunks = |sum: &(dyn Fn(&[T]) -> [f64; 3] + Sync)| -> Result<Vec<[f64; 3]>> {
        let sums = values.par_chunks(CHUNK).map(|chunk| {
            monitor.check()?;
            Ok(sum(chunk))
        });
        sums.collect()
    };
    let first = chunks(&|chunk| {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for value in chunk {
            (low, high) = (low.min(value.number()), high.max(value.number()));
        }
        [lanes(chunk, |v| v), low, high]
    })?;
    let mean = first.iter().map(|c| c[0]).sum::<f64>() / n;
    let second = chunks(&|chunk| [lanes(chunk, |v| (v - mean) * (v - mean)), 0.0, 0.0])?;
    Ok(Moments {
        mean,
        variance: second.iter().map(|c| c[0]).sum::<f64>() / n,
        minimum: first.iter().map(|c| c[1]).fold(f64::INFINITY, f64::min),
        maximum: first.iter().map(|c| c[2]).fold(f64::NEG_INFINITY, f64::max),
    })
}

/// A sum in several lanes, which a processor adds at once.
fn lanes<T: Gray>(values: &[T], of: impl Fn(f64) -> f64) -> f64 {
    let mut sums = [0.0; 8];
    let (eights, rest) = values.as_chunks::<8>();
    for eight in eights {
        for (sum, value) in sums.iter_mut().zip(eight) {
            *sum += of(value.number());
        }
    }
    for (sum, value) in sums.iter_mut().zip(rest) {
        *sum += of(value.number());
    }
    sums.iter().sum()
}

/// How many values lie in each bin between equidistant `edges`; the last bin holds its upper edge.
/// Values outside do not count.
pub fn binned_counts<T: Gray>(
    values: &[T],
    edges: &[f64],
    monitor: &Monitor<'_>,
) -> Result<Vec<u64>> {
    let [low, .., high] = edges else {
        return Err(Error::parameter("edges", edges, "must be at least two"));
    };
    if !edges.windows(2).all(|w| w[0] < w[1]) || !(high - low).is_finite() {
        return Err(Error::parameter("edges", (low, high), "must be finite and ascend"));
    }
    let bins = edges.len() - 1;
    let scale = bins as f64 / (high - low);
    values
        .par_chunks(1 << 20)
        .map(|chunk| {
            monitor.check()?;
            let mut counts = vec![0u64; bins];
            for value in chunk {
                let value = value.number();
                if value < *low || value > *high {
                    continue;
                }
                let mut bin = (((value - low) * scale) as usize).min(bins - 1);
                // Rounding may miss an edge by one.
                if value < edges[bin] {
                    bin -= 1;
                } else if value >= edges[bin + 1] && bin + 1 < bins {
                    bin += 1;
                }
                counts[bin] += 1;
            }
            Ok(counts)
        })
        .try_reduce(
            || vec![0; bins],
            |mut a, b| {
                a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
                Ok(a)
            },
        )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Key;
    use crate::threads::with_threads;

    #[test]
    fn moments_are_those_of_two_passes() {
        let silent = Monitor::silent();
        let values: Vec<f32> = (0..200_001).map(|i| 1e4 + Key::new(1).unit(i)).collect();
        let n = values.len() as f64;
        let mean = values.iter().map(|&v| f64::from(v)).sum::<f64>() / n;
        let variance = values.iter().map(|&v| (f64::from(v) - mean).powi(2)).sum::<f64>() / n;
        let found = moments(&values, &silent).unwrap();
        assert!((found.mean - mean).abs() < 1e-9 && (found.variance / variance - 1.0).abs() < 1e-9);
        assert_eq!(with_threads(1, || moments(&values, &silent)).unwrap(), Ok(found));
        let one = moments(&[7i16], &silent).unwrap();
        assert_eq!(one, Moments { mean: 7.0, variance: 0.0, minimum: 7.0, maximum: 7.0 });
        assert!(moments::<f64>(&[], &silent).is_err());
    }

    #[test]
    fn edges_belong_to_the_bin_above_them() {
        let third = 0.1 + 0.2;
        let edges = [0.0, 0.1, 0.2, third, 0.4];
        let values = [-0.1, 0.0, 0.1, 0.2, 0.3, third, 0.4, 0.41];
        let found = binned_counts(&values, &edges, &Monitor::silent()).unwrap();
        assert_eq!(found, [1, 1, 2, 2]);
        for bad in [&[0.0][..], &[1.0, 1.0], &[0.0, f64::INFINITY]] {
            assert!(binned_counts(&values, bad, &Monitor::silent()).is_err());
        }
    }
}
