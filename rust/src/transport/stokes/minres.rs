//! Preconditioned MINRES (Paige and Saunders 1975) in the form of Elman, Silvester and Wathen 2014,
//! Algorithm 4.1.

use super::super::diffusion::report;
use super::grid::{Grid, Unknowns};
use super::preconditioner::{Preconditioner, combine};
use crate::error::Result;
use crate::monitor::Monitor;
use crate::transport::Settings;
use crate::transport::vectors::{dot, for_chunks};

pub(super) struct Solved {
    pub unknowns: Vec<Unknowns>,
    pub residual: f64,
    pub iterations: usize,
}

/// Solves for a right side, from zero.
pub(super) fn solve(
    grid: &Grid<'_>,
    preconditioner: &mut Preconditioner,
    right: Vec<Unknowns>,
    settings: &Settings,
    monitor: &Monitor<'_>,
) -> Result<Solved> {
    let zeros = vec![[0.0f32; 4]; grid.len()];
    let mut x = zeros.clone();
    let (mut v_old, mut v) = (zeros.clone(), right);
    let (mut w_old, mut w) = (zeros.clone(), zeros.clone());
    let mut z = zeros.clone();
    let mut z_next = zeros.clone();
    let mut image = zeros;

    preconditioner.apply(grid, &v, &mut z, monitor);
    let product = |a: &[Unknowns], b: &[Unknowns]| dot(a.as_flattened(), b.as_flattened());
    let mut gamma = product(&z, &v).max(0.0).sqrt();
    let mut gamma_old = 1.0;
    let first = gamma;
    let mut eta = gamma;
    let (mut s_old, mut s, mut c_old, mut c) = (0.0f64, 0.0f64, 1.0f64, 1.0f64);
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
        for_chunks(&mut image, monitor, |first, image| {
            for (i, image) in image.iter_mut().enumerate() {
                *image = grid.apply(first + i, &z);
            }
        });
        let delta = product(&image, &z);
        // v_next = A z − (δ/γ) v − (γ/γ_old) v_old, in the room of v_old
        let (a, b) = ((delta / gamma) as f32, (gamma / gamma_old) as f32);
        for_chunks(&mut v_old, monitor, |first, v_old| {
            for (i, v_old) in v_old.iter_mut().enumerate() {
                let node = first + i;
                for c in 0..4 {
                    v_old[c] = image[node][c] - a * v[node][c] - b * v_old[c];
                }
            }
        });
        std::mem::swap(&mut v, &mut v_old);
        preconditioner.apply(grid, &v, &mut z_next, monitor);
        let gamma_next = product(&z_next, &v).max(0.0).sqrt();

        let alpha_0 = c * delta - c_old * s * gamma;
        let alpha_1 = alpha_0.hypot(gamma_next);
        let alpha_2 = s * delta + c_old * c * gamma;
        let alpha_3 = s_old * gamma;
        (c_old, c) = (c, alpha_0 / alpha_1);
        (s_old, s) = (s, gamma_next / alpha_1);
        // w_next = (z − α₃ w_old − α₂ w) / α₁, in the room of w_old; x += c η w_next
        let [a, b, d] = [1.0 / alpha_1, alpha_3 / alpha_1, alpha_2 / alpha_1].map(|f| f as f32);
        for_chunks(&mut w_old, monitor, |first, w_old| {
            for (i, w_old) in w_old.iter_mut().enumerate() {
                let node = first + i;
                for c in 0..4 {
                    w_old[c] = a * z[node][c] - b * w_old[c] - d * w[node][c];
                }
            }
        });
        std::mem::swap(&mut w, &mut w_old);
        combine(&mut x, [1.0, (c * eta) as f32], &w, monitor);
        eta *= -s;
        (gamma_old, gamma) = (gamma, gamma_next);
        std::mem::swap(&mut z, &mut z_next);
        iterations += 1;
    };
    Ok(Solved { unknowns: x, residual, iterations })
}
