//! A multigrid cycle whose finest level is the voxels of a pore space, to precondition with.
//!
//! The next level is of [`cubes`](super::cubes), from which on [`multigrid`](super::multigrid) goes on
//! with lists of links. On the voxels there are none, and no more vectors than two, of 16 bits: a step
//! of the smoother overwrites the values of two steps before.

use std::ops::Range;

use half::f16;
use multiversion::multiversion;

use super::chebyshev;
use super::compact::{narrow, widen};
use super::cubes::{Cubes, Names};
use super::links::{Conductances, Operator};
use super::multigrid::Multigrid;
use crate::error::Result;
use crate::monitor::Monitor;

/// What the correction of the cubes is multiplied by: constant in cubes of 4³, it is too stiff by a factor
/// near 4.
const OVERCORRECTION: f32 = 3.0;
/// Degree of the Chebyshev smoother, before and after the correction. From 2 to 4, with eigenvalues from
/// 0.3 to 0.15 and corrections from 2 to 4 times as large, the time to a solution is within a fifth.
const DEGREE: usize = 3;
/// Eigenvalues of D⁻¹A that the smoother damps.
const SMOOTHED: [f32; 2] = [0.2, 2.0];

/// Right sides are scaled to this root of their mean square, for 16 bits have room for numbers near 1;
/// what a cycle makes of them is up to as many times as large as the square of the voxels on an axis.
const TYPICAL: f64 = 1.0 / 64.0;

/// The cycle for the conductances of the voxels.
pub(super) struct Cycle {
    cubes: Cubes,
    coarse: Multigrid,
}

/// What a cycle works on: the solution, and that of the step before.
struct Room<'r> {
    solution: &'r mut [f16],
    other: &'r mut [f16],
}

impl Cycle {
    /// A cycle whose coarse levels have these conductances.
    ///
    /// Memory: 86 bytes a cube that has one node.
    pub fn new(links: &impl Conductances, monitor: &Monitor<'_>) -> Result<Self> {
        let cubes = Cubes::new(links.space());
        let places = cubes.places();
        let graph = cubes.graph(links, &places, monitor)?;
        let coarse = Multigrid::new(graph, places, cubes.shape, monitor)?;
        Ok(Self { cubes, coarse })
    }

    /// Approximates the solution of A x = b from zero: the first of two vectors, times the number that it
    /// returns; the other one is room. `links` is A on the voxels.
    ///
    /// `right(voxels, out)` writes what b is there.
    pub fn run(
        &mut self,
        links: &impl Operator,
        right: impl Fn(Range<usize>, &mut Vec<f32>) + Sync,
        [solution, other]: [&mut [f16]; 2],
        monitor: &Monitor<'_>,
    ) -> f64 {
        let space = links.space();
        let square = space.parts.sum(|_, own| {
            let mut b = Vec::new();
            right(own, &mut b);
            b.iter().map(|&b| f64::from(b).powi(2)).sum()
        });
        let scale = (square / space.len() as f64).sqrt() / TYPICAL;
        if scale == 0.0 {
            solution.fill(f16::ZERO);
            return scale;
        }
        let right = |voxels: Range<usize>, out: &mut Vec<f32>| {
            right(voxels, out);
            for b in out.iter_mut() {
                *b *= scale.recip() as f32;
            }
        };
        // What it had is taken 0 times, which of some bits makes no number.
        other.fill(f16::ZERO);
        let mut room = Room { solution, other };
        room.smooth(links, &right, true, monitor);
        let Self { cubes, coarse } = self;
        let solution = &mut *room.solution;
        cubes.parts.map(coarse.right(), monitor, |rows, start, coarse| {
            let (mut b, mut inflow, mut x, mut diagonal) = Default::default();
            let mut names = Names::new(space, cubes);
            coarse.fill(0.0);
            for rows in rows.flat_map(|row| cubes.rows_of(space, row)) {
                let voxels = space.voxels_of(rows.clone());
                links.gather(rows.clone(), solution, &mut inflow);
                links.diagonals(voxels.clone(), &mut diagonal);
                widen(&solution[voxels.clone()], &mut x);
                right(voxels, &mut b);
                for (i, b) in b.iter_mut().enumerate() {
                    *b += inflow[i] - diagonal[i] * x[i];
                }
                let mut residuals = b.as_slice();
                for row in rows {
                    names.for_row(row, |node, count| {
                        let (these, rest) = residuals.split_at(count);
                        coarse[node - start] += these.iter().sum::<f32>();
                        residuals = rest;
                    });
                }
            }
        });
        let correction = coarse.cycle(monitor);
        space.parts.map(solution, monitor, |rows, _, solution| {
            let mut x = Vec::new();
            widen(solution, &mut x);
            let mut names = Names::new(space, cubes);
            let mut values = x.as_mut_slice();
            for row in rows {
                names.for_row(row, |node, count| {
                    let (these, rest) = std::mem::take(&mut values).split_at_mut(count);
                    for x in these.iter_mut() {
                        *x += OVERCORRECTION * correction[node];
                    }
                    values = rest;
                });
            }
            narrow(&mut x, solution);
        });
        room.smooth(links, &right, false, monitor);
        scale
    }
}

impl Room<'_> {
    /// Chebyshev iteration; `from_zero` forgets the solution that is there.
    fn smooth(
        &mut self,
        links: &impl Operator,
        right: &(impl Fn(Range<usize>, &mut Vec<f32>) + Sync),
        from_zero: bool,
        monitor: &Monitor<'_>,
    ) {
        let Self { solution, other } = self;
        for (k, factors) in chebyshev::factors::<DEGREE>(SMOOTHED).into_iter().enumerate() {
            let zero = k == 0 && from_zero;
            if zero {
                solution.fill(f16::ZERO);
            }
            links.space().parts.map(other, monitor, |rows, first, other| {
                let voxels = first..first + other.len();
                let (mut b, mut inflow, mut diagonal) = Default::default();
                let (mut x, mut new) = (Vec::new(), Vec::new());
                right(voxels.clone(), &mut b);
                if zero {
                    inflow = vec![0.0; other.len()];
                } else {
                    links.gather(rows, solution, &mut inflow);
                }
                links.diagonals(voxels.clone(), &mut diagonal);
                widen(&solution[voxels], &mut x);
                widen(other, &mut new);
                step([&b, &inflow, &diagonal, &x], factors, &mut new);
                narrow(&mut new, other);
            });
            std::mem::swap(solution, other);
        }
    }
}

/// A step of the iteration, from `x` on, which overwrites the values of the step before that one.
#[multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
fn step([b, inflow, diagonal, x]: [&[f32]; 4], (keep, add): (f32, f32), out: &mut [f32]) {
    let n = out.len();
    let (b, inflow, diagonal, x) = (&b[..n], &inflow[..n], &diagonal[..n], &x[..n]);
    for i in 0..n {
        let residual = (b[i] + inflow[i]) / diagonal[i] - x[i];
        let residual = if diagonal[i] > 0.0 { residual } else { 0.0 };
        out[i] = x[i] + keep * (x[i] - out[i]) + add * residual;
    }
}
