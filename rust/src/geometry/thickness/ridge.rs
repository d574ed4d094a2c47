//! Balls that are not part of a neighbour's.

use multiversion::multiversion;
use ndarray::s;
use rayon::prelude::*;

use super::Space;
use super::cells::{CELL, Slab, put};
use super::diameters::Balls;
use super::needed::Needed;
use super::steps::{MIDDLE, STEPS, Steps};
use crate::error::Result;
use crate::geometry::distance::transform::Kept;
use crate::geometry::distance::window::{LANES, Lane};
use crate::monitor::Monitor;
use crate::volume::Boundary;

/// Voxels that are looked at together; it divides [`LANES`].
const SOME: usize = 16;

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
    let [count_y, per_row] = [ny, nx].map(|n| n.div_ceil(CELL));
    let slabs = (0..nz.div_ceil(CELL)).into_par_iter().map_init(
        || (Rows::new(nx, needed.kinds()), Vec::new()),
        |(rows, found), slab| {
            found.clear();
            for z in slab * CELL..((slab + 1) * CELL).min(nz) {
                rows.begin(balls, z, space.boundary);
                for y in 0..ny {
                    monitor.check()?;
                    rows.load(balls, [z, y], space.boundary);
                    rows.compare([z, y], [nz, ny, nx], space, &needed);
                    rows.balls(y, &space.steps, |x, mut ball| {
                        found.push((put(&mut ball, [z, y, x], per_row), ball));
                    });
                }
            }
            Ok(Slab::new(found, count_y * per_row))
        },
    );
    slabs.collect()
}

/// Rows of voxels about a row, each with one more voxel at both ends: of the planes before, of and
/// after it, the rows before, of and after it. They are filled up to whole lanes with none.
struct Rows<T> {
    /// Voxels of a row.
    nx: usize,
    reach: [Vec<T>; 9],
    rank: [Vec<T>; 9],
    /// The squares of the balls that no neighbour's holds, 0 for the others.
    whole: Vec<T>,
    /// What a neighbour's square must be at least, by the kind of the step to it.
    needed: Vec<Vec<T>>,
    /// By the kind of the step to them.
    neighbours: Vec<Neighbours<T>>,
}

/// The neighbours of the voxels of a row by steps of one kind.
#[derive(Clone)]
struct Neighbours<T> {
    /// The largest square of one that is as thick, 0 if none is; and the step to it.
    largest: Vec<T>,
    which: Vec<u8>,
}

impl<T: Lane + Kept<T>> Rows<T> {
    fn new(nx: usize, kinds: usize) -> Self {
        let width = nx.next_multiple_of(LANES);
        let padded = || std::array::from_fn(|_| vec![T::default(); width + 2]);
        let row = || vec![T::default(); width];
        Self {
            nx,
            reach: padded(),
            rank: padded(),
            whole: row(),
            needed: vec![row(); kinds],
            neighbours: vec![Neighbours { largest: row(), which: vec![0; width] }; kinds],
        }
    }

    /// Where a row is kept: rows take turns, so that each is loaded once.
    const fn place(plane: usize, y: usize) -> usize {
        3 * plane + y % 3
    }

    /// Loads what comes before the first row of a plane, and that row.
    fn begin(&mut self, balls: &Balls<'_, T>, z: usize, boundary: Boundary) {
        let ny = balls.reach.dim().1;
        self.load_row(balls, z, boundary.before(0, ny), 2, boundary);
        self.load_row(balls, z, Some(0), 0, boundary);
    }

    /// Loads what comes after a row, all before it being there.
    fn load(&mut self, balls: &Balls<'_, T>, [z, y]: [usize; 2], boundary: Boundary) {
        let next = boundary.after(y, balls.reach.dim().1);
        self.load_row(balls, z, next, y + 1, boundary);
    }

    /// Loads a row of three planes; beyond an open border there are no balls.
    fn load_row(
        &mut self,
        balls: &Balls<'_, T>,
        z: usize,
        y: Option<usize>,
        place: usize,
        boundary: Boundary,
    ) {
        let (nz, _, nx) = balls.reach.dim();
        let planes = [boundary.before(z, nz), Some(z), boundary.after(z, nz)];
        for (plane, z) in planes.into_iter().enumerate() {
            let place = Self::place(plane, place);
            let both = [(balls.reach.view(), &mut self.reach), (balls.rank.view(), &mut self.rank)];
            for (all, rows) in both {
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

    /// Compares the balls of a row with their neighbours'.
    fn compare(
        &mut self,
        [z, y]: [usize; 2],
        shape: [usize; 3],
        space: &Space,
        needed: &Needed<T>,
    ) {
        let later = |along: [i32; 3], x: usize| match space.boundary {
            // Beyond the border there are no balls.
            Boundary::Open => along > [0; 3],
            Boundary::Periodic => comes_after([z, y, x], along, shape),
        };
        let (nx, width) = (self.nx, self.whole.len());
        let middle = Self::place(1, y);
        self.whole.copy_from_slice(&self.reach[middle][1..=width]);
        // A row that goes on in itself may have one more value after its end.
        self.whole[nx..].fill(T::default());
        needed.fill(&self.whole, &mut self.needed);
        for neighbours in &mut self.neighbours {
            neighbours.largest.fill(T::default());
        }
        // Who comes later is another at the ends of a row that goes on in itself.
        let last = nx.max(2) - 1;
        let parts = match space.boundary {
            Boundary::Open => [0..width, 0..0, 0..0],
            Boundary::Periodic => [1..last, 0..1, last..nx],
        };
        for number in (0..STEPS).filter(|&number| number != MIDDLE) {
            let step = &space.steps.all[number];
            let [dz, dy, dx] = step.along;
            let row = Self::place((dz + 1) as usize, y + (dy + 3) as usize);
            let kind = needed.kind(step.axes());
            let neighbours = &mut self.neighbours[kind];
            for xs in parts.iter().filter(|xs| !xs.is_empty()).cloned() {
                let own = xs.start + 1..xs.end + 1;
                let others = own.start.strict_add_signed(dx as isize)..;
                meet(
                    [&self.reach[middle][own.clone()], &self.rank[middle][own]],
                    [&self.reach[row][others.clone()], &self.rank[row][others]],
                    later(step.along, xs.start),
                    [&mut self.whole[xs.clone()], &mut neighbours.largest[xs.clone()]],
                    (&self.needed[kind][xs.clone()], &mut neighbours.which[xs], number as u8),
                );
            }
        }
    }

    /// Calls `each` with the balls of a row that no neighbour's holds.
    fn balls(&self, y: usize, steps: &Steps, mut each: impl FnMut(usize, Ball<T>)) {
        for (first, some) in (0..).step_by(SOME).zip(self.whole.as_chunks::<SOME>().0) {
            // Most often there are none.
            if some.iter().fold(false, |any, &reach| any | (reach > T::default())) {
                for (x, _) in (first..).zip(some).filter(|&(_, &reach)| reach > T::default()) {
                    each(x, self.ball([y, x], steps));
                }
            }
        }
    }

    /// The ball of a voxel.
    fn ball(&self, [y, x]: [usize; 2], steps: &Steps) -> Ball<T> {
        let reach = self.whole[x];
        let rank = self.rank[Self::place(1, y)][x + 1];
        let mut ball = Ball { reach, rank, step: MIDDLE as u8, ..Ball::default() };
        let mut most = f32::NEG_INFINITY;
        for neighbours in &self.neighbours {
            let other = neighbours.largest[x];
            if other > T::default() {
                let step = neighbours.which[x];
                let begins = steps.all[usize::from(step)].begins(reach.square(), other.square());
                if begins > most {
                    (most, ball.neighbour, ball.step) = (begins, other, step);
                }
            }
        }
        ball
    }
}

/// Compares balls with those of a neighbour each, squares and ranks: which it holds, and whether it is
/// the largest that leads one.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
#[allow(clippy::needless_bitwise_bool)] // Where stores cannot be masked, branches are taken one by one.
fn meet<T: Lane + Default>(
    [reach, rank]: [&[T]; 2],
    [other, other_rank]: [&[T]; 2],
    later: bool,
    [whole, largest]: [&mut [T]; 2],
    (needed, which, number): (&[T], &mut [u8], u8),
) {
    let n = whole.len();
    let (reach, rank, other, other_rank) = (&reach[..n], &rank[..n], &other[..n], &other_rank[..n]);
    let (largest, needed, which) = (&mut largest[..n], &needed[..n], &mut which[..n]);
    for i in 0..n {
        // All is loaded before it is looked at, so that it need not be looked at one by one.
        let (square, thick) = (other[i], other_rank[i]);
        let (own, own_thick, least) = (reach[i], rank[i], needed[i]);
        let (kept, most, before) = (whole[i], largest[i], which[i]);
        let holds = (thick >= own_thick) & (square >= least);
        whole[i] = if holds { T::default() } else { kept };
        // Of balls that are as thick the larger leads, of those that are as large the later.
        let ahead = (square > own) | (later & (square >= own));
        let thicker = (thick > own_thick) | ((thick >= own_thick) & ahead);
        let leads = (square > most) & thicker;
        largest[i] = if leads { square } else { most };
        which[i] = if leads { number } else { before };
    }
}

/// Whether a neighbour comes after a voxel in the volume.
fn comes_after(at: [usize; 3], step: [i32; 3], shape: [usize; 3]) -> bool {
    let other = [0, 1, 2].map(|axis| {
        let n = shape[axis];
        (at[axis] + n).wrapping_add_signed(step[axis] as isize) % n
    });
    other > at
}
