//! A multigrid cycle for the graph Laplacian of a pore space, to precondition with.
//!
//! Nodes of a cube of 2³ that hang together inside it make one node of the next level, and the
//! conductances between them add up: piecewise constant interpolation. It is too stiff by a
//! factor near 2, for which the correction is multiplied (Braess 1995), and too coarse for one cycle to
//! solve well: each level asks the next one twice (W-cycle), which costs little where a level has an
//! eighth of the nodes. The coarsest level has one node a component. Smoothing is a Chebyshev
//! polynomial, so that the cycle is one symmetric positive operator, whatever the number of threads.

use rayon::prelude::*;

use super::chebyshev;
use super::vectors::{CHUNK, for_chunks, in_order};
use crate::error::Result;
use crate::monitor::Monitor;
use crate::volume::{Shape, index, position};

/// What the correction of a coarse level is multiplied by.
const OVERCORRECTION: f32 = 1.8;
/// Degree of the Chebyshev smoother, before and after the coarse correction.
const DEGREE: usize = 2;
/// Eigenvalues of D⁻¹A that the smoother damps: a coarse level sees those below.
const SMOOTHED: [f32; 2] = [0.33, 2.0];

/// Times that a level's equations are gone through.
const CYCLES: usize = 2;

/// Conductances between nodes, and from nodes to the ground.
pub(super) struct Graph {
    /// Where the links of each node begin; one more entry than nodes.
    starts: Vec<u32>,
    /// The node at the other end of each link.
    ends: Vec<u32>,
    /// Conductance of each link.
    links: Vec<f32>,
    /// Conductance from each node to the ground; only until it is coarsened.
    ground: Vec<f32>,
}

impl Graph {
    /// A graph of `ground.len()` nodes, the links of each of which `each` lists.
    pub fn new(
        ground: Vec<f32>,
        each: impl Fn(usize, &mut Vec<(u32, f32)>) + Sync,
        monitor: &Monitor<'_>,
    ) -> Result<Self> {
        let n = ground.len();
        let mut graph = Self { starts: vec![0], ends: Vec::new(), links: Vec::new(), ground };
        let of_chunk = |chunk: usize| {
            monitor.check()?;
            let (mut links, mut counts) = (Vec::new(), Vec::new());
            for node in chunk * CHUNK..((chunk + 1) * CHUNK).min(n) {
                let before = links.len();
                each(node, &mut links);
                counts.push(links.len() - before);
            }
            Ok((links, counts))
        };
        let mut start = 0;
        in_order(n.div_ceil(CHUNK), of_chunk, |(links, counts)| {
            graph.ends.extend(links.iter().map(|(end, _)| end));
            graph.links.extend(links.iter().map(|(_, link)| link));
            graph.starts.extend(counts.iter().map(|count| {
                start += count;
                start as u32
            }));
        })?;
        graph.starts.shrink_to_fit();
        graph.ends.shrink_to_fit();
        graph.links.shrink_to_fit();
        Ok(graph)
    }

    fn len(&self) -> usize {
        self.starts.len() - 1
    }

    #[inline(always)]
    fn links_of(&self, node: usize) -> impl Iterator<Item = (u32, f32)> {
        let range = self.starts[node] as usize..self.starts[node + 1] as usize;
        self.ends[range.clone()].iter().copied().zip(self.links[range].iter().copied())
    }

    /// Sum of conductance · value over the links of a node.
    #[inline(always)]
    fn inflow(&self, node: usize, values: &[f32]) -> f32 {
        let range = self.starts[node] as usize..self.starts[node + 1] as usize;
        let mut sum = 0.0;
        for (&end, &link) in self.ends[range.clone()].iter().zip(&self.links[range]) {
            sum += link * values[end as usize];
        }
        sum
    }
}

/// Adds a link to those of a node, the first of which is at `first`: two to one node are one link.
pub(super) fn add_link(links: &mut Vec<(u32, f32)>, first: usize, (end, conductance): (u32, f32)) {
    match links[first..].iter_mut().find(|(known, _)| *known == end) {
        Some((_, sum)) => *sum += conductance,
        None => links.push((end, conductance)),
    }
}

/// A level: its matrix, and what it is to the next level.
struct Level {
    graph: Graph,
    diagonal: Vec<f32>,
    /// The node of the next level that each node belongs to; empty on the last level.
    parents: Vec<u32>,
    /// The nodes of each node of the next level, and where they begin.
    children: Vec<u32>,
    child_starts: Vec<u32>,
}

/// Vectors that a cycle needs on a level.
#[derive(Default)]
struct Room {
    right: Vec<f32>,
    solution: Vec<f32>,
    other: Vec<f32>,
}

/// The levels, finest first.
pub(super) struct Multigrid {
    levels: Vec<Level>,
    rooms: Vec<Room>,
    /// The component of each node, if nothing is grounded.
    components: Vec<u32>,
}

impl Multigrid {
    /// Coarsens a graph whose nodes lie at `positions` (in C order) of a volume.
    ///
    /// Memory: 86 bytes a node that has six links.
    pub fn new(
        graph: Graph,
        mut positions: Vec<u32>,
        mut shape: Shape,
        monitor: &Monitor<'_>,
    ) -> Result<Self> {
        let mut levels = vec![Level::new(graph, monitor)];
        while shape.iter().any(|&n| n > 1) {
            let coarse = shape.map(|n| n.div_ceil(2));
            for_chunks(&mut positions, monitor, |_, positions| {
                for at in positions {
                    *at = index(coarse, position(shape, *at as usize).map(|i| i / 2)) as u32;
                }
            });
            shape = coarse;
            let last = levels.len() - 1;
            let (next, kept) = levels[last].coarsen(&positions, monitor)?;
            positions = kept;
            levels.push(Level::new(next, monitor));
        }
        let rooms = levels.iter().map(|level| Room::new(level.graph.len())).collect();
        let grounded = levels[0].graph.ground.iter().any(|&ground| ground > 0.0);
        for level in &mut levels {
            level.graph.ground = Vec::new();
        }
        let nodes = if grounded { 0 } else { levels[0].graph.len() as u32 };
        let components = (0..nodes).map(|node| {
            let above = levels.iter().filter(|level| !level.parents.is_empty());
            above.fold(node, |node, level| level.parents[node as usize])
        });
        Ok(Self { components: components.collect(), levels, rooms })
    }

    /// The right side b of the equations.
    pub fn right(&mut self) -> &mut [f32] {
        &mut self.rooms[0].right
    }

    /// Approximates the solution of A x = b, beginning from nothing.
    pub fn cycle(&mut self, monitor: &Monitor<'_>) -> &[f32] {
        // Where nothing is grounded, what rounding leaves of the sum over what hangs together would raise
        // the solution there as a whole, ever more from level to level.
        let count = self.levels[self.levels.len() - 1].graph.len();
        balance(&self.components, count, &mut self.rooms[0].right);
        cycle(&self.levels, &mut self.rooms, monitor);
        balance(&self.components, count, &mut self.rooms[0].solution);
        &self.rooms[0].solution
    }
}

/// Makes values sum to nothing over each of `count` components.
fn balance(components: &[u32], count: usize, values: &mut [f32]) {
    let mut sums = vec![(0.0, 0.0); count];
    for (&component, &value) in components.iter().zip(&*values) {
        let (sum, count) = &mut sums[component as usize];
        *sum += f64::from(value);
        *count += 1.0;
    }
    for (&component, value) in components.iter().zip(values) {
        let (sum, count) = sums[component as usize];
        *value -= (sum / count) as f32;
    }
}

/// Solves roughly for the first of `levels`; the right side and the solution are in the first room.
fn cycle(levels: &[Level], rooms: &mut [Room], monitor: &Monitor<'_>) {
    let ([level, below @ ..], [room, rooms @ ..]) = (levels, rooms) else { return };
    if below.is_empty() {
        // Its nodes have no links.
        level.step(room, (0.0, 1.0), true, monitor);
        return;
    }
    for k in 0..CYCLES {
        level.smooth(room, k == 0, monitor);
        level.residual(room, monitor);
        let residual = &room.other;
        for_chunks(&mut rooms[0].right, monitor, |first, right| {
            for (i, right) in right.iter_mut().enumerate() {
                *right = level.children_of(first + i).iter().map(|&c| residual[c as usize]).sum();
            }
        });
        cycle(below, rooms, monitor);
        let correction = &rooms[0].solution;
        for_chunks(&mut room.solution, monitor, |first, solution| {
            for (x, &parent) in solution.iter_mut().zip(&level.parents[first..]) {
                *x += OVERCORRECTION * correction[parent as usize];
            }
        });
        level.smooth(room, false, monitor);
    }
}

impl Room {
    fn new(n: usize) -> Self {
        Self { right: vec![0.0; n], solution: vec![0.0; n], other: vec![0.0; n] }
    }
}

impl Level {
    fn new(graph: Graph, monitor: &Monitor<'_>) -> Self {
        let mut diagonal = graph.ground.clone();
        for_chunks(&mut diagonal, monitor, |first, diagonal| {
            for (i, d) in diagonal.iter_mut().enumerate() {
                *d += graph.links_of(first + i).map(|(_, link)| link).sum::<f32>();
            }
        });
        let (parents, children, child_starts) = Default::default();
        Self { graph, diagonal, parents, children, child_starts }
    }

    fn children_of(&self, parent: usize) -> &[u32] {
        let starts = &self.child_starts[parent..];
        &self.children[starts[0] as usize..starts[1] as usize]
    }

    /// Joins the nodes that lie at the same position and hang together; returns the graph of the
    /// joined nodes, and their positions.
    fn coarsen(&mut self, positions: &[u32], monitor: &Monitor<'_>) -> Result<(Graph, Vec<u32>)> {
        let n = self.graph.len();
        let mut parents: Vec<u32> = (0..n as u32).collect();
        for node in 0..n {
            if node.is_multiple_of(CHUNK) {
                monitor.check()?;
            }
            for (end, _) in self.graph.links_of(node) {
                if (end as usize) < node && positions[end as usize] == positions[node] {
                    let (a, b) = (root(&parents, node as u32), root(&parents, end));
                    parents[a.max(b) as usize] = a.min(b);
                }
            }
        }
        // A root is the first of its nodes, so that it has been numbered before the others.
        let mut kept = Vec::new();
        let mut child_starts = vec![0u32];
        for node in 0..n {
            let parent = parents[node] as usize;
            if parent == node {
                parents[node] = kept.len() as u32;
                kept.push(positions[node]);
                child_starts.push(1);
            } else {
                parents[node] = parents[parent];
                child_starts[parents[node] as usize + 1] += 1;
            }
        }
        for i in 1..child_starts.len() {
            child_starts[i] += child_starts[i - 1];
        }
        let mut next = child_starts.clone();
        let mut children = vec![0; n];
        for (node, &parent) in parents.iter().enumerate() {
            children[next[parent as usize] as usize] = node as u32;
            next[parent as usize] += 1;
        }
        (self.parents, self.children, self.child_starts) = (parents, children, child_starts);

        let ground = (0..kept.len())
            .into_par_iter()
            .map(|p| self.children_of(p).iter().map(|&c| self.graph.ground[c as usize]).sum())
            .collect();
        let graph = Graph::new(
            ground,
            |parent, links| {
                let first = links.len();
                for &child in self.children_of(parent) {
                    for (end, link) in self.graph.links_of(child as usize) {
                        let end = self.parents[end as usize];
                        if end as usize == parent {
                            continue;
                        }
                        add_link(links, first, (end, link));
                    }
                }
            },
            monitor,
        )?;
        Ok((graph, kept))
    }

    /// Chebyshev iteration on D⁻¹A; `from_zero` forgets the solution that is there.
    fn smooth(&self, room: &mut Room, from_zero: bool, monitor: &Monitor<'_>) {
        for (k, factors) in chebyshev::factors::<DEGREE>(SMOOTHED).into_iter().enumerate() {
            self.step(room, factors, from_zero && k == 0, monitor);
        }
    }

    /// A step of the iteration, which overwrites the solution of two steps before.
    fn step(
        &self,
        room: &mut Room,
        (keep, add): (f32, f32),
        from_zero: bool,
        monitor: &Monitor<'_>,
    ) {
        let Room { right, solution, other } = room;
        if from_zero {
            solution.fill(0.0);
        }
        for_chunks(other, monitor, |first, other| {
            for (i, other) in other.iter_mut().enumerate() {
                let node = first + i;
                let (x, diagonal) = (solution[node], self.diagonal[node]);
                let inflow = if from_zero { 0.0 } else { self.graph.inflow(node, solution) };
                let residual = right[node] + inflow - diagonal * x;
                let step = if diagonal > 0.0 { add * residual / diagonal } else { 0.0 };
                *other = x + keep * (x - *other) + step;
            }
        });
        std::mem::swap(solution, other);
    }

    /// Writes b − A x into `other`.
    fn residual(&self, room: &mut Room, monitor: &Monitor<'_>) {
        let Room { right, solution, other } = room;
        for_chunks(other, monitor, |first, residual| {
            for (i, r) in residual.iter_mut().enumerate() {
                let node = first + i;
                let inflow = self.graph.inflow(node, solution);
                *r = right[node] + inflow - self.diagonal[node] * solution[node];
            }
        });
    }
}

fn root(parents: &[u32], mut node: u32) -> u32 {
    while parents[node as usize] != node {
        node = parents[node as usize];
    }
    node
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Key;
    use crate::transport::vectors::dot;
    use crate::volume::voxels;

    /// A lattice of random conductances, some of them missing, grounded at one end.
    fn lattice(shape: Shape) -> Multigrid {
        let silent = Monitor::silent();
        let n = voxels(shape);
        let ground = (0..n).map(|i| if position(shape, i)[0] == 0 { 2.0 } else { 0.0 }).collect();
        let each = |node: usize, links: &mut Vec<(u32, f32)>| {
            for axis in 0..3 {
                for after in [false, true] {
                    let mut to = position(shape, node);
                    to[axis] = if after { to[axis] + 1 } else { to[axis].wrapping_sub(1) };
                    if to[axis] < shape[axis] {
                        let to = index(shape, to);
                        let unit = Key::new(1).unit((3 * node.min(to) + axis) as u64);
                        if unit > 0.3 {
                            links.push((to as u32, unit));
                        }
                    }
                }
            }
        };
        let graph = Graph::new(ground, each, &silent).unwrap();
        let positions: Vec<u32> = (0..n as u32).collect();
        Multigrid::new(graph, positions, shape, &silent).unwrap()
    }

    fn noise(n: usize, seed: u64) -> Vec<f32> {
        (0..n).map(|i| Key::new(seed).unit(i as u64) - 0.5).collect()
    }

    #[test]
    fn a_cycle_is_symmetric_and_positive() {
        let shape = [9, 7, 11];
        let mut multigrid = lattice(shape);
        let [a, b] = [2, 3].map(|seed| noise(voxels(shape), seed));
        let mut cycle = |right: &[f32]| {
            multigrid.right().copy_from_slice(right);
            multigrid.cycle(&Monitor::silent()).to_vec()
        };
        let [cycled_a, cycled_b] = [&a, &b].map(|v| cycle(v));
        let (ab, ba) = (dot(&cycled_a, &b), dot(&a, &cycled_b));
        let scale = (dot(&cycled_a, &a) * dot(&cycled_b, &b)).sqrt();
        assert!((ab - ba).abs() < 1e-5 * scale);
        assert!(dot(&cycled_a, &a) > 0.0 && dot(&cycled_b, &b) > 0.0);
    }

    #[test]
    fn the_coarsest_level_has_a_node_for_each_part() {
        let multigrid = lattice([8, 8, 8]);
        let last = &multigrid.levels[multigrid.levels.len() - 1].graph;
        assert!(last.links.is_empty());
        let total: f32 = multigrid.levels[0].graph.ground.iter().sum();
        assert!((last.ground.iter().sum::<f32>() - total).abs() < 1e-3);
    }
}
