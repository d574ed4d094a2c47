//! What couples pressures and velocities: the slope G of a pressure, and the inflow Gᵀ of velocities.
//!
//! Pressures are numbers of voxels, without the solid; velocities are lines of one colour.

use std::ops::Range;

use half::f16;
use multiversion::multiversion;
use rayon::prelude::*;

use super::grid::{Grid, Velocity};
use super::lines::Colour::{self, Black, Red};
use super::runs::{collect, spread};
use crate::monitor::Monitor;
use crate::transport::compact::widen;
use crate::transport::pore::PoreSpace;
use crate::transport::vectors::summed;
use crate::volume::Boundary;

/// Velocities along an axis, through the face after each place.
#[derive(Clone, Copy)]
pub(super) struct Velocities<'a> {
    pub red: &'a [f16],
    pub black: &'a [f32],
}

impl Grid<'_> {
    /// Writes the slope G p of a pressure through the faces after the places of a colour in some rows,
    /// along an axis; also where there is no velocity.
    pub fn slopes(
        &self,
        axis: usize,
        rows: Range<usize>,
        colour: Colour,
        pressure: &[f16],
        out: &mut [f32],
    ) {
        slopes(self, axis, rows, colour, pressure, out);
    }

    /// Adds what flows into each voxel along an axis, Gᵀ u, times a factor.
    pub fn add_inflow(
        &self,
        axis: usize,
        velocities: Velocities<'_>,
        factor: f32,
        sums: &mut [f32],
        monitor: &Monitor<'_>,
    ) {
        let factor = factor * self.slopes[axis];
        self.space.parts.map(sums, monitor, |rows, _, sums| {
            add_inflow(self, axis, rows, velocities, factor, sums);
        });
    }

    /// Adds velocities, times a factor, to what their nodes have; not those before the inlet.
    pub fn add_velocities(
        &self,
        velocities: Velocities<'_>,
        factor: f32,
        sums: &mut [f32],
        monitor: &Monitor<'_>,
    ) {
        self.space.parts.map(sums, monitor, |rows, _, sums| {
            add_velocities(self, rows, velocities, factor, sums);
        });
    }

    /// Adds the flow of velocities along axis 0 through each plane, that before the inlet first, times
    /// a factor.
    pub fn add_fluxes(&self, velocities: Velocities<'_>, factor: f64, sums: &mut [f64]) {
        let [n0, n1, _] = self.space.shape;
        let planes = self.planes();
        sums.par_iter_mut().enumerate().for_each(|(i, sum)| {
            // The copy of the first plane, if there is one, comes last.
            let plane = (n0 + i) % planes;
            let mut line = vec![0.0; self.lines.length];
            for row in plane * n1..(plane + 1) * n1 {
                for odd in [false, true] {
                    line_of(self, row, odd, velocities, &mut line);
                    let [through] = summed(line.len(), |i| [line[i]]);
                    *sum += factor * through;
                }
            }
        });
    }

    /// Number of planes that a flow passes.
    pub fn planes(&self) -> usize {
        self.lines.places.rows() / self.space.shape[1]
    }
}

/// Spreads the values of the voxels of a row from place 1 on, with those that a periodic border puts
/// before and behind it.
#[inline(always)]
fn spread_row(space: &PoreSpace, row: usize, values: &[f16], places: &mut [f32]) {
    let n = space.shape[2];
    let mut wide = Vec::new();
    widen(&values[space.voxels_of(row..row + 1)], &mut wide);
    spread(space.bits_of(row..row + 1).words, &wide, &mut places[1..=n]);
    let wraps = space.boundary == Boundary::Periodic;
    (places[0], places[n + 1]) = if wraps { (places[n], places[1]) } else { (0.0, 0.0) };
}

#[multiversion(targets(
    "x86_64+avx512f+avx512vl+popcnt+bmi1+bmi2",
    "x86_64+avx2+popcnt+bmi1+bmi2"
))]
fn slopes(
    grid: &Grid<'_>,
    axis: usize,
    rows: Range<usize>,
    colour: Colour,
    pressure: &[f16],
    out: &mut [f32],
) {
    let Grid { lines, space, .. } = grid;
    let slope = grid.slopes[axis];
    let [mut own, mut beside] = [0, 1].map(|_| vec![0.0; space.shape[2] + 3]);
    let places = &lines.places;
    let mut last = None;
    lines.for_each(rows, colour, out, |row, odd, line| {
        // Pressure is 0 before the inlet and behind the outlet.
        let pressures = |row: Option<usize>, line: &mut Vec<f32>| match row {
            Some(row) if !places.is_before_inlet(row) => spread_row(space, row, pressure, line),
            _ => line.fill(0.0),
        };
        if last.replace(row) != Some(row) {
            pressures(Some(row), &mut own);
            if axis < 2 {
                pressures(places.row_beside(row, axis, true), &mut beside);
            } else {
                beside[..=space.shape[2] + 1].copy_from_slice(&own[1..]);
            }
        }
        let first = 1 + usize::from(odd);
        for (i, line) in line.iter_mut().enumerate() {
            *line = slope * (beside[first + 2 * i] - own[first + 2 * i]);
        }
    });
}

/// Writes the velocities of a line.
#[inline(always)]
fn line_of(grid: &Grid<'_>, row: usize, odd: bool, velocities: Velocities<'_>, out: &mut [f32]) {
    let n = out.len();
    match grid.lines.colour(row, odd) {
        Red => {
            let red = &grid.lines.line(row, odd, velocities.red)[..n];
            for i in 0..n {
                out[i] = red[i].single();
            }
        }
        Black => out.copy_from_slice(grid.lines.line(row, odd, velocities.black)),
    }
}

/// Adds what is at the places of a row, of its even ones and of its odd ones, times a factor, to what
/// the voxels have.
#[inline(always)]
fn add_row(
    space: &PoreSpace,
    row: usize,
    [even, odd]: [&[f32]; 2],
    factor: f32,
    room: &mut [f32],
    sums: &mut [f32],
) {
    let n = room.len() / 2;
    let (even, odd, room) = (&even[..n], &odd[..n], &mut room[..2 * n]);
    for i in 0..n {
        room[2 * i] = even[i];
        room[2 * i + 1] = odd[i];
    }
    collect(space.bits_of(row..row + 1).words, room, sums, |sum, value| *sum += factor * value);
}

#[multiversion(targets(
    "x86_64+avx512f+avx512vl+popcnt+bmi1+bmi2",
    "x86_64+avx2+popcnt+bmi1+bmi2"
))]
fn add_velocities(
    grid: &Grid<'_>,
    rows: Range<usize>,
    velocities: Velocities<'_>,
    factor: f32,
    sums: &mut [f32],
) {
    let Grid { lines, space, .. } = grid;
    let [mut even, mut odd] = [0; 2].map(|_| vec![0.0f32; lines.length]);
    let mut room = vec![0.0f32; 2 * lines.length];
    let mut left = sums;
    for row in rows {
        let (sums, rest) = left.split_at_mut(space.voxels_of(row..row + 1).len());
        left = rest;
        line_of(grid, row, false, velocities, &mut even);
        line_of(grid, row, true, velocities, &mut odd);
        add_row(space, row, [&even, &odd], factor, &mut room, sums);
    }
}

#[multiversion(targets(
    "x86_64+avx512f+avx512vl+popcnt+bmi1+bmi2",
    "x86_64+avx2+popcnt+bmi1+bmi2"
))]
fn add_inflow(
    grid: &Grid<'_>,
    axis: usize,
    rows: Range<usize>,
    velocities: Velocities<'_>,
    factor: f32,
    sums: &mut [f32],
) {
    let Grid { lines, space, .. } = grid;
    let n = lines.length;
    let [mut even, mut odd, mut room] = [0; 3].map(|_| vec![0.0f32; n]);
    let mut inflow = vec![0.0f32; 2 * n];
    let mut left = sums;
    for row in rows {
        let (sums, rest) = left.split_at_mut(space.voxels_of(row..row + 1).len());
        left = rest;
        if sums.is_empty() {
            continue;
        }
        line_of(grid, row, false, velocities, &mut even);
        line_of(grid, row, true, velocities, &mut odd);
        if axis < 2 {
            let before = lines.places.row_beside(row, axis, false);
            for (parity, line) in [(false, &mut even), (true, &mut odd)] {
                match before {
                    Some(before) => line_of(grid, before, parity, velocities, &mut room),
                    None => room.fill(0.0),
                }
                let (line, room) = (&mut line[..n], &room[..n]);
                for i in 0..n {
                    line[i] = room[i] - line[i];
                }
            }
        } else {
            // What comes before an even place is an odd one of the place before in its line.
            let last = space.shape[2] - 1;
            let wraps = space.boundary == Boundary::Periodic;
            let end = if last % 2 == 1 { odd[last / 2] } else { even[last / 2] };
            room[0] = if wraps { end } else { 0.0 };
            room[1..].copy_from_slice(&odd[..n - 1]);
            let (even, odd, room) = (&mut even[..n], &mut odd[..n], &room[..n]);
            for i in 0..n {
                odd[i] = even[i] - odd[i];
                even[i] = room[i] - even[i];
            }
        }
        add_row(space, row, [&even, &odd], factor, &mut inflow, sums);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Key;
    use crate::transport::stokes::tests::spaces;

    /// Velocities at random, only where there are any, in both precisions.
    fn random(grid: &Grid<'_>, axis: usize) -> (Vec<f16>, Vec<f32>) {
        let rows = 0..grid.lines.places.rows();
        let [red, black] = [Red, Black].map(|colour| {
            let mut diagonals = vec![0.0; grid.lines.len(colour)];
            grid.diagonals(axis, rows.clone(), colour, &mut diagonals);
            let unit =
                |i: usize| f16::from_f32(Key::new(colour as u64).unit(i as u64) - 0.5).to_f32();
            let each = diagonals.iter().enumerate();
            each.map(|(i, &d)| if d > 0.0 { unit(i) } else { 0.0 }).collect::<Vec<f32>>()
        });
        (red.into_iter().map(f16::from_f32).collect(), black)
    }

    #[test]
    fn inflow_is_the_transpose_of_the_slope() {
        let silent = Monitor::silent();
        for space in spaces() {
            let grid = Grid::new(&space, [0.5, 1.0, 2.0], &silent).unwrap();
            let pressure: Vec<f16> =
                (0..space.len()).map(|i| f16::from_f32(Key::new(5).unit(i as u64))).collect();
            for axis in 0..3 {
                let (red, black) = random(&grid, axis);
                let rows = 0..grid.lines.places.rows();
                let along = |colour, u: &[f32]| {
                    let mut slopes = vec![0.0; u.len()];
                    grid.slopes(axis, rows.clone(), colour, &pressure, &mut slopes);
                    u.iter().zip(slopes).map(|(u, slope)| f64::from(u * slope)).sum::<f64>()
                };
                let wide: Vec<f32> = red.iter().map(|u| u.to_f32()).collect();
                let expected = along(Red, &wide) + along(Black, &black);
                let mut inflow = vec![0.0; space.len()];
                let velocities = Velocities { red: &red, black: &black };
                grid.add_inflow(axis, velocities, 2.0, &mut inflow, &silent);
                let found: f64 =
                    inflow.iter().zip(&pressure).map(|(i, p)| f64::from(*i) * p.to_f64()).sum();
                let scale = 1e-5 * (space.len() as f64).sqrt();
                assert!((found / 2.0 - expected).abs() < scale, "{:?} {axis}", space.shape);
            }
        }
    }

    #[test]
    fn velocities_go_to_their_voxels_and_through_their_planes() {
        let silent = Monitor::silent();
        for space in spaces() {
            let grid = Grid::new(&space, [1.0; 3], &silent).unwrap();
            let (red, black) = random(&grid, 0);
            let velocities = Velocities { red: &red, black: &black };
            let mut found = vec![1.0; space.len()];
            grid.add_velocities(velocities, 3.0, &mut found, &silent);
            let [n0, n1, n2] = space.shape;
            let at = |row: usize, x: usize| match grid.lines.colour(row, x % 2 == 1) {
                Red => grid.lines.line(row, x % 2 == 1, &red)[x / 2].to_f32(),
                Black => grid.lines.line(row, x % 2 == 1, &black)[x / 2],
            };
            for (row, x) in (0..n0 * n1).flat_map(|row| (0..n2).map(move |x| (row, x))) {
                if let Some(voxel) = space.number([row, x]) {
                    assert!((found[voxel] - 1.0 - 3.0 * at(row, x)).abs() < 1e-6);
                }
            }
            let mut fluxes = vec![0.0; grid.planes()];
            grid.add_fluxes(velocities, 2.0, &mut fluxes);
            for (i, flux) in fluxes.iter().enumerate() {
                let plane = (n0 + i) % grid.planes();
                let places = (0..n1 * n2).map(|k| at(plane * n1 + k / n2, k % n2));
                let expected: f64 = places.map(f64::from).sum();
                assert!((flux - 2.0 * expected).abs() < 1e-5);
            }
        }
    }
}
