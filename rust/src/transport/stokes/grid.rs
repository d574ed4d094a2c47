//! The staggered grid: which velocities there are, and the operator.

use rayon::prelude::*;

use crate::error::Result;
use crate::monitor::Monitor;
use crate::transport::pore::{Neighbours, PoreSpace, side};
use crate::volume::Boundary;

/// Velocities through the faces after a voxel along axes 0, 1, 2, and the pressure at its centre.
pub(super) type Unknowns = [f32; 4];
/// The place of the pressure.
pub(super) const PRESSURE: usize = 3;

/// Nodes are the voxels of the pore space; with an open boundary, one more plane before the first,
/// which owns the velocities through the inlet; and a last one of zeros, which stands for every
/// neighbour that does not exist: gathering without a branch halves the time of a pass. Pressure is held at 0 in that plane and in
/// the one after the last, half a voxel beyond the volume, as if its end planes went on that far.
/// The other faces of an open volume are mirrors: nothing passes them, and they do not slow a flow.
pub(super) struct Grid<'a> {
    pub space: &'a PoreSpace,
    /// The nodes that touch each node; the last node where there is none.
    pub neighbours: Vec<Neighbours>,
    /// 1 / diagonal of the viscous operator for the three velocities, 0 where there is no velocity;
    /// then 0 for the pressure.
    pub inverse: Vec<Unknowns>,
    /// 1 / h² along each axis.
    pub weights: [f32; 3],
    /// 1 / h along each axis.
    pub slopes: [f32; 3],
}

/// What is beyond a velocity, one step along an axis.
#[derive(PartialEq, Clone, Copy)]
enum Beyond {
    /// Another velocity.
    Velocity,
    /// A face that is part of a wall: velocity 0 one step away.
    Edge,
    /// A wall between the two places: velocity 0 half a step away.
    Wall,
    /// The same velocity.
    Mirror,
}

impl<'a> Grid<'a> {
    pub fn new(space: &'a PoreSpace, spacing: [f64; 3], monitor: &Monitor<'_>) -> Result<Self> {
        let open = space.boundary == Boundary::Open;
        let n = space.len();
        let plane = space.shape[1] * space.shape[2];
        let inlet = space.positions.partition_point(|&at| (at as usize) < plane);
        let total = if open { n + inlet } else { n };
        let none = total as u32;
        let mut neighbours: Vec<Neighbours> = Vec::with_capacity(total + 1);
        neighbours.par_extend(
            space
                .neighbours
                .par_iter()
                .map(|n6| n6.map(|k| if k as usize == n { none } else { k })),
        );
        if open {
            for voxel in 0..inlet {
                let ghost = (n + voxel) as u32;
                // Voxels of the first plane have their neighbours there too.
                let mut around =
                    neighbours[voxel].map(|k| if k == none { k } else { k + n as u32 });
                around[side(0, 0)] = none;
                around[side(0, 1)] = voxel as u32;
                neighbours.push(around);
                neighbours[voxel][side(0, 0)] = ghost;
            }
        }
        neighbours.push([none; 6]);
        let mut grid = Self {
            space,
            neighbours,
            inverse: Vec::new(),
            weights: spacing.map(|h| (1.0 / h.powi(2)) as f32),
            slopes: spacing.map(|h| (1.0 / h) as f32),
        };
        grid.inverse = (0..=total)
            .into_par_iter()
            .map(|node| {
                monitor.check()?;
                Ok([0, 1, 2, PRESSURE].map(|axis| {
                    let there = axis != PRESSURE && grid.has_velocity(node as u32, axis);
                    if there { 1.0 / grid.viscous_diagonal(node as u32, axis) } else { 0.0 }
                }))
            })
            .collect::<Result<Vec<_>>>()?;
        Ok(grid)
    }

    pub fn len(&self) -> usize {
        self.neighbours.len()
    }

    fn none(&self) -> u32 {
        self.len() as u32 - 1
    }

    /// Whether the plane of outlet pressure follows a node along axis 0.
    fn before_outlet(&self, node: u32) -> bool {
        (node as usize) < self.space.len() && self.space.at_border(node as usize, side(0, 1))
    }

    /// Whether there is a velocity along an axis through the face after a node.
    fn has_velocity(&self, node: u32, axis: usize) -> bool {
        let ghost = node as usize >= self.space.len();
        self.neighbours[node as usize][side(axis, 1)] != self.none() && !(ghost && axis > 0)
            || axis == 0 && self.before_outlet(node)
    }

    /// What is beyond the velocity along `axis` after a node, on one of its sides; and the node
    /// there.
    fn beyond(&self, node: u32, axis: usize, to: usize) -> (Beyond, u32) {
        let none = self.none();
        let n = self.space.len();
        let next = self.neighbours[node as usize][to];
        if to / 2 == axis {
            // Along the flow of the velocity itself.
            let end = |ghost: bool| if ghost { Beyond::Mirror } else { Beyond::Edge };
            let kind = if to.is_multiple_of(2) {
                if next == none { end(node as usize >= n) } else { Beyond::Velocity }
            } else if axis == 0 && self.before_outlet(node) {
                Beyond::Mirror
            } else if next != none && self.has_velocity(next, axis) {
                Beyond::Velocity
            } else {
                Beyond::Edge
            };
            return (kind, next);
        }
        if axis > 0 && to / 2 == 0 && next as usize >= n && next != none {
            return (Beyond::Mirror, next); // the plane before the inlet
        }
        if next == none {
            let voxel = if node as usize >= n { node as usize - n } else { node as usize };
            if self.space.at_border(voxel, to) {
                return (Beyond::Mirror, next);
            }
        } else if self.has_velocity(next, axis) {
            return (Beyond::Velocity, next);
        }
        // The voxel on the other side of the face may have a neighbour where this one has none.
        let across = self.neighbours[node as usize][side(axis, 1)];
        let both_solid =
            next == none && (across == none || self.neighbours[across as usize][to] == none);
        (if both_solid { Beyond::Wall } else { Beyond::Edge }, next)
    }

    fn viscous_diagonal(&self, node: u32, axis: usize) -> f32 {
        (0..6)
            .map(|to| {
                let factor = match self.beyond(node, axis, to).0 {
                    Beyond::Velocity | Beyond::Edge => 1.0,
                    Beyond::Mirror => 0.0,
                    Beyond::Wall => wall_shear(self.width(node, axis, to ^ 1)),
                };
                factor * self.weights[to / 2]
            })
            .sum()
    }

    /// How far the opposite wall is from a wall, seen along `to` from a velocity next to it; steps.
    fn width(&self, mut node: u32, axis: usize, to: usize) -> f32 {
        let mut width = 1.0;
        // Beyond this the profile's curvature does not show at the wall.
        while width < 64.0 {
            match self.beyond(node, axis, to) {
                (Beyond::Velocity, next) => node = next,
                (Beyond::Wall, _) => return width,
                (Beyond::Edge, _) => return width + 0.5,
                (Beyond::Mirror, _) => return 2.0 * width,
            }
            width += 1.0;
        }
        width
    }

    /// Applies the whole operator at a node.
    #[inline(always)]
    pub fn apply(&self, node: usize, x: &[Unknowns]) -> Unknowns {
        let around = self.around(node, x);
        let own = x[node];
        let mut out = self.viscous(node, own, &around);
        let mut divergence = 0.0;
        for axis in 0..3 {
            let slope = self.slopes[axis];
            if self.inverse[node][axis] > 0.0 {
                out[axis] += slope * (around[side(axis, 1)][PRESSURE] - own[PRESSURE]);
            }
            divergence += slope * (around[side(axis, 0)][axis] - own[axis]);
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

    /// The unknowns round a node.
    #[inline(always)]
    pub fn around(&self, node: usize, x: &[Unknowns]) -> [Unknowns; 6] {
        // Spelled out: `map` is not inlined here, which costs a quarter of the time.
        let [a, b, c, d, e, f] = self.neighbours[node];
        let at = |k: u32| x[k as usize];
        [at(a), at(b), at(c), at(d), at(e), at(f)]
    }
}

/// Shear at a wall by (velocity half a step away / step): 2, and more for the curvature of the
/// profile between walls that are `width` steps apart.
///
/// With this factor the flow between parallel walls is h²/12 for every whole h. With 2 it is
/// h²/12 + 1/6: 3 times as much for one voxel, 13 % more for four.
fn wall_shear(width: f32) -> f32 {
    2.0 / (1.0 - 2.0 / (3.0 * width))
}
