//! Painting tiles of a volume with balls, thickest first.

use multiversion::multiversion;
use ndarray::{ArrayView3, ArrayViewMut3, Axis, s};

use super::Space;
use super::cells::{Cells, Extent, Placed};
use super::ridge::Ball;
use super::sections::{Discs, LANES, Roots, Section};
use crate::bits::pack;
use crate::error::Result;
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
pub(super) fn fill(
    (cells, discs): (&Cells, &Discs),
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
        paint(&mut tile, balls, space, discs);
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
fn paint(tile: &mut Tile, balls: &[Placed], space: &Space, discs: &Discs) {
    let size = space.size.map(|edge| edge as f32);
    for ball in balls {
        let diameter = space.diameter(ball.ball.rank);
        tile.paint(ball, diameter, size, discs);
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
    fn paint(&mut self, placed: &Placed, diameter: f32, size: [f32; 3], discs: &Discs) {
        let extents = extents(&placed.ball, size);
        // Axis by axis: `map` is not inlined into what is compiled for the processor.
        let depths = span(placed.at[0], extents[0]);
        let heights = span(placed.at[1], extents[1]);
        let widths = span(placed.at[2], extents[2]);
        let tabled = discs.hold(&placed.ball);
        let mut planes = self.planes & depths;
        while planes != 0 {
            let z = planes.trailing_zeros() as usize;
            planes &= planes - 1;
            let rows = self.rows[z] & heights;
            if rows == 0 {
                continue;
            }
            if tabled {
                self.paint_plane(&discs.section(placed, z), diameter, z, rows);
            } else {
                self.paint_plane(&Roots::new(placed, z, size, widths), diameter, z, rows);
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
    let mut ends = [(-radius, radius); 3];
    if ball.neighbour > 0.0 {
        // What is left lies in the cap that begins so far out in the direction away from the
        // neighbour: it ends at its rim, or where the ball does if that is in the cap.
        let mut away = [0.0; 3];
        let mut square = 0.0;
        for axis in 0..3 {
            away[axis] = -f32::from(ball.step[axis]) * size[axis];
            square += away[axis] * away[axis];
        }
        let length = square.sqrt();
        let begins = (ball.neighbour - square - ball.reach) / (2.0 * length);
        let rim = (ball.reach - begins * begins).max(0.0);
        for axis in 0..3 {
            let cosine = away[axis] / length;
            let rim = (rim * (1.0 - cosine * cosine).max(0.0)).sqrt();
            if -radius * cosine < begins {
                ends[axis].0 = begins * cosine - rim;
            }
            if radius * cosine < begins {
                ends[axis].1 = begins * cosine + rim;
            }
        }
    }
    // Truncation is towards the middle, by less than a step.
    let slack = 1e-3 * (1.0 + radius);
    let mut steps = [(0, 0); 3];
    for axis in 0..3 {
        let (low, high) = ends[axis];
        steps[axis] = (((low - slack) / size[axis]) as i32, ((high + slack) / size[axis]) as i32);
    }
    steps
}
