//! Noise for the waves of an image that the coarser level before could not hold.
//!
//! Steps of response matching multiply what a volume has: of nothing they make nothing.

use ndarray::{ArrayView2, ArrayView3, Axis};
use rayon::prelude::*;

use super::field::Field;
use super::random_field::fill_with_noise;
use super::responses::Target;
use crate::error::{Error, Result};
use crate::fourier::Transform;
use crate::monitor::Monitor;
use crate::rng::Key;
use crate::volume::{Shape, voxels};

/// Powers of the wave number that the amplitudes of the two noises fall with: grain is white, and
/// covariances that fall exponentially with the distance, as between random phases, have the other.
const FALLS: [i32; 2] = [0, -2];

/// Every how many slices of a volume are looked at: only a mean over them is asked for.
const SLICES: usize = 4;

/// Adds noise of the wave numbers that a field of the shape `coarse` lacks, as much as makes sections
/// as rough as the images at the scale of single pixels.
///
/// Memory: about 12 bytes a voxel beside the field.
///
/// # Errors
/// If the caller cancels.
pub(super) fn add_detail(
    targets: &[Target<'_>],
    field: &mut Field,
    coarse: Shape,
    key: Key,
    monitor: &Monitor<'_>,
) -> Result<()> {
    let shape = field.shape();
    let transform = Transform::new(shape);
    for c in 0..field.channels() {
        let mut missing = Roughness::default();
        for target in targets {
            let [_, ny, nx] = target.image.shape();
            let image = view(target.image.channel(c), [1, ny, nx])?;
            missing.add(1.0, Roughness::of_slice(image.index_axis(Axis(0), 0)));
            missing.add(-1.0, Roughness::of(view(field.channel(c), shape)?, target.axis, monitor)?);
        }
        let mut noises = Vec::new();
        let mut gains = [Roughness::default(); 2];
        for (i, (fall, gain)) in FALLS.into_iter().zip(&mut gains).enumerate() {
            let key = key.with(c as u64).with(i as u64);
            let noise = noise(&transform, (shape, coarse), fall, key, monitor)?;
            for target in targets {
                gain.add(1.0, Roughness::of(view(&noise, shape)?, target.axis, monitor)?);
            }
            noises.push(noise);
        }
        for (noise, power) in noises.iter().zip(powers(missing, gains)) {
            let amplitude = power.sqrt() as f32;
            let values = field.channel_mut(c).par_iter_mut().zip(noise);
            values.for_each(|(v, noise)| *v += amplitude * noise);
        }
    }
    Ok(())
}

fn view(values: &[f32], shape: Shape) -> Result<ArrayView3<'_, f32>> {
    ArrayView3::from_shape(shape, values)
        .map_err(|_| Error::parameter("values", values.len(), format!("must fill {shape:?}")))
}

/// How many times either noise is to be added, in power; neither can be taken away.
fn powers(missing: Roughness, [white, falling]: [Roughness; 2]) -> [f64; 2] {
    let alone = |noise: Roughness| {
        let power = missing.corners / noise.corners;
        if power.is_finite() { power.max(0.0) } else { 0.0 }
    };
    let determinant = white.corners * falling.edges - falling.corners * white.edges;
    let of_white =
        (missing.corners * falling.edges - falling.corners * missing.edges) / determinant;
    let of_falling = (white.corners * missing.edges - missing.corners * white.edges) / determinant;
    if of_falling > 0.0 && of_white > 0.0 {
        [of_white, of_falling]
    } else if of_falling > 0.0 {
        [0.0, alone(falling)]
    } else {
        [alone(white), 0.0]
    }
}

/// Noise without the waves of a coarser grid; its amplitudes fall with a power of the wave number.
fn noise(
    transform: &Transform,
    (shape, coarse): (Shape, Shape),
    fall: i32,
    key: Key,
    monitor: &Monitor<'_>,
) -> Result<Vec<f32>> {
    let amplitude = |wave: [usize; 3]| {
        let waves: [usize; 3] = std::array::from_fn(|a| wave[a].min(shape[a] - wave[a]));
        let held = (0..3).all(|a| 2 * waves[a] < coarse[a]);
        let share = |a: usize| (waves[a] as f32 / shape[a] as f32).powi(2);
        let length = (share(0) + share(1) + share(2)).sqrt();
        if held { 0.0 } else { length.powi(fall) }
    };
    let mut values = vec![0.0; voxels(shape)];
    fill_with_noise(&mut values, (shape, transform), amplitude, key, monitor)?;
    Ok(values)
}

/// Mean squares of what filters that see the shortest waves answer: of those along both axes, and of
/// those along one of them.
#[derive(Debug, Clone, Copy, Default)]
struct Roughness {
    corners: f64,
    edges: f64,
}

impl Roughness {
    fn add(&mut self, times: f64, other: Self) {
        self.corners += times * other.corners;
        self.edges += times * other.edges;
    }

    /// Of the slices of a volume across an axis.
    fn of(volume: ArrayView3<'_, f32>, axis: usize, monitor: &Monitor<'_>) -> Result<Self> {
        let slices: Vec<usize> = (0..volume.len_of(Axis(axis))).step_by(SLICES).collect();
        let found = slices.par_iter().map(|&i| {
            monitor.check()?;
            Ok(Self::of_slice(volume.index_axis(Axis(axis), i)))
        });
        let found: Vec<Self> = found.collect::<Result<_>>()?;
        let mut mean = Self::default();
        for slice in &found {
            mean.add(1.0 / found.len() as f64, *slice);
        }
        Ok(mean)
    }

    /// Of what lies inside a slice; none if it is less than 3 pixels wide.
    fn of_slice(slice: ArrayView2<'_, f32>) -> Self {
        let (ny, nx) = slice.dim();
        if ny < 3 || nx < 3 {
            return Self::default();
        }
        let mut sums = Self::default();
        for window in slice.windows((3, 3)) {
            // Along each row what changes from pixel to pixel, and what does not.
            let rows = [0usize, 1, 2].map(|y| {
                let row = [window[[y, 0]], window[[y, 1]], window[[y, 2]]];
                let beside = row[0] + row[2];
                [2.0 * row[1] - beside, 2.0 * row[1] + beside]
            });
            let change = |k: usize| 2.0 * rows[1][k] - rows[0][k] - rows[2][k];
            let mean = |k: usize| 2.0 * rows[1][k] + rows[0][k] + rows[2][k];
            sums.corners += f64::from(change(0)).powi(2);
            sums.edges += f64::from(change(1)).powi(2) + f64::from(mean(0)).powi(2);
        }
        let mut mean = Self::default();
        mean.add(1.0 / ((ny - 2) * (nx - 2)) as f64, sums);
        mean
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(value: impl Fn(usize, usize) -> f32) -> Field {
        let values = (0..64 * 64).map(|i| value(i / 64, i % 64)).collect();
        Field::new([1, 64, 64], 1, values).unwrap()
    }

    fn targets(image: &Field) -> Vec<Target<'_>> {
        (0..3).map(|axis| Target { axis, image, symmetric: true, weight: 1.0 }).collect()
    }

    fn detail(image: &Field) -> Field {
        let mut field = Field::zeros([32; 3], 1);
        add_detail(&targets(image), &mut field, [16; 3], Key::new(1), &Monitor::silent()).unwrap();
        field
    }

    #[test]
    fn sections_become_as_rough_as_white_noise() {
        let key = Key::new(7);
        let grain = image(|y, x| 5.0 * key.normal((64 * y + x) as u64));
        let field = detail(&grain);
        let wanted = Roughness::of_slice(
            view(grain.channel(0), [1, 64, 64]).unwrap().index_axis(Axis(0), 0),
        );
        for axis in 0..3 {
            let volume = view(field.channel(0), [32; 3]).unwrap();
            let found = Roughness::of(volume, axis, &Monitor::silent()).unwrap();
            assert!((found.corners / wanted.corners - 1.0).abs() < 0.15, "{found:?} {wanted:?}");
            assert!((found.edges / wanted.edges - 1.0).abs() < 0.3, "{found:?} {wanted:?}");
        }
    }

    #[test]
    fn what_a_coarser_grid_holds_is_left_alone() {
        let key = Key::new(7);
        let field = detail(&image(|y, x| 5.0 * key.normal((64 * y + x) as u64)));
        let transform = Transform::new([32; 3]);
        let spectrum = transform.forward(field.channel(0), &Monitor::silent()).unwrap();
        let largest = spectrum.iter().map(|v| v.norm()).fold(0.0, f32::max);
        for ((z, y, x), value) in spectrum.indexed_iter() {
            let held = [z, y, x].iter().all(|&k| k.min(32 - k) < 8);
            assert!(!held || value.norm() < 1e-4 * largest);
        }
        assert!(largest > 0.0);
    }

    #[test]
    fn a_smooth_or_a_flat_or_a_tiny_image_adds_nothing_to_speak_of() {
        let wave = |i: usize| (i as f32 * std::f32::consts::TAU / 64.0).sin();
        let smooth = detail(&image(|y, x| 100.0 * wave(y) * wave(x)));
        assert!(smooth.channel(0).iter().all(|v| v.abs() < 1.0));
        let flat = detail(&image(|_, _| 3.0));
        assert!(flat.channel(0).iter().all(|v| *v == 0.0));
        let tiny = Field::new([1, 2, 2], 1, vec![0.0, 9.0, 9.0, 0.0]).unwrap();
        assert!(detail(&tiny).channel(0).iter().all(|v| *v == 0.0));
    }
}
