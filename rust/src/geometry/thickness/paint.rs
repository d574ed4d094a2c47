//! Painting tiles of a volume with balls, thickest first.

use multiversion::multiversion;
use ndarray::{ArrayView3, ArrayViewMut3, Axis, s};

use super::Space;
use super::cells::{Cells, Extent, Placed};
use super::sections::{Discs, LANES, Roots, Section};
use super::steps::{STEPS, Step};
use crate::bits::pack;
use crate::error::Result;
use crate::geometry::distance::window::Lane;
use crate::monitor::Monitor;

/// Edge of a tile in voxels: a row is a word of bits.
pub(super) const TILE: usize = u64::BITS as usize;

/// Words of a plane: a few more than there are rows, so that lanes may go on beyond the last.
const PLANE: usize = TILE + LANES;

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
    Work { tile, found, order }: &mut Work<T>,
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
    if tile.planes == 0 {
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
        paint(tile, found, order, space, discs);
        if tile.planes == 0 {
            break;
        }
    }
    for (z, mut plane) in out.outer_iter_mut().enumerate() {
        for (y, mut row) in plane.outer_iter_mut().enumerate() {
            let painted = &tile.painted[(z * TILE + y) * TILE..];
            row.iter_mut().zip(painted).for_each(|(out, &painted)| *out = painted);
        }
    }
    Ok(())
}

/// Paints balls in an order, their numbers in the lower half. Everything below is inlined here, so
/// that it is compiled for the processor.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512vl+avx512dq+bmi1+bmi2",
    "x86_64+avx2+bmi1+bmi2"
))]
fn paint<T: Lane>(
    tile: &mut Tile,
    found: &[Placed<T>],
    order: &[u64],
    space: &Space,
    discs: &Discs,
) {
    for &number in order {
        tile.paint(&found[number as u32 as usize], space, discs);
    }
}

/// Room to work on a tile.
pub(super) struct Work<T> {
    tile: Tile,
    found: Vec<Placed<T>>,
    order: Vec<u64>,
}

impl<T> Default for Work<T> {
    fn default() -> Self {
        Self { tile: Tile::default(), found: Vec::new(), order: Vec::new() }
    }
}

/// What has been painted of a tile, and the voxels of the phase that wait for a ball.
struct Tile {
    /// [`TILE`] voxels a row, as many rows a plane.
    painted: Vec<f32>,
    /// A row in each word, [`PLANE`] words a plane.
    waiting: Vec<u64>,
    /// The rows of each plane that have some.
    rows: [u64; TILE],
    /// The planes that have some.
    planes: u64,
}

impl Default for Tile {
    fn default() -> Self {
        Self {
            painted: vec![0.0; TILE.pow(3)],
            waiting: vec![0; TILE * PLANE],
            rows: [0; TILE],
            planes: 0,
        }
    }
}

impl Tile {
    /// All voxels of a phase wait.
    fn begin(&mut self, phase: ArrayView3<'_, bool>) {
        self.painted.fill(0.0);
        self.waiting.fill(0);
        (self.rows, self.planes) = ([0; TILE], 0);
        for (z, plane) in phase.outer_iter().enumerate() {
            for (y, row) in plane.outer_iter().enumerate() {
                let bits = row.as_slice().map_or_else(
                    || row.iter().rev().fold(0, |bits, &inside| bits << 1 | u64::from(inside)),
                    pack,
                );
                self.waiting[z * PLANE + y] = bits;
                self.rows[z] |= u64::from(bits != 0) << y;
            }
            self.planes |= u64::from(self.rows[z] != 0) << z;
        }
    }

    /// Gives the voxels of a ball that wait its diameter, but for those in its neighbour's ball: that
    /// one came before, or one that has the same voxels did.
    #[inline(always)]
    fn paint<T: Lane>(&mut self, placed: &Placed<T>, space: &Space, discs: &Discs) {
        let ball = &placed.ball;
        let step = &space.steps.all[usize::from(ball.step) % STEPS];
        let [depths, heights, widths] = bounds(placed, step, space);
        let diameter = space.diameter(ball.rank.square());
        let tabled = discs.hold(ball);
        let mut planes = self.planes & depths;
        while planes != 0 {
            let z = planes.trailing_zeros() as usize;
            planes &= planes - 1;
            let rows = self.rows[z] & heights;
            if rows == 0 {
                continue;
            }
            if tabled {
                self.paint_plane(&discs.section(placed, step.along, z), diameter, z, rows);
            } else {
                let section = Roots::new(placed, step.along, space, z, widths);
                self.paint_plane(&section, diameter, z, rows);
            }
        }
    }

    #[inline(always)]
    fn paint_plane(&mut self, section: &impl Section, diameter: f32, z: usize, rows: u64) {
        let (first, last) = (rows.trailing_zeros(), u64::BITS - rows.leading_zeros());
        for y in (first as usize..last as usize).step_by(LANES) {
            let Some(words) = self.waiting[z * PLANE + y..].first_chunk_mut() else { continue };
            let mut hits = [0; LANES];
            if !section.find_hits(y, words, &mut hits) {
                continue;
            }
            for (i, mut bits) in hits.into_iter().enumerate().filter(|(_, bits)| *bits != 0) {
                words[i] &= !bits;
                if words[i] == 0 {
                    self.rows[z] &= !(1 << (y + i));
                }
                let row = &mut self.painted[(z * TILE + y + i) * TILE..][..TILE];
                while bits != 0 {
                    row[bits.trailing_zeros() as usize] = diameter;
                    bits &= bits - 1;
                }
            }
        }
        if self.rows[z] == 0 {
            self.planes &= !(1 << z);
        }
    }
}

/// The planes, rows and places in rows of a tile that have voxels of a ball which may not lie in its
/// neighbour's, as bits.
#[inline(always)]
fn bounds<T: Lane>(Placed { at, ball }: &Placed<T>, step: &Step, space: &Space) -> [u64; 3] {
    let (reach, neighbour) = (ball.reach.square(), ball.neighbour.square());
    let begins = if neighbour > 0.0 { step.begins(reach, neighbour) } else { -reach };
    let (low, high) = step.ends(reach, begins);
    let mut spans = [0; 3];
    for axis in 0..3 {
        // No rounding may leave out a voxel.
        let slack = 1e-3 * (1.0 + high[axis] - low[axis]);
        let by_edge = space.by_edge[axis];
        let low = at[axis] + ((low[axis] - slack) * by_edge).ceil() as i32;
        let high = at[axis] + ((high[axis] + slack) * by_edge).floor() as i32;
        spans[axis] = span(low, high);
    }
    spans
}

/// The places of a tile from one to another, as bits.
#[inline(always)]
fn span(low: i32, high: i32) -> u64 {
    let last = TILE as i32 - 1;
    let (low, high) = (low.max(0), high.min(last));
    if low > high { 0 } else { (u64::MAX << low) & (u64::MAX >> (last - high)) }
}
