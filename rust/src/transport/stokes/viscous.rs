//! Conjugate gradients for the viscous operator, the velocities of one axis at a time.

use super::grid::{Grid, Row};
use crate::error::Result;
use crate::monitor::Monitor;
use crate::transport::vectors::{for_chunks, sum};

/// Iterations after which a solution is left as it is. Blobs some 20 voxels wide take about 100.
const ITERATIONS: usize = 2000;

/// Room for a solution, which is not kept.
pub(super) struct Viscous {
    residual: Vec<f32>,
    direction: Vec<f32>,
    image: Vec<f32>,
}

impl Viscous {
    /// Memory: 12 bytes a node.
    pub fn new(grid: &Grid<'_>) -> Self {
        let zeros = vec![0.0; grid.len()];
        Self { residual: zeros.clone(), direction: zeros.clone(), image: zeros }
    }

    /// Solves A u = b for the velocities along `axis`; returns bᵀ u.
    ///
    /// `right(row, node)` is b, and `add(direction, length)` takes note of a part of u: all that is
    /// asked of it is linear.
    pub fn solve(
        &mut self,
        grid: &Grid<'_>,
        axis: usize,
        tolerance: f64,
        right: impl Fn(&Row, usize) -> f32 + Sync,
        mut add: impl FnMut(&[f32], f32),
        monitor: &Monitor<'_>,
    ) -> Result<f64> {
        let Self { residual, direction, image } = self;
        grid.for_rows(residual, monitor, |_, row, residual| {
            for (node, r) in row.nodes.clone().zip(residual) {
                let moves = grid.diagonals[node][axis] > 0.0;
                *r = if moves { right(row, node) } else { 0.0 };
            }
            0.0
        });
        let (mut product, mut before, mut first) = (0.0, 0.0, None);
        for _ in 0..ITERATIONS {
            monitor.check()?;
            let size = sum(grid.len(), |nodes| {
                let each = residual[nodes.clone()].iter().zip(&grid.diagonals[nodes]);
                each.map(|(r, diagonal)| f64::from(r * over(*r, diagonal[axis]))).sum()
            });
            if size <= *first.get_or_insert(size) * tolerance.powi(2) {
                break;
            }
            let ratio = if product > 0.0 { (size / before) as f32 } else { 0.0 };
            for_chunks(direction, monitor, |first, direction| {
                for (i, d) in direction.iter_mut().enumerate() {
                    *d = ratio * *d + over(residual[first + i], grid.diagonals[first + i][axis]);
                }
            });
            let curvature = grid.for_rows(image, monitor, |_, row, image| {
                let mut curvature = 0.0;
                for (node, image) in row.nodes.clone().zip(image) {
                    *image = grid.viscous(axis, row, node, direction);
                    curvature += f64::from(direction[node] * *image);
                }
                curvature
            });
            if curvature <= 0.0 {
                break;
            }
            let length = (size / curvature) as f32;
            for_chunks(residual, monitor, |first, residual| {
                for (r, image) in residual.iter_mut().zip(&image[first..]) {
                    *r -= length * image;
                }
            });
            add(direction, length);
            product += f64::from(length) * size;
            before = size;
        }
        Ok(product)
    }
}

/// A residual by the diagonal; 0 where there is no velocity.
#[inline(always)]
fn over(residual: f32, diagonal: f32) -> f32 {
    if diagonal > 0.0 { residual / diagonal } else { 0.0 }
}
