//! A symmetric positive preconditioner for the pressure.
//!
//! The Schur complement Gᵀ A⁻¹ G is the identity for changes from voxel to voxel, and for slow changes
//! Darcy's operator Gᵀ K G, where K = A⁻¹ 1 is how easily each face lets a fluid pass if pressure does
//! not react. Its inverse is taken as the sum of both inverses (after Cahouet and Chabard 1988), the
//! second by a multigrid cycle. K is only kept between cubes of voxels: on the voxels, where the identity
//! rules wherever pores are not narrow, its mean serves as well.

use std::ops::Range;

use half::f16;

use super::grid::Grid;
use super::viscous::Viscous;
use crate::error::Result;
use crate::monitor::Monitor;
use crate::transport::compact::{Short, narrow, widen};
use crate::transport::even::Even;
use crate::transport::finest::Cycle;
use crate::transport::links::{Conductances, Real};
use crate::transport::pore::PoreSpace;

/// Relative residual of K: more exact does not save iterations.
const CONDUCTANCE_TOLERANCE: f64 = 0.02;

pub(super) struct Preconditioner<'a> {
    space: &'a PoreSpace,
    darcy: Cycle,
    /// Mean conductance along each axis.
    conductances: [f64; 3],
}

/// z = P⁻¹ r.
pub(super) struct Preconditioned<'r> {
    /// The solution of the cycle, and what it is to be multiplied by.
    solution: &'r [f16],
    scale: f32,
}

impl<'a> Preconditioner<'a> {
    pub fn new(grid: &Grid<'a>, viscous: &mut Viscous, monitor: &Monitor<'_>) -> Result<Self> {
        let darcy = Darcy::new(grid, viscous, monitor)?;
        let Darcy { space, means, .. } = darcy;
        Ok(Self { space, darcy: Cycle::new(&darcy, monitor)?, conductances: means })
    }

    /// Finds z ← P⁻¹ r for a residual r. `room` has one number a voxel, `more` a byte.
    pub fn run<'r>(
        &mut self,
        residual: &[Short],
        room: &'r mut [f32],
        more: &mut [u8],
        monitor: &Monitor<'_>,
    ) -> Preconditioned<'r> {
        let right = |voxels: Range<usize>, out: &mut Vec<f32>| {
            out.clear();
            out.extend(residual[voxels].iter().map(|r| r.get()));
        };
        let links = Even::new(self.space, self.conductances, more, monitor);
        let (solution, other) = bytemuck::cast_slice_mut(room).split_at_mut(residual.len());
        let scale = self.darcy.run(&links, right, [solution, other], monitor) as f32;
        Preconditioned { solution, scale }
    }
}

impl Preconditioned<'_> {
    /// Writes z of some voxels.
    pub fn write(&self, residual: &[Short], voxels: Range<usize>, out: &mut Vec<f32>) {
        widen(&self.solution[voxels.clone()], out);
        for (z, r) in out.iter_mut().zip(&residual[voxels]) {
            *z = r.get() + self.scale * *z;
        }
    }
}

/// Darcy's operator on the voxels; inlet and outlet are held at 0.
struct Darcy<'a> {
    space: &'a PoreSpace,
    /// Conductances through the faces after each voxel.
    after: [Vec<f16>; 3],
    /// Mean of those along each axis that let a fluid pass; 1 if there is none.
    means: [f64; 3],
}

impl<'a> Darcy<'a> {
    /// Memory: 6 bytes a voxel, 10 while it begins.
    fn new(grid: &Grid<'a>, viscous: &mut Viscous, monitor: &Monitor<'_>) -> Result<Self> {
        let space = grid.space;
        let after = [0, 1, 2].map(|_| vec![f16::ZERO; space.len()]);
        let mut darcy = Self { space, after, means: [1.0; 3] };
        let mut found = vec![0.0f32; space.len()];
        for axis in 0..3 {
            found.fill(0.0);
            viscous.solve(
                grid,
                axis,
                CONDUCTANCE_TOLERANCE,
                |_, _, out| out.fill(1.0),
                |u, length| {
                    let factor = length as f32 * grid.weights[axis];
                    grid.add_velocities(u, factor, &mut found, monitor);
                },
                monitor,
            )?;
            // Where there is no velocity there is none to the last bit; elsewhere an error of the iteration
            // must not make a conductance negative. This is the least, between walls on all sides.
            let least = 0.1 * grid.weights[axis] / grid.weights.iter().sum::<f32>();
            let sums = space.parts.map(&mut darcy.after[axis], monitor, |_, first, after| {
                let mut along = found[first..first + after.len()].to_vec();
                let (mut sum, mut count) = (0.0, 0.0);
                for k in along.iter_mut().filter(|k| **k != 0.0) {
                    *k = k.max(least);
                    sum += f64::from(*k);
                    count += 1.0;
                }
                narrow(&mut along, after);
                [sum, count]
            });
            let [sum, count] = [0, 1].map(|i| sums.iter().map(|sums| sums[i]).sum::<f64>());
            if count > 0.0 {
                darcy.means[axis] = sum / count;
            }
        }
        Ok(darcy)
    }
}

impl Conductances for Darcy<'_> {
    fn space(&self) -> &PoreSpace {
        self.space
    }

    #[inline(always)]
    fn after<T: Real>(&self, axis: usize, voxel: usize) -> T {
        T::from_single(self.after[axis][voxel].to_f32())
    }

    // There is no voxel before the inlet that would have it.
    #[inline(always)]
    fn inlet(&self, voxel: usize) -> f32 {
        let after = self.after[0][voxel].to_f32();
        if after > 0.0 { after } else { self.means[0] as f32 }
    }

    #[inline(always)]
    fn outlet(&self, voxel: usize) -> f32 {
        self.after[0][voxel].to_f32()
    }
}
