//! Which of several coarse volumes is nearest to the exemplar over long distances.

use super::field::Field;
use crate::error::Result;
use crate::fourier::{Transform, fast_length};
use crate::monitor::Monitor;
use crate::volume::{Shape, index, position, voxels};

/// The field whose radial two-point function is nearest to the exemplar's, over all lags up to half of
/// the shortest edge, by the sum of squares; the first of several that are equally near. Channels are
/// added. Only pairs within the domain count.
///
/// Products of the values themselves, not of their deviations from the mean: these would not see a
/// volume that is denser at one end, which is what makes planes stand out.
///
/// # Errors
/// If the caller cancels.
pub(super) fn nearest(
    exemplar: &Field,
    fields: &[&Field],
    domain: Option<&[bool]>,
    monitor: &Monitor<'_>,
) -> Result<usize> {
    let Some(first) = fields.first() else { return Ok(0) };
    let edges = exemplar.shape().into_iter().chain(first.shape());
    let reach = edges.min().unwrap_or(1) / 2;
    let own = Pairs::new(exemplar.shape(), None, reach, monitor)?;
    let wanted = own.two_point(exemplar, monitor)?;
    let pairs = Pairs::new(first.shape(), domain, reach, monitor)?;
    let mut best = (f64::INFINITY, 0);
    for (i, field) in fields.iter().enumerate() {
        let found = pairs.two_point(field, monitor)?;
        let error: f64 = wanted.iter().zip(&found).map(|(a, b)| (a - b).powi(2)).sum();
        if error < best.0 {
            best = (error, i);
        }
    }
    Ok(best.1)
}

/// The pairs of voxels of a volume, by their distance.
struct Pairs<'a> {
    shape: Shape,
    domain: Option<&'a [bool]>,
    reach: usize,
    /// Of the volume with room for all lags, so that none wraps.
    transform: Transform,
    padded: Shape,
    /// How many at each distance, rounded to voxels.
    counts: Vec<f64>,
}

impl<'a> Pairs<'a> {
    fn new(
        shape: Shape,
        domain: Option<&'a [bool]>,
        reach: usize,
        monitor: &Monitor<'_>,
    ) -> Result<Self> {
        let padded = shape.map(|n| fast_length(n + reach));
        let transform = Transform::new(padded);
        let mut this = Self { shape, domain, reach, transform, padded, counts: Vec::new() };
        this.counts = this.products(|_| 1.0, monitor)?;
        Ok(this)
    }

    /// Mean product of the values of a pair, by distance; 0 where there is no pair.
    fn two_point(&self, field: &Field, monitor: &Monitor<'_>) -> Result<Vec<f64>> {
        let mut means = vec![0.0; self.reach + 1];
        for c in 0..field.channels() {
            let values = field.channel(c);
            let products = self.products(|i| values[i], monitor)?;
            for (mean, (sum, n)) in means.iter_mut().zip(products.iter().zip(&self.counts)) {
                // Counts are whole, up to rounding.
                *mean += if *n > 0.5 { sum / n } else { 0.0 };
            }
        }
        Ok(means)
    }

    /// Summed product of the values of all pairs in the domain, by distance.
    fn products(&self, value: impl Fn(usize) -> f32, monitor: &Monitor<'_>) -> Result<Vec<f64>> {
        let mut values = vec![0.0; voxels(self.padded)];
        for i in (0..voxels(self.shape)).filter(|&i| self.domain.is_none_or(|on| on[i])) {
            values[index(self.padded, position(self.shape, i))] = value(i);
        }
        self.transform.autocorrelate(&mut values, monitor)?;
        let mut sums = vec![0.0; self.reach + 1];
        for (i, product) in values.iter().enumerate() {
            let at = position(self.padded, i);
            let square: usize = (0..3).map(|a| at[a].min(self.padded[a] - at[a]).pow(2)).sum();
            let distance = (square as f64).sqrt().round() as usize;
            if let Some(sum) = sums.get_mut(distance) {
                *sum += f64::from(*product);
            }
        }
        Ok(sums)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Key;

    fn noise(shape: Shape, channels: usize, seed: u64) -> Field {
        let key = Key::new(seed);
        let values = (0..(channels * voxels(shape)) as u64).map(|i| 255.0 * key.unit(i)).collect();
        Field::new(shape, channels, values).unwrap()
    }

    #[test]
    fn two_point_functions_are_those_of_all_pairs_one_by_one() {
        let (shape, silent) = ([6, 7, 5], Monitor::silent());
        let field = noise(shape, 2, 1);
        let domain: Vec<bool> = (0..voxels(shape)).map(|i| i % 5 != 0).collect();
        for domain in [None, Some(&domain[..])] {
            let pairs = Pairs::new(shape, domain, 3, &silent).unwrap();
            let found = pairs.two_point(&field, &silent).unwrap();
            let (mut sums, mut counts) = ([0.0; 4], [0.0; 4]);
            let inside = |i: &usize| domain.is_none_or(|on| on[*i]);
            for i in (0..voxels(shape)).filter(inside) {
                for j in (0..voxels(shape)).filter(inside) {
                    let (a, b) = (position(shape, i), position(shape, j));
                    let square: usize = (0..3).map(|k| a[k].abs_diff(b[k]).pow(2)).sum();
                    let r = (square as f64).sqrt().round() as usize;
                    if r <= 3 {
                        let product = |c| field.channel(c)[i] * field.channel(c)[j];
                        sums[r] += f64::from(product(0) + product(1));
                        counts[r] += 1.0;
                    }
                }
            }
            for r in 0..4 {
                assert!((pairs.counts[r] - counts[r]).abs() < 1e-2);
                let wanted = sums[r] / counts[r];
                assert!((found[r] - wanted).abs() < 1e-4 * sums[0] / counts[0], "{r}");
            }
        }
    }

    #[test]
    fn the_field_with_the_exemplars_correlation_is_chosen() {
        let (shape, silent) = ([12, 10, 11], Monitor::silent());
        let exemplar = noise(shape, 1, 2);
        let flat = Field::new(shape, 1, vec![127.5; voxels(shape)]).unwrap();
        let mut layers = Field::zeros(shape, 1);
        for (i, v) in layers.channel_mut(0).iter_mut().enumerate() {
            *v = if position(shape, i)[0] % 6 < 3 { 0.0 } else { 255.0 };
        }
        let fields = [&layers, &flat, &exemplar, &exemplar];
        assert_eq!(nearest(&exemplar, &fields, None, &silent).unwrap(), 2);
        assert_eq!(nearest(&exemplar, &fields[..2], None, &silent).unwrap(), 1);
        // What lies outside of the domain does not count.
        let domain: Vec<bool> = (0..voxels(shape)).map(|i| position(shape, i)[1] < 8).collect();
        let mut other = exemplar.clone();
        for (v, on) in other.channel_mut(0).iter_mut().zip(&domain) {
            *v = if *on { *v } else { 0.0 };
        }
        let fields = [&flat, &other];
        assert_eq!(nearest(&exemplar, &fields, Some(&domain), &silent).unwrap(), 1);
    }
}
