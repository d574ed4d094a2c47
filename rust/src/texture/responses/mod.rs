//! A volume whose slices answer filters as images do: sliced optimal transport on filter responses.
//!
//! A step draws a few filters at random. For each, the responses of all slices are given the
//! distribution of the image's responses, and the volume moves to the least-squares compromise
//! between all that is asked of it: with R the responses, T(R) the responses as they should be and F
//! the filters, the volume gains (Σ FᵀF + ε)⁻¹ Σ Fᵀ(T(R) − R), which the Fourier transform solves at
//! once. Volumes tile space.

mod distribution;
mod filters;
mod images;
mod planes;
mod second;
mod stacks;

use ndarray::{Array3, ArrayView3, Axis};
use rayon::prelude::*;
use rustfft::num_complex::Complex32;

use self::distribution::Distribution;
use self::filters::{Filter, GROUP, Group, groups};
use self::planes::{Plane, Squares, Workspace};
use self::second::Second;
use self::stacks::Layout;
use super::field::Field;
use crate::error::{Error, Result};
use crate::fourier::Transform;
use crate::intensity::Quantiles;
use crate::monitor::Monitor;
use crate::rng::Key;
use crate::volume::Shape;

/// Every how many rows and columns of a slice a filter is applied. With 2, four filters together look
/// everywhere, twice as fast as with 1 (128³: 4.5 instead of 8.3 s), and the structure is as good.
const STEP: usize = 2;

/// What the slices perpendicular to an axis should look like.
#[derive(Debug, Clone, Copy)]
pub struct Target<'a> {
    /// The axis across the slices.
    pub axis: usize,
    /// Of shape (1, rows, columns): rows lie along the first of the two other axes in (z, y, x)
    /// order, columns along the second.
    pub image: &'a Field,
    /// Whether mirror images and transpositions of the image are as good as itself.
    pub symmetric: bool,
    /// Importance beside the other targets.
    pub weight: f32,
}

/// How many filters a step draws, and how large; what is asked of the volume.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FilterBank {
    /// Number of filters a step.
    pub filters: usize,
    /// Their edge in voxels.
    pub edge: usize,
    /// Whether responses to their responses count too. Where an image is too small for these, they
    /// do not.
    pub deep: bool,
    /// Whether the responses to responses of all images together are those of one material.
    pub alike: bool,
    /// ε, as a share of the mean of Σ FᵀF over the wave numbers: those that hardly a filter sees stay.
    pub regularisation: f32,
}

impl Default for FilterBank {
    fn default() -> Self {
        Self { filters: 16, edge: 3, deep: false, alike: false, regularisation: 0.05 }
    }
}

/// Refuses targets that are not images of so many channels and at least this edge.
pub(super) fn check_targets(targets: &[Target<'_>], channels: usize, edge: usize) -> Result<()> {
    for target in targets {
        if target.axis > 2 {
            return Err(Error::parameter("axis", target.axis, "must be 0, 1 or 2"));
        }
        if !(target.weight > 0.0 && target.weight.is_finite()) {
            return Err(Error::parameter("weight", target.weight, "must be positive and finite"));
        }
        let shape = target.image.shape();
        if shape[0] != 1 || shape[1] < edge || shape[2] < edge {
            let allowed = format!("must be one plane of at least {edge} × {edge} pixels");
            return Err(Error::parameter("image", shape, allowed));
        }
        if target.image.channels() != channels {
            let allowed = format!("must be those of the volume, {channels}");
            return Err(Error::parameter("image channels", target.image.channels(), allowed));
        }
    }
    Ok(())
}

/// Distribution of the values of all images together, channel by channel.
pub fn pooled_quantiles(targets: &[Target<'_>]) -> Vec<Quantiles> {
    let channels = targets.first().map_or(0, |target| target.image.channels());
    (0..channels)
        .map(|c| {
            let values: Vec<f32> =
                targets.iter().flat_map(|target| target.image.channel(c)).copied().collect();
            Quantiles::new(&values)
        })
        .collect()
}

/// Matches the responses of volumes of one shape to those of images.
pub struct ResponseMatching<'a> {
    targets: Vec<Target<'a>>,
    /// Of each target, which of `images` its own is.
    image_of: Vec<usize>,
    /// Images that differ, with whether their symmetries count.
    images: Vec<(&'a Field, bool)>,
    bank: FilterBank,
    shape: Shape,
    channels: usize,
    transform: Transform,
}

impl<'a> ResponseMatching<'a> {
    /// Prepares for volumes of a shape and number of channels.
    ///
    /// # Errors
    /// If an axis is empty, an image is smaller than the filters or has other channels, or there is
    /// no filter.
    pub fn new(
        targets: &[Target<'a>],
        (channels, shape): (usize, Shape),
        bank: FilterBank,
    ) -> Result<Self> {
        if bank.filters == 0 || bank.edge == 0 {
            let given = (bank.filters, bank.edge);
            return Err(Error::parameter("filters, edge", given, "must be at least 1"));
        }
        if !(bank.regularisation > 0.0 && bank.regularisation.is_finite()) {
            let allowed = "must be positive and finite";
            return Err(Error::parameter("regularisation", bank.regularisation, allowed));
        }
        if shape.contains(&0) {
            return Err(Error::parameter("shape", shape, "must not be empty"));
        }
        check_targets(targets, channels, bank.edge)?;
        let mut images: Vec<(&Field, bool)> = Vec::new();
        let image_of = targets
            .iter()
            .map(|target| {
                let image = (target.image, target.symmetric);
                images.iter().position(|known| *known == image).unwrap_or_else(|| {
                    images.push(image);
                    images.len() - 1
                })
            })
            .collect();
        let transform = Transform::new(shape);
        let targets = targets.to_vec();
        Ok(Self { targets, image_of, images, bank, shape, channels, transform })
    }

    /// One step with filters of its own; returns the mean square of the corrections to the responses.
    ///
    /// Afterwards each channel of the volume is given the distribution in `quantiles`, if there are
    /// any. Memory: about 30 bytes a voxel and channel.
    ///
    /// # Errors
    /// If the volume is not what this was prepared for, or the caller cancels.
    pub fn step(
        &self,
        volume: &mut Field,
        quantiles: &[Quantiles],
        key: Key,
        monitor: &Monitor<'_>,
    ) -> Result<f64> {
        if (volume.channels(), volume.shape()) != (self.channels, self.shape) {
            let given = (volume.channels(), volume.shape());
            let allowed = format!("must be {:?}", (self.channels, self.shape));
            return Err(Error::parameter("volume", given, allowed));
        }
        let energy = self.correct(volume, key, monitor)?;
        for (c, quantiles) in quantiles.iter().enumerate().take(self.channels) {
            monitor.check()?;
            quantiles.match_values(volume.channel_mut(c), None);
        }
        Ok(energy)
    }

    fn correct(&self, volume: &mut Field, key: Key, monitor: &Monitor<'_>) -> Result<f64> {
        if self.targets.is_empty() {
            return Ok(0.0);
        }
        let filters = self.draw(key.with(0));
        let wanted = self.image_responses(&filters, monitor)?;
        let groups = groups(&filters, key.with(1));
        let second = self.second(&groups, &wanted, key.with(2), monitor)?;
        let mut gradient = Field::zeros(self.shape, self.channels);
        let (mut work, mut squares) = (Workspace::default(), Squares::default());
        for (target, &image) in self.targets.iter().zip(&self.image_of) {
            let layout = self.layout(target);
            let mut plane = Plane::new(layout, volume, &mut work);
            for (g, group) in groups.iter().enumerate() {
                let wanted = &wanted[image][g * GROUP..];
                let second = second[if self.bank.alike { 0 } else { image }].get(g);
                squares.add(plane.correct(group, wanted, second, monitor)?);
            }
            plane.collect(target.weight, &mut gradient);
        }
        self.solve(&groups, gradient, volume, monitor)?;
        Ok(squares.mean())
    }

    fn draw(&self, key: Key) -> Vec<Filter> {
        let images: Vec<&Field> = self.targets.iter().map(|target| target.image).collect();
        let FilterBank { filters, edge, .. } = self.bank;
        (0..filters).map(|k| Filter::draw(&images, edge, key.with(k as u64))).collect()
    }

    fn layout(&self, target: &Target<'_>) -> Layout {
        Layout::new(self.shape, target.axis, self.bank.edge, STEP)
    }

    /// Of each image, the distribution of the responses to each filter along each direction.
    fn image_responses(
        &self,
        filters: &[Filter],
        monitor: &Monitor<'_>,
    ) -> Result<Vec<Vec<Vec<Distribution>>>> {
        let of_image = |&(image, symmetric): &(&Field, bool)| {
            let of_filter = |filter| images::responses(image, symmetric, filter, monitor);
            filters.par_iter().map(of_filter).collect()
        };
        self.images.iter().map(of_image).collect()
    }

    /// Of each image, or of all together if they are alike, the second filters of each group; none
    /// where they do not count.
    fn second(
        &self,
        groups: &[Group<'_>],
        wanted: &[Vec<Vec<Distribution>>],
        key: Key,
        monitor: &Monitor<'_>,
    ) -> Result<Vec<Vec<Second>>> {
        let of_images = |(i, (images, first)): (usize, (&[_], &[Vec<Vec<_>>]))| {
            let fit = |image: &(&Field, bool)| Second::fits(image.0, self.bank.edge);
            if !self.bank.deep || !images.iter().all(fit) {
                return Ok(Vec::new());
            }
            let of_group = |(g, group): (usize, &Group<'_>)| {
                let key = key.with(i as u64).with(g as u64);
                let first: Vec<_> = first.iter().map(|first| &first[g * GROUP..]).collect();
                Second::draw(images, group, &first, key, monitor)
            };
            groups.iter().enumerate().map(of_group).collect()
        };
        let together = if self.bank.alike { self.images.len() } else { 1 };
        let images = self.images.chunks(together).zip(wanted.chunks(together));
        images.enumerate().map(of_images).collect()
    }

    /// Adds to the volume what solves the least squares.
    fn solve(
        &self,
        groups: &[Group<'_>],
        mut gradient: Field,
        volume: &mut Field,
        monitor: &Monitor<'_>,
    ) -> Result<()> {
        let mut powers = Vec::new();
        let mut mean = 0.0;
        for target in &self.targets {
            let (power, of_target) = self.power(groups, target, monitor)?;
            powers.push(power);
            mean += of_target;
        }
        let powers: Vec<ArrayView3<'_, Complex32>> = powers
            .iter()
            .filter_map(|power| {
                power.broadcast((self.shape[0], self.shape[1], self.transform.half()))
            })
            .collect();
        for c in 0..self.channels {
            let mut spectrum = self.transform.forward(gradient.channel(c), monitor)?;
            spectrum.axis_iter_mut(Axis(0)).into_par_iter().enumerate().for_each(
                |(z, mut plane)| {
                    for ((y, x), value) in plane.indexed_iter_mut() {
                        let power: f32 = powers.iter().map(|power| power[[z, y, x]].re).sum();
                        *value /= power.max(0.0) + self.bank.regularisation * mean;
                    }
                },
            );
            let step = gradient.channel_mut(c);
            self.transform.inverse(spectrum, step, monitor)?;
            let values = volume.channel_mut(c);
            values.par_iter_mut().zip(step).with_min_len(1 << 14).for_each(|(v, s)| *v += *s);
        }
        Ok(())
    }

    /// Σ |F̂|² of all filters in the slices of a target, and its mean over all wave numbers.
    fn power(
        &self,
        groups: &[Group<'_>],
        target: &Target<'_>,
        monitor: &Monitor<'_>,
    ) -> Result<(Array3<Complex32>, f32)> {
        let mut shape = self.shape;
        shape[target.axis] = 1;
        let layout = self.layout(target);
        let [rows, columns] = [layout.rows(), layout.columns()];
        let edge = self.bank.edge;
        let mut correlation = vec![0.0f32; rows * columns];
        for group in groups {
            let [down, along] = layout.positions(group.phase);
            let share = (down.count * along.count) as f32 / (rows * columns) as f32;
            for filter in group.filters {
                for (i, a) in filter.taps.iter().enumerate() {
                    for (j, b) in filter.taps.iter().enumerate() {
                        let lag = |a: usize, b: usize, n: usize| (a + edge * n - b) % n;
                        let row = lag(i / edge, j / edge, rows);
                        let column = lag(i % edge, j % edge, columns);
                        correlation[row * columns + column] += target.weight * share * a * b;
                    }
                }
            }
        }
        let mean = correlation[0];
        Ok((Transform::new(shape).forward(&correlation, monitor)?, mean))
    }
}
