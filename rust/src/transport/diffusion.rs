//! Steady diffusion through the pore: Laplace's equation on its voxels.
//!
//! One concentration a voxel, conductance between voxels that share a face, none through the solid.
//! With an open boundary the first and the last face of axis 0 are held at two concentrations, half
//! a voxel from the first centres, and nothing passes the other faces; with a periodic one the
//! concentration falls evenly from volume to volume. What is solved for is the deviation χ from the
//! even fall, by conjugate gradients with a multigrid cycle. χ is not kept: what is asked of it, the
//! dissipated energy and the fluxes through the planes, follows from what each iteration adds.

use std::ops::Range;

use half::f16;
use rayon::prelude::*;

use super::Settings;
use super::compact::{Long, narrow, single, widen};
use super::even::Even;
use super::finest::Cycle;
use super::links::shared;
use super::pore::PoreSpace;
use crate::error::Result;
use crate::monitor::Monitor;
use crate::volume::{Boundary, voxels};

/// How diffusion goes through a pore space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Diffusion {
    /// Effective diffusivity of the volume by that of the pore.
    pub diffusivity: f64,
    /// Difference between the largest and the smallest flux through a plane, by the mean flux.
    pub flux_mismatch: f64,
    /// Estimate of the relative error in the energy norm; the error of the diffusivity is about its
    /// square.
    pub residual: f64,
    /// Iterations done.
    pub iterations: usize,
}

/// Solves for the diffusion along axis 0.
///
/// Peak memory: 15 bytes a percolating voxel besides the pore space, 25 where pores are so narrow that
/// cubes have few voxels.
pub fn diffuse(space: &PoreSpace, settings: &Settings, monitor: &Monitor<'_>) -> Result<Diffusion> {
    if space.is_empty() {
        return Ok(Diffusion {
            diffusivity: 0.0,
            flux_mismatch: 0.0,
            residual: 0.0,
            iterations: 0,
        });
    }
    let [h, ..] = settings.spacing;
    let weights = settings.spacing.map(|s| (h / s).powi(2));
    let mut degrees = vec![0; space.len()];
    let problem = Problem(Even::new(space, weights, &mut degrees, monitor));
    let mut cycle = Cycle::new(&problem.0, monitor)?;
    let mut fluxes = problem.fluxes(1.0, |_| 0.0);
    let mut energy = problem.even_energy(&fluxes);
    let mut residual = problem.sources(monitor);
    let [mut solution, mut other, mut direction] = [0, 1, 2].map(|_| vec![f16::ZERO; space.len()]);
    let (mut before, mut last, mut first) = (0.0, 1.0, None);
    let mut iterations = 0;
    let error = loop {
        monitor.check()?;
        let right = |voxels: Range<usize>, out: &mut Vec<f32>| single(&residual[voxels], out);
        let scale = cycle.run(&problem.0, right, [&mut solution, &mut other], monitor);
        if scale == 0.0 {
            break 0.0;
        }
        let down = |vector: &[f16]| {
            space.parts.sum(|_, own| {
                let mut values = Vec::new();
                widen(&vector[own.clone()], &mut values);
                values.iter().zip(&residual[own]).map(|(&v, r)| f64::from(v) * r.get()).sum()
            })
        };
        let product = scale * down(&solution);
        // product ≈ |error|² in the energy norm.
        let error = (product / energy).sqrt();
        report(monitor, error, *first.get_or_insert(error), settings.tolerance);
        if error <= settings.tolerance || iterations == settings.iterations {
            break error;
        }
        // The direction is kept in the units of the last cycle.
        let ratio = if iterations == 0 { 0.0 } else { product / before * last / scale };
        space.parts.map(&mut direction, monitor, |_, first, direction| {
            let (mut new, mut old) = (Vec::new(), Vec::new());
            widen(&solution[first..first + direction.len()], &mut new);
            widen(direction, &mut old);
            for (new, old) in new.iter_mut().zip(old) {
                *new += ratio as f32 * old;
            }
            narrow(&mut new, direction);
        });
        // The direction has been rounded: what follows is exact for it as it is.
        let (slope, curvature) = (down(&direction), problem.energy(&direction));
        if curvature <= 0.0 {
            break error;
        }
        let length = slope / curvature;
        energy -= length * slope;
        let added = problem.fluxes(0.0, |voxel| direction[voxel].to_f64());
        for (flux, added) in fluxes.iter_mut().zip(added) {
            *flux += length * added;
        }
        space.parts.map(&mut residual, monitor, |rows, _, residual| {
            let outflow = problem.0.outflow(rows, &direction);
            for (r, outflow) in residual.iter_mut().zip(outflow) {
                *r = Long::new(r.get() - length * outflow);
            }
        });
        last = scale;
        before = product;
        iterations += 1;
    };
    Ok(Diffusion {
        diffusivity: energy / (voxels(space.shape) as f64 * problem.0.weights[0]),
        flux_mismatch: mismatch(&fluxes),
        residual: error,
        iterations,
    })
}

/// Progress in digits of the error.
pub(super) fn report(monitor: &Monitor<'_>, error: f64, first: f64, tolerance: f64) {
    let digits = (first / tolerance).ln();
    let done = if digits > 0.0 { (first / error).ln() / digits } else { 1.0 };
    monitor.report("solving", done.clamp(0.0, 1.0));
}

/// Largest less smallest flux through the planes, by their mean.
pub(super) fn mismatch(fluxes: &[f64]) -> f64 {
    let mean = fluxes.iter().sum::<f64>() / fluxes.len() as f64;
    let low = fluxes.iter().copied().fold(f64::INFINITY, f64::min);
    let high = fluxes.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if mean > 0.0 { (high - low) / mean } else { 0.0 }
}

/// The system of equations, for a fall of 1 from plane to plane.
struct Problem<'a>(Even<'a>);

impl Problem<'_> {
    /// What flows to each voxel when χ is 0.
    fn sources(&self, monitor: &Monitor<'_>) -> Vec<Long> {
        let space = self.0.space;
        let mut sources = vec![Long::default(); space.len()];
        space.parts.map(&mut sources, monitor, |rows, first, sources| {
            for (after, flow) in [(false, self.0.weights[0]), (true, -self.0.weights[0])] {
                for row in rows.clone().filter(|&row| space.open_ends(row)[usize::from(after)]) {
                    let voxels = space.voxels_of(row..row + 1);
                    let all = &mut sources[voxels.start - first..voxels.end - first];
                    for source in all {
                        *source = Long::new(source.get() + flow);
                    }
                }
                for (piece, beside) in space.beside(rows.clone(), 0, after) {
                    let others = space.bits_of(beside..beside + piece.len());
                    for (voxel, _, length) in shared(space.bits_of(piece), others) {
                        for source in &mut sources[voxel - first..][..length] {
                            *source = Long::new(source.get() + flow);
                        }
                    }
                }
            }
        });
        sources
    }

    /// Fluxes through the inlet, between the planes and through the outlet; with a periodic boundary
    /// behind each plane. `fall` is the even fall from plane to plane, `chi` what is beside it.
    fn fluxes(&self, fall: f64, chi: impl Fn(usize) -> f64 + Sync) -> Vec<f64> {
        let [n0, n1, _] = self.0.space.shape;
        let of_row = |row: usize| {
            let space = self.0.space;
            let weight = self.0.weights[0];
            let ends = space.open_ends(row);
            let voxels = || space.voxels_of(row..row + 1);
            let inlet = if ends[0] { voxels().map(|v| fall - 2.0 * chi(v)).sum() } else { 0.0 };
            let mut between: f64 =
                if ends[1] { voxels().map(|v| fall + 2.0 * chi(v)).sum() } else { 0.0 };
            if let Some(next) = space.row_beside(row, 0, true) {
                let own = space.bits_of(row..row + 1);
                for (voxel, other, length) in shared(own, space.bits_of(next..next + 1)) {
                    for i in 0..length {
                        between += fall + chi(voxel + i) - chi(other + i);
                    }
                }
            }
            [weight * inlet, weight * between]
        };
        let rows: Vec<[f64; 2]> = (0..n0 * n1).into_par_iter().map(of_row).collect();
        let mut fluxes = Vec::with_capacity(n0 + 1);
        if self.0.space.boundary == Boundary::Open {
            fluxes.push(rows[..n1].iter().map(|row| row[0]).sum());
        }
        fluxes.extend(rows.chunks(n1).map(|plane| plane.iter().map(|row| row[1]).sum::<f64>()));
        fluxes
    }

    /// Energy that the even fall dissipates, flux · fall: over half a step at inlet and outlet.
    fn even_energy(&self, fluxes: &[f64]) -> f64 {
        let ends = match self.0.space.boundary {
            Boundary::Open => fluxes[0] + fluxes[fluxes.len() - 1],
            Boundary::Periodic => 0.0,
        };
        fluxes.iter().sum::<f64>() - 0.5 * ends
    }

    /// χᵀ A χ.
    fn energy(&self, chi: &[f16]) -> f64 {
        self.0.space.parts.sum(|rows, own| {
            let outflow = self.0.outflow(rows, chi);
            chi[own].iter().zip(outflow).map(|(own, outflow)| own.to_f64() * outflow).sum()
        })
    }
}
