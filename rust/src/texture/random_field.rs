//! A start for a synthesis from images: a Gaussian random field with their covariance.

use rayon::prelude::*;

use super::field::Field;
use super::responses::{Target, check_targets};
use crate::error::{Error, Result};
use crate::fourier::{Transform, fast_length};
use crate::intensity::Quantiles;
use crate::monitor::Monitor;
use crate::rng::Key;
use crate::volume::{Shape, position, voxels};

/// What keeps the weight of an image finite for lags that lie in its plane: there it counts this many
/// times less than 1/… of what lies across.
const ACROSS: f64 = 0.01;

/// A periodic field of normal noise with the covariance of images, then given their distribution.
///
/// The channels are independent. Along a lag d the covariance is the mean of those of the images, of
/// each at d turned into its plane, weighted by 1/((d_a/|d|)² + small) with d_a the part of d across
/// the plane: an image says most about the lags that lie in it. Memory: about 16 bytes a voxel beside
/// the field.
///
/// # Errors
/// If there is no image, the shape is empty, or the caller cancels.
pub fn random_field(
    targets: &[Target<'_>],
    shape: Shape,
    quantiles: &[Quantiles],
    key: Key,
    monitor: &Monitor<'_>,
) -> Result<Field> {
    let Some(first) = targets.first() else {
        return Err(Error::parameter("images", 0, "must be at least one"));
    };
    if shape.contains(&0) {
        return Err(Error::parameter("shape", shape, "must not be empty"));
    }
    let channels = first.image.channels();
    check_targets(targets, channels, 1)?;
    let transform = Transform::new(shape);
    let mut out = Field::zeros(shape, channels);
    for c in 0..channels {
        let images = targets
            .iter()
            .map(|target| Covariance::new(target, c, monitor))
            .collect::<Result<Vec<_>>>()?;
        let covariance = fill(shape, monitor, |p| mean_covariance(&images, lag(shape, p)))?;
        let power = transform.forward(&covariance, monitor)?;
        let key = key.with(c as u64);
        let noise = fill(shape, monitor, |p| key.normal(crate::volume::index(shape, p) as u64))?;
        let mut spectrum = transform.forward(&noise, monitor)?;
        spectrum.zip_mut_with(&power, |value, power| *value *= power.re.max(0.0).sqrt());
        transform.inverse(spectrum, out.channel_mut(c), monitor)?;
        if let Some(quantiles) = quantiles.get(c) {
            quantiles.match_values(out.channel_mut(c), None);
        }
    }
    Ok(out)
}

/// Covariance of one channel of an image with itself.
struct Covariance {
    axis: usize,
    weight: f64,
    /// Lags beyond this have none.
    reach: usize,
    /// By lag along rows and columns, from −`reach` to `reach`; empty for a symmetric image.
    map: Vec<f32>,
    /// By length, mean over the directions.
    radial: Vec<f32>,
}

impl Covariance {
    fn new(target: &Target<'_>, channel: usize, monitor: &Monitor<'_>) -> Result<Self> {
        let [_, ny, nx] = target.image.shape();
        let values = target.image.channel(channel);
        let mean = values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len() as f64;
        let reach = ny.min(nx) / 2;
        let padded = [1, fast_length(ny + reach), fast_length(nx + reach)];
        let mut centred = vec![0.0; voxels(padded)];
        for (to, from) in centred.chunks_exact_mut(padded[2]).zip(values.chunks_exact(nx)) {
            for (to, &from) in to.iter_mut().zip(from) {
                *to = (f64::from(from) - mean) as f32;
            }
        }
        let transform = Transform::new(padded);
        let mut spectrum = transform.forward(&centred, monitor)?;
        spectrum.mapv_inplace(|value| value.norm_sqr().into());
        transform.inverse(spectrum, &mut centred, monitor)?;
        let edge = 2 * reach + 1;
        let mut map = vec![0.0; edge * edge];
        let mut rings = vec![(0.0, 0.0); reach + 2];
        for (i, out) in map.iter_mut().enumerate() {
            let [dy, dx] = [i / edge, i % edge].map(|k| k as isize - reach as isize);
            let wrap = |d: isize, n: usize| d.rem_euclid(n as isize) as usize;
            let products = centred[wrap(dy, padded[1]) * padded[2] + wrap(dx, padded[2])];
            let pairs = (ny - dy.unsigned_abs()) * (nx - dx.unsigned_abs());
            *out = products / pairs as f32;
            let r = ((dy * dy + dx * dx) as f64).sqrt();
            let ring = r as usize;
            if ring <= reach {
                // Shared between the two nearest rings.
                let beyond = r - ring as f64;
                for (ring, share) in [(ring, 1.0 - beyond), (ring + 1, beyond)] {
                    rings[ring].0 += share * f64::from(*out);
                    rings[ring].1 += share;
                }
            }
        }
        let radial = rings.iter().map(|(sum, n)| (sum / f64::max(*n, 1e-9)) as f32).collect();
        if target.symmetric {
            map.clear();
        }
        let weight = f64::from(target.weight);
        Ok(Self { axis: target.axis, weight, reach, map, radial })
    }

    /// At a lag turned into the plane; 0 from half the image's edge on.
    fn at(&self, lag: [f64; 3], length: f64) -> f64 {
        let reach = self.reach as f64;
        if length >= reach && length > 0.0 {
            return 0.0;
        }
        let [down, along] = [[1, 2], [0, 2], [0, 1]][self.axis].map(|a| lag[a]);
        let in_plane = down.hypot(along);
        let value = if self.map.is_empty() || in_plane < 1e-9 {
            let ring = length as usize;
            let beyond = length - ring as f64;
            let [low, high] = [ring, ring + 1].map(|r| f64::from(self.radial[r]));
            low + beyond * (high - low)
        } else {
            let turned = [down, along].map(|d| d * length / in_plane + reach);
            self.interpolated(turned)
        };
        value * taper(length / reach)
    }

    fn interpolated(&self, [y, x]: [f64; 2]) -> f64 {
        let edge = 2 * self.reach + 1;
        let (row, column) = ((y as usize).min(edge - 2), (x as usize).min(edge - 2));
        let (ty, tx) = (y - row as f64, x - column as f64);
        let line = |row: usize| {
            let [a, b] = [0, 1].map(|i| f64::from(self.map[row * edge + column + i]));
            a + tx * (b - a)
        };
        let (a, b) = (line(row), line(row + 1));
        a + ty * (b - a)
    }
}

/// 1 up to half the reach, then a cosine down to 0.
fn taper(share: f64) -> f64 {
    let beyond = (2.0 * share - 1.0).clamp(0.0, 1.0);
    f64::midpoint(1.0, (std::f64::consts::PI * beyond).cos())
}

/// The lag of a place of a periodic volume from its origin, the short way round.
fn lag(shape: Shape, p: [usize; 3]) -> [f64; 3] {
    std::array::from_fn(|a| {
        if 2 * p[a] > shape[a] { p[a] as f64 - shape[a] as f64 } else { p[a] as f64 }
    })
}

fn mean_covariance(images: &[Covariance], lag: [f64; 3]) -> f32 {
    let length = lag.iter().map(|d| d * d).sum::<f64>().sqrt();
    let (mut sum, mut total) = (0.0, 0.0);
    for image in images {
        let across = if length > 0.0 { lag[image.axis] / length } else { 0.0 };
        let weight = image.weight / (across * across + ACROSS);
        sum += weight * image.at(lag, length);
        total += weight;
    }
    (sum / total) as f32
}

fn fill(
    shape: Shape,
    monitor: &Monitor<'_>,
    value: impl Fn([usize; 3]) -> f32 + Sync,
) -> Result<Vec<f32>> {
    let mut out = vec![0.0; voxels(shape)];
    out.par_chunks_mut(shape[2]).enumerate().try_for_each(|(row, out)| {
        monitor.check()?;
        let first = position(shape, row * shape[2]);
        for (x, out) in out.iter_mut().enumerate() {
            *out = value([first[0], first[1], x]);
        }
        Ok(())
    })?;
    Ok(out)
}
