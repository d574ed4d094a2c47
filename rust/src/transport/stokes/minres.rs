//! Preconditioned MINRES (Paige and Saunders 1975) in the form of Elman, Silvester and Wathen 2014,
//! Algorithm 4.1.
//!
//! The solution is not kept, nor are the directions that it is made of: what is asked of it, the flow
//! through the planes, is linear, so that the recurrence of the directions is that of their flows.

use super::super::diffusion::report;
use super::grid::{Grid, Unknowns};
use super::preconditioner::{Preconditioner, combine};
use crate::error::Result;
use crate::monitor::Monitor;
use crate::transport::Settings;
use crate::transport::vectors::dot;

pub(super) struct Solved {
    /// Flow through each plane.
    pub fluxes: Vec<f64>,
    pub residual: f64,
    pub iterations: usize,
}

/// Solves for a right side, from zero.
pub(super) fn solve(
    grid: &Grid<'_>,
    preconditioner: &mut Preconditioner<'_>,
    right: Vec<Unknowns>,
    settings: &Settings,
    monitor: &Monitor<'_>,
) -> Result<Solved> {
    let zeros = vec![[0.0f32; 4]; grid.len()];
    let (mut v_old, mut v) = (zeros.clone(), right);
    let mut z = zeros;
    preconditioner.apply(grid, &v, &mut z, monitor);
    let product = |a: &[Unknowns], b: &[Unknowns]| dot(a.as_flattened(), b.as_flattened());
    let mut gamma = product(&z, &v).max(0.0).sqrt();
    let mut gamma_old = 1.0;
    let first = gamma;
    let mut eta = gamma;
    let (mut s_old, mut s, mut c_old, mut c) = (0.0f64, 0.0f64, 1.0f64, 1.0f64);
    // Flows of the solution, and of its last two directions.
    let mut fluxes = vec![0.0; grid.fluxes(&z).len()];
    let (mut w_old, mut w) = (fluxes.clone(), fluxes.clone());
    let mut iterations = 0;
    let residual = loop {
        monitor.check()?;
        let residual = if first > 0.0 { eta.abs() / first } else { 0.0 };
        report(monitor, residual, 1.0, settings.tolerance);
        if residual <= settings.tolerance || iterations == settings.iterations || gamma <= 0.0 {
            break residual;
        }
        let inverse = (1.0 / gamma) as f32;
        combine(&mut z, [inverse, 0.0], &v, monitor);
        // v_next = A z − (δ/γ) v − (γ/γ_old) v_old, in the room of v_old
        let b = (gamma / gamma_old) as f32;
        let delta = grid.for_rows(&mut v_old, monitor, |_, row, v_old| {
            let mut delta = 0.0;
            for (node, v_old) in row.nodes.clone().zip(v_old) {
                let image = grid.apply(row, node, &z);
                for c in 0..4 {
                    delta += f64::from(image[c] * z[node][c]);
                    v_old[c] = image[c] - b * v_old[c];
                }
            }
            delta
        });
        combine(&mut v_old, [1.0, -(delta / gamma) as f32], &v, monitor);
        std::mem::swap(&mut v, &mut v_old);
        let of_z = grid.fluxes(&z);
        preconditioner.apply(grid, &v, &mut z, monitor);
        let gamma_next = product(&z, &v).max(0.0).sqrt();

        let alpha_0 = c * delta - c_old * s * gamma;
        let alpha_1 = alpha_0.hypot(gamma_next);
        let alpha_2 = s * delta + c_old * c * gamma;
        let alpha_3 = s_old * gamma;
        (c_old, c) = (c, alpha_0 / alpha_1);
        (s_old, s) = (s, gamma_next / alpha_1);
        // w_next = (z − α₃ w_old − α₂ w) / α₁, in the room of w_old; x += c η w_next
        for (i, w_old) in w_old.iter_mut().enumerate() {
            *w_old = (of_z[i] - alpha_3 * *w_old - alpha_2 * w[i]) / alpha_1;
            fluxes[i] += c * eta * *w_old;
        }
        std::mem::swap(&mut w, &mut w_old);
        eta *= -s;
        (gamma_old, gamma) = (gamma, gamma_next);
        iterations += 1;
    };
    Ok(Solved { fluxes, residual, iterations })
}
