//! Responses to responses: what filters see of the places where other filters answer strongly.
//!
//! A second filter looks at 3 × 3 places, two pixels apart, of what is left of all responses of a group
//! above an offset. So where an edge ends, and which others it meets, enter the matching: a linear
//! filter sees the sum of its neighbours alone.

use rayon::prelude::*;

use super::distribution::{Correction, Distribution};
use super::filters::{Filter, Group, SYMMETRIES, turned};
use super::images::{append_responses, mixed};
use super::planes::{Order, distributions, for_lanes_mut};
use super::stacks::{Aligned, LANES, add_all_products, add_products};
use crate::error::Result;
use crate::monitor::Monitor;
use crate::rng::Key;
use crate::texture::field::Field;

/// Edge of the second filters, places.
const EDGE: usize = 3;

/// Taps of a second filter on one kind of responses.
const TAPS: usize = EDGE * EDGE;

/// Pixels from one place to the next: volumes are answered at every second pixel.
const APART: usize = super::STEP;

/// How far to go along the direction of a safe step. With 1 the responses themselves, which are
/// solved for exactly, take everything back: the structure error of Ketton limestone was 34 instead
/// of 23 % with 12. At 20 its gradient was 6 % too high.
const STRENGTH: f32 = 12.0;

/// Second filters of a group.
const FILTERS: usize = 4;

/// Second filters of a group, and what images answer to them.
pub(super) struct Second {
    /// What the responses of each kind are multiplied by, and then what is added.
    scales: Vec<[f32; 2]>,
    /// Of each filter, taps of all kinds, one kind after the other; their sizes add up to 1.
    taps: Vec<Vec<f32>>,
    /// Of each kind, what is asked of it is multiplied by; 0 where a kind has one response only.
    factors: Vec<f32>,
    wanted: Vec<Distribution>,
}

/// Memory that one axis after the other uses: row after row of all stacks, in each the rows of all
/// kinds, or of all second filters, as [`Rows`] says.
#[derive(Debug, Default)]
pub(super) struct Room {
    /// What is left of the responses.
    left: Aligned,
    /// Responses to it, then their corrections.
    responses: Aligned,
}

/// Where rows of places lie that are long enough to go round.
#[derive(Debug, Clone, Copy)]
struct Rows {
    order: Order,
    /// Rows of places for each row of a stack.
    kinds: usize,
}

impl Rows {
    /// Numbers of a row of places, without those that go round.
    fn places(self) -> usize {
        self.order.columns.count * LANES
    }

    fn pitch(self) -> usize {
        self.places() + (EDGE - 1) * LANES
    }

    /// Numbers of all kinds.
    fn row(self) -> usize {
        self.kinds * self.pitch()
    }

    /// Numbers at the places of a row of one kind, from the `column`-th on.
    fn at(self, numbers: &[f32], row: usize, kind: usize, column: usize) -> &[f32] {
        &numbers[row * self.row() + kind * self.pitch() + column * LANES..][..self.places()]
    }

    /// The row so many after another in its stack.
    fn below(self, row: usize, steps: usize) -> usize {
        let n = self.order.rows.count;
        row - row % n + (row + steps) % n
    }

    /// The row so many before another in its stack.
    fn above(self, row: usize, steps: usize) -> usize {
        let n = self.order.rows.count;
        row - row % n + (row % n + EDGE * n - steps) % n
    }
}

impl Second {
    /// Draws filters: differences of two places of one of the images. `first` are the images'
    /// responses to the group.
    pub fn draw(
        images: &[(&Field, bool)],
        group: &Group<'_>,
        first: &[&[Vec<Distribution>]],
        key: Key,
        monitor: &Monitor<'_>,
    ) -> Result<Self> {
        let which = key.with(1 + FILTERS as u64).below(0, images.len());
        let (image, first) = (images[which].0, first[which]);
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
        let left = images
            .iter()
            .map(|image| left_of_image(*image, group, &scales, monitor))
            .collect::<Result<Vec<_>>>()?;
        let size = |image: &Field| [1, 2].map(|a| image.shape()[a] + 1 - group.filters[0].edge);
        let width = size(image)[1];
        let inside = size(image).map(|n| n - APART * (EDGE - 1));
        let taps: Vec<Vec<f32>> = (0..FILTERS)
            .map(|k| {
                let key = key.with(1 + k as u64);
                let places = [0, 2].map(|i| [key.below(i, inside[0]), key.below(i + 1, inside[1])]);
                difference(&left[which][0], width, places)
            })
            .collect();
        let factor = |(kind, [scale, _]): (usize, &[f32; 2])| {
            let own = taps.iter().map(|taps| sizes(&taps[kind * TAPS..][..TAPS]));
            let factor = STRENGTH / (scale * own.sum::<f32>());
            if factor.is_finite() { factor } else { 0.0 }
        };
        let factors = scales.iter().enumerate().map(factor).collect();
        let wanted = taps
            .par_iter()
            .map(|taps| {
                monitor.check()?;
                let mut responses = Vec::new();
                for (image, left) in images.iter().zip(&left) {
                    for (turn, left) in left.iter().enumerate() {
                        respond(left, size(image.0), taps, turn, &mut responses);
                    }
                }
                Ok(Distribution::of(&responses))
            })
            .collect::<Result<_>>()?;
        Ok(Self { scales, taps, factors, wanted })
    }

    /// Whether an image is large enough for filters of this edge and second ones.
    pub fn fits(image: &Field, edge: usize) -> bool {
        image.shape()[1..].iter().all(|&n| n >= edge + APART * (EDGE - 1))
    }

    /// Finds in `room` what [`Self::add`] needs.
    pub fn prepare(
        &self,
        responses: &[f32],
        order: Order,
        room: &mut Room,
        monitor: &Monitor<'_>,
    ) -> Result<()> {
        self.cut(responses, order, &mut room.left);
        self.respond(order, room, monitor)?;
        self.correct(order, &mut room.responses, monitor)
    }

    /// What is left of all responses, and then of the first places of each row again.
    fn cut(&self, responses: &[f32], order: Order, left: &mut Aligned) {
        let rows = self.first(order);
        left.resize(responses.len() / order.row() * rows.row());
        let both =
            left.par_chunks_exact_mut(rows.row()).zip(responses.par_chunks_exact(order.row()));
        both.for_each(|(left, responses)| {
            let kinds = responses.chunks_exact(order.pitch()).zip(&self.scales);
            for (left, (responses, scale)) in left.chunks_exact_mut(rows.pitch()).zip(kinds) {
                cut(&responses[order.inside()], *scale, left);
                for column in 0..EDGE - 1 {
                    let from = column % order.columns.count * LANES;
                    left.copy_within(from..from + LANES, rows.places() + column * LANES);
                }
            }
        });
    }

    /// Responses to what is left, after room for those that [`Self::correct`] puts before them.
    fn respond(&self, order: Order, room: &mut Room, monitor: &Monitor<'_>) -> Result<()> {
        let (first, second) = (self.first(order), self.second(order));
        let Room { left, responses } = room;
        responses.resize(left.len() / first.row() * second.row());
        responses.par_chunks_exact_mut(second.row()).enumerate().try_for_each(|(row, out)| {
            monitor.check()?;
            out.fill(0.0);
            let sums =
                out.chunks_exact_mut(second.pitch()).map(|out| &mut out[(EDGE - 1) * LANES..]);
            let terms: Vec<&[f32]> = (0..first.kinds * TAPS)
                .map(|t| {
                    let (kind, down, along) = (t / TAPS, t % TAPS / EDGE, t % EDGE);
                    first.at(left, first.below(row, down), kind, along)
                })
                .collect();
            add_all_products(sums.collect(), &terms, |k, t| self.taps[k][t]);
            Ok(())
        })
    }

    /// Replaces responses by their corrections, before them those of the last places again.
    fn correct(&self, order: Order, responses: &mut [f32], monitor: &Monitor<'_>) -> Result<()> {
        let rows = self.second(order);
        let inside = (EDGE - 1) * LANES..rows.pitch();
        let of_row = (rows.kinds, rows.pitch(), inside.clone());
        let found = distributions(responses, of_row, |row| order.lanes(row), monitor)?;
        let both = found.iter().zip(&self.wanted);
        let corrections: Vec<_> = both.map(|(from, to)| Correction::new(from, to)).collect();
        responses.par_chunks_exact_mut(rows.row()).enumerate().for_each(|(row, values)| {
            for (values, correction) in values.chunks_exact_mut(rows.pitch()).zip(&corrections) {
                let own = &mut values[inside.clone()];
                for_lanes_mut(own, order.lanes(row), |values| correction.apply(values));
                let count = order.columns.count;
                for column in 0..EDGE - 1 {
                    // Few columns go round more than once.
                    let from = (count * EDGE + column - (EDGE - 1)) % count + EDGE - 1;
                    values.copy_within(from * LANES..(from + 1) * LANES, column * LANES);
                }
            }
        });
        Ok(())
    }

    /// Adds to the corrections of a row of responses what the second ones ask of them: a step of
    /// simultaneous iterative reconstruction (SIRT), [`STRENGTH`] times as long. Where nothing is
    /// left of a response, nothing is asked of it.
    pub fn add(&self, room: &Room, row: usize, order: Order, values: &mut [f32]) {
        let (first, second) = (self.first(order), self.second(order));
        let mut asked = vec![0.0; first.kinds * first.places()];
        let terms: Vec<&[f32]> = (0..second.kinds * TAPS)
            .map(|t| {
                let (k, down, along) = (t / TAPS, t % TAPS / EDGE, t % EDGE);
                second.at(&room.responses, second.above(row, down), k, EDGE - 1 - along)
            })
            .collect();
        add_all_products(asked.chunks_exact_mut(first.places()).collect(), &terms, |kind, t| {
            self.taps[t / TAPS][kind * TAPS + t % TAPS]
        });
        let kinds = values.chunks_exact_mut(order.pitch()).zip(asked.chunks_exact(first.places()));
        for (kind, (values, asked)) in kinds.enumerate() {
            let left = first.at(&room.left, row, kind, 0);
            add_where_left(&mut values[order.inside()], asked, left, self.factors[kind]);
        }
    }

    fn first(&self, order: Order) -> Rows {
        Rows { order, kinds: self.scales.len() }
    }

    fn second(&self, order: Order) -> Rows {
        Rows { order, kinds: self.taps.len() }
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

/// What is left of the responses of an image to each kind, for each symmetry of the filters.
fn left_of_image(
    (image, symmetric): (&Field, bool),
    group: &Group<'_>,
    scales: &[[f32; 2]],
    monitor: &Monitor<'_>,
) -> Result<Vec<Vec<Vec<f32>>>> {
    let [_, ny, nx] = image.shape();
    let filters = group.filters.len();
    let kinds: Vec<_> = scales
        .iter()
        .enumerate()
        .map(|(kind, &scale)| {
            let filter = &group.filters[kind % filters];
            let directions = filter.directions.chunks_exact(image.channels());
            let direction = directions.into_iter().nth(kind / filters).unwrap_or_default();
            (filter, mixed(image, direction), scale)
        })
        .collect();
    let of_symmetry = |symmetry: usize| {
        monitor.check()?;
        let of_kind = |(filter, mixed, scale): &(&Filter, Vec<f32>, [f32; 2])| {
            let taps = turned(&filter.taps, filter.edge, symmetry);
            let mut responses = Vec::new();
            append_responses(mixed, [ny, nx], &taps, filter.edge, &mut responses);
            let mut left = vec![0.0; responses.len()];
            cut(&responses, *scale, &mut left);
            left
        };
        Ok(kinds.iter().map(of_kind).collect())
    };
    let symmetries = if symmetric { SYMMETRIES } else { 1 };
    (0..symmetries).into_par_iter().map(of_symmetry).collect()
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
    let all: Vec<Vec<f32>> = taps.chunks_exact(TAPS).map(|taps| turned(taps, EDGE, turn)).collect();
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
            (0..TAPS).map(|t| {
                let [a, b] = places
                    .map(|[y, x]| left[(y + t / EDGE * APART) * width + x + t % EDGE * APART]);
                a - b
            })
        })
        .collect();
    let sum = sizes(&taps);
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

fn sizes(taps: &[f32]) -> f32 {
    taps.iter().map(|tap| tap.abs()).sum()
}
