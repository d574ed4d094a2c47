//! The nodes as a chessboard, and vectors that hold the squares of one colour.
//!
//! The nodes beside a node are all of the other colour, so that the velocities of one colour follow from
//! those of the other. A row is two lines, the even places and the odd ones, each of one colour. Vectors
//! of velocities hold the lines of one colour, solid or not, 0 where there is no velocity, so that what is
//! beside a line is so many slices. Vectors of pressures leave the solid out.

use std::ops::Range;

use super::places::Places;
use crate::bits::WORD;
use crate::transport::pore::PoreSpace;
use crate::transport::vectors::Parts;
use crate::volume::Boundary;

/// Places of a colour that one thread handles at a time: what is calculated for them stays in its cache.
const PART: usize = 1 << 12;
/// Places of a line in a word of bits.
pub(super) const HALF: usize = WORD / 2;

/// One of the two colours.
///
/// Black nodes never touch each other. Red ones do where a periodic volume has an odd number of
/// voxels along an axis, which no chessboard closes round.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum Colour {
    Red,
    Black,
}
use Colour::{Black, Red};

/// Where the lines of each colour are.
pub(super) struct Lines<'a> {
    pub places: Places<'a>,
    /// Places of a line.
    pub length: usize,
    /// The number of each line among those of its colour, doubled, and 1 more if it is black; row by row,
    /// even places first.
    numbers: Vec<u32>,
    /// Number of lines of each colour.
    counts: [usize; 2],
    /// Rows in parts of some [`PART`] places of a colour.
    parts: [Parts; 2],
    /// Whether red nodes touch each other.
    pub reds_touch: bool,
}

impl<'a> Lines<'a> {
    /// Memory: 8 bytes a row.
    pub fn new(space: &'a PoreSpace) -> Self {
        let places = Places::new(space);
        let odd = space.shape.map(|n| n % 2 == 1 && space.boundary == Boundary::Periodic);
        let length = space.shape[2].div_ceil(2);
        let mut counts = [0; 2];
        let mut numbers = Vec::with_capacity(2 * places.rows());
        let mut firsts = [vec![0], vec![0]];
        for row in 0..places.rows() {
            let [z, y] = places.position(row);
            for x in 0..2 {
                let seam = odd[0] && z + 1 == space.shape[0] || odd[1] && y + 1 == space.shape[1];
                let black = if odd[2] { x == 1 && (z + y) % 2 == 0 } else { (z + y + x) % 2 == 1 };
                let black = black && !seam;
                let count = &mut counts[usize::from(black)];
                numbers.push(2 * *count as u32 + u32::from(black));
                *count += 1;
            }
            firsts.iter_mut().zip(counts).for_each(|(firsts, count)| firsts.push(count * length));
        }
        let parts = firsts
            .map(|firsts| Parts::new(places.rows(), PART, |row| firsts[row]..firsts[row + 1]));
        let reds_touch = odd.contains(&true);
        Self { places, length, numbers, counts, parts, reds_touch }
    }

    /// Rows in parts, by the places of a colour.
    pub fn parts(&self, colour: Colour) -> &Parts {
        &self.parts[colour as usize]
    }

    /// Length of a vector of a colour.
    pub fn len(&self, colour: Colour) -> usize {
        self.counts[colour as usize] * self.length
    }

    /// Colour of a line of a row.
    #[inline(always)]
    pub fn colour(&self, row: usize, odd: bool) -> Colour {
        if self.numbers[2 * row + usize::from(odd)] % 2 == 1 { Black } else { Red }
    }

    /// Calls `work(row, odd, line)` for the lines of a colour that some rows have of a vector.
    #[inline(always)]
    pub fn for_each(
        &self,
        rows: Range<usize>,
        colour: Colour,
        mut values: &mut [f32],
        mut work: impl FnMut(usize, bool, &mut [f32]),
    ) {
        for row in rows {
            for odd in [false, true] {
                if self.colour(row, odd) == colour {
                    let (line, rest) = std::mem::take(&mut values).split_at_mut(self.length);
                    work(row, odd, line);
                    values = rest;
                }
            }
        }
    }

    /// A line of a vector of its colour.
    #[inline(always)]
    pub fn line<'v, T>(&self, row: usize, odd: bool, values: &'v [T]) -> &'v [T] {
        let number = self.numbers[2 * row + usize::from(odd)] as usize / 2;
        &values[number * self.length..][..self.length]
    }
}

/// Every other bit, from the lowest on.
#[inline(always)]
pub(super) fn every_other(word: u64) -> u32 {
    let mut bits = word & 0x5555_5555_5555_5555;
    bits = (bits | bits >> 1) & 0x3333_3333_3333_3333;
    bits = (bits | bits >> 2) & 0x0f0f_0f0f_0f0f_0f0f;
    bits = (bits | bits >> 4) & 0x00ff_00ff_00ff_00ff;
    bits = (bits | bits >> 8) & 0x0000_ffff_0000_ffff;
    (bits | bits >> 16) as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::stokes::tests::spaces;

    #[test]
    fn black_places_never_touch() {
        for space in spaces() {
            let lines = Lines::new(&space);
            let n = space.shape[2];
            let colour = |row: usize, x: usize| lines.colour(row, x % 2 == 1);
            let mut red_pairs = 0;
            for (row, x) in (0..lines.places.rows()).flat_map(|row| (0..n).map(move |x| (row, x))) {
                let rows = lines.places.beside(row).into_iter().flatten().map(|row| (row, x));
                let periodic = space.boundary == Boundary::Periodic;
                let next = if x + 1 < n { Some(x + 1) } else { periodic.then_some(0) };
                for (other, at) in rows.chain(next.map(|x| (row, x))) {
                    assert!(
                        [colour(row, x), colour(other, at)] != [Black, Black],
                        "{:?}",
                        space.shape
                    );
                    red_pairs += usize::from([colour(row, x), colour(other, at)] == [Red, Red]);
                }
            }
            assert_eq!(red_pairs > 0, lines.reds_touch, "{:?} {:?}", space.shape, space.boundary);
        }
    }

    #[test]
    fn vectors_of_both_colours_hold_each_line_once() {
        for space in spaces() {
            let lines = Lines::new(&space);
            let rows = lines.places.rows();
            let mut seen = 0;
            for colour in [Red, Black] {
                let numbers: Vec<f32> = (0..lines.len(colour)).map(|i| i as f32).collect();
                let mut next = 0;
                lines.for_each(0..rows, colour, &mut numbers.clone(), |row, odd, line| {
                    assert_eq!(lines.line(row, odd, &numbers), line);
                    assert_eq!(line[0] as usize, next);
                    next += lines.length;
                    seen += 1;
                });
                assert_eq!(next, lines.len(colour));
            }
            assert_eq!(seen, 2 * rows);
        }
    }

    #[test]
    fn every_other_bit_is_kept() {
        for (i, word) in [0, 1, 2, u64::MAX, 1 << 62, 0x0123_4567_89ab_cdef].into_iter().enumerate()
        {
            let expected = (0..HALF).fold(0, |bits, k| bits | ((word >> (2 * k)) as u32 & 1) << k);
            assert_eq!(every_other(word), expected, "{i}");
        }
    }
}
