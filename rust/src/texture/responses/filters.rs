//! The filters of a step: random directions in the space of small patches.

use super::STEP;
use crate::rng::Key;
use crate::texture::field::Field;

/// Filters in a group: their responses are held at once.
pub(super) const GROUP: usize = 4;

/// A filter of unit length, and the directions in channel space that it is applied along.
#[derive(Debug, Clone)]
pub(super) struct Filter {
    pub edge: usize,
    /// Row after row.
    pub taps: Vec<f32>,
    /// An orthonormal basis of the channels, direction after direction.
    pub directions: Vec<f32>,
}

impl Filter {
    /// Draws a filter: the difference of two patches of one of the images.
    ///
    /// Such differences point where the images' patches vary. Noise, which points everywhere alike,
    /// would spend its responses on what hardly varies: with half of the filters noise, struts of bone
    /// came out 28 instead of 7 % too thick.
    pub fn draw(images: &[&Field], edge: usize, key: Key) -> Self {
        let channels = images[0].channels();
        let directions = rotation(channels, key.with(0));
        let noise = || (0..(edge * edge) as u64).map(|i| key.with(1).normal(i)).collect();
        let patches = patch_difference(images, &directions[..channels], edge, key.with(2));
        // Two equal patches have no direction.
        let taps =
            unit(patches).or_else(|| unit(noise())).unwrap_or_else(|| vec![1.0; edge * edge]);
        Self { edge, taps, directions }
    }

    /// The filter as it lies in the plane after each of the 8 symmetries of a square.
    pub fn symmetric(&self) -> Vec<Vec<f32>> {
        (0..SYMMETRIES).map(|symmetry| turned(&self.taps, self.edge, symmetry)).collect()
    }
}

/// Symmetries of a square.
pub(super) const SYMMETRIES: usize = 8;

/// Taps of a filter as they lie after one of the symmetries; the first leaves them where they are.
pub(super) fn turned(taps: &[f32], edge: usize, symmetry: usize) -> Vec<f32> {
    let last = edge - 1;
    (0..edge * edge)
        .map(|i| {
            let (mut y, mut x) = (i / edge, i % edge);
            if symmetry & 4 != 0 {
                (y, x) = (x, y);
            }
            y = if symmetry & 2 != 0 { last - y } else { y };
            x = if symmetry & 1 != 0 { last - x } else { x };
            taps[y * edge + x]
        })
        .collect()
}

/// Filters that are applied one after the other to each row.
#[derive(Debug)]
pub(super) struct Group<'a> {
    pub filters: &'a [Filter],
    /// First row and first column that they look at.
    pub phase: [usize; 2],
}

/// Filters in groups, which take turns so that some of them look at every place.
pub(super) fn groups(filters: &[Filter], key: Key) -> Vec<Group<'_>> {
    let turns = STEP * STEP;
    let start = key.below(0, turns);
    let groups = filters.chunks(GROUP).enumerate();
    groups
        .map(|(g, filters)| {
            let turn = (start + g) % turns;
            Group { filters, phase: [turn / STEP, turn % STEP] }
        })
        .collect()
}

/// Scales values to unit length.
fn unit(mut values: Vec<f32>) -> Option<Vec<f32>> {
    let length = values.iter().map(|&v| f64::from(v).powi(2)).sum::<f64>().sqrt();
    (length > 0.0).then(|| {
        for v in &mut values {
            *v = (f64::from(*v) / length) as f32;
        }
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
