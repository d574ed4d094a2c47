//! A start for a synthesis from images: a Gaussian random field with their covariance.

use ndarray::Axis;
use rayon::prelude::*;

use super::covariance::{Covariance, has_both};
use super::field::Field;
use super::responses::{Target, check_targets};
use crate::error::{Error, Result};
use crate::fourier::Transform;
use crate::intensity::Quantiles;
use crate::monitor::Monitor;
use crate::rng::Key;
use crate::volume::{Shape, position, voxels};

/// What keeps the weight of an image finite for lags that lie in its plane: there it counts this many
/// times less than 1/… of what lies across.
const ACROSS: f64 = 0.01;

/// A periodic field of normal noise with the covariance of images, then given a distribution.
///
/// The channels are independent. Where a channel of all images has values on both sides of 127.5, as
/// fields of phases have, the noise has the correlation at which its cut has the two-point
/// correlation of the images' cuts. Along a lag d the covariance is the mean of those of the images,
/// of each at d turned into its plane, weighted by 1/((d_a/|d|)² + small) with d_a the part of d
/// across the plane: an image says most about the lags that lie in it. A voxel is `scale` pixels
/// wide: coarse images would have lost what is thin. Memory: about 16 bytes a voxel beside the field.
///
/// # Errors
/// If there is no image, the shape is empty, or the caller cancels.
pub fn random_field(
    targets: &[Target<'_>],
    scale: usize,
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
        let cut = targets.iter().all(|target| has_both(target.image.channel(c)));
        let images = targets
            .iter()
            .map(|target| Covariance::new(target, c, cut, monitor))
            .collect::<Result<Vec<_>>>()?;
        let covariance = fill(shape, monitor, |p| mean_covariance(&images, lag(shape, scale, p)))?;
        let power = transform.forward(&covariance, monitor)?;
        let amplitude = |p| power[p].re.max(0.0).sqrt();
        let values = out.channel_mut(c);
        fill_with_noise(values, (shape, &transform), amplitude, key.with(c as u64), monitor)?;
        if let Some(quantiles) = quantiles.get(c) {
            quantiles.match_values(out.channel_mut(c), None);
        }
    }
    Ok(out)
}

/// Replaces the values of a periodic volume by normal noise whose waves have these amplitudes, by
/// their numbers along (z, y, x).
pub(super) fn fill_with_noise(
    values: &mut [f32],
    (shape, transform): (Shape, &Transform),
    amplitude: impl Fn([usize; 3]) -> f32 + Sync,
    key: Key,
    monitor: &Monitor<'_>,
) -> Result<()> {
    let noise = fill(shape, monitor, |p| key.normal(crate::volume::index(shape, p) as u64))?;
    let mut spectrum = transform.forward(&noise, monitor)?;
    drop(noise);
    spectrum.axis_iter_mut(Axis(0)).into_par_iter().enumerate().for_each(|(z, mut plane)| {
        for ((y, x), value) in plane.indexed_iter_mut() {
            *value *= amplitude([z, y, x]);
        }
    });
    transform.inverse(spectrum, values, monitor)
}

/// The lag in pixels of a place of a periodic volume from its origin, the short way round.
fn lag(shape: Shape, scale: usize, p: [usize; 3]) -> [f64; 3] {
    std::array::from_fn(|a| {
        let far = if 2 * p[a] > shape[a] { shape[a] } else { 0 };
        scale as f64 * (p[a] as f64 - far as f64)
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
