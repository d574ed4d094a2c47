//! A symmetric positive preconditioner for the pressure.
//!
//! The Schur complement Gᵀ A⁻¹ G is the identity for changes from voxel to voxel, and for slow changes
//! Darcy's operator Gᵀ K G, where K = A⁻¹ 1 is how easily each face lets a fluid pass if pressure does
//! not react. Its inverse is taken as the sum of both inverses (after Cahouet and Chabard 1988), the
//! second by a multigrid cycle.

use std::ops::Range;

use half::f16;
use multiversion::multiversion;

use super::grid::Grid;
use super::viscous::Viscous;
use crate::error::Result;
use crate::monitor::Monitor;
use crate::transport::compact::widen;
use crate::transport::finest::Cycle;
use crate::transport::links::{self, Conductances, Real};
use crate::transport::pore::PoreSpace;
use crate::transport::vectors::for_chunks;

/// Relative residual of K: more exact does not save iterations.
const CONDUCTANCE_TOLERANCE: f64 = 0.02;

pub(super) struct Preconditioner<'a> {
    darcy: Cycle<Darcy<'a>>,
    /// What the solution of the cycle is to be multiplied by.
    scale: f32,
}

impl<'a> Preconditioner<'a> {
    pub fn new(grid: &Grid<'a>, viscous: &mut Viscous, monitor: &Monitor<'_>) -> Result<Self> {
        let darcy = Cycle::new(Darcy::new(grid, viscous, monitor)?, monitor)?;
        Ok(Self { darcy, scale: 0.0 })
    }

    /// Prepares z ← P⁻¹ r for a residual r.
    pub fn run(&mut self, residual: &[f32], monitor: &Monitor<'_>) {
        let right = |voxels: Range<usize>, out: &mut Vec<f32>| {
            out.clear();
            out.extend_from_slice(&residual[voxels]);
        };
        self.scale = self.darcy.run(right, monitor) as f32;
    }

    /// Writes z of some voxels, of the residual that was prepared.
    pub fn pressures(&self, residual: &[f32], voxels: Range<usize>, out: &mut Vec<f32>) {
        widen(&self.darcy.solution[voxels.clone()], out);
        for (z, r) in out.iter_mut().zip(&residual[voxels]) {
            *z = r + self.scale * *z;
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
    fn new(grid: &Grid<'a>, viscous: &mut Viscous, monitor: &Monitor<'_>) -> Result<Self> {
        let mut darcy = Self {
            space: grid.space,
            after: Default::default(),
            inlet: Vec::new(),
            diagonals: Vec::new(),
        };
        for axis in 0..3 {
            let mut along = conductances(grid, viscous, axis, monitor)?;
            let before = along.split_off(grid.space.len());
            if axis == 0 {
                darcy.inlet = before;
            }
            darcy.after[axis] = along;
        }
        darcy.diagonals = links::all_diagonals(&darcy, |sum| sum, monitor);
        Ok(darcy)
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

/// K = A⁻¹ 1 for the velocities of an axis, roughly, by the square of the step.
fn conductances(
    grid: &Grid<'_>,
    viscous: &mut Viscous,
    axis: usize,
    monitor: &Monitor<'_>,
) -> Result<Vec<f32>> {
    let mut found = vec![0.0f32; grid.len()];
    let add = |u: &[f32], length: f32| {
        for_chunks(&mut found, monitor, |first, found| {
            for (found, u) in found.iter_mut().zip(&u[first..]) {
                *found += length * u;
            }
        });
    };
    viscous.solve(grid, axis, CONDUCTANCE_TOLERANCE, |_, _| 1.0, add, monitor)?;
    // An error of the iteration must not make a conductance negative.
    for_chunks(&mut found, monitor, |first, found| {
        for (k, diagonal) in found.iter_mut().zip(&grid.diagonals[first..]) {
            if diagonal[axis] > 0.0 {
                *k = k.max(0.5 / diagonal[axis]) * grid.weights[axis];
            }
        }
    });
    Ok(found)
}
