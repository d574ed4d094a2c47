//! Painting tiles of a volume with balls, thickest first.

use multiversion::multiversion;
use ndarray::{ArrayView3, ArrayViewMut3, Axis, s};

use super::Space;
use super::cells::{Cells, Extent, Placed};
use super::ridge::Ball;
use super::sections::{Discs, LANES, Roots, Sections, whole};
use super::steps::{STEPS, Step};
use crate::bits::pack;
use crate::error::Result;
use crate::geometry::distance::window::Lane;
use crate::monitor::Monitor;

/// Edge of a tile in voxels: a row is a word of bits.
pub(super) const TILE: usize = u64::BITS as usize;

/// Words of a plane: a few more than there are rows, so that lanes may go on beyond the last.
const ROWS: usize = TILE + LANES;

/// Cuts a volume into tiles, each with the place of its first voxel.
pub(super) fn tiles(out: ArrayViewMut3<'_, f32>) -> Vec<([usize; 3], ArrayViewMut3<'_, f32>)> {
    let mut tiles = vec![([0; 3], out)];
    for axis in 0..3 {
        let mut cut = Vec::new();
        for (mut origin, mut rest) in tiles {
            while rest.len_of(Axis(axis)) > TILE {
                let (tile, others) = rest.split_at(Axis(axis), TILE);
                cut.push((origin, tile));
                origin[axis] += TILE;
                rest = others;
            }
            cut.push((origin, rest));
        }
        tiles = cut;
    }
    tiles
}

/// Writes the thickness of a tile.
pub(super) fn fill<T: Lane + Default>(
    Work { tile, found, order, next }: &mut Work<T>,
    (cells, discs): (&Cells<T>, &Discs),
    phase: ArrayView3<'_, bool>,
    space: &Space,
    origin: [usize; 3],
    mut out: ArrayViewMut3<'_, f32>,
    monitor: &Monitor<'_>,
) -> Result<()> {
    let (z, y, x) = out.dim();
    let [from_z, from_y, from_x] = origin;
    let phase = phase.slice(s![from_z..from_z + z, from_y..from_y + y, from_x..from_x + x]);
    tile.begin(phase);
    if tile.rows == 0 {
        out.fill(0.0);
        return Ok(());
    }
    let low = origin.map(|from| from as i32);
    let extent = Extent { low, high: [0, 1, 2].map(|i| low[i] + [z, y, x][i] as i32 - 1) };
    let found = {
        let count = cells.reaching(&extent, found);
        &found[..count]
    };
    // Thickest first: the bits of larger numbers are larger.
    order.clear();
    let key = |(i, placed): (usize, &Placed<T>)| {
        u64::from(!placed.ball.rank.square().to_bits()) << 32 | i as u64
    };
    order.extend(found.iter().enumerate().map(key));
    order.sort_unstable();
    for order in order.chunks(1024) {
        monitor.check()?;
        // Fetched all at once, since one does not wait for another then.
        next.clear();
        next.extend(order.iter().map(|&number| found[number as u32 as usize]));
        paint(tile, next, space, discs);
        if tile.rows == 0 {
            break;
        }
    }
    for (z, mut plane) in out.outer_iter_mut().enumerate() {
        for (y, mut row) in plane.outer_iter_mut().enumerate() {
            if let Some(row) = row.as_slice_mut() {
                to_diameters(&tile.painted[(z * TILE + y) * TILE..][..row.len()], space, row);
            }
        }
    }
    Ok(())
}

/// Writes the diameters of balls, given their ranks.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn to_diameters<T: Lane>(ranks: &[T], space: &Space, out: &mut [f32]) {
    for (out, rank) in out.iter_mut().zip(ranks) {
        *out = space.diameter(rank.square());
    }
}

/// Paints balls. Everything below is inlined here, so that it is compiled for the processor.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512vl+avx512dq+bmi1+bmi2",
    "x86_64+avx2+bmi1+bmi2"
))]
fn paint<T: Lane + Default>(tile: &mut Tile<T>, balls: &[Placed<T>], space: &Space, discs: &Discs) {
    for placed in balls {
        tile.paint(placed, space, discs);
    }
}

/// Room to work on a tile.
pub(super) struct Work<T> {
    tile: Tile<T>,
    found: Vec<Placed<T>>,
    order: Vec<u64>,
    /// Balls that are next in the order.
    next: Vec<Placed<T>>,
}

impl<T: Lane + Default> Default for Work<T> {
    fn default() -> Self {
        Self { tile: Tile::default(), found: Vec::new(), order: Vec::new(), next: Vec::new() }
    }
}

/// What has been painted of a tile, and the voxels of the phase that wait for a ball.
struct Tile<T> {
    /// The ranks of voxels, [`TILE`] a row, as many rows a plane; 0 where none was painted.
    painted: Vec<T>,
    /// A row in each word, [`ROWS`] words a plane.
    waiting: Vec<u64>,
    /// Of each row along x, the planes in which some wait.
    planes: [u64; ROWS],
    /// Rows in which some wait.
    rows: usize,
}

impl<T: Lane + Default> Default for Tile<T> {
    fn default() -> Self {
        Self {
            painted: vec![T::default(); TILE.pow(3)],
            waiting: vec![0; TILE * ROWS],
            planes: [0; ROWS],
            rows: 0,
        }
    }
}

impl<T: Lane + Default> Tile<T> {
    /// All voxels of a phase wait.
    fn begin(&mut self, phase: ArrayView3<'_, bool>) {
        self.painted.fill(T::default());
        self.waiting.fill(0);
        (self.planes, self.rows) = ([0; ROWS], 0);
        for (z, plane) in phase.outer_iter().enumerate() {
            for (y, row) in plane.outer_iter().enumerate() {
                let bits = row.as_slice().map_or_else(
                    || row.iter().rev().fold(0, |bits, &inside| bits << 1 | u64::from(inside)),
                    pack,
                );
                self.waiting[z * ROWS + y] = bits;
                self.planes[y] |= u64::from(bits != 0) << z;
                self.rows += usize::from(bits != 0);
            }
        }
    }

    /// Gives the voxels of a ball that wait its rank, but for those in its neighbour's ball: that
    /// one came before, or one that has the same voxels did.
    #[inline(always)]
    fn paint(&mut self, placed: &Placed<T>, space: &Space, discs: &Discs) {
        let Placed { at, ball } = placed;
        let step = &space.steps.all[usize::from(ball.step) % STEPS];
        let part = Part::new(ball, step);
        let [depths, heights] = [0, 1].map(|axis| part.along(axis, *at, space));
        if discs.hold(ball) {
            let sections = discs.sections(placed, step.along);
            self.paint_sections(&sections, ball.rank, [depths, heights]);
        } else {
            let sections = Roots::new(placed, step.along, space, part.along(2, *at, space));
            self.paint_sections(&sections, ball.rank, [depths, heights]);
        }
    }

    #[inline(always)]
    fn paint_sections(&mut self, sections: &impl Sections, rank: T, [depths, heights]: [u64; 2]) {
        let (first, last) = (heights.trailing_zeros(), u64::BITS - heights.leading_zeros());
        for y in (first as usize..last as usize).step_by(LANES) {
            let Some(planes) = self.planes[y..].first_chunk::<LANES>() else { continue };
            let mut planes = planes.iter().fold(0, |some, planes| some | planes) & depths;
            // Two balls of three find no one: to look at all planes first takes no branch for each.
            let mut hit = 0;
            while planes != 0 {
                let z = planes.trailing_zeros() as usize;
                planes &= planes - 1;
                if let Some(waiting) = self.waiting[z * ROWS + y..].first_chunk() {
                    let hits = sections.hits([z, y], waiting);
                    hit |= u64::from(hits.iter().fold(0, |any, hits| any | hits) != 0) << z;
                }
            }
            while hit != 0 {
                self.paint_rows(sections, rank, [hit.trailing_zeros() as usize, y]);
                hit &= hit - 1;
            }
        }
    }

    /// Paints what is hit of [`LANES`] rows.
    #[inline(always)]
    fn paint_rows(&mut self, sections: &impl Sections, rank: T, [z, y]: [usize; 2]) {
        let Some(waiting) = self.waiting[z * ROWS + y..].first_chunk_mut() else { return };
        let hits = sections.hits([z, y], waiting);
        let mut rows = 0;
        for (i, bits) in hits.iter().enumerate() {
            rows |= u32::from(*bits != 0) << i;
        }
        while rows != 0 {
            let i = rows.trailing_zeros() as usize % LANES;
            rows &= rows - 1;
            let mut bits = hits[i];
            waiting[i] &= !bits;
            if waiting[i] == 0 {
                self.planes[y + i] &= !(1 << z);
                self.rows -= 1;
            }
            let row = &mut self.painted[(z * TILE + y + i) * TILE..][..TILE];
            while bits != 0 {
                row[bits.trailing_zeros() as usize] = rank;
                bits &= bits - 1;
            }
        }
    }
}

/// The part of a ball that may not lie in its neighbour's, as it ends along each axis.
struct Part {
    low: [f32; 3],
    high: [f32; 3],
}

impl Part {
    #[inline(always)]
    fn new<T: Lane>(ball: &Ball<T>, step: &Step) -> Self {
        let (reach, neighbour) = (ball.reach.square(), ball.neighbour.square());
        let begins = if neighbour > 0.0 { step.begins(reach, neighbour) } else { -reach };
        let (low, high) = step.ends(reach, begins);
        Self { low, high }
    }

    /// The planes, rows or places in rows of a tile that have some of it, as bits.
    #[inline(always)]
    fn along(&self, axis: usize, at: [i32; 3], space: &Space) -> u64 {
        let (low, high) = (self.low[axis], self.high[axis]);
        // No rounding may leave out a voxel.
        let slack = 1e-3 * (1.0 + high - low);
        let by_edge = space.by_edge[axis];
        let low = at[axis] + whole((low - slack) * by_edge + 0.5);
        let high = at[axis] + whole((high + slack) * by_edge - 0.5);
        span(low, high)
    }
}

/// The places of a tile from one to another, as bits.
#[inline(always)]
fn span(low: i32, high: i32) -> u64 {
    let last = TILE as i32 - 1;
    let (low, high) = (low.max(0), high.min(last));
    if low > high { 0 } else { (u64::MAX << low) & (u64::MAX >> (last - high)) }
}
