//! Responses to responses: what filters see of the places where other filters answer strongly.
//!
//! A second filter looks at 3 × 3 places, two pixels apart, of what is left of all responses of a group
//! above an offset. So where an edge ends, and which others it meets, enter the matching: a linear
//! filter sees the sum of its neighbours alone.

use rayon::prelude::*;

use super::distribution::{BINS, Correction, Distribution, Range, count};
use super::filters::{Group, SYMMETRIES, turned};
use super::images::{append_responses, mixed};
use super::planes::{Order, distributions, for_lanes_mut};
use super::stacks::{Aligned, LANES, add_products};
use crate::error::Result;
use crate::monitor::Monitor;
use crate::rng::Key;
use crate::texture::field::Field;

/// Edge of the second filters, places.
const EDGE: usize = 3;

/// Pixels from one place to the next: volumes are answered at every second pixel.
const APART: usize = super::STEP;

/// How far to go along the direction of a safe step. With 1 the responses themselves, which are
/// solved for exactly, take everything back: the structure error of Ketton limestone was 34 instead
/// of 23 % with 12. At 20 its gradient was 6 % too high.
const STRENGTH: f32 = 12.0;

/// Second filters of a group.
const FILTERS: usize = 4;

/// Second filters of a group, and what an image answers to them.
pub(super) struct Second {
    /// What the responses of each kind are multiplied by, and then what is added.
    scales: Vec<[f32; 2]>,
    /// Of each filter, taps of all kinds, one kind after the other; their sizes add up to 1.
    taps: Vec<Vec<f32>>,
    /// Of each kind, what corrections are divided by: the sizes of its taps of all filters.
    totals: Vec<f32>,
    wanted: Vec<Distribution>,
}

/// Memory that one axis after the other uses.
#[derive(Debug, Default)]
pub(super) struct Room {
    /// What is left of the responses, row after row of all stacks, in each the rows of all kinds.
    left: Aligned,
    /// Responses to it.
    responses: Aligned,
}

impl Second {
    /// Draws filters: differences of two places of the image. `first` are its responses to the group.
    pub fn draw(
        (image, symmetric): (&Field, bool),
        group: &Group<'_>,
        first: &[Vec<Distribution>],
        key: Key,
        monitor: &Monitor<'_>,
    ) -> Result<Self> {
        let filters = group.filters.len();
        let kinds = filters * image.channels();
        let scales: Vec<[f32; 2]> = (0..kinds)
            .map(|i| {
                let responses = &first[i % filters][i / filters];
                let scale = 1.0 / responses.deviation();
                let scale = if scale.is_finite() { scale } else { 0.0 };
                // Not the outermost tenths, of which hardly a place is left, or none is cut.
                let share = 0.1 + 0.8 * f64::from(key.with(0).unit(i as u64));
                [scale as f32, (-scale * responses.quantile(share)) as f32]
            })
            .collect();
        let symmetries = if symmetric { SYMMETRIES } else { 1 };
        let left: Vec<Vec<Vec<f32>>> = (0..symmetries)
            .into_par_iter()
            .map(|turn| {
                monitor.check()?;
                Ok(left_of_image(image, group, &scales, turn))
            })
            .collect::<Result<_>>()?;
        let [_, ny, nx] = image.shape();
        let edge = group.filters[0].edge;
        let size = [ny + 1 - edge, nx + 1 - edge];
        let inside = size.map(|n| n.saturating_sub(APART * (EDGE - 1)));
        let taps: Vec<Vec<f32>> = (0..FILTERS)
            .map(|k| {
                let key = key.with(1 + k as u64);
                let places = [0, 2].map(|i| [key.below(i, inside[0]), key.below(i + 1, inside[1])]);
                difference(&left[0], size[1], places)
            })
            .collect();
        let sum = |taps: &[f32]| taps.iter().map(|v| v.abs()).sum::<f32>();
        let of_kind = |kind: usize| {
            taps.iter().map(|taps| sum(&taps[kind * EDGE * EDGE..][..EDGE * EDGE])).sum()
        };
        let totals = (0..kinds).map(of_kind).collect();
        let wanted = taps
            .par_iter()
            .map(|taps| {
                monitor.check()?;
                let mut responses = Vec::new();
                for (turn, left) in left.iter().enumerate() {
                    respond(left, size, taps, turn, &mut responses);
                }
                let range = Range::of(&responses);
                let mut counts = vec![0; BINS];
                count(&responses, range, &mut counts);
                Ok(Distribution::new(range, &counts))
            })
            .collect::<Result<_>>()?;
        Ok(Self { scales, taps, totals, wanted })
    }

    /// Whether an image is large enough for filters of this edge and second ones.
    pub fn fits(image: &Field, edge: usize) -> bool {
        image.shape()[1..].iter().all(|&n| n >= edge + APART * (EDGE - 1))
    }

    /// Finds in `room` what each kind is asked for: see [`Self::add`].
    pub fn prepare(
        &self,
        responses: &[f32],
        order: Order,
        room: &mut Room,
        monitor: &Monitor<'_>,
    ) -> Result<()> {
        let wide = (order.columns.count + EDGE - 1) * LANES;
        let inside = order.inside();
        let row = order.kinds() * wide;
        let rows = responses.len() / order.row();
        let Room { left, responses: second } = room;
        left.resize(rows * row);
        left.par_chunks_exact_mut(row).zip(responses.par_chunks_exact(order.row())).for_each(
            |(left, responses)| {
                let kinds = responses.chunks_exact(order.pitch()).zip(&self.scales);
                for (left, (responses, scale)) in left.chunks_exact_mut(wide).zip(kinds) {
                    cut(&responses[inside.clone()], *scale, left);
                    wrap(left, order.columns.count);
                }
            },
        );
        let left = &*left;
        let across = order.rows.count;
        let place = |kind: usize, j: usize, i: usize| kind * EDGE * EDGE + j * EDGE + i;
        second.resize(rows * self.taps.len() * wide);
        second.par_chunks_exact_mut(self.taps.len() * wide).enumerate().try_for_each(
            |(at, out)| {
                monitor.check()?;
                let (stack, y) = (at / across, at % across);
                for (taps, out) in self.taps.iter().zip(out.chunks_exact_mut(wide)) {
                    let terms = (0..order.kinds() * EDGE * EDGE).map(|t| {
                        let (kind, j, i) = (t / (EDGE * EDGE), t / EDGE % EDGE, t % EDGE);
                        let from = (stack * across + (y + j) % across) * row + kind * wide;
                        let from = &left[from + i * LANES..][..order.columns.count * LANES];
                        (taps[place(kind, j, i)], from)
                    });
                    // Before the first place there is room for what `add` wraps.
                    let out = &mut out[(EDGE - 1) * LANES..];
                    out.fill(0.0);
                    add_products(out, terms);
                }
                Ok(())
            },
        )?;
        let of_second = (self.taps.len(), wide, (EDGE - 1) * LANES..wide);
        let found = distributions(second, of_second.clone(), |row| order.lanes(row), monitor)?;
        let corrections: Vec<Correction> =
            found.iter().zip(&self.wanted).map(|(from, to)| Correction::new(from, to)).collect();
        second.par_chunks_exact_mut(self.taps.len() * wide).enumerate().for_each(|(at, rows)| {
            for (values, correction) in rows.chunks_exact_mut(wide).zip(&corrections) {
                let inside = &mut values[of_second.2.clone()];
                for_lanes_mut(inside, order.lanes(at), |values| correction.apply(values));
                let count = order.columns.count;
                for c in 0..EDGE - 1 {
                    // Few columns go round more than once.
                    let from = (count * EDGE + c - (EDGE - 1)) % count + EDGE - 1;
                    values.copy_within(from * LANES..(from + 1) * LANES, c * LANES);
                }
            }
        });
        Ok(())
    }

    /// Adds to the corrections of a row of responses what the second ones ask of them: a step of
    /// simultaneous iterative reconstruction (SIRT), [`STRENGTH`] times as long. Where nothing is
    /// left of a response, nothing is asked of it.
    pub fn add(&self, room: &Room, row: usize, order: Order, values: &mut [f32]) {
        let count = order.columns.count;
        let wide = (count + EDGE - 1) * LANES;
        let across = order.rows.count;
        let (stack, y) = (row / across, row % across);
        let mut asked = vec![0.0; count * LANES];
        for (kind, values) in values.chunks_exact_mut(order.pitch()).enumerate() {
            asked.fill(0.0);
            let terms = (0..self.taps.len() * EDGE * EDGE).map(|t| {
                let (k, j, i) = (t / (EDGE * EDGE), t / EDGE % EDGE, t % EDGE);
                let from = stack * across + (y + EDGE * across - j) % across;
                let from = (from * self.taps.len() + k) * wide + (EDGE - 1 - i) * LANES;
                let tap = self.taps[k][kind * EDGE * EDGE + j * EDGE + i];
                (tap, &room.responses[from..from + count * LANES])
            });
            add_products(&mut asked, terms);
            let left = &room.left[(row * order.kinds() + kind) * wide..][..count * LANES];
            let factor = STRENGTH / (self.scales[kind][0] * self.totals[kind]);
            if factor.is_finite() {
                add_where_left(&mut values[order.inside()], &asked, left, factor);
            }
        }
    }
}

/// What is left of a row of responses above an offset.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
fn cut(responses: &[f32], [scale, offset]: [f32; 2], left: &mut [f32]) {
    for (out, v) in left.iter_mut().zip(responses) {
        *out = (v * scale + offset).max(0.0);
    }
}

#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
fn add_where_left(values: &mut [f32], asked: &[f32], left: &[f32], factor: f32) {
    for (v, (a, l)) in values.iter_mut().zip(asked.iter().zip(left)) {
        *v += if *l > 0.0 { factor * a } else { 0.0 };
    }
}

/// Repeats the first places of a row after its last.
fn wrap(row: &mut [f32], count: usize) {
    for c in count..count + EDGE - 1 {
        let from = c % count * LANES;
        row.copy_within(from..from + LANES, c * LANES);
    }
}

/// What is left of the responses of an image to each kind, with filters turned.
fn left_of_image(
    image: &Field,
    group: &Group<'_>,
    scales: &[[f32; 2]],
    turn: usize,
) -> Vec<Vec<f32>> {
    let [_, ny, nx] = image.shape();
    let channels = image.channels();
    let filters = group.filters.len();
    let of_kind = |(kind, scale): (usize, &[f32; 2])| {
        let filter = &group.filters[kind % filters];
        let direction = &filter.directions[kind / filters * channels..][..channels];
        let taps = turned(&filter.taps, filter.edge, turn);
        let mut responses = Vec::new();
        append_responses(&mixed(image, direction), [ny, nx], &taps, filter.edge, &mut responses);
        let mut left = vec![0.0; responses.len()];
        cut(&responses, *scale, &mut left);
        left
    };
    scales.iter().enumerate().map(of_kind).collect()
}

/// Appends the responses at all places inside an image to a second filter that is turned as it is.
fn respond(
    left: &[Vec<f32>],
    [ny, nx]: [usize; 2],
    taps: &[f32],
    turn: usize,
    responses: &mut Vec<f32>,
) {
    let [height, width] = [ny, nx].map(|n| n - APART * (EDGE - 1));
    let all: Vec<Vec<f32>> =
        taps.chunks_exact(EDGE * EDGE).map(|taps| turned(taps, EDGE, turn)).collect();
    for y in 0..height {
        let start = responses.len();
        responses.resize(start + width, 0.0);
        let terms = left.iter().zip(&all).flat_map(|(left, taps)| {
            taps.iter().enumerate().map(move |(t, &tap)| {
                let from = (y + t / EDGE * APART) * nx + t % EDGE * APART;
                (tap, &left[from..from + width])
            })
        });
        add_products(&mut responses[start..], terms);
    }
}

/// Difference of two places of an image; its sizes add up to 1.
fn difference(left: &[Vec<f32>], width: usize, places: [[usize; 2]; 2]) -> Vec<f32> {
    let mut taps: Vec<f32> = left
        .iter()
        .flat_map(|left| {
            (0..EDGE * EDGE).map(|t| {
                let [a, b] = places
                    .map(|[y, x]| left[(y + t / EDGE * APART) * width + x + t % EDGE * APART]);
                a - b
            })
        })
        .collect();
    let sum: f32 = taps.iter().map(|v| v.abs()).sum();
    if sum > 0.0 {
        for v in &mut taps {
            *v /= sum;
        }
    } else {
        // Two equal places have no direction.
        let even = 1.0 / taps.len() as f32;
        taps.fill(even);
    }
    taps
}
