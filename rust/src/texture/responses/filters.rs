//! The filters of a step: random directions in the space of small patches.

use crate::rng::Key;
use crate::texture::field::Field;

/// A filter of unit length, and the directions in channel space that it is applied along.
#[derive(Debug, Clone)]
pub(super) struct Filter {
    /// Row after row.
    pub taps: Vec<f32>,
    /// An orthonormal basis of the channels, direction after direction.
    pub directions: Vec<f32>,
}

impl Filter {
    /// Draws a filter: the difference of two patches of one of the images.
    ///
    /// Such differences point where the images' patches vary. Noise, which points everywhere alike,
    /// would spend its responses on what hardly varies: with half of the filters noise, features came
    /// out a fifth too thick, and with all of them half as thick again.
    pub fn draw(images: &[&Field], edge: usize, key: Key) -> Self {
        let channels = images[0].channels();
        let directions = rotation(channels, key.with(0));
        let noise = || (0..(edge * edge) as u64).map(|i| key.with(1).normal(i)).collect();
        let patches = patch_difference(images, &directions[..channels], edge, key.with(2));
        // Two equal patches have no direction.
        let taps =
            unit(patches).or_else(|| unit(noise())).unwrap_or_else(|| vec![1.0; edge * edge]);
        Self { taps, directions }
    }

    /// The filter as it lies in the plane after each of the 8 symmetries of a square.
    pub fn symmetric(&self, edge: usize) -> Vec<Vec<f32>> {
        let last = edge - 1;
        (0..8)
            .map(|symmetry| {
                (0..edge * edge)
                    .map(|i| {
                        let (mut y, mut x) = (i / edge, i % edge);
                        if symmetry & 4 != 0 {
                            (y, x) = (x, y);
                        }
                        y = if symmetry & 2 != 0 { last - y } else { y };
                        x = if symmetry & 1 != 0 { last - x } else { x };
                        self.taps[y * edge + x]
                    })
                    .collect()
            })
            .collect()
    }
}

/// Scales values to unit length.
fn unit(mut values: Vec<f32>) -> Option<Vec<f32>> {
    let length = values.iter().map(|&v| f64::from(v).powi(2)).sum::<f64>().sqrt();
    (length > 0.0).then(|| {
        values.iter_mut().for_each(|v| *v = (f64::from(*v) / length) as f32);
        values
    })
}

fn patch_difference(images: &[&Field], direction: &[f32], edge: usize, key: Key) -> Vec<f32> {
    let image = images[key.below(0, images.len())];
    let [_, ny, nx] = image.shape();
    let [first, second] = [1, 3].map(|i| {
        let y = key.below(i, ny - edge + 1);
        y * nx + key.below(i + 1, nx - edge + 1)
    });
    (0..edge * edge)
        .map(|i| {
            let at = i / edge * nx + i % edge;
            let difference =
                |c: usize| image.channel(c)[first + at] - image.channel(c)[second + at];
            direction.iter().enumerate().map(|(c, q)| q * difference(c)).sum()
        })
        .collect()
}

/// A random orthonormal basis: normal vectors, made orthogonal one after the other.
fn rotation(n: usize, key: Key) -> Vec<f32> {
    if n == 1 {
        return vec![1.0];
    }
    let mut basis: Vec<Vec<f32>> = Vec::with_capacity(n);
    let mut attempt = 0;
    while basis.len() < n {
        let mut v: Vec<f32> = (0..n as u64).map(|i| key.with(attempt).normal(i)).collect();
        attempt += 1;
        // Twice, against rounding.
        for _ in 0..2 {
            for b in &basis {
                let along: f32 = v.iter().zip(b).map(|(v, b)| v * b).sum();
                v.iter_mut().zip(b).for_each(|(v, b)| *v -= along * b);
            }
            v = unit(v).unwrap_or_default();
        }
        if v.len() == n {
            basis.push(v);
        }
    }
    basis.concat()
}
