//! Conjugate gradients for the viscous operator, the velocities of one axis at a time.
//!
//! Black velocities follow from the red ones beside them, so that the equations are solved for the red
//! ones alone: half as many unknowns, and half as many iterations.

use std::ops::Range;

use half::f16;
use multiversion::multiversion;

use super::coupling::Velocities;
use super::grid::Grid;
use super::lines::Colour::{self, Black, Red};
use crate::error::Result;
use crate::monitor::Monitor;
use crate::transport::compact::{narrow, widen};
use crate::transport::vectors::summed;

/// Iterations after which a solution is left as it is. Blobs some 20 voxels wide take about 50.
const ITERATIONS: usize = 1000;

/// Room for a solution, which is not kept.
pub(super) struct Viscous {
    residual: Vec<f32>,
    direction: Vec<f16>,
    /// What the black velocities are for the direction of the red ones.
    black: Vec<f32>,
}

impl Viscous {
    /// Memory: 5 bytes a voxel of the volume, or up to 6 where a periodic one has odd edges.
    pub fn new(grid: &Grid<'_>) -> Self {
        let [red, black] = [Red, Black].map(|colour| grid.lines.len(colour));
        Self { residual: vec![0.0; red], direction: vec![f16::ZERO; red], black: vec![0.0; black] }
    }

    /// Bytes that are free between solutions, at least one a voxel of the volume.
    pub fn room(&mut self) -> &mut [u8] {
        bytemuck::cast_slice_mut(&mut self.residual)
    }

    /// Solves A u = b for the velocities along `axis`; returns bᵀ u.
    ///
    /// `right(rows, colour, out)` writes b at the places of a colour, and `add(velocities, factor)` takes
    /// note of a part of u: all that is asked of it is linear.
    pub fn solve(
        &mut self,
        grid: &Grid<'_>,
        axis: usize,
        tolerance: f64,
        right: impl Fn(Range<usize>, Colour, &mut [f32]) + Sync,
        mut add: impl FnMut(Velocities<'_>, f64),
        monitor: &Monitor<'_>,
    ) -> Result<f64> {
        let Self { residual, direction, black } = self;
        let lines = &grid.lines;
        let (reds, blacks) = (lines.parts(Red), lines.parts(Black));
        let diagonals = |rows: &Range<usize>, colour: Colour, n: usize| {
            let mut diagonals = vec![0.0; n];
            grid.diagonals(axis, rows.clone(), colour, &mut diagonals);
            diagonals
        };
        // What the black velocities are with the red ones at rest.
        let products = blacks.map(black, monitor, |rows, _, black| {
            let mut b = vec![0.0; black.len()];
            right(rows.clone(), Black, &mut b);
            divide(&b, &diagonals(&rows, Black, black.len()), black)
        });
        let mut product: f64 = products.iter().sum();
        let sizes = reds.map(residual, monitor, |rows, _, residual| {
            let [mut b, mut inflow] = [0, 1].map(|_| vec![0.0; residual.len()]);
            right(rows.clone(), Red, &mut b);
            grid.of_black(rows.clone(), black, &mut inflow);
            for (b, inflow) in b.iter_mut().zip(inflow) {
                *b += inflow;
            }
            take(&b, &diagonals(&rows, Red, residual.len()), residual)
        });
        let mut size: f64 = sizes.iter().sum();
        direction.fill(f16::ZERO);
        add(Velocities { red: direction, black }, 1.0);
        let (first, mut before, mut last) = (size, size, 0.0);
        for _ in 0..ITERATIONS {
            monitor.check()?;
            if size <= first * tolerance.powi(2) {
                break;
            }
            // Directions have numbers near 1.
            let unit = (size / residual.len() as f64).sqrt();
            let factors = [(size / before * last / unit) as f32, unit.recip() as f32];
            let each = reds.map(direction, monitor, |rows, first, direction| {
                let residual = &residual[first..first + direction.len()];
                let diagonals = diagonals(&rows, Red, direction.len());
                let mut new = Vec::new();
                widen(direction, &mut new);
                turn(factors, residual, &diagonals, &mut new);
                narrow(&mut new, direction);
                widen(direction, &mut new);
                slope_and_energy(&new, residual, &diagonals)
            });
            let [slope, mut curvature] =
                [0, 1].map(|i| each.iter().map(|sums| sums[i]).sum::<f64>());
            let each = blacks.map(black, monitor, |rows, _, black| {
                let mut inflow = vec![0.0; black.len()];
                grid.of_red(rows.clone(), Black, direction, &mut inflow);
                divide(&inflow, &diagonals(&rows, Black, black.len()), black)
            });
            curvature -= each.iter().sum::<f64>();
            if lines.reds_touch {
                curvature -= reds.sum(|rows, own| {
                    let (mut inflow, mut d) = (vec![0.0; own.len()], Vec::new());
                    grid.of_red(rows, Red, direction, &mut inflow);
                    widen(&direction[own], &mut d);
                    dot(&d, &inflow)
                });
            }
            if curvature <= 0.0 {
                break;
            }
            let length = slope / curvature;
            let sizes = reds.map(residual, monitor, |rows, first, residual| {
                let mut inflow = vec![0.0; residual.len()];
                grid.of_black(rows.clone(), black, &mut inflow);
                if lines.reds_touch {
                    let mut more = vec![0.0; residual.len()];
                    grid.of_red(rows.clone(), Red, direction, &mut more);
                    inflow.iter_mut().zip(more).for_each(|(inflow, more)| *inflow += more);
                }
                let diagonals = diagonals(&rows, Red, residual.len());
                let mut own = Vec::new();
                widen(&direction[first..first + residual.len()], &mut own);
                step(length as f32, residual, [&own, &diagonals], &mut inflow);
                take(&inflow, &diagonals, residual)
            });
            add(Velocities { red: direction, black }, length);
            product += length * slope;
            (before, last) = (size, unit);
            size = sizes.iter().sum();
        }
        Ok(product)
    }
}

/// A number by the diagonal; 0 where there is no velocity.
#[inline(always)]
fn over(number: f32, diagonal: f32) -> f32 {
    let by = number / diagonal;
    if diagonal > 0.0 { by } else { 0.0 }
}

/// Writes D⁻¹ b; returns bᵀ D⁻¹ b.
#[multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
fn divide(b: &[f32], diagonals: &[f32], out: &mut [f32]) -> f64 {
    let n = out.len();
    let (b, diagonals) = (&b[..n], &diagonals[..n]);
    for i in 0..n {
        out[i] = over(b[i], diagonals[i]);
    }
    let [sum] = summed(n, |i| [b[i] * out[i]]);
    sum
}

/// Writes r where there is a velocity; returns rᵀ D⁻¹ r.
#[multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
fn take(r: &[f32], diagonals: &[f32], out: &mut [f32]) -> f64 {
    let n = out.len();
    let (r, diagonals) = (&r[..n], &diagonals[..n]);
    for i in 0..n {
        out[i] = if diagonals[i] > 0.0 { r[i] } else { 0.0 };
    }
    let [sum] = summed(n, |i| [out[i] * over(out[i], diagonals[i])]);
    sum
}

/// d ← factor · d + other factor · D⁻¹ r.
#[multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
fn turn([keep, add]: [f32; 2], r: &[f32], diagonals: &[f32], d: &mut [f32]) {
    let n = d.len();
    let (r, diagonals) = (&r[..n], &diagonals[..n]);
    for i in 0..n {
        d[i] = keep * d[i] + add * over(r[i], diagonals[i]);
    }
}

/// Writes r − length · (D d − inflow) over the inflow.
#[multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
fn step(length: f32, r: &[f32], [d, diagonals]: [&[f32]; 2], inflow: &mut [f32]) {
    let n = inflow.len();
    let (r, d, diagonals) = (&r[..n], &d[..n], &diagonals[..n]);
    for i in 0..n {
        inflow[i] = r[i] - length * (diagonals[i] * d[i] - inflow[i]);
    }
}

/// dᵀ r and dᵀ D d.
#[multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
fn slope_and_energy(d: &[f32], r: &[f32], diagonals: &[f32]) -> [f64; 2] {
    let n = d.len();
    let (r, diagonals) = (&r[..n], &diagonals[..n]);
    summed(n, |i| [d[i] * r[i], diagonals[i] * d[i] * d[i]])
}

/// aᵀ b.
#[multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
fn dot(a: &[f32], b: &[f32]) -> f64 {
    let n = a.len();
    let b = &b[..n];
    let [sum] = summed(n, |i| [a[i] * b[i]]);
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Key;
    use crate::transport::stokes::tests::spaces;

    #[test]
    fn solved_velocities_fulfil_their_equations() {
        let silent = Monitor::silent();
        for space in spaces() {
            let grid = Grid::new(&space, [1.0, 2.0, 0.7], &silent).unwrap();
            let lines = &grid.lines;
            let rows = 0..lines.places.rows();
            let mut viscous = Viscous::new(&grid);
            for axis in 0..3 {
                let right = |colour: Colour, row: usize, i: usize| {
                    Key::new(7).unit((2 * (row * lines.length + i) + colour as usize) as u64)
                };
                let [mut red, mut black] = [Red, Black].map(|colour| vec![0.0; lines.len(colour)]);
                let product = viscous
                    .solve(
                        &grid,
                        axis,
                        1e-6,
                        |rows, colour, out| {
                            lines.for_each(rows, colour, out, |row, _, line| {
                                for (i, b) in line.iter_mut().enumerate() {
                                    *b = right(colour, row, i);
                                }
                            });
                        },
                        |u, factor| {
                            for (sum, u) in red.iter_mut().zip(u.red) {
                                *sum += factor as f32 * u.to_f32();
                            }
                            for (sum, u) in black.iter_mut().zip(u.black) {
                                *sum += factor as f32 * u;
                            }
                        },
                        &silent,
                    )
                    .unwrap();
                let short: Vec<f16> = red.iter().map(|&u| f16::from_f32(u)).collect();
                let mut energy = 0.0;
                for (colour, own) in [(Red, &red), (Black, &black)] {
                    let [mut diagonals, mut image, mut more] =
                        [0, 1, 2].map(|_| vec![0.0; own.len()]);
                    grid.diagonals(axis, rows.clone(), colour, &mut diagonals);
                    grid.of_red(rows.clone(), colour, &short, &mut image);
                    if colour == Red {
                        grid.of_black(rows.clone(), &black, &mut more);
                    }
                    lines.for_each(rows.clone(), colour, &mut image, |row, odd, image| {
                        let diagonals = lines.line(row, odd, &diagonals);
                        let (own, more) = (lines.line(row, odd, own), lines.line(row, odd, &more));
                        for (i, &diagonal) in diagonals.iter().enumerate() {
                            if diagonal == 0.0 {
                                assert_eq!(own[i].to_bits(), 0);
                                continue;
                            }
                            let b = right(colour, row, i);
                            energy += f64::from(b * own[i]);
                            let off = diagonal * own[i] - image[i] - more[i] - b;
                            // Red velocities are rounded to 16 bits here.
                            let rounding = 1e-3 * diagonal * own[i].abs().max(0.1);
                            assert!(off.abs() < rounding, "{:?} {axis} {off}", space.shape);
                        }
                    });
                }
                assert!((product / energy - 1.0).abs() < 1e-4 || energy == 0.0);
            }
        }
    }
}
