//! Balls, and the cells of the volume that they are kept in.

use multiversion::multiversion;

use super::Space;
use crate::volume::Boundary;

/// Edge of a cell in voxels.
pub(super) const CELL: usize = 16;

/// The voxels nearer to a place than a distance.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ball {
    pub at: [f32; 3],
    /// The distance squared.
    pub reach: f32,
    pub diameter: f32,
}

/// Centres of the first and the last voxel of a block.
#[derive(Debug, Clone, Copy)]
pub(super) struct Extent {
    pub low: [f32; 3],
    pub high: [f32; 3],
}

impl Extent {
    /// Squared distance to the nearest place of a block and to the farthest.
    #[inline(always)]
    fn squares_to(&self, place: [f32; 3]) -> (f32, f32) {
        let (mut nearest, mut farthest) = (0.0, 0.0);
        for (axis, &at) in place.iter().enumerate() {
            let near = gap(self.low[axis], self.high[axis], at, at);
            let far = larger(at - self.low[axis], self.high[axis] - at);
            nearest += near * near;
            farthest += far * far;
        }
        (nearest, farthest)
    }
}

/// Unlike `f32::max`, one instruction; there is no NaN here.
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// How far two intervals miss each other.
#[inline(always)]
fn gap(low: f32, high: f32, other_low: f32, other_high: f32) -> f32 {
    larger(larger(low - other_high, other_low - high), 0.0)
}

/// The balls of a volume, by the cell that their centres lie in.
pub(super) struct Cells {
    balls: Vec<Ball>,
    /// Where the balls of each cell begin, in C order of the cells.
    starts: Vec<usize>,
    /// Largest reach in each cell.
    reaches: Vec<f32>,
    /// The largest of all.
    reach: f32,
    count: [usize; 3],
    /// Edges of the volume.
    edges: [f32; 3],
    /// Edges of a cell.
    cell: [f32; 3],
    periodic: bool,
}

impl Cells {
    /// Sorts the balls of each slab of planes into cells.
    pub(super) fn new(slabs: Vec<Vec<Ball>>, shape: (usize, usize, usize), space: &Space) -> Self {
        let shape = [shape.0, shape.1, shape.2];
        let count = shape.map(|n| n.div_ceil(CELL));
        let cell = space.size.map(|edge| (edge * CELL as f64) as f32);
        let number = |at: f32, axis: usize| {
            // Half a voxel on, so that rounding does not matter.
            let voxel = at + 0.5 * space.size[axis] as f32;
            ((voxel / cell[axis]) as usize).min(count[axis] - 1)
        };
        let mut balls = Vec::with_capacity(slabs.iter().map(Vec::len).sum());
        let per_slab = count[1] * count[2];
        let mut starts = Vec::with_capacity(slabs.len() * per_slab + 1);
        let mut reaches = vec![0.0; slabs.len() * per_slab];
        for (slab, reaches) in slabs.into_iter().zip(reaches.chunks_mut(per_slab)) {
            let cells: Vec<usize> = slab
                .iter()
                .map(|ball| number(ball.at[1], 1) * count[2] + number(ball.at[2], 2))
                .collect();
            let mut sizes = vec![0; per_slab];
            for (&cell, ball) in cells.iter().zip(&slab) {
                sizes[cell] += 1;
                reaches[cell] = larger(reaches[cell], ball.reach);
            }
            let mut next = balls.len();
            let mut places: Vec<usize> = Vec::with_capacity(per_slab);
            for size in sizes {
                places.push(next);
                next += size;
            }
            starts.extend_from_slice(&places);
            balls.resize(next, Ball { at: [0.0; 3], reach: 0.0, diameter: 0.0 });
            for (&cell, &ball) in cells.iter().zip(&slab) {
                balls[places[cell]] = ball;
                places[cell] += 1;
            }
        }
        starts.push(balls.len());
        let reach = reaches.iter().copied().fold(0.0, f32::max);
        let edges = [0, 1, 2].map(|axis| (shape[axis] as f64 * space.size[axis]) as f32);
        let periodic = space.boundary == Boundary::Periodic;
        Self { balls, starts, reaches, reach, count, edges, cell, periodic }
    }

    /// The balls that reach into a block, thickest first, but for those that are no match for one
    /// that holds all of it.
    pub(super) fn reaching(&self, extent: &Extent) -> Balls {
        let [along_z, along_y, along_x] = [0, 1, 2].map(|axis| self.reaching_along(extent, axis));
        let mut found: Vec<Ball> = Vec::new();
        let mut least = 0.0;
        for &(z, shift_z, gap_z) in &along_z {
            for &(y, shift_y, gap_y) in &along_y {
                for &(x, shift_x, gap_x) in &along_x {
                    let cell = (z * self.count[1] + y) * self.count[2] + x;
                    if gap_z * gap_z + gap_y * gap_y + gap_x * gap_x >= self.reaches[cell] {
                        continue;
                    }
                    let own = &self.balls[self.starts[cell]..self.starts[cell + 1]];
                    gather(own, [shift_z, shift_y, shift_x], extent, &mut least, &mut found);
                }
            }
        }
        // Diameters are positive, so that their bits are in order; equal balls may change places.
        let mut order: Vec<(u32, u32)> = found
            .iter()
            .enumerate()
            .filter(|(_, ball)| ball.diameter >= least)
            .map(|(i, ball)| (!ball.diameter.to_bits(), i as u32))
            .collect();
        order.sort_unstable();
        let mut balls = Balls::default();
        for (_, i) in order {
            balls.push(&found[i as usize]);
        }
        balls
    }

    /// Cells along an axis that hold balls which may reach a block: number, shift to the period
    /// that is meant, distance.
    fn reaching_along(&self, extent: &Extent, axis: usize) -> Vec<(usize, f32, f32)> {
        let reach = self.reach.sqrt();
        let periods = if self.periodic { (reach / self.edges[axis]).ceil() as i32 } else { 0 };
        let mut found = Vec::new();
        for period in -periods..=periods {
            let shift = period as f32 * self.edges[axis];
            for cell in 0..self.count[axis] {
                let low = cell as f32 * self.cell[axis] + shift;
                let high = low + self.cell[axis];
                let gap = gap(extent.low[axis], extent.high[axis], low, high);
                if gap < reach {
                    found.push((cell, shift, gap));
                }
            }
        }
        found
    }
}

/// Adds the balls that reach into a block, if as thick as the thickest that holds all of it.
#[inline(always)]
fn gather(
    balls: &[Ball],
    shift: [f32; 3],
    extent: &Extent,
    least: &mut f32,
    found: &mut Vec<Ball>,
) {
    for ball in balls {
        let at = [ball.at[0] + shift[0], ball.at[1] + shift[1], ball.at[2] + shift[2]];
        let (nearest, farthest) = extent.squares_to(at);
        if nearest < ball.reach && ball.diameter >= *least {
            found.push(Ball { at, ..*ball });
            if farthest < ball.reach {
                *least = ball.diameter;
            }
        }
    }
}

/// Balls, thickest first, each number in a vector of its own.
#[derive(Debug, Default)]
pub(super) struct Balls {
    pub z: Vec<f32>,
    pub y: Vec<f32>,
    pub x: Vec<f32>,
    pub reach: Vec<f32>,
    pub diameter: Vec<f32>,
}

impl Balls {
    fn push(&mut self, ball: &Ball) {
        self.z.push(ball.at[0]);
        self.y.push(ball.at[1]);
        self.x.push(ball.at[2]);
        self.reach.push(ball.reach);
        self.diameter.push(ball.diameter);
    }

    /// Those that reach into a part of the block, up to the first that holds all of it.
    pub(super) fn reaching(&self, extent: &Extent) -> Self {
        let mut found = Self::default();
        for start in (0..self.reach.len()).step_by(LANES) {
            let (near, all) = compare(self, start, extent);
            let mut rest = near;
            while rest != 0 {
                let lane = rest.trailing_zeros();
                rest &= rest - 1;
                let i = start + lane as usize;
                found.push(&Ball {
                    at: [self.z[i], self.y[i], self.x[i]],
                    reach: self.reach[i],
                    diameter: self.diameter[i],
                });
                if all >> lane & 1 == 1 {
                    return found;
                }
            }
        }
        found
    }
}

const LANES: usize = 64;

/// Which of 64 balls reach into a block, and which hold all of it.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn compare(balls: &Balls, start: usize, extent: &Extent) -> (u64, u64) {
    let mut nearest = [0.0f32; LANES];
    let mut farthest = [0.0f32; LANES];
    let end = balls.reach.len().min(start + LANES);
    for (axis, places) in [&balls.z, &balls.y, &balls.x].into_iter().enumerate() {
        let (low, high) = (extent.low[axis], extent.high[axis]);
        let squares = nearest.iter_mut().zip(&mut farthest);
        for ((nearest, farthest), &at) in squares.zip(&places[start..end]) {
            let near = gap(low, high, at, at);
            let far = larger(at - low, high - at);
            *nearest += near * near;
            *farthest += far * far;
        }
    }
    let (mut near, mut all) = (0, 0);
    let reach = &balls.reach[start..end];
    for i in 0..reach.len().min(LANES) {
        near |= u64::from(nearest[i] < reach[i]) << i;
        all |= u64::from(farthest[i] < reach[i]) << i;
    }
    (near, all)
}
