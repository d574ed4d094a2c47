//! The slices perpendicular to one axis: their responses, and what these ask of the voxels.

use rayon::prelude::*;

use super::distribution::{Correction, Distribution, Range, bins_for, count};
use super::filters::Group;
use super::second::{Room, Second};
use super::stacks::{Aligned, LANES, Layout, Positions, add_products, range, sum_of_squares};
use crate::error::Result;
use crate::monitor::Monitor;
use crate::texture::field::Field;

/// A sum of squares and how many they are.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Squares {
    sum: f64,
    number: usize,
}

impl Squares {
    pub fn add(&mut self, other: Self) {
        self.sum += other.sum;
        self.number += other.number;
    }

    pub fn mean(&self) -> f64 {
        self.sum / self.number.max(1) as f64
    }
}

/// Memory that one axis after the other uses.
#[derive(Debug, Default)]
pub(super) struct Workspace {
    /// The slices of each channel.
    stacks: Vec<Aligned>,
    /// What the responses ask of them so far.
    asked: Vec<Aligned>,
    responses: Aligned,
    second: Room,
}

/// The slices of a volume perpendicular to an axis.
pub(super) struct Plane<'a> {
    layout: Layout,
    work: &'a mut Workspace,
}

/// Where the responses to one group of filters lie: row after row of all stacks, in each the rows of
/// responses of all kinds, that is, for each direction (or channel) those to each filter.
#[derive(Debug, Clone, Copy)]
pub(super) struct Order {
    layout: Layout,
    pub rows: Positions,
    pub columns: Positions,
    filters: usize,
    channels: usize,
}

impl Order {
    pub fn kinds(&self) -> usize {
        self.channels * self.filters
    }

    /// Numbers of one kind in a row.
    pub fn pitch(&self) -> usize {
        self.layout.response_pitch()
    }

    /// Numbers in a row.
    pub fn row(&self) -> usize {
        self.kinds() * self.pitch()
    }

    /// Slices that exist in the stack that a row is of.
    pub fn lanes(&self, row: usize) -> usize {
        self.layout.lanes(row / self.rows.count)
    }

    /// The responses among the numbers of a kind.
    pub fn inside(&self) -> std::ops::Range<usize> {
        self.layout.responses(self.columns)
    }
}

impl<'a> Plane<'a> {
    pub fn new(layout: Layout, volume: &Field, work: &'a mut Workspace) -> Self {
        for channels in [&mut work.stacks, &mut work.asked] {
            channels.resize_with(volume.channels(), Aligned::default);
        }
        for (c, (stacks, asked)) in work.stacks.iter_mut().zip(&mut work.asked).enumerate() {
            layout.gather(volume.channel(c), stacks);
            asked.resize(stacks.len());
            asked.fill(0.0);
        }
        Self { layout, work }
    }

    /// Adds `weight` times what was asked of the slices to a field.
    pub fn collect(&self, weight: f32, field: &mut Field) {
        for (c, asked) in self.work.asked.iter().enumerate() {
            self.layout.scatter(asked, weight, field.channel_mut(c));
        }
    }

    /// Gives the responses to a group of filters the wanted distributions, by filter and direction.
    pub fn correct(
        &mut self,
        group: &Group<'_>,
        wanted: &[Vec<Distribution>],
        second: Option<&Second>,
        monitor: &Monitor<'_>,
    ) -> Result<Squares> {
        let [rows, columns] = self.layout.positions(group.phase);
        let (filters, channels) = (group.filters.len(), self.work.stacks.len());
        let order = Order { layout: self.layout, rows, columns, filters, channels };
        self.respond(group, order, monitor)?;
        let of_row = (order.kinds(), order.pitch(), order.inside());
        let found = distributions(&self.work.responses, of_row, |row| order.lanes(row), monitor)?;
        let wanted = (0..order.kinds()).map(|i| &wanted[i % filters][i / filters]);
        let corrections: Vec<_> =
            found.iter().zip(wanted).map(|(from, to)| Correction::new(from, to)).collect();
        if let Some(second) = second {
            second.prepare(&self.work.responses, order, &mut self.work.second, monitor)?;
        }
        let squares = self.apply(&corrections, second, group, order, monitor)?;
        self.spread(group, order, monitor)?;
        Ok(squares)
    }

    /// Finds the responses of the channels, and turns them into those along the directions.
    fn respond(&mut self, group: &Group<'_>, order: Order, monitor: &Monitor<'_>) -> Result<()> {
        let Order { layout, rows, columns, filters, .. } = order;
        let of_stack = layout.rows() * layout.pitch();
        let Workspace { stacks, responses, .. } = &mut *self.work;
        responses.resize(layout.stacks() * rows.count * order.row());
        responses.par_chunks_exact_mut(order.row()).enumerate().try_for_each(|(at, out)| {
            monitor.check()?;
            let (stack, row) = (at / rows.count, rows.first + at % rows.count * rows.step);
            let channels = out.chunks_exact_mut(filters * order.pitch());
            for (stacks, out) in stacks.iter().zip(channels) {
                let filters = group.filters.iter().map(|filter| &filter.taps[..]);
                let filters = filters.zip(out.chunks_exact_mut(order.pitch()));
                layout.correlate(&stacks[stack * of_stack..], row, columns, filters);
            }
            mix(out, group, order, false);
            Ok(())
        })
    }

    /// Replaces the responses along the directions by their corrections in the channels.
    fn apply(
        &mut self,
        corrections: &[Correction],
        second: Option<&Second>,
        group: &Group<'_>,
        order: Order,
        monitor: &Monitor<'_>,
    ) -> Result<Squares> {
        let inside = order.inside();
        let Workspace { responses, second: room, .. } = &mut *self.work;
        let rows = responses.par_chunks_exact_mut(order.row()).enumerate();
        let of_rows = rows
            .map(|(row, values)| {
                monitor.check()?;
                let (lanes, mut squares) = (order.lanes(row), Squares::default());
                let kinds = values.chunks_exact_mut(order.pitch());
                for (values, correction) in kinds.zip(corrections) {
                    let values = &mut values[inside.clone()];
                    for_lanes_mut(values, lanes, |values| correction.apply(values));
                    let sum = sum_of_squares(values);
                    squares.add(Squares { sum, number: order.columns.count * lanes });
                }
                if let Some(second) = second {
                    second.add(room, row, order, values);
                }
                mix(values, group, order, true);
                Ok(squares)
            })
            .collect::<Result<Vec<_>>>()?;
        let mut squares = Squares::default();
        for of_row in of_rows {
            squares.add(of_row);
        }
        Ok(squares)
    }

    /// Brings the corrections of the responses back to the slices.
    fn spread(&mut self, group: &Group<'_>, order: Order, monitor: &Monitor<'_>) -> Result<()> {
        let layout = self.layout;
        let filters: Vec<&[f32]> = group.filters.iter().map(|filter| &filter.taps[..]).collect();
        let Workspace { asked, responses, .. } = &mut *self.work;
        for (c, asked) in asked.iter_mut().enumerate() {
            let rows = asked.par_chunks_exact_mut(layout.pitch()).enumerate();
            rows.try_for_each(|(at, out)| {
                monitor.check()?;
                let (stack, row) = (at / layout.rows(), at % layout.rows());
                let corrections = |row: usize, k: usize| {
                    let row = (stack * order.rows.count + row) * order.row();
                    &responses[row + (c * order.filters + k) * order.pitch()..][..order.pitch()]
                };
                layout.spread(corrections, row, [order.rows, order.columns], &filters, out);
                Ok(())
            })?;
        }
        Ok(())
    }
}

/// Distribution of the responses of each kind, of rows of `kinds` times `pitch` numbers of which those
/// `inside` are responses; `lanes` says how many slices the stack of a row has.
pub(super) fn distributions(
    responses: &[f32],
    (kinds, pitch, inside): (usize, usize, std::ops::Range<usize>),
    lanes: impl Fn(usize) -> usize + Sync,
    monitor: &Monitor<'_>,
) -> Result<Vec<Distribution>> {
    let rows = || responses.par_chunks_exact(kinds * pitch).enumerate();
    let ranges = rows()
        .map(|(row, values)| {
            let kinds = values.chunks_exact(pitch);
            kinds.map(|values| range(&values[inside.clone()], lanes(row))).collect()
        })
        .reduce(
            || vec![Range::EMPTY; kinds],
            |a, b: Vec<Range>| a.into_iter().zip(b).map(|(a, b)| a.join(b)).collect(),
        );
    monitor.check()?;
    let columns = inside.len() / LANES;
    let values = (0..responses.len() / (kinds * pitch)).map(|row| columns * lanes(row)).sum();
    let bins = bins_for(values);
    let counts = rows()
        .fold(
            || vec![0u32; kinds * bins],
            |mut counts, (row, values)| {
                let kinds = values.chunks_exact(pitch).zip(&ranges);
                for (counts, (values, range)) in counts.chunks_exact_mut(bins).zip(kinds) {
                    for_lanes(&values[inside.clone()], lanes(row), |values| {
                        count(values, *range, counts);
                    });
                }
                counts
            },
        )
        .reduce(
            || vec![0; kinds * bins],
            |mut a, b| {
                a.iter_mut().zip(&b).for_each(|(a, b)| *a += b);
                a
            },
        );
    monitor.check()?;
    let kinds = ranges.into_iter().zip(counts.chunks_exact(bins));
    Ok(kinds.map(|(range, counts)| Distribution::new(range, counts)).collect())
}

/// Hands over the values of slices that exist.
fn for_lanes(values: &[f32], lanes: usize, mut visit: impl FnMut(&[f32])) {
    if lanes == LANES {
        visit(values);
    } else {
        values.chunks_exact(LANES).for_each(|values| visit(&values[..lanes]));
    }
}

/// Hands over the values of slices that exist, and sets those of the others to zero.
pub(super) fn for_lanes_mut(values: &mut [f32], lanes: usize, visit: impl Fn(&mut [f32])) {
    if lanes == LANES {
        visit(values);
        return;
    }
    for values in values.chunks_exact_mut(LANES) {
        visit(&mut values[..lanes]);
        values[lanes..].fill(0.0);
    }
}

/// Turns a row of responses of the channels into those along the directions, or back.
fn mix(values: &mut [f32], group: &Group<'_>, order: Order, back: bool) {
    let Order { channels, filters, .. } = order;
    if channels == 1 {
        return;
    }
    let pitch = order.pitch();
    let mut before = vec![0.0; channels * pitch];
    for (k, filter) in group.filters.iter().enumerate() {
        let row = |c: usize| (c * filters + k) * pitch..(c * filters + k + 1) * pitch;
        for (c, before) in before.chunks_exact_mut(pitch).enumerate() {
            before.copy_from_slice(&values[row(c)]);
        }
        for to in 0..channels {
            let factor = |from: usize| {
                let [q, c] = if back { [from, to] } else { [to, from] };
                filter.directions[q * channels + c]
            };
            let out = &mut values[row(to)];
            out.fill(0.0);
            let rows = before.chunks_exact(pitch).enumerate();
            add_products(out, rows.map(|(from, row)| (factor(from), row)));
        }
    }
}
