//! A volume whose slices answer filters as images do: sliced optimal transport on filter responses.
//!
//! A step draws a few filters at random. For each, the responses of all slices are given the
//! distribution of the image's responses, and the volume moves to the least-squares compromise
//! between all that is asked of it: with R the responses, T(R) the responses as they should be and F
//! the filters, the volume gains (Σ FᵀF + ε)⁻¹ Σ Fᵀ(T(R) − R), which the Fourier transform solves at
//! once. Volumes tile space.

mod distribution;
mod filters;
mod stacks;

use ndarray::{Array3, ArrayView3};
use rayon::prelude::*;
use rustfft::num_complex::Complex32;

use self::distribution::{BINS, Correction, Distribution, Range, count};
use self::filters::Filter;
use self::stacks::{GROUP, LANES, Layout, Positions, correlate, range, spread};
use super::field::Field;
use crate::error::{Error, Result};
use crate::fourier::Transform;
use crate::intensity::Quantiles;
use crate::monitor::Monitor;
use crate::rng::Key;
use crate::volume::{Shape, voxels};

/// ε, as a share of the mean of Σ FᵀF over the wave numbers: those that hardly a filter sees stay.
const REGULARISATION: f32 = 0.05;

/// Every how many rows and columns of a slice a filter is applied.
const STEP: usize = 1;

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

/// How many filters a step draws, and how large.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FilterBank {
    /// Number of filters a step.
    pub filters: usize,
    /// Their edge in voxels.
    pub edge: usize,
}

impl Default for FilterBank {
    fn default() -> Self {
        Self { filters: 16, edge: 8 }
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

/// A group of filters as the kernels take them.
struct Group<'a> {
    filters: &'a [Filter],
    /// Row after row; zeros where there are fewer filters.
    taps: Vec<[f32; GROUP]>,
    /// First row and first column that are looked at.
    phase: [usize; 2],
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
        let groups = self.groups(&filters, key.with(1));
        let mut gradient = Field::zeros(self.shape, self.channels);
        let (mut sum, mut responses) = (0.0, 0);
        for (target, &image) in self.targets.iter().zip(&self.image_of) {
            let plane = Plane::new(self, target.axis, volume);
            let mut asked = vec![vec![0.0; plane.layout.len()]; self.channels];
            for (group, wanted) in groups.iter().zip(wanted[image].chunks(GROUP)) {
                let (squares, number) = plane.correct(group, wanted, &mut asked, monitor)?;
                sum += squares;
                responses += number;
            }
            for (c, asked) in asked.iter().enumerate() {
                plane.layout.scatter(asked, target.weight, gradient.channel_mut(c));
            }
        }
        self.solve(&groups, gradient, volume, monitor)?;
        Ok(sum / responses as f64)
    }

    fn draw(&self, key: Key) -> Vec<Filter> {
        let images: Vec<&Field> = self.targets.iter().map(|target| target.image).collect();
        let FilterBank { filters, edge } = self.bank;
        (0..filters)
            .map(|k| Filter::draw(&images, edge, key.with(k as u64)))
            .collect()
    }

    /// Filters in groups, those of one group looking at the same positions.
    fn groups<'f>(&self, filters: &'f [Filter], key: Key) -> Vec<Group<'f>> {
        let edge = self.bank.edge;
        let chunks = filters.chunks(GROUP).enumerate();
        chunks
            .map(|(g, filters)| {
                let mut taps = vec![[0.0; GROUP]; edge * edge];
                for (k, filter) in filters.iter().enumerate() {
                    for (taps, &tap) in taps.iter_mut().zip(&filter.taps) {
                        taps[k] = tap;
                    }
                }
                // Groups take turns, so that four of them look everywhere.
                let turn = (key.below(0, STEP * STEP) + g) % (STEP * STEP);
                Group { filters, taps, phase: [turn / STEP, turn % STEP] }
            })
            .collect()
    }

    /// Of each image, the distribution of the responses to each filter along each direction.
    fn image_responses(
        &self,
        filters: &[Filter],
        monitor: &Monitor<'_>,
    ) -> Result<Vec<Vec<Vec<Distribution>>>> {
        let edge = self.bank.edge;
        let of_image = |&(image, symmetric): &(&Field, bool)| {
            let of_filter = |filter: &Filter| {
                let variants =
                    if symmetric { filter.symmetric(edge) } else { vec![filter.taps.clone()] };
                let of_direction = |direction: &[f32]| {
                    monitor.check()?;
                    let mixed = mixed(image, direction);
                    let mut responses = Vec::new();
                    for taps in &variants {
                        let [_, ny, nx] = image.shape();
                        image_row_responses(&mixed, [ny, nx], taps, edge, &mut responses);
                    }
                    let range = Range::of(&responses);
                    let mut counts = [0; BINS];
                    count(&responses, range.low, range.scale(), &mut counts);
                    Ok(Distribution::new(range, &counts))
                };
                filter.directions.chunks_exact(self.channels).map(of_direction).collect()
            };
            filters.par_iter().map(of_filter).collect()
        };
        self.images.iter().map(of_image).collect()
    }

    /// Adds to the volume what solves the least squares.
    fn solve(
        &self,
        groups: &[Group<'_>],
        gradient: Field,
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
            spectrum.axis_iter_mut(ndarray::Axis(0)).into_par_iter().enumerate().for_each(
                |(z, mut plane)| {
                    for ((y, x), value) in plane.indexed_iter_mut() {
                        let power: f32 = powers.iter().map(|power| power[[z, y, x]].re).sum();
                        *value /= power.max(0.0) + REGULARISATION * mean;
                    }
                },
            );
            let mut step = vec![0.0; voxels(self.shape)];
            self.transform.inverse(spectrum, &mut step, monitor)?;
            let values = volume.channel_mut(c);
            values.par_iter_mut().zip(&step).with_min_len(1 << 14).for_each(|(v, s)| *v += s);
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
        let layout = Layout::new(self.shape, target.axis, self.bank.edge);
        let [rows, columns] = [layout.rows(), layout.columns()];
        let edge = self.bank.edge;
        let mut correlation = vec![0.0f32; rows * columns];
        for group in groups {
            let [down, along] = group.positions(&layout);
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

impl Group<'_> {
    /// Rows and columns that are looked at.
    fn positions(&self, layout: &Layout) -> [Positions; 2] {
        [
            Positions::new(layout.rows(), self.phase[0], STEP),
            Positions::new(layout.columns(), self.phase[1], STEP),
        ]
    }
}

/// The slices perpendicular to one axis.
struct Plane {
    layout: Layout,
    channels: usize,
    /// The volume's channels, stacked.
    stacks: Vec<Vec<f32>>,
}

impl Plane {
    fn new(matching: &ResponseMatching<'_>, axis: usize, volume: &Field) -> Self {
        let layout = Layout::new(matching.shape, axis, matching.bank.edge);
        let channels = matching.channels;
        let stacks = (0..channels).map(|c| layout.gather(volume.channel(c))).collect();
        Self { layout, channels, stacks }
    }

    /// Adds to `asked` what one group of filters asks for; returns the sum of the squares of the
    /// corrections and their number.
    fn correct(
        &self,
        group: &Group<'_>,
        wanted: &[Vec<Distribution>],
        asked: &mut [Vec<f32>],
        monitor: &Monitor<'_>,
    ) -> Result<(f64, usize)> {
        let [rows, columns] = group.positions(&self.layout);
        let mut responses = self.responses(group, rows, columns, monitor)?;
        let corrections = self.corrections(&responses, group, columns, rows, wanted, monitor)?;
        let length = self.row_length(columns);
        let squares: Vec<f64> = responses
            .par_chunks_exact_mut(length)
            .enumerate()
            .map(|(row, out)| {
                monitor.check()?;
                let lanes = self.layout.lanes(row / rows.count);
                Ok(apply_row(out, &corrections, group, columns.count, self.channels, lanes))
            })
            .collect::<Result<_>>()?;
        self.spread(&responses, group, rows, columns, asked, monitor)?;
        let slices: usize = (0..self.layout.stacks()).map(|s| self.layout.lanes(s)).sum();
        let number = slices * rows.count * columns.count * group.filters.len() * self.channels;
        Ok((squares.iter().sum(), number))
    }

    /// Numbers in a row of responses: direction, filter, column, slice.
    fn row_length(&self, columns: Positions) -> usize {
        self.channels * GROUP * columns.count * LANES
    }

    /// Responses of all stacks, row after row.
    fn responses(
        &self,
        group: &Group<'_>,
        rows: Positions,
        columns: Positions,
        monitor: &Monitor<'_>,
    ) -> Result<Vec<f32>> {
        let (layout, length) = (&self.layout, self.row_length(columns));
        let mut out = vec![0.0; layout.stacks() * rows.count * length];
        out.par_chunks_exact_mut(length).enumerate().try_for_each(|(row, out)| {
            monitor.check()?;
            let (stack, row) = (row / rows.count, rows.first + row % rows.count * rows.step);
            for (stacks, out) in self.stacks.iter().zip(out.chunks_mut(length / self.channels)) {
                let reached: Vec<&[f32]> = (0..layout.edge)
                    .map(|j| {
                        let at = stack * layout.rows() + (row + j) % layout.rows();
                        &stacks[at * layout.pitch()..][..layout.pitch()]
                    })
                    .collect();
                correlate(&reached, &group.taps, columns, out);
            }
            mix(out, group, self.channels, false);
            Ok(())
        })?;
        Ok(out)
    }

    /// What turns the responses to each filter along each direction into those wanted.
    fn corrections(
        &self,
        responses: &[f32],
        group: &Group<'_>,
        columns: Positions,
        rows: Positions,
        wanted: &[Vec<Distribution>],
        monitor: &Monitor<'_>,
    ) -> Result<Vec<Vec<Correction>>> {
        let length = self.row_length(columns);
        let part = columns.count * LANES;
        let lanes = |row: usize| self.layout.lanes(row / rows.count);
        let kinds = self.channels * GROUP;
        let ranges = responses
            .par_chunks_exact(length)
            .enumerate()
            .map(|(row, values)| {
                values.chunks_exact(part).map(|values| range(values, lanes(row))).collect()
            })
            .reduce(
                || vec![Range::EMPTY; kinds],
                |a, b: Vec<Range>| a.into_iter().zip(b).map(|(a, b)| a.join(b)).collect(),
            );
        monitor.check()?;
        let counts = responses
            .par_chunks_exact(length)
            .enumerate()
            .fold(
                || vec![[0u32; BINS]; kinds],
                |mut counts, (row, values)| {
                    let kinds = counts.iter_mut().zip(&ranges).zip(values.chunks_exact(part));
                    for ((counts, range), values) in kinds {
                        count_row(values, lanes(row), *range, counts);
                    }
                    counts
                },
            )
            .reduce(
                || vec![[0; BINS]; kinds],
                |mut a, b| {
                    a.iter_mut().flatten().zip(b.iter().flatten()).for_each(|(a, b)| *a += b);
                    a
                },
            );
        monitor.check()?;
        let of_filter = |(k, _): (usize, &Filter)| {
            (0..self.channels)
                .map(|q| {
                    let at = q * GROUP + k;
                    let found = Distribution::new(ranges[at], &counts[at]);
                    Correction::new(&found, &wanted[k][q])
                })
                .collect()
        };
        Ok(group.filters.iter().enumerate().map(of_filter).collect())
    }

    /// Brings the corrections of the responses back to the voxels.
    fn spread(
        &self,
        corrections: &[f32],
        group: &Group<'_>,
        rows: Positions,
        columns: Positions,
        asked: &mut [Vec<f32>],
        monitor: &Monitor<'_>,
    ) -> Result<()> {
        let (layout, length) = (&self.layout, self.row_length(columns));
        let of_channel = length / self.channels;
        for (c, asked) in asked.iter_mut().enumerate() {
            asked.par_chunks_exact_mut(layout.pitch()).enumerate().try_for_each(|(at, out)| {
                monitor.check()?;
                let (stack, row) = (at / layout.rows(), at % layout.rows());
                for (j, taps) in group.taps.chunks_exact(layout.edge).enumerate() {
                    let from = (row + layout.edge * layout.rows() - j) % layout.rows();
                    if let Some(from) = rows.find(from) {
                        let from = (stack * rows.count + from) * length + c * of_channel;
                        spread(&corrections[from..from + of_channel], taps, columns, out);
                    }
                }
                Ok(())
            })?;
        }
        Ok(())
    }
}

/// Turns the responses of the channels into those along the directions, or back.
fn mix(values: &mut [f32], group: &Group<'_>, channels: usize, back: bool) {
    if channels == 1 {
        return;
    }
    let part = values.len() / (channels * GROUP);
    let mut mixed = vec![0.0; channels];
    for (k, filter) in group.filters.iter().enumerate() {
        for i in 0..part {
            let at = |c: usize| (c * GROUP + k) * part + i;
            for (q, mixed) in mixed.iter_mut().enumerate() {
                let factor = |c: usize| {
                    filter.directions[if back { c * channels + q } else { q * channels + c }]
                };
                *mixed = (0..channels).map(|c| factor(c) * values[at(c)]).sum();
            }
            for (c, &mixed) in mixed.iter().enumerate() {
                values[at(c)] = mixed;
            }
        }
    }
}

/// Replaces a row of responses by their corrections, in the volume's channels; returns the sum of the
/// squares.
fn apply_row(
    values: &mut [f32],
    corrections: &[Vec<Correction>],
    group: &Group<'_>,
    columns: usize,
    channels: usize,
    lanes: usize,
) -> f64 {
    let part = columns * LANES;
    let mut squares = 0.0;
    for (k, corrections) in corrections.iter().enumerate() {
        for (q, correction) in corrections.iter().enumerate() {
            let values = &mut values[(q * GROUP + k) * part..][..part];
            apply_lanes(values, correction, lanes);
            squares += values.iter().map(|&v| f64::from(v).powi(2)).sum::<f64>();
        }
    }
    mix(values, group, channels, true);
    squares
}

fn apply_lanes(values: &mut [f32], correction: &Correction, lanes: usize) {
    if lanes == LANES {
        correction.apply(values);
        return;
    }
    for values in values.chunks_exact_mut(LANES) {
        correction.apply(&mut values[..lanes]);
        values[lanes..].fill(0.0);
    }
}

fn count_row(values: &[f32], lanes: usize, range: Range, counts: &mut [u32; BINS]) {
    if lanes == LANES {
        count(values, range.low, range.scale(), counts);
        return;
    }
    for values in values.chunks_exact(LANES) {
        count(&values[..lanes], range.low, range.scale(), counts);
    }
}

/// An image along a direction in channel space.
fn mixed(image: &Field, direction: &[f32]) -> Vec<f32> {
    let mut out = vec![0.0; image.channel(0).len()];
    for (c, &q) in direction.iter().enumerate() {
        out.iter_mut().zip(image.channel(c)).for_each(|(sum, v)| *sum += q * v);
    }
    out
}

/// Appends the responses at all positions inside an image.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
fn image_row_responses(
    image: &[f32],
    [ny, nx]: [usize; 2],
    taps: &[f32],
    edge: usize,
    responses: &mut Vec<f32>,
) {
    let width = nx + 1 - edge;
    for y in 0..=ny - edge {
        let start = responses.len();
        responses.resize(start + width, 0.0);
        let out = &mut responses[start..];
        for (i, tap) in taps.iter().enumerate() {
            let from = &image[(y + i / edge) * nx + i % edge..][..width];
            for (sum, v) in out.iter_mut().zip(from) {
                *sum += tap * v;
            }
        }
    }
}
