//! Balls that are not part of a neighbour's.

use multiversion::multiversion;
use ndarray::{ArrayView3, s};
use rayon::prelude::*;

use super::Space;
use super::cells::{CELL, Slab, put};
use super::diameters::Balls;
use super::needed::{KINDS, Needed};
use super::steps::{MIDDLE, STEPS};
use crate::error::Result;
use crate::geometry::distance::transform::Kept;
use crate::geometry::distance::window::{LANES, Lane};
use crate::monitor::Monitor;
use crate::volume::Boundary;

/// Voxels that are looked at together; it divides [`LANES`].
const SOME: usize = 32;

/// A ball that no neighbour's ball holds.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Ball<T> {
    /// Squared distance to the nearest voxel outside.
    pub reach: T,
    /// The same of the neighbour as thick whose ball leaves least of this one; 0 if none is as thick.
    pub neighbour: T,
    pub rank: T,
    /// The voxel in the middle, by its place in the [`CELL`].
    pub place: u16,
    /// The step to the neighbour.
    pub step: u8,
}

/// The balls whose voxels do not all lie in the ball of a neighbour that is as thick, in slabs of
/// [`CELL`] planes.
///
/// Balls that are as thick as each other are in order, so that following the neighbours never leads
/// back.
pub(super) fn ridge<T: Lane + Kept<T>>(
    balls: &Balls<'_, T>,
    space: &Space,
    monitor: &Monitor<'_>,
) -> Result<Vec<Slab<T>>> {
    let (nz, ny, nx) = balls.reach.dim();
    let needed = Needed::new(space, balls.most.square());
    let order = Order::new(space, &needed);
    let [count_y, per_row] = [ny, nx].map(|n| n.div_ceil(CELL));
    let slabs = (0..nz.div_ceil(CELL)).into_par_iter().map_init(
        || (Rows::new(balls, space, &needed, &order), Vec::new()),
        |(rows, found), slab| {
            found.clear();
            for z in slab * CELL..((slab + 1) * CELL).min(nz) {
                rows.begin(z);
                for y in 0..ny {
                    monitor.check()?;
                    rows.load([z, y]);
                    rows.compare();
                    rows.balls(|x, mut ball| {
                        found.push((put(&mut ball, [z, y, x], per_row), ball));
                    });
                }
            }
            Ok(Slab::new(found, count_y * per_row))
        },
    );
    slabs.collect()
}

/// The steps to neighbours, kind by kind.
struct Order {
    steps: [usize; STEPS - 1],
    /// Where each kind ends.
    ends: Vec<usize>,
}

impl Order {
    fn new<T: Lane + Default>(space: &Space, needed: &Needed<T>) -> Self {
        let kind = |number: usize| needed.kind(space.steps.all[number].axes());
        let mut steps = std::array::from_fn(|i| if i < MIDDLE { i } else { i + 1 });
        steps.sort_by_key(|&number| kind(number));
        let end = |of| steps.partition_point(|&number| kind(number) <= of);
        Self { steps, ends: (0..needed.kinds()).map(end).collect() }
    }
}

/// Rows of voxels about a row, each with one more voxel at both ends: of the planes before, of and
/// after it, the rows before, of and after it. They are filled up to whole lanes with none.
struct Rows<'a, T> {
    /// Those of the volume, and their ranks.
    all: [ArrayView3<'a, T>; 2],
    space: &'a Space,
    needed: &'a Needed<T>,
    order: &'a Order,
    /// The plane and the row.
    at: [usize; 2],
    reach: [Vec<T>; 9],
    rank: [Vec<T>; 9],
    found: Found<T>,
}

/// What is found of a row.
#[derive(Default)]
struct Found<T> {
    /// The squares of the balls that no neighbour's holds, 0 for the others.
    whole: Vec<T>,
    /// The neighbours that lead those, by the kind of the step to them.
    leading: Vec<Leading<T>>,
}

/// Neighbours of the voxels of a row by steps of one kind.
#[derive(Clone)]
struct Leading<T> {
    /// The largest square of one that leads, 0 if none does.
    largest: Vec<T>,
    /// The step to it; as wide as most squares are, so that as many are done at once.
    step: Vec<u16>,
}

/// The neighbours of the voxels of a row by one step, from that of the first on.
struct Neighbours<'a, T> {
    reach: &'a [T],
    rank: &'a [T],
    /// Whether they come after their voxels.
    later: bool,
    step: u16,
}

impl<'a, T: Lane + Kept<T>> Rows<'a, T> {
    fn new(
        balls: &'a Balls<'_, T>,
        space: &'a Space,
        needed: &'a Needed<T>,
        order: &'a Order,
    ) -> Self {
        let width = balls.reach.dim().2.next_multiple_of(LANES);
        let padded = || std::array::from_fn(|_| vec![T::default(); width + 2]);
        let row = || vec![T::default(); width];
        let leading = Leading { largest: row(), step: vec![0; width] };
        let found = Found { whole: row(), leading: vec![leading; order.ends.len()] };
        let (reach, rank) = (padded(), padded());
        let all = [balls.reach.view(), balls.rank.view()];
        Self { all, space, needed, order, at: [0; 2], reach, rank, found }
    }

    fn shape(&self) -> [usize; 3] {
        self.all[0].dim().into()
    }

    /// Where a row is kept: rows take turns, so that each is loaded once.
    const fn place(plane: usize, y: usize) -> usize {
        3 * plane + y % 3
    }

    /// Loads what comes before the first row of a plane, and that row.
    fn begin(&mut self, z: usize) {
        self.load_row(z, self.space.boundary.before(0, self.shape()[1]), 2);
        self.load_row(z, Some(0), 0);
    }

    /// Loads what comes after a row, all before it being there.
    fn load(&mut self, [z, y]: [usize; 2]) {
        self.at = [z, y];
        self.load_row(z, self.space.boundary.after(y, self.shape()[1]), y + 1);
    }

    /// Loads a row of three planes; beyond an open border there are no balls.
    fn load_row(&mut self, z: usize, y: Option<usize>, place: usize) {
        let ([nz, _, nx], boundary) = (self.shape(), self.space.boundary);
        let planes = [boundary.before(z, nz), Some(z), boundary.after(z, nz)];
        for (plane, z) in planes.into_iter().enumerate() {
            let place = Self::place(plane, place);
            for (all, rows) in self.all.iter().zip([&mut self.reach, &mut self.rank]) {
                let row = &mut rows[place];
                let Some((z, y)) = z.zip(y) else {
                    row.fill(T::default());
                    continue;
                };
                if let Some(values) = all.slice(s![z, y, ..]).to_slice() {
                    row[1..=nx].copy_from_slice(values);
                }
                if boundary == Boundary::Periodic {
                    row[0] = row[nx];
                    row[nx + 1] = row[1];
                }
            }
        }
    }

    /// The neighbours of the row, in the order of the steps; who comes later is told for a voxel.
    fn neighbours(&self, x: usize) -> [Neighbours<'_, T>; STEPS - 1] {
        let ([z, y], shape) = (self.at, self.shape());
        let rows: [_; 9] = std::array::from_fn(|row| {
            let place = Self::place(row / 3, y + row % 3 + 2);
            [self.reach[place].as_slice(), self.rank[place].as_slice()]
        });
        self.order.steps.map(|step| {
            let [reach, rank] = rows[step / 3].map(|row| &row[step % 3..]);
            let later = match self.space.boundary {
                // Beyond the border there are no balls.
                Boundary::Open => step > MIDDLE,
                Boundary::Periodic => {
                    comes_after([z, y, x], self.space.steps.all[step].along, shape)
                }
            };
            Neighbours { reach, rank, later, step: step as u16 }
        })
    }

    /// Compares the balls of the row with their neighbours'.
    fn compare(&mut self) {
        let mut found = std::mem::take(&mut self.found);
        let middle = Self::place(1, self.at[1]);
        let own = [&self.reach[middle][1..], &self.rank[middle][1..]];
        let [_, _, nx] = self.shape();
        let kinds = (self.needed, self.order.ends.as_slice());
        meet(own, &self.neighbours(1.min(nx - 1)), kinds, &mut found);
        if self.space.boundary == Boundary::Periodic {
            // Who comes later is another at the ends of a row that goes on in itself.
            for x in [0, nx - 1] {
                meet_some::<T, 1>(x, own, &self.neighbours(x), kinds, &mut found);
            }
        }
        // Such a row may have one more value after its end.
        found.whole[nx..].fill(T::default());
        self.found = found;
    }

    /// Calls `each` with the balls of the row that no neighbour's holds.
    fn balls(&self, mut each: impl FnMut(usize, Ball<T>)) {
        for (first, some) in (0..).step_by(SOME).zip(self.found.whole.as_chunks::<SOME>().0) {
            // Most often there are none.
            if any(some) {
                for (x, _) in (first..).zip(some).filter(|&(_, &reach)| reach > T::default()) {
                    each(x, self.ball(x));
                }
            }
        }
    }

    /// The ball of a voxel.
    fn ball(&self, x: usize) -> Ball<T> {
        let reach = self.found.whole[x];
        let rank = self.rank[Self::place(1, self.at[1])][x + 1];
        let mut ball = Ball { reach, rank, step: MIDDLE as u8, ..Ball::default() };
        let mut most = f32::NEG_INFINITY;
        for leading in &self.found.leading {
            let other = leading.largest[x];
            if other > T::default() {
                let step = leading.step[x];
                let all = &self.space.steps.all;
                let begins = all[usize::from(step)].begins(reach.square(), other.square());
                if begins > most {
                    (most, ball.neighbour, ball.step) = (begins, other, step as u8);
                }
            }
        }
        ball
    }
}

/// Compares the balls of a row, squares and ranks, with their neighbours': see [`meet_some`].
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn meet<T: Lane + Default>(
    own: [&[T]; 2],
    neighbours: &[Neighbours<'_, T>; STEPS - 1],
    kinds: (&Needed<T>, &[usize]),
    found: &mut Found<T>,
) {
    for x in (0..found.whole.len()).step_by(SOME) {
        meet_some::<T, SOME>(x, own, neighbours, kinds, found);
    }
}

/// Compares some balls from x on with their neighbours': which one holds, and which is the largest of
/// each kind that leads one. So many stay in registers, and those that are held need no more kinds.
#[inline(always)]
#[allow(clippy::needless_bitwise_bool)] // As below.
fn meet_some<T: Lane + Default, const N: usize>(
    x: usize,
    [reach, rank]: [&[T]; 2],
    neighbours: &[Neighbours<'_, T>; STEPS - 1],
    (needed, ends): (&Needed<T>, &[usize]),
    Found { whole, leading }: &mut Found<T>,
) {
    let own = (some::<T, N>(reach, x), some::<T, N>(rank, x), whole[x..].first_chunk_mut());
    let (Some(reach), Some(rank), Some(whole)) = own else { return };
    *whole = *reach;
    if !any(whole) {
        return;
    }
    let (mut least, mut left) = ([[T::default(); N]; KINDS], *reach);
    needed.fill(reach, &mut least[..ends.len()]);
    let mut first = 0;
    for (kind, (&end, least)) in ends.iter().zip(&least).enumerate() {
        let (mut largest, mut step) = ([T::default(); N], [0; N]);
        for of in &neighbours[first..end] {
            let both = (some::<T, N>(of.reach, x), some::<T, N>(of.rank, x));
            let (Some(others), Some(ranks)) = both else { return };
            for i in 0..N {
                let holds = (ranks[i] >= rank[i]) & (others[i] >= least[i]);
                left[i] = if holds { T::default() } else { left[i] };
            }
            let squares = if of.later {
                leading_ones::<T, N, true>([reach, rank], [others, ranks])
            } else {
                leading_ones::<T, N, false>([reach, rank], [others, ranks])
            };
            let number = of.step;
            for i in 0..N {
                // All is loaded before it is looked at, so that it need not be looked at one by one.
                let (square, most, before) = (squares[i], largest[i], step[i]);
                step[i] = if square > most { number } else { before };
                largest[i] = if square > most { square } else { most };
            }
        }
        leading[kind].largest[x..x + N].copy_from_slice(&largest);
        leading[kind].step[x..x + N].copy_from_slice(&step);
        if !any(&left) {
            break;
        }
        first = end;
    }
    *whole = left;
}

/// The squares of other balls that lead, 0 for those that do not: the thicker does, of those that are as
/// thick the larger, of those that are as large the later.
#[inline(always)]
#[allow(clippy::needless_bitwise_bool)] // Where stores cannot be masked, branches are taken one by one.
fn leading_ones<T: Lane + Default, const N: usize, const LATER: bool>(
    [reach, rank]: [&[T; N]; 2],
    [others, ranks]: [&[T; N]; 2],
) -> [T; N] {
    let mut squares = [T::default(); N];
    for i in 0..N {
        let ahead = if LATER { others[i] >= reach[i] } else { others[i] > reach[i] };
        let leads = (ranks[i] >= rank[i]) & (ahead | (ranks[i] > rank[i]));
        squares[i] = if leads { others[i] } else { T::default() };
    }
    squares
}

/// Some values of a row from x on.
#[inline(always)]
fn some<T, const N: usize>(row: &[T], x: usize) -> Option<&[T; N]> {
    row.get(x..)?.first_chunk()
}

/// Whether there is any that is not 0.
#[inline(always)]
fn any<T: Lane + Default, const N: usize>(values: &[T; N]) -> bool {
    let mut any = false;
    for value in values {
        any |= *value > T::default();
    }
    any
}

/// Whether a neighbour comes after a voxel in the volume.
fn comes_after(at: [usize; 3], step: [i32; 3], shape: [usize; 3]) -> bool {
    let other = [0, 1, 2].map(|axis| {
        let n = shape[axis];
        (at[axis] + n).wrapping_add_signed(step[axis] as isize) % n
    });
    other > at
}
