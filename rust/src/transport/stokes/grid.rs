//! The staggered grid: which velocities there are, and the viscous operator.

use std::ops::Range;

use half::f16;
use multiversion::multiversion;

use super::diagonals::Diagonals;
use super::lines::{
    Colour::{self, Black, Red},
    Lines,
};
use crate::error::Result;
use crate::monitor::Monitor;
use crate::transport::compact::single_of;
use crate::transport::pore::PoreSpace;

pub(super) struct Grid<'a> {
    pub space: &'a PoreSpace,
    pub lines: Lines<'a>,
    /// Those of the viscous operator, for the velocities along each axis.
    diagonals: [Diagonals; 3],
    /// 1 / h² along each axis.
    pub weights: [f32; 3],
    /// 1 / h along each axis.
    pub slopes: [f32; 3],
}

impl<'a> Grid<'a> {
    pub fn new(space: &'a PoreSpace, spacing: [f64; 3], monitor: &Monitor<'_>) -> Result<Self> {
        let lines = Lines::new(space);
        let weights = spacing.map(|h| (1.0 / h.powi(2)) as f32);
        let along = |axis| Diagonals::new(&lines.places, axis, weights, monitor);
        let diagonals = [along(0)?, along(1)?, along(2)?];
        Ok(Self { space, lines, diagonals, weights, slopes: spacing.map(|h| (1.0 / h) as f32) })
    }

    /// Writes the diagonal of the viscous operator for the places of a colour in some rows, 0 where there
    /// is no velocity.
    pub fn diagonals(&self, axis: usize, rows: Range<usize>, colour: Colour, out: &mut [f32]) {
        diagonals(self, axis, rows, colour, out);
    }

    /// Writes for the places of a colour in some rows what the viscous operator takes from the red
    /// velocities beside them; also where there is no velocity.
    pub fn of_red(&self, rows: Range<usize>, colour: Colour, red: &[f16], out: &mut [f32]) {
        of_red(self, rows, colour, red, out);
    }

    /// The same for red places, from the black velocities beside them.
    pub fn of_black(&self, rows: Range<usize>, black: &[f32], out: &mut [f32]) {
        of_black(self, rows, black, out);
    }
}

#[multiversion(targets(
    "x86_64+avx512f+avx512vl+popcnt+bmi1+bmi2",
    "x86_64+avx2+popcnt+bmi1+bmi2"
))]
fn diagonals(grid: &Grid<'_>, axis: usize, rows: Range<usize>, colour: Colour, out: &mut [f32]) {
    let lines = &grid.lines;
    lines.for_each(rows, colour, out, |row, odd, line| {
        grid.diagonals[axis].write(&lines.places, row, odd, line);
    });
}

/// A velocity, which is calculated with in single precision.
pub(super) trait Velocity: Copy {
    fn single(self) -> f32;
}

impl Velocity for f32 {
    #[inline(always)]
    fn single(self) -> f32 {
        self
    }
}

impl Velocity for f16 {
    #[inline(always)]
    fn single(self) -> f32 {
        single_of(self)
    }
}

#[multiversion(targets(
    "x86_64+avx512f+avx512vl+popcnt+bmi1+bmi2",
    "x86_64+avx2+popcnt+bmi1+bmi2"
))]
fn of_red(grid: &Grid<'_>, rows: Range<usize>, colour: Colour, red: &[f16], out: &mut [f32]) {
    gather(grid, rows, [Red, colour], red, out);
}

#[multiversion(targets(
    "x86_64+avx512f+avx512vl+popcnt+bmi1+bmi2",
    "x86_64+avx2+popcnt+bmi1+bmi2"
))]
fn of_black(grid: &Grid<'_>, rows: Range<usize>, black: &[f32], out: &mut [f32]) {
    gather(grid, rows, [Black, Red], black, out);
}

/// Writes sums of weight · value over the places beside those of a colour that are of another.
#[inline(always)]
fn gather<T: Velocity>(
    grid: &Grid<'_>,
    rows: Range<usize>,
    [from, to]: [Colour; 2],
    values: &[T],
    out: &mut [f32],
) {
    let lines = &grid.lines;
    let mut left = out;
    // Spelled out: a closure would be compiled for any processor.
    for row in rows {
        for odd in [false, true] {
            if lines.colour(row, odd) == to {
                let (sums, rest) = left.split_at_mut(lines.length);
                gather_line(grid, row, odd, from, values, sums);
                left = rest;
            }
        }
    }
}

/// The same for a line.
#[inline(always)]
fn gather_line<T: Velocity>(
    grid: &Grid<'_>,
    row: usize,
    odd: bool,
    from: Colour,
    values: &[T],
    sums: &mut [f32],
) {
    let Grid { lines, weights, .. } = grid;
    sums.fill(0.0);
    let besides = lines.places.beside(row);
    for side in 0..4 {
        let Some(beside) = besides[side] else { continue };
        if lines.colour(beside, odd) == from {
            add(weights[side / 2], lines.line(beside, odd, values), sums);
        }
    }
    if lines.colour(row, !odd) == from {
        let line = lines.line(row, !odd, values);
        add(weights[2], line, sums);
        if odd {
            add(weights[2], &line[1..], sums);
        } else {
            add(weights[2], line, &mut sums[1..]);
        }
    }
    for &[end, other] in lines.places.wraps() {
        let from_odd = other % 2 == 1;
        if (end % 2 == 1) == odd && lines.colour(row, from_odd) == from {
            let value = lines.line(row, from_odd, values)[other / 2];
            sums[end / 2] += weights[2] * value.single();
        }
    }
}

/// Adds a weight times the values to as many sums as there are of both.
#[inline(always)]
fn add<T: Velocity>(weight: f32, values: &[T], sums: &mut [f32]) {
    let n = sums.len().min(values.len());
    let (values, sums) = (&values[..n], &mut sums[..n]);
    for i in 0..n {
        sums[i] += weight * values[i].single();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Key;
    use crate::transport::stokes::tests::spaces;

    #[test]
    fn what_comes_from_a_colour_is_that_of_the_places_beside() {
        for space in spaces() {
            let grid = Grid::new(&space, [0.5, 1.0, 2.0], &Monitor::silent()).unwrap();
            let lines = &grid.lines;
            let n = space.shape[2];
            let rows = lines.places.rows();
            // Values only at places of the row, as there are no velocities elsewhere.
            let fill = |colour: Colour, seed: u64| {
                let mut values = vec![0.0; lines.len(colour)];
                lines.for_each(0..rows, colour, &mut values, |row, odd, line| {
                    for x in (usize::from(odd)..n).step_by(2) {
                        line[x / 2] = Key::new(seed).unit((row * n + x) as u64) - 0.5;
                    }
                });
                values
            };
            let red: Vec<f16> = fill(Red, 1).into_iter().map(f16::from_f32).collect();
            let black = fill(Black, 2);
            let value = |from: Colour, row: usize, x: usize| {
                let odd = x % 2 == 1;
                match lines.colour(row, odd) {
                    colour if colour != from => 0.0,
                    Red => lines.line(row, odd, &red)[x / 2].to_f32(),
                    Black => lines.line(row, odd, &black)[x / 2],
                }
            };
            for [from, to] in [[Red, Black], [Black, Red], [Red, Red]] {
                let mut found = vec![0.0; lines.len(to)];
                match from {
                    Red => grid.of_red(0..rows, to, &red, &mut found),
                    Black => grid.of_black(0..rows, &black, &mut found),
                }
                lines.for_each(0..rows, to, &mut found, |row, odd, line| {
                    for x in (usize::from(odd)..n).step_by(2) {
                        let mut expected = 0.0;
                        for (side, beside) in lines.places.beside(row).into_iter().enumerate() {
                            let value = beside.map_or(0.0, |row| value(from, row, x));
                            expected += grid.weights[side / 2] * value;
                        }
                        for after in [false, true] {
                            let beside = if after {
                                space.boundary.after(x, n)
                            } else {
                                space.boundary.before(x, n)
                            };
                            let value = beside.map_or(0.0, |x| value(from, row, x));
                            expected += grid.weights[2] * value;
                        }
                        let (shape, boundary) = (space.shape, space.boundary);
                        let off = (line[x / 2] - expected).abs();
                        assert!(off < 1e-5, "{shape:?} {boundary:?} {row} {x}");
                    }
                });
            }
        }
    }
}
