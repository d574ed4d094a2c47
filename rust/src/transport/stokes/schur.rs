//! Conjugate gradients for the pressure: Gᵀ A⁻¹ G p = Gᵀ A⁻¹ 1, where each product with A⁻¹ is a
//! solution for the velocities of one axis after the other (Uzawa's method, with directions that are
//! conjugate).
//!
//! Neither the pressure nor the velocities are kept: what is asked of them, the flow through the
//! planes, is linear, so that it is that of the directions. A flow has four unknowns a voxel, of which
//! only one is ever held at a time.

use half::f16;

use super::super::diffusion::report;
use super::grid::Grid;
use super::preconditioner::Preconditioner;
use super::viscous::Viscous;
use crate::error::Result;
use crate::monitor::Monitor;
use crate::transport::Settings;
use crate::transport::compact::{Short, narrow, widen};
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
    let mut image = vec![0.0f32; voxels];
    let mut fluxes = vec![0.0; grid.planes()];
    viscous.solve(
        grid,
        0,
        settings.tolerance,
        |_, _, out| out.fill(1.0),
        |u, length| {
            grid.add_inflow(0, u, length as f32, &mut image, monitor);
            grid.add_fluxes(u, length, &mut fluxes);
        },
        monitor,
    )?;
    let mut residual: Vec<Short> = image.iter().map(|&r| Short::new(r)).collect();
    let mut direction = vec![f16::ZERO; voxels];
    let (mut before, mut last, mut first) = (0.0, 0.0, None);
    let mut iterations = 0;
    loop {
        monitor.check()?;
        let degrees = &mut viscous.room()[..voxels];
        let preconditioned = preconditioner.run(&residual, &mut image, degrees, monitor);
        let of = |term: fn(f32, f32) -> f32| {
            sum(voxels, |range| {
                let mut z = Vec::new();
                preconditioned.write(&residual, range.clone(), &mut z);
                residual[range].iter().zip(z).map(|(r, z)| f64::from(term(r.get(), z))).sum()
            })
        };
        let size = of(|r, z| r * z);
        let share = (size.max(0.0) / first.get_or_insert(size).max(f64::MIN_POSITIVE)).sqrt();
        report(monitor, share, 1.0, settings.tolerance);
        if share <= settings.tolerance || iterations == settings.iterations {
            return Ok(Solved { fluxes, residual: share, iterations });
        }
        // Directions have numbers near 1.
        let unit = (of(|_, z| z * z) / voxels as f64).sqrt();
        let ratio = if iterations == 0 { 0.0 } else { (size / before * last / unit) as f32 };
        for_chunks(&mut direction, monitor, |first, direction| {
            let (mut z, mut new) = (Vec::new(), Vec::new());
            preconditioned.write(&residual, first..first + direction.len(), &mut z);
            widen(direction, &mut new);
            for (d, z) in new.iter_mut().zip(z) {
                *d = ratio * *d + z / unit as f32;
            }
            narrow(&mut new, direction);
        });
        // The direction has been rounded: what follows is exact for it as it is.
        let slope = sum(voxels, |range| {
            let mut d = Vec::new();
            widen(&direction[range.clone()], &mut d);
            residual[range].iter().zip(d).map(|(r, d)| f64::from(r.get() * d)).sum()
        });
        image.fill(0.0);
        let mut curvature = 0.0;
        let tolerance = (LOOSER * settings.tolerance / share.sqrt()).min(ROUGHEST);
        let mut along = vec![0.0; fluxes.len()];
        for axis in 0..3 {
            curvature += viscous.solve(
                grid,
                axis,
                tolerance,
                |rows, colour, out| grid.slopes(axis, rows, colour, &direction, out),
                |u, length| {
                    grid.add_inflow(axis, u, length as f32, &mut image, monitor);
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
        let length = slope / curvature;
        for (flux, along) in fluxes.iter_mut().zip(along) {
            *flux -= length * along;
        }
        for_chunks(&mut residual, monitor, |first, residual| {
            for (r, image) in residual.iter_mut().zip(&image[first..]) {
                *r = Short::new(r.get() - length as f32 * image);
            }
        });
        (before, last) = (size, unit);
        iterations += 1;
    }
}
