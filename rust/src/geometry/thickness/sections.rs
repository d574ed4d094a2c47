//! Which voxels of a tile lie in a ball, but not in that of its neighbour, plane by plane.

use super::Space;
use super::cells::Placed;
use super::paint::TILE;
use super::ridge::Ball;
use crate::geometry::distance::window::Lane;

/// Rows that are compared with a ball at once.
pub(super) const LANES: usize = 8;

/// A ball and that of its neighbour in the planes of a tile.
pub(super) trait Sections {
    /// The voxels of [`LANES`] rows from (z, y) on that wait and lie in the ball but not in its
    /// neighbour's.
    fn hits(&self, from: [usize; 2], waiting: &[u64; LANES]) -> [u64; LANES];
}

/// Largest radius of discs in [`Discs`], in voxels: the neighbour's may be one larger.
const LARGEST: u32 = 30;

/// Bit of the middle of a row: as many voxels lie on both sides.
const CENTRE: i32 = 31;

/// Discs as bits, by the square that their voxels are nearer than, in voxels.
///
/// Most balls are small: looking their rows up, instead of finding where they end, took a third off
/// the time of painting.
pub(super) struct Discs {
    rows: Vec<u64>,
    /// Which row of a disc is that of its middle: beyond the disc there are as many without voxels as
    /// rows of its own ball, or of its neighbour's, may ask for.
    middle: i32,
    /// Rows of a disc.
    height: usize,
    /// The squares of the balls whose sections are here are less.
    below: u32,
}

impl Discs {
    /// Discs of balls up to a reach, as far as they are kept here.
    pub(super) fn of_cubes(reach: f32) -> Self {
        let most = ((0.25 * reach) as u32).min((LARGEST + 1).pow(2));
        let middle = most.isqrt() as i32 + 4;
        let height = 2 * middle as usize + LANES;
        let mut rows = vec![0; (most as usize + 1) * height];
        for (square, disc) in rows.chunks_exact_mut(height).enumerate() {
            for (row, bits) in disc.iter_mut().enumerate() {
                let left = square as i32 - 1 - (row as i32 - middle).pow(2);
                if left >= 0 {
                    let steps = left.isqrt();
                    *bits = ((1 << (2 * steps + 1)) - 1) << (CENTRE - steps);
                }
            }
        }
        Self { rows, middle, height, below: 4 * most + 4 }
    }

    /// None: where voxels are no cubes, discs are ellipses of many kinds.
    pub(super) const fn none() -> Self {
        Self { rows: Vec::new(), middle: 0, height: 0, below: 0 }
    }

    /// Whether the sections of a ball and of its neighbour's are here.
    #[inline(always)]
    pub(super) fn hold<T: Lane>(&self, ball: &Ball<T>) -> bool {
        ball.reach.whole() < self.below && ball.neighbour.whole() < self.below
    }

    /// The sections of a ball that is held, with the step to its neighbour.
    #[inline(always)]
    pub(super) fn sections<T: Lane>(&self, placed: &Placed<T>, along: [i32; 3]) -> Tabled<'_> {
        let Placed { at, ball } = placed;
        let discs = |square: T, [z, y, x]: [i32; 3]| Row {
            square: (square.whole() / 4) as i32,
            plane: z,
            // The row that has the middle of the ball, were it on this one.
            first: self.middle - y,
            shift: to_both_sides(x - CENTRE),
        };
        Tabled {
            discs: self,
            own: discs(ball.reach, *at),
            other: discs(ball.neighbour, placed.beside(along)),
        }
    }

    /// The rows from y on of a disc in a plane, where it is in the table.
    #[inline(always)]
    fn rows(&self, of: &Row, [z, y]: [usize; 2]) -> Option<&[u64; LANES]> {
        let dz = z as i32 - of.plane;
        let left = of.square - dz * dz;
        let left = if left > 0 { left as usize } else { 0 };
        self.rows.get(left * self.height + (of.first + y as i32) as usize..)?.first_chunk()
    }
}

/// Sections from the table.
pub(super) struct Tabled<'a> {
    discs: &'a Discs,
    own: Row,
    other: Row,
}

/// Which discs are the sections of a ball.
struct Row {
    /// What the squares of its voxels are less than, in voxels.
    square: i32,
    /// The plane of its middle.
    plane: i32,
    /// Which row of a disc is the first of the tile.
    first: i32,
    /// How much farther along x its middle is than in the table.
    shift: [u32; 2],
}

impl Sections for Tabled<'_> {
    #[inline(always)]
    fn hits(&self, at: [usize; 2], waiting: &[u64; LANES]) -> [u64; LANES] {
        let mut hits = [0; LANES];
        let both = (self.discs.rows(&self.own, at), self.discs.rows(&self.other, at));
        let (Some(own), Some(other)) = both else { return hits };
        let ([left, right], [other_left, other_right]) = (self.own.shift, self.other.shift);
        for i in 0..LANES {
            let own = own[i] << left >> right;
            let other = other[i] << other_left >> other_right;
            hits[i] = own & !other & waiting[i];
        }
        hits
    }
}

/// A shift to the left, and one to the right, of which one is 0.
#[inline(always)]
fn to_both_sides(shift: i32) -> [u32; 2] {
    let last = u64::BITS - 1;
    let left = if shift > 0 { shift as u32 } else { 0 };
    let right = if shift < 0 { shift.unsigned_abs() } else { 0 };
    [left & last, right & last]
}

/// Sections found by roots.
pub(super) struct Roots {
    /// Squares that the voxels of either ball must be less than, from its middle.
    own: f32,
    other: f32,
    /// Where either middle is.
    at: [[i32; 3]; 2],
    /// Where what lies in the ball and not in its neighbour's may be along x, as bits.
    widths: u64,
    /// Edges of a voxel along z and y, and one by that along x.
    size: [f32; 3],
}

impl Roots {
    #[inline(always)]
    pub(super) fn new<T: Lane>(
        placed: &Placed<T>,
        along: [i32; 3],
        space: &Space,
        widths: u64,
    ) -> Self {
        let Placed { at, ball } = placed;
        let [depth, height, width] = space.size.map(|edge| edge as f32);
        Self {
            own: space.inside(ball.reach.square()),
            other: space.inside(ball.neighbour.square()),
            at: [*at, placed.beside(along)],
            widths,
            size: [depth, height, width.recip()],
        }
    }
}

impl Sections for Roots {
    #[inline(always)]
    fn hits(&self, [z, y]: [usize; 2], waiting: &[u64; LANES]) -> [u64; LANES] {
        let mut hits = [0; LANES];
        // Most often no one waits there, which is seen sooner than the balls are.
        if waiting.iter().fold(0, |any, word| any | word & self.widths) == 0 {
            return hits;
        }
        let [depth, height, width] = self.size;
        let [own, other] = [self.own, self.other];
        let own = own - square(z as i32 - self.at[0][0], depth);
        let other = other - square(z as i32 - self.at[1][0], depth);
        for i in 0..LANES {
            let y = (y + i) as i32;
            let own = row_of(own, y, self.at[0], [height, width]);
            let other = row_of(other, y, self.at[1], [height, width]);
            hits[i] = own & !other & waiting[i];
        }
        hits
    }
}

fn square(steps: i32, size: f32) -> f32 {
    let distance = steps as f32 * size;
    distance * distance
}

/// Rounds a number of less than a few millions to the next whole one, in two instructions.
#[inline(always)]
pub(super) fn whole(value: f32) -> i32 {
    /// With this added, whole numbers are in the last bits.
    const WHOLE: f32 = 12_582_912.0;
    (value + WHOLE).to_bits() as i32 - WHOLE.to_bits() as i32
}

/// The voxels of a row that lie in a ball, as bits.
#[inline(always)]
fn row_of(square: f32, y: i32, at: [i32; 3], [size, reciprocal]: [f32; 2]) -> u64 {
    let off = (y - at[1]) as f32 * size;
    let square = square - off * off;
    let steps = (square.max(0.0).sqrt() * reciprocal).floor();
    let steps = if square > 0.0 { steps } else { -1.0 };
    let steps = whole(steps);
    let last = TILE as i32 - 1;
    let (low, high) = (at[2] - steps, at[2] + steps);
    let low = if low > 0 { low } else { 0 };
    let high = if high < last { high } else { last };
    let bits = (u64::MAX << (low & last)) & (u64::MAX >> ((last - high) & last));
    if low <= high { bits } else { 0 }
}
