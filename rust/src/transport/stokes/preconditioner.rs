//! A symmetric positive preconditioner of two blocks for the Stokes operator.
//!
//! Velocities: a Chebyshev polynomial of the viscous operator A. Pressure: the Schur complement
//! Gᵀ A⁻¹ G is the identity for changes from voxel to voxel, and for slow changes Darcy's operator
//! Gᵀ K G, where K = A⁻¹ 1 is how easily each face lets a fluid pass if pressure does not react. Its
//! inverse is taken as the sum of both inverses (after Cahouet and Chabard 1988), the second by a
//! multigrid cycle.

use rayon::prelude::*;

use super::grid::{Grid, PRESSURE, Unknowns};
use crate::error::Result;
use crate::monitor::Monitor;
use crate::transport::multigrid::{Graph, Multigrid};
use crate::transport::vectors::{CHUNK, dot, for_chunks};

/// Relative residual of K: more exact does not save iterations.
const CONDUCTANCE_TOLERANCE: f64 = 0.02;
/// Most iterations for K.
const CONDUCTANCE_ITERATIONS: usize = 200;

/// Degree of the polynomial.
const DEGREE: usize = 6;

pub(super) struct Preconditioner {
    multigrid: Multigrid,
    /// Range of the eigenvalues of D⁻¹A that the polynomial is made for.
    eigenvalues: [f32; 2],
    degree: usize,
    step: Vec<Unknowns>,
    other: Vec<Unknowns>,
    pub conductance_iterations: usize,
}

impl Preconditioner {
    pub fn new(grid: &Grid<'_>, monitor: &Monitor<'_>) -> Result<Self> {
        let (conductances, conductance_iterations) = conductances(grid, monitor)?;
        let graph = darcy(grid, &conductances, monitor)?;
        let multigrid = Multigrid::new(graph, &grid.space.positions, grid.space.shape, monitor)?;
        let low = std::env::var("LOW").map_or(0.05, |v| v.parse().unwrap());
        let degree = std::env::var("DEG").map_or(DEGREE, |v| v.parse().unwrap());
        let room = vec![[0.0; 4]; grid.len()];
        Ok(Self { multigrid, eigenvalues: [low, 2.0], degree, step: room.clone(), other: room, conductance_iterations })
    }

    /// z ← P⁻¹ r.
    pub fn apply(&mut self, grid: &Grid<'_>, r: &[Unknowns], z: &mut Vec<Unknowns>) {
        self.velocities(grid, r, z);
        let pressures = self.multigrid.cycle(|first, right| {
            for (right, r) in right.iter_mut().zip(&r[first..]) {
                *right = r[PRESSURE];
            }
        });
        for_chunks(&mut z[..pressures.len()], |first, z| {
            for (i, z) in z.iter_mut().enumerate() {
                z[PRESSURE] = r[first + i][PRESSURE] + pressures[first + i];
            }
        });
    }

    /// Chebyshev iteration for A z = r from zero; pressures become 0.
    fn velocities(&mut self, grid: &Grid<'_>, r: &[Unknowns], z: &mut Vec<Unknowns>) {
        let [low, high] = self.eigenvalues;
        let (center, half) = (f32::midpoint(low, high), (high - low) / 2.0);
        let mut rho = half / center;
        for k in 0..self.degree {
            let (keep, add) = if k == 0 {
                (0.0, 1.0 / center)
            } else {
                let next = 1.0 / (2.0 * center / half - rho);
                let factors = (next * rho, 2.0 * next / half);
                rho = next;
                factors
            };
            let old = &*z;
            self.step
                .par_chunks_mut(CHUNK)
                .zip(self.other.par_chunks_mut(CHUNK))
                .enumerate()
                .for_each(|(chunk, (step, new))| {
                    for (i, (step, new)) in step.iter_mut().zip(new).enumerate() {
                        let node = chunk * CHUNK + i;
                        let diagonal = &grid.diagonal[node];
                        let mut image = [0.0; 4];
                        let mut own = [0.0; 4];
                        if k > 0 {
                            own = old[node];
                            image = grid.viscous(node, own, &grid.around(node, old));
                        }
                        for c in 0..PRESSURE {
                            let residual = r[node][c] - image[c];
                            step[c] = if diagonal[c] > 0.0 {
                                keep * step[c] + add * residual / diagonal[c]
                            } else {
                                0.0
                            };
                            new[c] = own[c] + step[c];
                        }
                        new[PRESSURE] = 0.0;
                    }
                });
            std::mem::swap(z, &mut self.other);
        }
    }
}

/// Darcy's operator on the voxels.
fn darcy(grid: &Grid<'_>, conductances: &[Unknowns], monitor: &Monitor<'_>) -> Result<Graph> {
    let n = grid.space.len();
    // The conductance of the face on a side of a voxel, and the voxel there; none is held at 0.
    let face = |voxel: usize, to: usize| {
        let axis = to / 2;
        let next = grid.neighbours[voxel][to];
        let owner = if to.is_multiple_of(2) { next as usize } else { voxel };
        let conductance = conductances.get(owner).map_or(0.0, |c| c[axis] * grid.weights[axis]);
        (conductance, (next as usize) < n, next)
    };
    let ground = (0..n)
        .into_par_iter()
        .map(|voxel| {
            (0..6).map(|to| face(voxel, to)).filter(|f| !f.1).map(|f| f.0).sum::<f32>()
        })
        .collect();
    let each = |voxel: usize, links: &mut Vec<(u32, f32)>| {
        for to in 0..6 {
            let (conductance, is_voxel, next) = face(voxel, to);
            if is_voxel && conductance > 0.0 && next as usize != voxel {
                links.push((next, conductance));
            }
        }
    };
    Graph::new(ground, each, monitor)
}

/// K = A⁻¹ 1 for the velocities of all three axes, roughly, by conjugate gradients.
fn conductances(grid: &Grid<'_>, monitor: &Monitor<'_>) -> Result<(Vec<Unknowns>, usize)> {
    let n = grid.len();
    let ones = |d: &Unknowns| [0, 1, 2, 3].map(|c| if c < 3 && d[c] > 0.0 { 1.0 } else { 0.0 });
    let mut residual: Vec<Unknowns> = grid.diagonal.par_iter().map(ones).collect();
    let mut solution = vec![[0.0f32; 4]; n];
    let mut scaled = solution.clone();
    let mut direction = solution.clone();
    let mut image = solution.clone();
    let (mut before, mut first) = (0.0, 0.0);
    let mut iterations = 0;
    loop {
        monitor.check()?;
        for_chunks(&mut scaled, |first, scaled| {
            for (i, s) in scaled.iter_mut().enumerate() {
                let (r, d) = (&residual[first + i], &grid.diagonal[first + i]);
                *s = [0, 1, 2, 3].map(|c| if c < 3 && d[c] > 0.0 { r[c] / d[c] } else { 0.0 });
            }
        });
        let product = dot(residual.as_flattened(), scaled.as_flattened());
        if iterations == 0 {
            first = product;
        }
        let reached = product <= first * CONDUCTANCE_TOLERANCE.powi(2);
        if reached || iterations == CONDUCTANCE_ITERATIONS {
            break;
        }
        let ratio = if iterations == 0 { 0.0 } else { (product / before) as f32 };
        combine(&mut direction, ratio, 1.0, &scaled);
        for_chunks(&mut image, |first, image| {
            for (i, image) in image.iter_mut().enumerate() {
                let node = first + i;
                *image = grid.viscous(node, direction[node], &grid.around(node, &direction));
                image[PRESSURE] = 0.0;
            }
        });
        let curvature = dot(direction.as_flattened(), image.as_flattened());
        if curvature <= 0.0 {
            break;
        }
        let length = (product / curvature) as f32;
        combine(&mut solution, 1.0, length, &direction);
        combine(&mut residual, 1.0, -length, &image);
        before = product;
        iterations += 1;
    }
    // An error of the iteration must not make a conductance negative.
    for_chunks(&mut solution, |first, solution| {
        for (k, d) in solution.iter_mut().zip(&grid.diagonal[first..]) {
            *k = [0, 1, 2, 3]
                .map(|c| if c < 3 && d[c] > 0.0 { k[c].max(1.0 / (2.0 * d[c])) } else { 0.0 });
        }
    });
    Ok((solution, iterations))
}

/// a ← keep · a + factor · b.
pub(super) fn combine(a: &mut [Unknowns], keep: f32, factor: f32, b: &[Unknowns]) {
    for_chunks(a, |first, a| {
        for (a, b) in a.iter_mut().zip(&b[first..]) {
            for (a, b) in a.iter_mut().zip(b) {
                *a = keep * *a + factor * *b;
            }
        }
    });
}
