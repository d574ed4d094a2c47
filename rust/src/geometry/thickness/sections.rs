//! Which voxels of a plane of a tile lie in a ball, but not in that of its neighbour.

use super::Space;
use super::cells::Placed;
use super::paint::TILE;
use super::ridge::Ball;
use crate::geometry::distance::window::Lane;

/// Rows that are compared with a ball at once.
pub(super) const LANES: usize = 8;

/// A ball and that of its neighbour in a plane of a tile.
pub(super) trait Section {
    /// Finds the voxels of [`LANES`] rows from y on that wait and lie in the ball but not in its
    /// neighbour's; false if there are none.
    fn find_hits(&self, y: usize, waiting: &[u64; LANES], hits: &mut [u64; LANES]) -> bool;
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

    /// The section of a ball that is held, with the step to its neighbour.
    #[inline(always)]
    pub(super) fn section<T: Lane>(
        &self,
        Placed { at, ball }: &Placed<T>,
        along: [i32; 3],
        z: usize,
    ) -> Tabled<'_> {
        let whole = |square: T| (square.whole() / 4) as i32;
        let dz = z as i32 - at[0];
        let other_dz = dz - along[0];
        Tabled {
            own: self.disc(whole(ball.reach) - dz * dz),
            other: self.disc(whole(ball.neighbour) - other_dz * other_dz),
            // The row that has the middle of the ball, and of its neighbour's, were it on this one.
            first: [self.middle - at[1], self.middle - at[1] - along[1]],
            shift: [at[2] - CENTRE, at[2] + along[2] - CENTRE],
        }
    }

    #[inline(always)]
    fn disc(&self, square: i32) -> &[u64] {
        let square = if square > 0 { square as usize } else { 0 };
        &self.rows[square * self.height..][..self.height]
    }
}

/// A section from the table.
pub(super) struct Tabled<'a> {
    own: &'a [u64],
    other: &'a [u64],
    /// Which row of either disc is the first of the tile.
    first: [i32; 2],
    /// How much farther along x the middles are than in the table.
    shift: [i32; 2],
}

impl Section for Tabled<'_> {
    #[inline(always)]
    fn find_hits(&self, y: usize, waiting: &[u64; LANES], hits: &mut [u64; LANES]) -> bool {
        let own = (self.first[0] + y as i32) as usize;
        let other = (self.first[1] + y as i32) as usize;
        let (Some(own), Some(other)) = (self.own.get(own..), self.other.get(other..)) else {
            return false;
        };
        let (Some(own), Some(other)) = (own.first_chunk::<LANES>(), other.first_chunk::<LANES>())
        else {
            return false;
        };
        let ([left, right], [other_left, other_right]) =
            (to_both_sides(self.shift[0]), to_both_sides(self.shift[1]));
        let mut any = 0;
        for i in 0..LANES {
            let own = own[i] << left >> right;
            let other = other[i] << other_left >> other_right;
            hits[i] = own & !other & waiting[i];
            any |= hits[i];
        }
        any != 0
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

/// A section found by roots.
pub(super) struct Roots {
    /// Squares that steps in the plane must be less than, from the middle of either.
    own: f32,
    other: f32,
    /// Where either middle is along y and x.
    at: [[i32; 2]; 2],
    /// Where what lies in the ball and not in its neighbour's may be along x, as bits.
    widths: u64,
    /// Edge of a voxel along y, and one by that along x.
    size: [f32; 2],
}

impl Roots {
    #[inline(always)]
    pub(super) fn new<T: Lane>(
        Placed { at, ball }: &Placed<T>,
        along: [i32; 3],
        space: &Space,
        z: usize,
        widths: u64,
    ) -> Self {
        let size = space.size.map(|edge| edge as f32);
        let dz = z as i32 - at[0];
        Self {
            own: space.inside(ball.reach.square()) - square(dz, size[0]),
            other: space.inside(ball.neighbour.square()) - square(dz - along[0], size[0]),
            at: [[at[1], at[2]], [at[1] + along[1], at[2] + along[2]]],
            widths,
            size: [size[1], size[2].recip()],
        }
    }
}

impl Section for Roots {
    #[inline(always)]
    fn find_hits(&self, y: usize, waiting: &[u64; LANES], hits: &mut [u64; LANES]) -> bool {
        // Most often no one waits there, which is seen sooner than the balls are.
        let mut any = 0;
        for word in waiting {
            any |= word & self.widths;
        }
        if any == 0 {
            return false;
        }
        any = 0;
        for i in 0..LANES {
            let own = row_of(self.own, (y + i) as i32, self.at[0], self.size);
            let other = row_of(self.other, (y + i) as i32, self.at[1], self.size);
            hits[i] = own & !other & waiting[i];
            any |= hits[i];
        }
        any != 0
    }
}

fn square(steps: i32, size: f32) -> f32 {
    let distance = steps as f32 * size;
    distance * distance
}

/// Adding this to a small whole number leaves it in the last bits, which takes one instruction.
const WHOLE: f32 = 12_582_912.0;

/// The voxels of a row that lie in a ball, as bits.
#[inline(always)]
fn row_of(square: f32, y: i32, at: [i32; 2], [size, reciprocal]: [f32; 2]) -> u64 {
    let off = (y - at[0]) as f32 * size;
    let square = square - off * off;
    let steps = (square.max(0.0).sqrt() * reciprocal).floor();
    let steps = if square > 0.0 { steps } else { -1.0 };
    let steps = (steps + WHOLE).to_bits() as i32 - WHOLE.to_bits() as i32;
    let last = TILE as i32 - 1;
    let (low, high) = (at[1] - steps, at[1] + steps);
    let low = if low > 0 { low } else { 0 };
    let high = if high < last { high } else { last };
    let bits = (u64::MAX << (low & last)) & (u64::MAX >> ((last - high) & last));
    if low <= high { bits } else { 0 }
}
