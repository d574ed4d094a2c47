//! Painting tiles of a volume with balls, thickest first.

use multiversion::multiversion;
use ndarray::{ArrayView3, ArrayViewMut3, Axis, s};

use super::Space;
use super::cells::{Cells, Extent, Placed};
use super::ridge::Ball;
use crate::bits::pack;
use crate::error::Result;
use crate::monitor::Monitor;

/// Edge of a tile in voxels: a row is a word of bits.
pub(super) const TILE: usize = u64::BITS as usize;

/// Rows that are compared with a ball at once.
const LANES: usize = 8;

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
pub(super) fn fill(
    cells: &Cells,
    phase: ArrayView3<'_, bool>,
    space: &Space,
    origin: [usize; 3],
    mut out: ArrayViewMut3<'_, f32>,
    monitor: &Monitor<'_>,
) -> Result<()> {
    let (z, y, x) = out.dim();
    let [from_z, from_y, from_x] = origin;
    let phase = phase.slice(s![from_z..from_z + z, from_y..from_y + y, from_x..from_x + x]);
    let mut tile = Tile::new(phase);
    if tile.planes == 0 {
        out.fill(0.0);
        return Ok(());
    }
    let low = origin.map(|from| from as i32);
    let extent = Extent { low, high: [0, 1, 2].map(|i| low[i] + [z, y, x][i] as i32 - 1) };
    for balls in cells.reaching(&extent).chunks(1024) {
        monitor.check()?;
        paint(&mut tile, balls, space);
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

/// Paints balls. Everything below is inlined here, so that it is compiled for the processor.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512vl+avx512dq+bmi1+bmi2",
    "x86_64+avx2+bmi1+bmi2"
))]
fn paint(tile: &mut Tile, balls: &[Placed], space: &Space) {
    for ball in balls {
        tile.paint(ball, space);
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

impl Tile {
    fn new(phase: ArrayView3<'_, bool>) -> Self {
        let mut tile = Self {
            painted: vec![0.0; TILE.pow(3)],
            waiting: vec![0; TILE * PLANE],
            rows: [0; TILE],
            planes: 0,
        };
        for (z, plane) in phase.outer_iter().enumerate() {
            for (y, row) in plane.outer_iter().enumerate() {
                let bits = row.as_slice().map_or_else(
                    || row.iter().rev().fold(0, |bits, &inside| bits << 1 | u64::from(inside)),
                    pack,
                );
                tile.waiting[z * PLANE + y] = bits;
                tile.rows[z] |= u64::from(bits != 0) << y;
            }
            tile.planes |= u64::from(tile.rows[z] != 0) << z;
        }
        tile
    }

    /// Gives the voxels of a ball that wait its diameter, but for those in its neighbour's ball: that
    /// one came before, or one that has the same voxels did.
    #[inline(always)]
    fn paint(&mut self, placed: &Placed, space: &Space) {
        let size = space.size.map(|edge| edge as f32);
        let extents = extents(&placed.ball, size);
        let [depths, heights, widths] = [0, 1, 2].map(|i| span(placed.at[i], extents[i]));
        let mut planes = self.planes & depths;
        let diameter = space.diameter(placed.ball.rank);
        while planes != 0 {
            let z = planes.trailing_zeros() as usize;
            planes &= planes - 1;
            let rows = self.rows[z] & heights;
            if rows != 0 {
                self.paint_plane(placed, diameter, size, z, [rows, widths]);
            }
        }
    }

    #[inline(always)]
    fn paint_plane(
        &mut self,
        placed: &Placed,
        diameter: f32,
        size: [f32; 3],
        z: usize,
        [rows, widths]: [u64; 2],
    ) {
        let Placed { at, ball } = *placed;
        let [step_z, step_y, step_x] = ball.step.map(i32::from);
        let dz = z as i32 - at[0];
        let slice = Slice {
            own: ball.reach - square(dz, size[0]),
            other: ball.neighbour - square(dz - step_z, size[0]),
            at: [at[2], at[2] + step_x],
            widths,
            size: [size[1], size[2], size[2].recip()],
        };
        let (first, last) = (rows.trailing_zeros(), u64::BITS - rows.leading_zeros());
        for y in (first as usize..last as usize).step_by(LANES) {
            let dy = y as i32 - at[1];
            let Some(words) = self.waiting[z * PLANE + y..].first_chunk_mut() else { continue };
            let mut hits = [0; LANES];
            if !find_hits(&slice, [dy, dy - step_y], words, &mut hits) {
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

fn square(steps: i32, size: f32) -> f32 {
    let distance = steps as f32 * size;
    distance * distance
}

/// The places of a tile from one step from a place to another, as bits.
#[inline(always)]
fn span(at: i32, (low, high): (i32, i32)) -> u64 {
    let last = TILE as i32 - 1;
    let (low, high) = ((at + low).max(0), (at + high).min(last));
    if low > high { 0 } else { (u64::MAX << low) & (u64::MAX >> (last - high)) }
}

/// The first and the last step along each axis from the middle of a ball to what does not lie in its
/// neighbour's ball.
#[inline(always)]
fn extents(ball: &Ball, size: [f32; 3]) -> [(i32, i32); 3] {
    let radius = ball.reach.sqrt();
    let slack = 1e-3 * (1.0 + radius);
    // Truncation is towards the middle, by less than a step.
    let steps = |low: f32, high: f32, axis: usize| {
        (((low - slack) / size[axis]) as i32, ((high + slack) / size[axis]) as i32)
    };
    if ball.neighbour <= 0.0 {
        return [0, 1, 2].map(|axis| steps(-radius, radius, axis));
    }
    // What is left lies in the cap that begins so far out in the direction away from the neighbour:
    // it ends at its rim, or where the ball does if that is in the cap.
    let away = [0, 1, 2].map(|axis| -f32::from(ball.step[axis]) * size[axis]);
    let square = away[0] * away[0] + away[1] * away[1] + away[2] * away[2];
    let length = square.sqrt();
    let begins = (ball.neighbour - square - ball.reach) / (2.0 * length);
    let rim = (ball.reach - begins * begins).max(0.0);
    [0, 1, 2].map(|axis| {
        let cosine = away[axis] / length;
        let rim = (rim * (1.0 - cosine * cosine).max(0.0)).sqrt();
        let low = if -radius * cosine < begins { begins * cosine - rim } else { -radius };
        let high = if radius * cosine < begins { begins * cosine + rim } else { radius };
        steps(low, high, axis)
    })
}

/// A ball and that of its neighbour in a plane of a tile.
struct Slice {
    /// Squares that steps in the plane must be less than, from the middle of either.
    own: f32,
    other: f32,
    /// Where either middle is along x.
    at: [i32; 2],
    /// Where what lies in the ball and not in its neighbour's may be along x, as bits.
    widths: u64,
    /// Edges of a voxel along y and x, and one by the last.
    size: [f32; 3],
}

/// Finds the voxels of some rows that wait and lie in a ball but not in its neighbour's; false if
/// there are none. `dy` are the steps from either middle to the first row.
#[inline(always)]
fn find_hits(slice: &Slice, dy: [i32; 2], words: &[u64; LANES], hits: &mut [u64; LANES]) -> bool {
    // Most often no one waits there, which is seen sooner than the balls are.
    let mut any = 0;
    for word in words {
        any |= word & slice.widths;
    }
    if any == 0 {
        return false;
    }
    any = 0;
    for i in 0..LANES {
        let own = row_of(slice.own, dy[0] + i as i32, slice.at[0], slice.size);
        let other = row_of(slice.other, dy[1] + i as i32, slice.at[1], slice.size);
        hits[i] = own & !other & words[i];
        any |= hits[i];
    }
    any != 0
}

/// Adding this to a small whole number leaves it in the last bits, which takes one instruction.
const WHOLE: f32 = 12_582_912.0;

/// The voxels of a row that lie in a ball, as bits.
#[inline(always)]
fn row_of(square: f32, dy: i32, at: i32, size: [f32; 3]) -> u64 {
    let off = dy as f32 * size[0];
    let square = square - off * off;
    let root = if square > 0.0 { square.sqrt() } else { 0.0 };
    let steps = (root * size[2]).floor();
    let length = steps * size[1];
    let steps = if length * length < square { steps } else { steps - 1.0 };
    let steps = (steps + WHOLE).to_bits() as i32 - WHOLE.to_bits() as i32;
    let last = TILE as i32 - 1;
    let (low, high) = (at - steps, at + steps);
    let low = if low > 0 { low } else { 0 };
    let high = if high < last { high } else { last };
    let bits = (u64::MAX << (low & last)) & (u64::MAX >> ((last - high) & last));
    if low <= high { bits } else { 0 }
}
