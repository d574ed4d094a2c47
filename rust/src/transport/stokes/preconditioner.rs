//! A symmetric positive preconditioner of two blocks for the Stokes operator.
//!
//! Velocities: a Chebyshev polynomial of the viscous operator A. Pressure: the Schur complement
//! Gᵀ A⁻¹ G is the identity for changes from voxel to voxel, and for slow changes Darcy's operator
//! Gᵀ K G, where K = A⁻¹ 1 is how easily each face lets a fluid pass if pressure does not react. Its
//! inverse is taken as the sum of both inverses (after Cahouet and Chabard 1988), the second by a
//! multigrid cycle.

use std::ops::Range;

use half::f16;
use multiversion::multiversion;

use super::grid::{Grid, PRESSURE, Unknowns};
use crate::error::Result;
use crate::monitor::Monitor;
use crate::transport::chebyshev;
use crate::transport::compact::widen;
use crate::transport::finest::Cycle;
use crate::transport::links::{self, Conductances, Real};
use crate::transport::pore::PoreSpace;
use crate::transport::vectors::{for_chunks, sum};

/// Relative residual of K: more exact does not save iterations.
const CONDUCTANCE_TOLERANCE: f64 = 0.02;
/// Most iterations for K.
const CONDUCTANCE_ITERATIONS: usize = 200;

/// Degree of the Chebyshev polynomial.
const DEGREE: usize = 8;
/// Eigenvalues of D⁻¹A that it is made for: all, but for the slow ones of wide pores. From degree 4
/// to 14 and from 0.01 to 0.1 the time to a solution changes by less than a quarter for a sandstone.
const EIGENVALUES: [f32; 2] = [0.02, 2.0];

pub(super) struct Preconditioner<'a> {
    pressures: Cycle<Darcy<'a>>,
    other: Vec<Unknowns>,
}

impl<'a> Preconditioner<'a> {
    pub fn new(grid: &Grid<'a>, monitor: &Monitor<'_>) -> Result<Self> {
        let pressures =
            Cycle::new(Darcy::new(grid, &conductances(grid, monitor)?, monitor), monitor)?;
        Ok(Self { pressures, other: vec![[0.0; 4]; grid.len()] })
    }

    /// z ← P⁻¹ r.
    pub fn apply(
        &mut self,
        grid: &Grid<'_>,
        r: &[Unknowns],
        z: &mut Vec<Unknowns>,
        monitor: &Monitor<'_>,
    ) {
        self.velocities(grid, r, z, monitor);
        let right = |voxels: Range<usize>, out: &mut Vec<f32>| {
            out.clear();
            out.extend(r[voxels].iter().map(|r| r[PRESSURE]));
        };
        let scale = self.pressures.run(right, monitor) as f32;
        let pressures = &self.pressures.solution;
        for_chunks(&mut z[..pressures.len()], monitor, |first, z| {
            let mut added = Vec::new();
            widen(&pressures[first..first + z.len()], &mut added);
            for ((z, r), added) in z.iter_mut().zip(&r[first..]).zip(added) {
                z[PRESSURE] = r[PRESSURE] + scale * added;
            }
        });
    }

    /// Chebyshev iteration for A z = r from zero, of which each step overwrites the values of two
    /// steps before; pressures become 0.
    fn velocities(
        &mut self,
        grid: &Grid<'_>,
        r: &[Unknowns],
        z: &mut Vec<Unknowns>,
        monitor: &Monitor<'_>,
    ) {
        let [(_, first), factors @ ..] = chebyshev::factors::<DEGREE>(EIGENVALUES);
        self.other.fill([0.0; 4]);
        for_chunks(z, monitor, |start, z| {
            for (i, z) in z.iter_mut().enumerate() {
                let (inverse, right) = (&grid.inverse[start + i], &r[start + i]);
                *z = [0, 1, 2, 3].map(|c| first * inverse[c] * right[c]);
            }
        });
        for (keep, add) in factors {
            grid.for_rows(&mut self.other, monitor, |_, row, other| {
                for (node, other) in row.nodes.clone().zip(other) {
                    let (inverse, right) = (&grid.inverse[node], &r[node]);
                    let own = &z[node];
                    let sum = grid.weighted_sum(&grid.around(row, node, z));
                    for c in 0..4 {
                        // D⁻¹ (r − A z)
                        let residual = inverse[c] * (right[c] + sum[c]) - own[c];
                        other[c] = own[c] + keep * (own[c] - other[c]) + add * residual;
                    }
                }
                0.0
            });
            std::mem::swap(z, &mut self.other);
        }
    }
}

/// Darcy's operator on the voxels; inlet and outlet are held at 0.
struct Darcy<'a> {
    space: &'a PoreSpace,
    /// Conductances through the faces after each voxel.
    after: [Vec<f32>; 3],
    /// Conductances from the inlet to the voxels of the first plane of an open volume.
    inlet: Vec<f32>,
    /// Sum of the conductances of each voxel.
    diagonals: Vec<f32>,
}

impl<'a> Darcy<'a> {
    fn new(grid: &Grid<'a>, conductances: &[Unknowns], monitor: &Monitor<'_>) -> Self {
        let (voxels, before) = conductances.split_at(grid.space.len());
        let along = |axis: usize, all: &[Unknowns]| {
            all.iter().map(|k| k[axis] * grid.weights[axis]).collect()
        };
        let mut darcy = Self {
            space: grid.space,
            after: [0, 1, 2].map(|axis| along(axis, voxels)),
            inlet: along(0, before),
            diagonals: Vec::new(),
        };
        darcy.diagonals = links::all_diagonals(&darcy, |sum| sum, monitor);
        darcy
    }
}

impl Conductances for Darcy<'_> {
    fn space(&self) -> &PoreSpace {
        self.space
    }

    fn gather(&self, rows: Range<usize>, values: &[f16], inflow: &mut Vec<f32>) {
        gather(self, rows, values, inflow);
    }

    #[inline(always)]
    fn after<T: Real>(&self, axis: usize, voxel: usize) -> T {
        T::from_single(self.after[axis][voxel])
    }

    #[inline(always)]
    fn inlet(&self, voxel: usize) -> f32 {
        self.inlet[voxel]
    }

    #[inline(always)]
    fn outlet(&self, voxel: usize) -> f32 {
        self.after[0][voxel]
    }

    #[inline(always)]
    fn diagonals(&self, voxels: Range<usize>, out: &mut Vec<f32>) {
        out.clear();
        out.extend_from_slice(&self.diagonals[voxels]);
    }
}

#[multiversion(targets(
    "x86_64+avx512f+avx512vl+popcnt+bmi1+bmi2",
    "x86_64+avx2+popcnt+bmi1+bmi2"
))]
fn gather(darcy: &Darcy<'_>, rows: Range<usize>, values: &[f16], inflow: &mut Vec<f32>) {
    links::gather(darcy, rows, values, inflow);
}

/// K = A⁻¹ 1 for the velocities of all three axes, roughly, by conjugate gradients.
fn conductances(grid: &Grid<'_>, monitor: &Monitor<'_>) -> Result<Vec<Unknowns>> {
    let ones = |d: &Unknowns| d.map(|d| if d > 0.0 { 1.0 } else { 0.0 });
    let mut residual: Vec<Unknowns> = grid.inverse.iter().map(ones).collect();
    let mut solution = vec![[0.0f32; 4]; grid.len()];
    let mut direction = solution.clone();
    let mut image = solution.clone();
    let (mut before, mut first) = (0.0, 0.0);
    let mut iterations = 0;
    loop {
        monitor.check()?;
        let product = sum(grid.len(), |nodes| {
            let each = residual[nodes.clone()].iter().zip(&grid.inverse[nodes]);
            each.map(|(r, d)| (0..4).map(|c| f64::from(r[c] * r[c] * d[c])).sum::<f64>()).sum()
        });
        if iterations == 0 {
            first = product;
        }
        let reached = product <= first * CONDUCTANCE_TOLERANCE.powi(2);
        if reached || iterations == CONDUCTANCE_ITERATIONS {
            break;
        }
        let ratio = if iterations == 0 { 0.0 } else { (product / before) as f32 };
        for_chunks(&mut direction, monitor, |first, direction| {
            for (i, direction) in direction.iter_mut().enumerate() {
                let (r, d) = (&residual[first + i], &grid.inverse[first + i]);
                *direction = [0, 1, 2, 3].map(|c| ratio * direction[c] + r[c] * d[c]);
            }
        });
        let curvature = grid.for_rows(&mut image, monitor, |_, row, image| {
            let mut curvature = 0.0;
            for (node, image) in row.nodes.clone().zip(image) {
                let own = direction[node];
                *image = grid.viscous(node, own, &grid.around(row, node, &direction));
                curvature += (0..4).map(|c| f64::from(own[c] * image[c])).sum::<f64>();
            }
            curvature
        });
        if curvature <= 0.0 {
            break;
        }
        let length = (product / curvature) as f32;
        combine(&mut solution, [1.0, length], &direction, monitor);
        combine(&mut residual, [1.0, -length], &image, monitor);
        before = product;
        iterations += 1;
    }
    // An error of the iteration must not make a conductance negative.
    for_chunks(&mut solution, monitor, |first, solution| {
        for (k, inverse) in solution.iter_mut().zip(&grid.inverse[first..]) {
            *k = [0, 1, 2, 3].map(|c| k[c].max(inverse[c] / 2.0));
        }
    });
    Ok(solution)
}

/// a ← keep · a + factor · b.
pub(super) fn combine(
    a: &mut [Unknowns],
    [keep, factor]: [f32; 2],
    b: &[Unknowns],
    monitor: &Monitor<'_>,
) {
    for_chunks(a, monitor, |first, a| {
        for (a, b) in a.iter_mut().zip(&b[first..]) {
            for (a, b) in a.iter_mut().zip(b) {
                *a = keep * *a + factor * *b;
            }
        }
    });
}
