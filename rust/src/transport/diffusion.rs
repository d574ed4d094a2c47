//! Steady diffusion through the pore: Laplace's equation on its voxels.
//!
//! One concentration a voxel, conductance between voxels that share a face, none through the solid.
//! With an open boundary the first and the last face of axis 0 are held at two concentrations, half
//! a voxel from the first centres, and nothing passes the other faces; with a periodic one the
//! concentration falls evenly from volume to volume. What is solved for is the deviation χ from the
//! even fall, by conjugate gradients with a multigrid cycle.

use rayon::prelude::*;

use super::Settings;
use super::multigrid::{Graph, Multigrid};
use super::pore::{PoreSpace, side};
use super::vectors::{dot, for_chunks, sum};
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
/// Peak memory: 160 bytes a percolating voxel besides the pore space.
pub fn diffuse(space: &PoreSpace, settings: &Settings, monitor: &Monitor<'_>) -> Result<Diffusion> {
    if space.is_empty() {
        return Ok(Diffusion {
            diffusivity: 0.0,
            flux_mismatch: 0.0,
            residual: 0.0,
            iterations: 0,
        });
    }
    let problem = Problem::new(space, settings);
    let mut multigrid =
        Multigrid::new(problem.graph(monitor)?, &space.positions, space.shape, monitor)?;

    let n = space.len();
    let mut chi = vec![0.0f64; n];
    let mut residual: Vec<f64> = (0..n).into_par_iter().map(|i| problem.source(i)).collect();
    let mut direction = vec![0.0f64; n];
    let mut image = vec![0.0f64; n];
    let (mut before, mut first) = (0.0, None);
    let mut iterations = 0;
    let error = loop {
        monitor.check()?;
        let scale = dot(&residual, &residual).sqrt();
        if scale == 0.0 {
            break 0.0;
        }
        // Single precision has no room for residuals of any size.
        let scale_down = |first: usize, right: &mut [f32]| {
            for (right, r) in right.iter_mut().zip(&residual[first..]) {
                *right = (r / scale) as f32;
            }
        };
        let preconditioned = multigrid.cycle(scale_down, monitor);
        let product = scale
            * sum(n, |range| {
                let pairs = residual[range.clone()].iter().zip(&preconditioned[range]);
                pairs.map(|(r, &z)| r * f64::from(z)).sum()
            });
        // product ≈ |error|² in the energy norm.
        let error = (product / problem.energy(&chi)).sqrt();
        report(monitor, error, *first.get_or_insert(error), settings.tolerance);
        if error <= settings.tolerance || iterations == settings.iterations {
            break error;
        }
        let ratio = if iterations == 0 { 0.0 } else { product / before };
        for_chunks(&mut direction, monitor, |first, direction| {
            for (d, &z) in direction.iter_mut().zip(&preconditioned[first..]) {
                *d = scale * f64::from(z) + ratio * *d;
            }
        });
        for_chunks(&mut image, monitor, |first, image| {
            for (i, image) in image.iter_mut().enumerate() {
                *image = problem.apply(first + i, &direction);
            }
        });
        let curvature = dot(&direction, &image);
        if curvature <= 0.0 {
            break error;
        }
        let length = product / curvature;
        add(&mut chi, length, &direction, monitor);
        add(&mut residual, -length, &image, monitor);
        before = product;
        iterations += 1;
    };
    Ok(Diffusion {
        diffusivity: problem.energy(&chi) / (voxels(space.shape) as f64 * problem.weights[0]),
        flux_mismatch: problem.flux_mismatch(&chi),
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

fn add(values: &mut [f64], factor: f64, other: &[f64], monitor: &Monitor<'_>) {
    for_chunks(values, monitor, |first, values| {
        for (value, other) in values.iter_mut().zip(&other[first..]) {
            *value += factor * other;
        }
    });
}

/// The system of equations, for a fall of 1 from plane to plane.
struct Problem<'a> {
    space: &'a PoreSpace,
    none: u32,
    /// Conductance between neighbours along each axis.
    weights: [f64; 3],
    open: bool,
}

impl<'a> Problem<'a> {
    fn new(space: &'a PoreSpace, settings: &Settings) -> Self {
        let [h, ..] = settings.spacing;
        Self {
            space,
            none: space.len() as u32,
            weights: settings.spacing.map(|s| (h / s).powi(2)),
            open: space.boundary == Boundary::Open,
        }
    }

    /// Whether a side of a voxel is the inlet or the outlet.
    fn is_held(&self, voxel: usize, side: usize) -> bool {
        side < 2 && self.open && self.space.at_border(voxel, side)
    }

    /// Conductance from a voxel to the inlet and the outlet, half a voxel away.
    fn ground(&self, voxel: usize) -> f64 {
        let held = (0..2).filter(|&side| self.is_held(voxel, side)).count();
        2.0 * self.weights[0] * held as f64
    }

    /// What flows to a voxel when χ is 0.
    fn source(&self, voxel: usize) -> f64 {
        let [inflow, outflow] = [0, 1].map(|side| {
            let linked = self.space.neighbours[voxel][side] != self.none;
            if linked || self.is_held(voxel, side) { self.weights[0] } else { 0.0 }
        });
        inflow - outflow
    }

    /// Row of the matrix times χ.
    fn apply(&self, voxel: usize, chi: &[f64]) -> f64 {
        let own = chi[voxel];
        let mut sum = self.ground(voxel) * own;
        for (side, &other) in self.space.neighbours[voxel].iter().enumerate() {
            if other != self.none {
                sum += self.weights[side / 2] * (own - chi[other as usize]);
            }
        }
        sum
    }

    /// Flux · fall over the links after a voxel, and over its link to the inlet.
    fn energy(&self, chi: &[f64]) -> f64 {
        sum(chi.len(), |range| {
            range
                .map(|voxel| {
                    let own = chi[voxel];
                    let mut sum = 0.0;
                    for axis in 0..3 {
                        let other = self.space.neighbours[voxel][side(axis, 1)];
                        if other != self.none {
                            let fall = if axis == 0 { 1.0 } else { 0.0 };
                            sum += self.weights[axis] * (own - chi[other as usize] + fall).powi(2);
                        }
                    }
                    for (side, chi) in [own, -own].into_iter().enumerate() {
                        if self.is_held(voxel, side) {
                            sum += 2.0 * self.weights[0] * (0.5 - chi).powi(2);
                        }
                    }
                    sum
                })
                .sum()
        })
    }

    /// Spread of the fluxes through the planes between voxels, by their mean.
    fn flux_mismatch(&self, chi: &[f64]) -> f64 {
        let planes = self.space.shape[0];
        let mut fluxes = vec![0.0; planes + 1];
        for (voxel, &own) in chi.iter().enumerate() {
            let plane = self.space.plane(voxel);
            let next = self.space.neighbours[voxel][side(0, 1)];
            if next != self.none {
                fluxes[plane + 1] += self.weights[0] * (1.0 + own - chi[next as usize]);
            }
            if self.is_held(voxel, 0) {
                fluxes[0] += self.weights[0] * (1.0 - 2.0 * own);
            }
            if self.is_held(voxel, 1) {
                fluxes[planes] += self.weights[0] * (1.0 + 2.0 * own);
            }
        }
        let fluxes = if self.open { &fluxes[..] } else { &fluxes[1..] };
        let mean = fluxes.iter().sum::<f64>() / fluxes.len() as f64;
        let [low, high] = [f64::min, f64::max].map(|f| fluxes.iter().copied().reduce(f));
        match (low, high) {
            (Some(low), Some(high)) if mean > 0.0 => (high - low) / mean,
            _ => 0.0,
        }
    }

    fn graph(&self, monitor: &Monitor<'_>) -> Result<Graph> {
        let ground = (0..self.space.len()).into_par_iter().map(|i| self.ground(i) as f32).collect();
        let each = |voxel: usize, links: &mut Vec<(u32, f32)>| {
            let sides = self.space.neighbours[voxel].iter().enumerate();
            links.extend(
                sides
                    .filter(|(_, other)| **other != self.none && **other as usize != voxel)
                    .map(|(side, &other)| (other, self.weights[side / 2] as f32)),
            );
        };
        Graph::new(ground, each, monitor)
    }
}
