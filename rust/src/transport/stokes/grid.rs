//! The staggered grid: which velocities there are, and the operator.

use std::ops::Range;

use rayon::prelude::*;

use super::places::Places;
use crate::error::{Error, Result};
use crate::monitor::Monitor;
use crate::transport::pore::PoreSpace;
use crate::transport::vectors::{CHUNK, Parts};

/// Marks that no node touches another on a side.
const NONE: u16 = u16::MAX;

/// The nodes of [`Places`]; and a last one of zeros, which stands for every neighbour that does not
/// exist: gathering without a branch halves the time of a pass.
pub(super) struct Grid<'a> {
    pub space: &'a PoreSpace,
    places: Places<'a>,
    /// Which node of the row on each side, before and after along axes 0, 1, 2, touches each node.
    links: Vec<[u16; 6]>,
    /// Diagonal of the viscous operator for the velocities through the faces after each node along the
    /// three axes, 0 where there is no velocity. Not its inverse: between wide walls a rounding of 6 is
    /// felt.
    pub diagonals: Vec<[f32; 3]>,
    /// 1 / h² along each axis.
    pub weights: [f32; 3],
    /// 1 / h along each axis.
    slopes: [f32; 3],
    /// Rows in parts.
    parts: Parts,
}

/// A row of nodes, and the first nodes of the rows on its sides.
pub(super) struct Row {
    pub nodes: Range<usize>,
    firsts: [u32; 6],
}

impl<'a> Grid<'a> {
    pub fn new(space: &'a PoreSpace, spacing: [f64; 3], monitor: &Monitor<'_>) -> Result<Self> {
        let [_, _, n2] = space.shape;
        if n2 > usize::from(NONE) {
            let allowed = format!("must be at most {NONE} along the last axis for a flow");
            return Err(Error::parameter("shape", space.shape, allowed));
        }
        let places = Places { space };
        let parts = Parts::new(places.rows(), CHUNK, |row| places.nodes_of(row));
        let mut grid = Self {
            space,
            places,
            links: Vec::new(),
            diagonals: Vec::new(),
            weights: spacing.map(|h| (1.0 / h.powi(2)) as f32),
            slopes: spacing.map(|h| (1.0 / h) as f32),
            parts,
        };
        let places = &grid.places;
        let mut links = vec![[NONE; 6]; grid.len()];
        let mut diagonals = vec![[0.0; 3]; grid.len()];
        let nodes_of =
            |row: usize| (0..n2).map(move |x| [row, x]).filter(|&at| places.node(at).is_some());
        grid.for_rows(&mut links, monitor, |row, sides, links| {
            for (links, at) in links.iter_mut().zip(nodes_of(row)) {
                *links = [0, 1, 2, 3, 4, 5].map(|side| {
                    let to = places.place_beside(at, side / 2, side % 2 == 1);
                    let node = to.and_then(|to| places.node(to));
                    node.map_or(NONE, |node| (node - sides.firsts[side] as usize) as u16)
                });
            }
            0.0
        });
        let weights = grid.weights;
        grid.for_rows(&mut diagonals, monitor, |row, _, diagonals| {
            for (diagonal, at) in diagonals.iter_mut().zip(nodes_of(row)) {
                for axis in (0..3).filter(|&axis| places.has_velocity(at, axis)) {
                    diagonal[axis] = places.viscous_diagonal(at, axis, weights);
                }
            }
            0.0
        });
        monitor.check()?;
        (grid.links, grid.diagonals) = (links, diagonals);
        Ok(grid)
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.places.nodes_of(self.places.rows() - 1).end + 1
    }

    fn row(&self, row: usize) -> Row {
        let first = |side: usize| match side / 2 {
            2 => Some(row),
            axis => self.places.row_beside(row, axis, side % 2 == 1),
        };
        Row {
            nodes: self.places.nodes_of(row),
            firsts: [0, 1, 2, 3, 4, 5]
                .map(|side| first(side).map_or(0, |row| self.places.nodes_of(row).start as u32)),
        }
    }

    /// Applies the viscous operator A for the velocities along an axis at a node of a row.
    #[inline(always)]
    pub fn viscous(&self, axis: usize, row: &Row, node: usize, u: &[f32]) -> f32 {
        let diagonal = self.diagonals[node][axis];
        if diagonal == 0.0 {
            return 0.0;
        }
        let at = |side: usize| self.beside(row, node, side, u);
        let [w0, w1, w2] = self.weights;
        let sum = w0 * (at(0) + at(1)) + w1 * (at(2) + at(3)) + w2 * (at(4) + at(5));
        diagonal * u[node] - sum
    }

    /// The slope G p of a pressure through the face after a node of a row along an axis.
    #[inline(always)]
    pub fn slope(&self, axis: usize, row: &Row, node: usize, p: &[f32]) -> f32 {
        let after = self.beside(row, node, 2 * axis + 1, p);
        if self.diagonals[node][axis] > 0.0 { self.slopes[axis] * (after - p[node]) } else { 0.0 }
    }

    /// The value on a side of a node of a row, 0 where there is no node.
    #[inline(always)]
    fn beside(&self, row: &Row, node: usize, side: usize, values: &[f32]) -> f32 {
        let link = self.links[node][side];
        let there = row.firsts[side] as usize + usize::from(link);
        values[if link == NONE { self.links.len() - 1 } else { there }]
    }

    /// Adds what flows into each voxel along an axis, Gᵀ u, times a factor.
    pub fn add_inflow(
        &self,
        axis: usize,
        u: &[f32],
        factor: f32,
        sums: &mut [f32],
        monitor: &Monitor<'_>,
    ) {
        let factor = factor * self.slopes[axis];
        self.for_rows(sums, monitor, |_, row, sums| {
            for (node, sum) in row.nodes.clone().zip(sums) {
                *sum += factor * (self.beside(row, node, 2 * axis, u) - u[node]);
            }
            0.0
        });
    }

    /// Adds the flow of velocities along axis 0 through each plane, that before the inlet first, times
    /// a factor.
    pub fn add_fluxes(&self, u: &[f32], factor: f32, sums: &mut [f64]) {
        let [n0, n1, _] = self.space.shape;
        let planes = self.planes();
        sums.par_iter_mut().enumerate().for_each(|(i, sum)| {
            // The copy of the first plane, if there is one, comes last.
            let plane = (n0 + i) % planes;
            let [first, last] = [plane * n1, (plane + 1) * n1 - 1];
            let nodes = self.places.nodes_of(first).start..self.places.nodes_of(last).end;
            *sum += f64::from(factor) * u[nodes].iter().map(|&u| f64::from(u)).sum::<f64>();
        });
    }

    /// Number of planes that a flow passes.
    pub fn planes(&self) -> usize {
        self.places.rows() / self.space.shape[1]
    }

    /// Calls `work(number of a row, the row, its part of `out`)` for each row; returns the sum of what
    /// it returns, always added in one order.
    ///
    /// Once the caller wants to stop, rows are left out; the values are then of no use.
    pub fn for_rows<T: Send>(
        &self,
        out: &mut [T],
        monitor: &Monitor<'_>,
        work: impl Fn(usize, &Row, &mut [T]) -> f64 + Sync,
    ) -> f64 {
        let each = self.parts.map(out, monitor, |rows, _, mut out| {
            let mut sum = 0.0;
            for number in rows {
                let row = self.row(number);
                let (own, rest) = out.split_at_mut(row.nodes.len());
                sum += work(number, &row, own);
                out = rest;
            }
            sum
        });
        each.iter().sum()
    }
}
