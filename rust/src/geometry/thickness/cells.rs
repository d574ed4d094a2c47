//! The cells of a volume that balls are kept in.

use super::Space;
use super::ridge::Ball;
use crate::volume::Boundary;

/// Edge of a cell in voxels.
pub(super) const CELL: usize = 16;

/// A ball in the period that is meant.
#[derive(Debug, Clone, Copy)]
pub(super) struct Placed {
    /// The voxel in the middle, seen from the first of a block.
    pub at: [i32; 3],
    pub ball: Ball,
}

/// The first and the last voxel of a block.
#[derive(Debug, Clone, Copy)]
pub(super) struct Extent {
    pub low: [i32; 3],
    pub high: [i32; 3],
}

/// Steps from one interval to another.
fn gap(low: i32, high: i32, other_low: i32, other_high: i32) -> i32 {
    (low - other_high).max(other_low - high).max(0)
}

/// The balls in [`CELL`] planes, cell by cell.
pub(super) struct Slab {
    balls: Vec<Ball>,
    /// Where the balls of each cell begin, in C order of the cells.
    starts: Vec<usize>,
    /// Largest reach in each cell.
    reaches: Vec<f32>,
}

impl Slab {
    /// Sorts balls into cells; `plane` are the edges of the volume along y and x.
    pub(super) fn new(unsorted: &[Ball], plane: [usize; 2]) -> Self {
        let [count_y, count_x] = plane.map(|n| n.div_ceil(CELL));
        let number = |ball: &Ball| {
            let [y, x] = [ball.at[1], ball.at[2]].map(|at| usize::from(at) / CELL);
            y * count_x + x
        };
        let mut starts = vec![0; count_y * count_x + 1];
        let mut reaches = vec![0.0f32; count_y * count_x];
        for ball in unsorted {
            let cell = number(ball);
            starts[cell + 1] += 1;
            reaches[cell] = reaches[cell].max(ball.reach);
        }
        for cell in 1..starts.len() {
            starts[cell] += starts[cell - 1];
        }
        let mut next = starts.clone();
        let mut balls = vec![Ball::default(); unsorted.len()];
        for ball in unsorted {
            let place = &mut next[number(ball)];
            balls[*place] = *ball;
            *place += 1;
        }
        Self { balls, starts, reaches }
    }
}

/// The balls of a volume, by the cell that their centres lie in.
pub(super) struct Cells {
    slabs: Vec<Slab>,
    /// The largest reach of all.
    reach: f32,
    /// Edges of the volume.
    edges: [usize; 3],
    /// Edges of a voxel.
    size: [f32; 3],
    boundary: Boundary,
}

impl Cells {
    pub(super) fn new(slabs: Vec<Slab>, shape: (usize, usize, usize), space: &Space) -> Self {
        let reaches = slabs.iter().flat_map(|slab| &slab.reaches);
        let reach = reaches.copied().fold(0.0, f32::max);
        let size = space.size.map(|edge| edge as f32);
        Self { slabs, reach, edges: shape.into(), size, boundary: space.boundary }
    }

    /// The largest reach of all.
    pub(super) const fn reach(&self) -> f32 {
        self.reach
    }

    /// The balls that reach into a block, thickest first.
    pub(super) fn reaching(&self, extent: &Extent) -> Vec<Placed> {
        let [along_z, along_y, along_x] = [0, 1, 2].map(|axis| self.reaching_along(extent, axis));
        let per_row = self.edges[2].div_ceil(CELL);
        let mut found = Vec::new();
        for &(z, shift_z, gap_z) in &along_z {
            let slab = &self.slabs[z];
            for &(y, shift_y, gap_y) in &along_y {
                for &(x, shift_x, gap_x) in &along_x {
                    let cell = y * per_row + x;
                    if gap_z + gap_y + gap_x < slab.reaches[cell] {
                        let own = &slab.balls[slab.starts[cell]..slab.starts[cell + 1]];
                        self.gather(own, [shift_z, shift_y, shift_x], extent, &mut found);
                    }
                }
            }
        }
        found.sort_unstable_by(|a, b| b.ball.rank.total_cmp(&a.ball.rank));
        found
    }

    /// Cells along an axis that hold balls which may reach a block: number, shift to the period
    /// that is meant, square of the distance.
    fn reaching_along(&self, extent: &Extent, axis: usize) -> Vec<(usize, i32, f32)> {
        let edge = self.edges[axis];
        let length = edge as f32 * self.size[axis];
        let periods = match self.boundary {
            Boundary::Open => 0,
            Boundary::Periodic => (self.reach.sqrt() / length).ceil() as i32,
        };
        let mut found = Vec::new();
        for period in -periods..=periods {
            let shift = period * edge as i32;
            for cell in 0..edge.div_ceil(CELL) {
                let low = (cell * CELL) as i32 + shift;
                let gap = gap(extent.low[axis], extent.high[axis], low, low + CELL as i32 - 1);
                let square = (gap as f32 * self.size[axis]).powi(2);
                if square < self.reach {
                    found.push((cell, shift, square));
                }
            }
        }
        found
    }

    /// Adds the balls that reach into a block.
    fn gather(&self, balls: &[Ball], shift: [i32; 3], extent: &Extent, found: &mut Vec<Placed>) {
        for ball in balls {
            let mut at = [0; 3];
            let mut nearest = 0.0;
            for axis in 0..3 {
                let place = i32::from(ball.at[axis]) + shift[axis];
                at[axis] = place - extent.low[axis];
                let gap = gap(extent.low[axis], extent.high[axis], place, place);
                nearest += (gap as f32 * self.size[axis]).powi(2);
            }
            if nearest < ball.reach {
                found.push(Placed { at, ball: *ball });
            }
        }
    }
}
