//! The staggered grid: which velocities there are, and the operator.

use std::ops::Range;

use rayon::prelude::*;

use super::places::Places;
use crate::error::{Error, Result};
use crate::monitor::Monitor;
use crate::transport::pore::PoreSpace;
use crate::transport::vectors::{CHUNK, Parts};

/// Velocities through the faces after a voxel along axes 0, 1, 2, and the pressure at its centre.
pub(super) type Unknowns = [f32; 4];
/// The place of the pressure.
pub(super) const PRESSURE: usize = 3;

/// Marks that no node touches another on a side.
const NONE: u16 = u16::MAX;

/// The nodes of [`Places`]; and a last one of zeros, which stands for every neighbour that does not
/// exist: gathering without a branch halves the time of a pass.
pub(super) struct Grid<'a> {
    pub space: &'a PoreSpace,
    places: Places<'a>,
    /// Which node of the row on each side, before and after along axes 0, 1, 2, touches each node.
    links: Vec<[u16; 6]>,
    /// 1 / diagonal of the viscous operator for the three velocities, 0 where there is no velocity;
    /// then 0 for the pressure.
    pub inverse: Vec<Unknowns>,
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
            inverse: Vec::new(),
            weights: spacing.map(|h| (1.0 / h.powi(2)) as f32),
            slopes: spacing.map(|h| (1.0 / h) as f32),
            parts,
        };
        let places = &grid.places;
        let (mut links, mut inverse) = (vec![[NONE; 6]; grid.len()], vec![[0.0; 4]; grid.len()]);
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
        grid.for_rows(&mut inverse, monitor, |row, _, inverse| {
            for (inverse, at) in inverse.iter_mut().zip(nodes_of(row)) {
                for axis in (0..3).filter(|&axis| places.has_velocity(at, axis)) {
                    inverse[axis] = 1.0 / places.viscous_diagonal(at, axis, weights);
                }
            }
            0.0
        });
        monitor.check()?;
        (grid.links, grid.inverse) = (links, inverse);
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

    /// Applies the whole operator at a node of a row.
    #[inline(always)]
    pub fn apply(&self, row: &Row, node: usize, x: &[Unknowns]) -> Unknowns {
        let around = self.around(row, node, x);
        let own = x[node];
        let mut out = self.viscous(node, own, &around);
        let mut divergence = 0.0;
        for axis in 0..3 {
            let slope = self.slopes[axis];
            if self.inverse[node][axis] > 0.0 {
                out[axis] += slope * (around[2 * axis + 1][PRESSURE] - own[PRESSURE]);
            }
            divergence += slope * (around[2 * axis][axis] - own[axis]);
        }
        out[PRESSURE] = if node < self.space.len() { divergence } else { 0.0 };
        out
    }

    /// Applies the viscous operator A at a node; the pressure becomes 0.
    #[inline(always)]
    pub fn viscous(&self, node: usize, own: Unknowns, around: &[Unknowns; 6]) -> Unknowns {
        let (inverse, sum) = (&self.inverse[node], self.weighted_sum(around));
        let mut out = [0.0; 4];
        for i in 0..4 {
            out[i] = if inverse[i] > 0.0 { own[i] / inverse[i] - sum[i] } else { 0.0 };
        }
        out
    }

    /// What the neighbours add to A, but for the sign.
    #[inline(always)]
    pub fn weighted_sum(&self, around: &[Unknowns; 6]) -> Unknowns {
        let mut sum = [0.0; 4];
        for axis in 0..3 {
            for (i, sum) in sum.iter_mut().enumerate() {
                *sum += self.weights[axis] * (around[2 * axis][i] + around[2 * axis + 1][i]);
            }
        }
        sum
    }

    /// The unknowns round a node of a row.
    #[inline(always)]
    pub fn around(&self, row: &Row, node: usize, x: &[Unknowns]) -> [Unknowns; 6] {
        let links = &self.links[node];
        let none = self.links.len() - 1;
        // Spelled out: `map` is not inlined here, which costs a quarter of the time.
        let at = |side: usize| {
            let there = row.firsts[side] as usize + usize::from(links[side]);
            x[if links[side] == NONE { none } else { there }]
        };
        [at(0), at(1), at(2), at(3), at(4), at(5)]
    }

    /// The sum of the velocities along axis 0 behind each plane, that before the inlet first.
    pub fn fluxes(&self, values: &[Unknowns]) -> Vec<f64> {
        let [n0, n1, _] = self.space.shape;
        let of_plane = |plane: usize| {
            let [first, last] = [plane * n1, (plane + 1) * n1 - 1];
            let nodes = self.places.nodes_of(first).start..self.places.nodes_of(last).end;
            values[nodes].iter().map(|unknowns| f64::from(unknowns[0])).sum::<f64>()
        };
        // The copy of the first plane, if there is one, comes last.
        let planes = self.places.rows() / n1;
        (n0..planes).chain(0..n0).collect::<Vec<_>>().into_par_iter().map(of_plane).collect()
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
