//! Conjugate gradients for the pressure: Gᵀ A⁻¹ G p = Gᵀ A⁻¹ 1, where each product with A⁻¹ is a
//! solution for the velocities of one axis after the other (Uzawa's method, with directions that are
//! conjugate).
//!
//! Neither the pressure nor the velocities are kept: what is asked of them, the flow through the
//! planes, is linear, so that it is that of the directions. A flow has four unknowns a voxel, of which
//! only one is ever held at a time.

use super::super::diffusion::report;
use super::grid::Grid;
use super::preconditioner::Preconditioner;
use super::viscous::Viscous;
use crate::error::Result;
use crate::monitor::Monitor;
use crate::transport::Settings;
use crate::transport::vectors::{for_chunks, sum};

/// Tolerance of the velocities by that of the pressure. On blobs, a sandstone and noise the permeability
/// is then right to 0.3 times the tolerance of the pressure (of 1e-4); with 10 to all of it, in four
/// fifths of the time.
const LOOSER: f64 = 3.0;
/// Largest tolerance of the velocities. The nearer the pressure, the rougher its directions may be
/// followed (van den Eshof and Sleijpen 2004): by the square root, for in proportion the permeability
/// is off by up to nine times the tolerance.
const ROUGHEST: f64 = 0.1;

pub(super) struct Solved {
    /// Flow through each plane.
    pub fluxes: Vec<f64>,
    pub residual: f64,
    pub iterations: usize,
}

/// Solves for the flow that a unit force along axis 0 drives.
pub(super) fn solve(
    grid: &Grid<'_>,
    preconditioner: &mut Preconditioner<'_>,
    viscous: &mut Viscous,
    settings: &Settings,
    monitor: &Monitor<'_>,
) -> Result<Solved> {
    let voxels = grid.space.len();
    let exact = LOOSER * settings.tolerance;
    // Behind the voxels are their copies before the inlet, and what stands for no voxel: without use
    // here, and without pressure.
    let mut residual = vec![0.0f32; grid.len()];
    let mut fluxes = vec![0.0; grid.planes()];
    viscous.solve(
        grid,
        0,
        settings.tolerance,
        |_, _| 1.0,
        |u, length| {
            grid.add_inflow(0, u, length, &mut residual, monitor);
            grid.add_fluxes(u, length, &mut fluxes);
        },
        monitor,
    )?;
    let mut direction = vec![0.0f32; grid.len()];
    let mut image = vec![0.0f32; grid.len()];
    let (mut before, mut first) = (0.0, None);
    let mut iterations = 0;
    loop {
        monitor.check()?;
        preconditioner.run(&residual[..voxels], monitor);
        let size = sum(voxels, |range| {
            let mut z = Vec::new();
            preconditioner.pressures(&residual, range.clone(), &mut z);
            residual[range].iter().zip(z).map(|(r, z)| f64::from(r * z)).sum()
        });
        let share = (size.max(0.0) / first.get_or_insert(size).max(f64::MIN_POSITIVE)).sqrt();
        report(monitor, share, 1.0, settings.tolerance);
        if share <= settings.tolerance || iterations == settings.iterations {
            return Ok(Solved { fluxes, residual: share, iterations });
        }
        let ratio = if iterations == 0 { 0.0 } else { (size / before) as f32 };
        for_chunks(&mut direction[..voxels], monitor, |first, direction| {
            let mut z = Vec::new();
            preconditioner.pressures(&residual, first..first + direction.len(), &mut z);
            for (d, z) in direction.iter_mut().zip(z) {
                *d = ratio * *d + z;
            }
        });
        image.fill(0.0);
        let mut curvature = 0.0;
        let tolerance = (exact / share.sqrt()).min(ROUGHEST);
        let mut along = vec![0.0; fluxes.len()];
        for axis in 0..3 {
            curvature += viscous.solve(
                grid,
                axis,
                tolerance,
                |row, node| grid.slope(axis, row, node, &direction),
                |u, length| {
                    grid.add_inflow(axis, u, length, &mut image, monitor);
                    if axis == 0 {
                        grid.add_fluxes(u, length, &mut along);
                    }
                },
                monitor,
            )?;
        }
        if curvature <= 0.0 {
            return Ok(Solved { fluxes, residual: share, iterations });
        }
        let length = size / curvature;
        for (flux, along) in fluxes.iter_mut().zip(along) {
            *flux -= length * along;
        }
        for_chunks(&mut residual, monitor, |first, residual| {
            for (r, image) in residual.iter_mut().zip(&image[first..]) {
                *r -= length as f32 * image;
            }
        });
        before = size;
        iterations += 1;
    }
}
