//! Balls that are not part of a neighbour's.

use multiversion::multiversion;
use ndarray::s;
use rayon::prelude::*;

use super::Space;
use super::cells::{CELL, Slab};
use super::diameters::Balls;
use crate::error::Result;
use crate::geometry::distance::transform::Kept;
use crate::geometry::distance::window::Lane;
use crate::monitor::Monitor;
use crate::volume::Boundary;

/// Largest radius in voxels for which [`Needed::table`] is made; it takes the cube of it.
const LARGEST_IN_TABLE: usize = 512;

/// Room for a voxel and its neighbours, in C order.
const BLOCK: usize = 32;

/// Where the voxel is among them.
const MIDDLE: usize = 13;

/// What is taken off the squares of balls in cubes: between voxels, squares are multiples of 4.
pub(super) const SHORT: f32 = 2.0;

/// The step to a neighbour.
const fn step(i: usize) -> [i32; 3] {
    [i as i32 / 9 - 1, i as i32 / 3 % 3 - 1, i as i32 % 3 - 1]
}

/// A ball that no neighbour's ball holds.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Ball {
    /// The voxel in the middle.
    pub at: [u16; 3],
    /// The step to the neighbour as thick whose ball leaves least of this one.
    pub step: [i8; 3],
    /// The ball holds the voxels nearer than the root of this: in cubes, a square less [`SHORT`].
    pub reach: f32,
    /// The same of the neighbour's; 0 if there is none as thick.
    pub neighbour: f32,
    pub rank: f32,
}

/// The balls whose voxels do not all lie in the ball of a neighbour that is as thick, in slabs of
/// [`CELL`] planes.
///
/// Balls that are as thick as each other are in order, so that following the neighbours never leads
/// back.
pub(super) fn ridge<T: Lane + Kept<T>>(
    balls: &Balls<T>,
    space: &Space,
    monitor: &Monitor<'_>,
) -> Result<Vec<Slab>> {
    let (nz, ny, nx) = balls.reach.dim();
    let reaches = balls.reach.as_slice().unwrap_or(&[]).par_iter().copied();
    let most = reaches.reduce(T::default, |a, b| if b > a { b } else { a });
    let needed = Needed::new(space, most.square());
    let slabs = (0..nz.div_ceil(CELL)).into_par_iter().map(|slab| {
        let mut rows = Rows::new(nx);
        let mut found = Vec::new();
        for z in slab * CELL..((slab + 1) * CELL).min(nz) {
            rows.begin(balls, z, space.boundary);
            for y in 0..ny {
                monitor.check()?;
                rows.load(balls, [z, y], space.boundary);
                needed.fill(&rows.reach[Rows::place(1, y)][1..=nx], &mut rows.needed);
                rows.find_parts(y, &needed);
                let whole = (0..nx).filter(|&x| !rows.part[x]);
                found.extend(whole.map(|x| rows.ball([z, y, x], [nz, ny, nx], &needed)));
            }
        }
        Ok(Slab::new(&found, [ny, nx]))
    });
    slabs.collect()
}

/// Rows of voxels about a row, each with one more voxel at both ends: of the planes before, of and
/// after it, the rows before, of and after it.
struct Rows {
    reach: [Vec<f32>; 9],
    rank: [Vec<f32>; 9],
    /// What a neighbour's square must be at least, by the axes along which it differs.
    needed: [Vec<f32>; 8],
    /// Whether a ball is part of another's, or none.
    part: Vec<bool>,
}

impl Rows {
    fn new(nx: usize) -> Self {
        let padded = || std::array::from_fn(|_| vec![0.0; nx + 2]);
        Self {
            reach: padded(),
            rank: padded(),
            needed: std::array::from_fn(|_| vec![0.0; nx]),
            part: vec![false; nx],
        }
    }

    /// Where a row is kept: rows take turns, so that each is loaded once.
    const fn place(plane: usize, y: usize) -> usize {
        3 * plane + y % 3
    }

    /// Loads what comes before the first row of a plane, and that row.
    fn begin<T: Lane + Kept<T>>(&mut self, balls: &Balls<T>, z: usize, boundary: Boundary) {
        let ny = balls.reach.dim().1;
        self.load_row(balls, z, boundary.before(0, ny), 2, boundary);
        self.load_row(balls, z, Some(0), 0, boundary);
    }

    /// Loads what comes after a row, all before it being there.
    fn load<T: Lane + Kept<T>>(
        &mut self,
        balls: &Balls<T>,
        [z, y]: [usize; 2],
        boundary: Boundary,
    ) {
        let next = boundary.after(y, balls.reach.dim().1);
        self.load_row(balls, z, next, y + 1, boundary);
    }

    /// Loads a row of three planes; beyond an open border there are no balls.
    fn load_row<T: Lane + Kept<T>>(
        &mut self,
        balls: &Balls<T>,
        z: usize,
        y: Option<usize>,
        place: usize,
        boundary: Boundary,
    ) {
        let (nz, _, nx) = balls.reach.dim();
        let planes = [boundary.before(z, nz), Some(z), boundary.after(z, nz)];
        for (plane, z) in planes.into_iter().enumerate() {
            let place = Self::place(plane, place);
            let both = [(&balls.reach, &mut self.reach), (&balls.rank, &mut self.rank)];
            for (all, rows) in both {
                let row = &mut rows[place];
                let Some((z, y)) = z.zip(y) else {
                    row.fill(0.0);
                    continue;
                };
                if let Some(values) = all.slice(s![z, y, ..]).to_slice() {
                    T::to_squares(values, &mut row[1..=nx]);
                }
                if boundary == Boundary::Periodic {
                    row[0] = row[nx];
                    row[nx + 1] = row[1];
                }
            }
        }
    }

    fn find_parts(&mut self, y: usize, needed: &Needed) {
        let nx = self.part.len();
        let middle = Self::place(1, y);
        let own = &self.rank[middle][1..=nx];
        for (part, &square) in self.part.iter_mut().zip(&self.reach[middle][1..]) {
            *part = square <= 0.0;
        }
        for step in (0..27).filter(|&i| i != MIDDLE).map(step) {
            let (row, shift) = Self::neighbour(y, step);
            mark_parts(
                &mut self.part,
                (&self.reach[row][shift..], &self.needed[needed.kind(step)]),
                (&self.rank[row][shift..], own),
            );
        }
    }

    /// In which row a neighbour is kept, and where the neighbour of the first voxel is in it.
    const fn neighbour(y: usize, [dz, dy, dx]: [i32; 3]) -> (usize, usize) {
        (Self::place((dz + 1) as usize, y + (dy + 3) as usize), (dx + 1) as usize)
    }

    fn ball(&self, at: [usize; 3], shape: [usize; 3], needed: &Needed) -> Ball {
        let [_, y, x] = at;
        let mut around = Around { reach: [0.0; BLOCK], rank: [0.0; BLOCK] };
        for (i, row) in (0..9).map(|i| (3 * i, Self::place(i / 3, y + i % 3 + 2))) {
            around.reach[i..i + 3].copy_from_slice(&self.reach[row][x..x + 3]);
            around.rank[i..i + 3].copy_from_slice(&self.rank[row][x..x + 3]);
        }
        let (reach, rank) = (around.reach[MIDDLE], around.rank[MIDDLE]);
        let neighbour = leaves_least(&around, later(at, shape), &needed.lengths);
        Ball {
            at: at.map(|i| i as u16),
            step: neighbour.map_or([0; 3], |i| step(i).map(|step| step as i8)),
            reach: needed.inside(reach),
            neighbour: neighbour.map_or(0.0, |i| needed.inside(around.reach[i])),
            rank,
        }
    }
}

/// The balls of a voxel and its neighbours, and a few that are none.
struct Around {
    reach: [f32; BLOCK],
    rank: [f32; BLOCK],
}

/// The neighbour as thick whose ball leaves least of that in the middle: what it leaves begins
/// farthest out.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn leaves_least(around: &Around, later: u32, lengths: &[f32; BLOCK]) -> Option<usize> {
    let (reach, rank) = (around.reach[MIDDLE], around.rank[MIDDLE]);
    let mut beyond = [f32::NEG_INFINITY; BLOCK];
    for i in 0..BLOCK {
        let (other, other_rank) = (around.reach[i], around.rank[i]);
        let as_thick = other > reach || (other >= reach && later >> i & 1 == 1);
        let from = (other - lengths[i] * lengths[i] - reach) / (2.0 * lengths[i]);
        let leads = other_rank > rank || (other_rank >= rank && as_thick);
        beyond[i] = if leads { from } else { f32::NEG_INFINITY };
    }
    let most = largest(&beyond);
    let mut which = 0;
    for (i, &from) in beyond.iter().enumerate() {
        which |= u32::from(from >= most) << i;
    }
    (most > f32::NEG_INFINITY).then_some(which.trailing_zeros() as usize)
}

/// Halves the values, a power of two, until one is left, which vectorises.
#[inline(always)]
fn largest(values: &[f32; BLOCK]) -> f32 {
    let mut values = *values;
    let mut width = BLOCK / 2;
    while width > 0 {
        for i in 0..width {
            if values[i + width] > values[i] {
                values[i] = values[i + width];
            }
        }
        width /= 2;
    }
    values[0]
}

/// Which neighbours come later in the volume than a voxel, as bits.
fn later(at: [usize; 3], shape: [usize; 3]) -> u32 {
    if (0..3).all(|axis| at[axis] > 0 && at[axis] + 1 < shape[axis]) {
        return u32::MAX << (MIDDLE + 1);
    }
    (0..27).filter(|&i| comes_after(at, step(i), shape)).fold(0, |bits, i| bits | 1 << i)
}

/// Whether a neighbour comes after a voxel in the volume.
fn comes_after(at: [usize; 3], step: [i32; 3], shape: [usize; 3]) -> bool {
    let other = [0, 1, 2].map(|axis| {
        let n = shape[axis];
        (at[axis] + n).wrapping_add_signed(step[axis] as isize) % n
    });
    other > at
}

/// A class along one axis, one along two, and that along three.
const BY_AXES: [usize; 3] = [1, 3, 7];

/// Along which axes a neighbour differs, as bits.
const fn class([dz, dy, dx]: [i32; 3]) -> usize {
    4 * (dz & 1) as usize + 2 * (dy & 1) as usize + (dx & 1) as usize
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn mark_parts(part: &mut [bool], squares: (&[f32], &[f32]), ranks: (&[f32], &[f32])) {
    let squares = squares.0.iter().zip(squares.1);
    let ranks = ranks.0.iter().zip(ranks.1);
    for ((part, (square, needed)), (rank, own)) in part.iter_mut().zip(squares).zip(ranks) {
        let holds = square >= needed;
        *part |= holds && rank >= own;
    }
}

/// The squared distance that a neighbour must have for its ball to hold that of a voxel.
struct Needed {
    /// By squared distance in voxels, and by how many axes the neighbour differs along.
    table: Option<Vec<[f32; 3]>>,
    /// Distance of each neighbour; never 0.
    lengths: [f32; BLOCK],
    cubic: bool,
}

impl Needed {
    fn new(space: &Space, most: f32) -> Self {
        let most = (most / 4.0) as usize;
        let table = space.is_cubic() && most <= LARGEST_IN_TABLE.pow(2);
        Self {
            table: table.then(|| Self::table(most)),
            lengths: std::array::from_fn(|i| {
                let step = step(if i == MIDDLE { 0 } else { i % 27 });
                let along = |axis: usize| (f64::from(step[axis]) * space.size[axis]).powi(2);
                (0..3).map(along).sum::<f64>().sqrt() as f32
            }),
            cubic: space.is_cubic(),
        }
    }

    /// Takes so much off a square that no rounding reaches the voxels outside.
    fn inside(&self, square: f32) -> f32 {
        if self.cubic { square - SHORT } else { square * (1.0 - 1e-6) }
    }

    /// Where squares are whole numbers, a ball of a voxel may lie in that of a neighbour though its
    /// real one does not (Rémy and Thiel 2002). The farthest voxel v of a ball from the neighbour
    /// at −e has the square |v|² + 2 v·e + |e|²; the neighbour's must be larger by one at least.
    fn table(most: usize) -> Vec<[f32; 3]> {
        let mut sums = vec![[None::<usize>; 3]; most + 1];
        let root = most.isqrt();
        for a in 0..=root {
            for b in 0..=a.min((most - a * a).isqrt()) {
                for c in 0..=b.min((most - a * a - b * b).isqrt()) {
                    let of = &mut sums[a * a + b * b + c * c];
                    for (largest, sum) in of.iter_mut().zip([a, a + b, a + b + c]) {
                        *largest = (*largest).max(Some(sum));
                    }
                }
            }
        }
        let mut farthest = [0; 3];
        let mut needed = vec![[0.0; 3]; most + 1];
        for square in 1..=most {
            for axes in 0..3 {
                if let Some(sum) = sums[square - 1][axes] {
                    farthest[axes] = farthest[axes].max(square - 1 + 2 * sum + axes + 1);
                }
                needed[square][axes] = 4.0 * (farthest[axes] + 1) as f32;
            }
        }
        needed
    }

    /// The class that stands for that of a step: in cubes all along as many axes are alike.
    fn kind(&self, step: [i32; 3]) -> usize {
        let class = class(step);
        if self.table.is_some() { BY_AXES[class.count_ones() as usize - 1] } else { class }
    }

    fn fill(&self, squares: &[f32], needed: &mut [Vec<f32>; 8]) {
        if let Some(table) = &self.table {
            for (x, &square) in squares.iter().enumerate() {
                let by_axes = table[(square as u32 / 4) as usize];
                for (class, value) in BY_AXES.into_iter().zip(by_axes) {
                    needed[class][x] = value;
                }
            }
        } else {
            for i in 0..MIDDLE {
                for (needed, square) in needed[class(step(i))].iter_mut().zip(squares) {
                    *needed = (square.sqrt() + self.lengths[i]).powi(2) * (1.0 + 4e-6);
                }
            }
        }
    }
}
