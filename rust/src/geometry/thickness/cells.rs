//! The cells of a volume that balls are kept in.

use super::Space;
use super::ridge::Ball;
use crate::geometry::distance::window::Lane;
use crate::volume::Boundary;

/// Edge of a cell in voxels.
pub(super) const CELL: usize = 16;

/// A ball in the period that is meant.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Placed<T> {
    /// The voxel in the middle, seen from the first of a block.
    pub at: [i32; 3],
    pub ball: Ball<T>,
}

impl<T> Placed<T> {
    /// The voxel a step from the middle.
    #[inline(always)]
    pub(super) fn beside(&self, along: [i32; 3]) -> [i32; 3] {
        [0, 1, 2].map(|axis| self.at[axis] + along[axis])
    }
}

/// The first and the last voxel of a block.
#[derive(Debug, Clone, Copy)]
pub(super) struct Extent {
    pub low: [i32; 3],
    pub high: [i32; 3],
}

/// The balls in [`CELL`] planes, cell by cell.
pub(super) struct Slab<T> {
    balls: Vec<Ball<T>>,
    /// Where the balls of each cell begin, in C order of the cells, and where the last end.
    starts: Vec<usize>,
    /// The largest reach in each cell.
    reaches: Vec<T>,
}

/// Puts a ball into its cell, given the voxel in its middle; returns which of the slab that is.
/// `per_row` is how many cells there are along x.
pub(super) fn put<T>(ball: &mut Ball<T>, at: [usize; 3], per_row: usize) -> u32 {
    ball.place = at.iter().fold(0, |place, at| place * CELL + at % CELL) as u16;
    (at[1] / CELL * per_row + at[2] / CELL) as u32
}

impl<T: Lane + Default> Slab<T> {
    /// Sorts balls, each with its cell, of which there are so many.
    pub(super) fn new(unsorted: &[(u32, Ball<T>)], cells: usize) -> Self {
        let mut starts = vec![0; cells + 1];
        let mut reaches = vec![T::default(); cells];
        for &(cell, ball) in unsorted {
            let cell = cell as usize;
            starts[cell + 1] += 1;
            if ball.reach > reaches[cell] {
                reaches[cell] = ball.reach;
            }
        }
        for cell in 0..cells {
            starts[cell + 1] += starts[cell];
        }
        let mut next = starts.clone();
        let mut balls = vec![Ball::default(); unsorted.len()];
        for &(cell, ball) in unsorted {
            let place = &mut next[cell as usize];
            balls[*place] = ball;
            *place += 1;
        }
        Self { balls, starts, reaches }
    }
}

/// The balls of a volume, by the cell that their centres lie in.
pub(super) struct Cells<T> {
    slabs: Vec<Slab<T>>,
    /// The largest reach of all.
    reach: f32,
    /// Edges of the volume.
    edges: [usize; 3],
    /// Edges of a voxel.
    size: [f32; 3],
    boundary: Boundary,
}

/// A cell along an axis.
struct Along {
    number: usize,
    /// Its first voxel, in the period that is meant, seen from the first of a block.
    first: i32,
    /// Squares of the distances of its voxels from the block, and the least of them.
    squares: [f32; CELL],
    gap: f32,
}

impl<T: Lane + Default> Cells<T> {
    pub(super) fn new(slabs: Vec<Slab<T>>, shape: (usize, usize, usize), space: &Space) -> Self {
        let reaches = slabs.iter().flat_map(|slab| &slab.reaches).map(|reach| reach.square());
        let reach = reaches.fold(0.0, f32::max);
        let size = space.size.map(|edge| edge as f32);
        Self { slabs, reach, edges: shape.into(), size, boundary: space.boundary }
    }

    /// The largest reach of all.
    pub(super) const fn reach(&self) -> f32 {
        self.reach
    }

    /// Finds the balls that reach into a block; returns how many they are, the first that are found.
    pub(super) fn reaching(&self, extent: &Extent, found: &mut Vec<Placed<T>>) -> usize {
        let (mut count, per_row) = (0, self.edges[2].div_ceil(CELL));
        let [along_z, along_y, along_x] = [0, 1, 2].map(|axis| self.reaching_along(extent, axis));
        for z in &along_z {
            let slab = &self.slabs[z.number];
            for y in &along_y {
                for x in &along_x {
                    let cell = y.number * per_row + x.number;
                    if z.gap + y.gap + x.gap < slab.reaches[cell].square() {
                        let balls = &slab.balls[slab.starts[cell]..slab.starts[cell + 1]];
                        count = gather(balls, [z, y, x], count, found);
                    }
                }
            }
        }
        count
    }

    /// Cells along an axis that hold balls which may reach a block.
    fn reaching_along(&self, extent: &Extent, axis: usize) -> Vec<Along> {
        let edge = self.edges[axis];
        let length = edge as f32 * self.size[axis];
        let periods = match self.boundary {
            Boundary::Open => 0,
            Boundary::Periodic => (self.reach.sqrt() / length).ceil() as i32,
        };
        let [low, high] = [extent.low[axis], extent.high[axis]];
        let mut found = Vec::new();
        for period in -periods..=periods {
            for number in 0..edge.div_ceil(CELL) {
                let first = (number * CELL) as i32 + period * edge as i32;
                let squares = std::array::from_fn(|i| {
                    let place = first + i as i32;
                    let gap = (low - place).max(place - high).max(0);
                    (gap as f32 * self.size[axis]).powi(2)
                });
                let gap = squares.iter().copied().fold(f32::INFINITY, f32::min);
                if gap < self.reach {
                    found.push(Along { number, first: first - low, squares, gap });
                }
            }
        }
        found
    }
}

/// Puts the balls of a cell that reach into a block after those that are found; returns how many they
/// are then.
fn gather<T: Lane + Default>(
    balls: &[Ball<T>],
    along: [&Along; 3],
    mut count: usize,
    found: &mut Vec<Placed<T>>,
) -> usize {
    if found.len() < count + balls.len() {
        found.resize(2 * (count + balls.len()), Placed::default());
    }
    for &ball in balls {
        let place = usize::from(ball.place);
        let within = [place / CELL / CELL, place / CELL % CELL, place % CELL];
        let (mut at, mut square) = ([0; 3], 0.0);
        for axis in 0..3 {
            at[axis] = along[axis].first + within[axis] as i32;
            square += along[axis].squares[within[axis] % CELL];
        }
        // Without a branch, which could not be foreseen.
        found[count] = Placed { at, ball };
        count += usize::from(square < ball.reach.square());
    }
    count
}
