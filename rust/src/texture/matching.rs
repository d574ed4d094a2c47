//! The search phase of a pass: describe every window of the output, match it, measure the fit.

use rayon::prelude::*;

use super::field::Field;
use super::lattice::Lattice;
use super::match_map::Match;
use super::neighbourhoods::{BLOCK, Neighbourhoods, Projection, copy_rows};
use super::search::{Scene, Search};
use crate::error::Result;
use crate::monitor::Monitor;
use crate::volume::{Shape, position, voxels};

/// Added to a root mean square difference, in field units, before it is raised to r − 2: a window
/// that matches exactly must not take over.
const FLOOR: f32 = 1.0;

/// Which windows touch the domain.
pub(super) fn active_sites(lattice: &Lattice, domain: Option<&[bool]>) -> Vec<bool> {
    let sites = lattice.sites();
    let Some(domain) = domain else { return vec![true; voxels(sites)] };
    let shape = lattice.shape;
    (0..voxels(sites))
        .into_par_iter()
        .map(|site| {
            let at = position(sites, site);
            let o: [usize; 3] = std::array::from_fn(|a| lattice.origins[a][at[a]]);
            let w = lattice.window;
            (0..w[0]).any(|z| {
                (0..w[1]).any(|y| {
                    let row = ((o[0] + z) % shape[0] * shape[1] + (o[1] + y) % shape[1]) * shape[2];
                    (0..w[2]).any(|x| domain[row + (o[2] + x) % shape[2]])
                })
            })
        })
        .collect()
}

/// How well the matches of all sites of an exemplar fit.
#[derive(Default)]
pub(super) struct Matched {
    /// Unscaled weight ‖s − e‖^(r − 2) of each site; 0 outside the domain.
    weights: Vec<f32>,
    /// Mean squared difference per voxel, and per pair of neighbouring voxels.
    data: Vec<f32>,
    gradient: Vec<f32>,
}

/// Data and gradient terms of Eq. 1 at λ = 1, means over the windows' voxels.
pub(super) fn energy(matched: &[Matched], mu: f32) -> (f64, f64) {
    let (mut data, mut gradient, mut sites) = (0.0f64, 0.0f64, 0usize);
    for m in matched {
        data += m.weights.iter().zip(&m.data).map(|(w, d)| f64::from(w * d)).sum::<f64>();
        gradient += m.gradient.iter().map(|g| f64::from(*g)).sum::<f64>();
        sites += m.sites();
    }
    let sites = sites.max(1) as f64;
    (data / sites, f64::from(mu) * gradient / sites)
}

/// Weights with mean λ: only their ratio to μ matters, which λ then sets.
pub(super) fn weights(matched: &[Matched], factor: f32) -> Vec<Vec<f32>> {
    let sum: f64 = matched.iter().flat_map(|m| &m.weights).map(|w| f64::from(*w)).sum();
    let sites: usize = matched.iter().map(Matched::sites).sum();
    let scale = if sum > 0.0 { factor * (sites as f64 / sum) as f32 } else { 0.0 };
    matched.iter().map(|m| m.weights.iter().map(|w| w * scale).collect()).collect()
}

impl Matched {
    fn sites(&self) -> usize {
        self.weights.iter().filter(|w| **w > 0.0).count()
    }
}

/// Matches all active sites; the fit is weighed by ‖s − e‖^(exponent − 2), and gradients are compared
/// if wanted.
pub(super) fn match_sites(
    scene: &Scene<'_>,
    backend: &dyn Search,
    field: &Field,
    active: &[bool],
    (exponent, gradients): (f32, bool),
    monitor: &Monitor<'_>,
) -> Result<(Vec<Match>, Matched)> {
    let set = scene.neighbourhoods;
    let (n, length) = (active.len(), set.length());
    let mut matches = vec![Match::NONE; n];
    let mut out = Matched { weights: vec![0.0; n], data: vec![0.0; n], gradient: vec![0.0; n] };
    matches
        .par_chunks_mut(BLOCK)
        .zip(out.weights.par_chunks_mut(BLOCK))
        .zip(out.data.par_chunks_mut(BLOCK).zip(out.gradient.par_chunks_mut(BLOCK)))
        .enumerate()
        .try_for_each_init(
            Scratch::default,
            |scratch, (block, ((matches, weights), (data, gradient)))| {
                monitor.check()?;
                let first = block * BLOCK;
                let count = matches.len();
                let active = &active[first..first + count];
                if !active.contains(&true) {
                    return Ok(());
                }
                scratch.describe(set, field, scene.lattice, first, active);
                backend.search(scene, first, &scratch.queries, active, matches);
                scratch.candidate.resize(length, 0.0);
                for i in (0..count).filter(|&i| active[i]) {
                    let own = &mut scratch.windows[i * length..(i + 1) * length];
                    if gradients {
                        set.gather(matches[i], &mut scratch.candidate);
                        own.iter_mut().zip(&scratch.candidate).for_each(|(a, b)| *a -= b);
                        data[i] = own.iter().map(|d| d * d).sum::<f32>() / length as f32;
                        gradient[i] = mean_square_gradient(own, set.window());
                    } else {
                        data[i] = set.mean_square_difference(matches[i], own);
                    }
                    weights[i] = (data[i].sqrt() + FLOOR).powf(exponent - 2.0);
                }
                Ok(())
            },
        )?;
    Ok((matches, out))
}

/// Memory of a task.
#[derive(Default)]
pub(super) struct Scratch {
    windows: Vec<f32>,
    /// Descriptors of the windows, one after the other.
    pub(super) queries: Vec<i16>,
    candidate: Vec<f32>,
    projection: Projection,
}

impl Scratch {
    /// Collects and describes the windows of the active ones among the sites from `first` on.
    pub(super) fn describe(
        &mut self,
        set: &Neighbourhoods<'_>,
        field: &Field,
        lattice: &Lattice,
        first: usize,
        active: &[bool],
    ) {
        let (sites, length) = (lattice.sites(), set.length());
        self.windows.resize(active.len() * length, 0.0);
        self.queries.resize(active.len() * set.dims(), 0);
        for (i, window) in self.windows.chunks_exact_mut(length).enumerate() {
            if active[i] {
                let at = position(sites, first + i);
                let origin = std::array::from_fn(|a| lattice.origins[a][at[a]]);
                gather(field, origin, set.window(), window);
            }
        }
        set.describe(&self.windows, &mut self.projection, &mut self.queries);
    }
}

/// Copies a window of the output, which wraps if the boundary is periodic (an open lattice never
/// reaches over the border).
fn gather(field: &Field, origin: [usize; 3], window: Shape, out: &mut [f32]) {
    let [nz, ny, nx] = field.shape();
    let [oz, oy, ox] = origin;
    let [_, height, length] = window;
    let head = length.min(nx - ox);
    let wrapped = |at: usize, n: usize| if at < n { at } else { at - n };
    let start = |dz: usize, dy: usize| (wrapped(oz + dz, nz) * ny + wrapped(oy + dy, ny)) * nx;
    for (c, out) in out.chunks_exact_mut(voxels(window)).enumerate() {
        let values = field.channel(c);
        if head == length {
            copy_rows(values, window, |dz, dy| start(dz, dy) + ox, out);
        } else {
            for (row, out) in out.chunks_exact_mut(length).enumerate() {
                let line = &values[start(row / height, row % height)..][..nx];
                out[..head].copy_from_slice(&line[ox..]);
                out[head..].copy_from_slice(&line[..length - head]);
            }
        }
    }
}

/// Mean squared gradient of a difference of windows: of each pair of neighbouring voxels, for both.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
fn mean_square_gradient(difference: &[f32], window: Shape) -> f32 {
    let [_, height, w] = window;
    let (plane, all) = (height * w, voxels(window));
    let mut gradient = 0.0f32;
    for d in difference.chunks_exact(all) {
        gradient += square_difference(&d[..all - plane], &d[plane..]);
        for layer in d.chunks_exact(plane) {
            gradient += square_difference(&layer[..plane - w], &layer[w..]);
        }
        // Along x all pairs of the window at once, then without those that span two rows.
        gradient += square_difference(&d[..all - 1], &d[1..]);
        gradient -= d[w - 1..all - 1]
            .iter()
            .step_by(w)
            .zip(d[w..].iter().step_by(w))
            .map(|(a, b)| (a - b) * (a - b))
            .sum::<f32>();
    }
    2.0 * gradient.max(0.0) / difference.len() as f32
}

#[inline(always)]
fn square_difference(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0f32; 8];
    for (a, b) in a.chunks(8).zip(b.chunks(8)) {
        for ((s, a), b) in sums.iter_mut().zip(a).zip(b) {
            *s += (a - b) * (a - b);
        }
    }
    sums.iter().sum()
}
