//! The graph of a skeleton: ends and junctions, and the branches between them.

use ndarray::ArrayView3;
use rayon::prelude::*;

use super::bit_rows::{Around, BITS, Layout, pack};
use super::simple_point::{CENTRE, Word, is_connected};
use crate::bits::ones;
use crate::error::{Error, Result};
use crate::monitor::Monitor;

/// What a node is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    /// A voxel without neighbours.
    Isolated,
    /// A voxel with one neighbour.
    End,
    /// Touching voxels with more than two neighbours, or with two that touch each other.
    Junction,
    /// The first voxel of a ring that has no junction.
    Ring,
}

/// A node.
#[derive(Debug, Clone, PartialEq)]
pub struct Node {
    /// Centroid (z, y, x) of its voxels, in voxels.
    pub place: [f64; 3],
    /// What it is.
    pub kind: Kind,
    /// Number of its voxels.
    pub size: u32,
}

/// A branch.
#[derive(Debug, Clone, PartialEq)]
pub struct Branch {
    /// The nodes at its ends.
    pub nodes: [u32; 2],
    /// Length from node to node, from voxel centre to voxel centre.
    pub length: f64,
    /// Where its voxels begin in `Graph::voxels`.
    pub start: usize,
}

/// The graph of a skeleton.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Graph {
    /// In C order of their first voxels; rings come last.
    pub nodes: Vec<Node>,
    /// In the order in which the nodes meet them.
    pub branches: Vec<Branch>,
    /// Voxels (z, y, x) of one branch after another, from node to node. An end belongs to its
    /// branch, a junction to none.
    pub voxels: Vec<[u32; 3]>,
}

/// Makes the graph of the true voxels, of which 26 touch each. Lengths are in units of `voxel_size`.
///
/// Peak memory: ⅛ byte a voxel and about 40 bytes a voxel of the skeleton.
pub fn graph(
    skeleton: ArrayView3<'_, bool>,
    voxel_size: [f64; 3],
    monitor: &Monitor<'_>,
) -> Result<Graph> {
    if !voxel_size.iter().all(|&edge| edge > 0.0 && edge.is_finite()) {
        return Err(Error::parameter("voxel_size", voxel_size, "must be positive"));
    }
    let voxels = Voxels::of(skeleton, monitor)?;
    let mut tracing = Tracing::new(&voxels, voxel_size, monitor)?;
    tracing.trace_from_nodes()?;
    tracing.trace_rings()?;
    Ok(tracing.graph)
}

/// A voxel of the skeleton.
struct Voxel {
    /// Its row, spare rows counted.
    row: u32,
    x: u32,
    neighbours: Word,
}

impl Voxel {
    fn class(&self) -> Class {
        match self.neighbours.count_ones() {
            0 => Class::Isolated,
            1 => Class::End,
            2 if !is_connected(self.neighbours) => Class::Path,
            _ => Class::Junction,
        }
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Class {
    Isolated,
    End,
    Path,
    Junction,
}

/// The voxels of a skeleton in C order.
struct Voxels {
    layout: Layout,
    bits: Vec<u64>,
    list: Vec<Voxel>,
    /// Number of the first voxel of each row.
    first: Vec<u32>,
}

impl Voxels {
    fn of(skeleton: ArrayView3<'_, bool>, monitor: &Monitor<'_>) -> Result<Self> {
        let too_large = |_| Error::parameter("shape", skeleton.dim(), "must hold less voxels");
        let layout = Layout::of(skeleton.dim());
        u32::try_from(layout.rows * layout.planes).map_err(too_large)?;
        u32::try_from(skeleton.dim().2).map_err(too_large)?;
        let bits = pack(skeleton, &layout, monitor)?;
        let planes = (1..layout.planes - 1)
            .into_par_iter()
            .map(|z| {
                monitor.check()?;
                Ok(voxels_of_plane(&bits, &layout, z))
            })
            .collect::<Result<Vec<_>>>()?;
        let list: Vec<Voxel> = planes.into_iter().flatten().collect();
        u32::try_from(list.len()).map_err(too_large)?;
        let mut first = Vec::with_capacity(layout.rows * layout.planes);
        let mut next = 0;
        for row in 0..(layout.rows * layout.planes) as u32 {
            first.push(next as u32);
            while list.get(next).is_some_and(|voxel| voxel.row == row) {
                next += 1;
            }
        }
        Ok(Self { layout, bits, list, first })
    }

    /// Number of a neighbour, by its bit in the neighbourhood.
    fn neighbour(&self, voxel: &Voxel, bit: u32) -> usize {
        let bit = bit as usize;
        let rows = self.layout.rows;
        let row = voxel.row as usize + bit / 9 * rows + bit / 3 % 3 - rows - 1;
        let x = voxel.x as usize + bit % 3 - 1;
        let at = 1 + row * self.layout.words;
        let words = &self.bits[at..=at + x / BITS];
        let before: u32 = words[..x / BITS].iter().map(|word| word.count_ones()).sum();
        let below = words[x / BITS] & ((1 << (x % BITS)) - 1);
        (self.first[row] + before + below.count_ones()) as usize
    }

    fn neighbours(&self, number: usize) -> impl Iterator<Item = usize> + '_ {
        let voxel = &self.list[number];
        ones(voxel.neighbours.into()).map(move |bit| self.neighbour(voxel, bit))
    }

    fn place(&self, number: usize) -> [u32; 3] {
        let Voxel { row, x, .. } = self.list[number];
        let rows = self.layout.rows as u32;
        [row / rows - 1, row % rows - 1, x]
    }
}

fn voxels_of_plane(bits: &[u64], layout: &Layout, z: usize) -> Vec<Voxel> {
    let mut voxels = Vec::new();
    for y in 1..layout.rows - 1 {
        let at = layout.at(z, y);
        for (word, &own) in bits[at..at + layout.words].iter().enumerate() {
            if own == 0 {
                continue;
            }
            let around = Around::new(bits, layout, at + word);
            voxels.extend(ones(own).map(|bit| Voxel {
                row: (z * layout.rows + y) as u32,
                x: (BITS * word) as u32 + bit,
                neighbours: around.neighbourhood(bit) & !CENTRE,
            }));
        }
    }
    voxels
}

/// No node; no voxel.
const NONE: u32 = u32::MAX;
/// Voxels between two questions whether to stop.
const CHECK: usize = 1 << 16;

struct Tracing<'a> {
    voxels: &'a Voxels,
    voxel_size: [f64; 3],
    monitor: &'a Monitor<'a>,
    /// Node of each voxel; none for those on the way.
    node: Vec<u32>,
    classes: Vec<Class>,
    visited: Vec<bool>,
    graph: Graph,
}

impl<'a> Tracing<'a> {
    fn new(voxels: &'a Voxels, voxel_size: [f64; 3], monitor: &'a Monitor<'a>) -> Result<Self> {
        let classes: Vec<Class> = voxels.list.par_iter().map(Voxel::class).collect();
        let mut tracing = Self {
            voxels,
            voxel_size,
            monitor,
            node: vec![NONE; classes.len()],
            visited: vec![false; classes.len()],
            classes,
            graph: Graph::default(),
        };
        tracing.find_nodes()?;
        Ok(tracing)
    }

    /// Makes a node of each end and isolated voxel, and of all junction voxels that touch.
    fn find_nodes(&mut self) -> Result<()> {
        let mut stack = Vec::new();
        for start in 0..self.classes.len() {
            if start.is_multiple_of(CHECK) {
                self.monitor.check()?;
            }
            let kind = match self.classes[start] {
                Class::Isolated => Kind::Isolated,
                Class::End => Kind::End,
                Class::Junction if self.node[start] == NONE => Kind::Junction,
                _ => continue,
            };
            let node = self.graph.nodes.len() as u32;
            let (mut sum, mut size) = ([0; 3], 0);
            self.node[start] = node;
            stack.push(start);
            while let Some(voxel) = stack.pop() {
                size += 1;
                for (sum, place) in sum.iter_mut().zip(self.voxels.place(voxel)) {
                    *sum += u64::from(place);
                }
                if kind == Kind::Junction {
                    for other in self.voxels.neighbours(voxel) {
                        if self.classes[other] == Class::Junction && self.node[other] == NONE {
                            self.node[other] = node;
                            stack.push(other);
                        }
                    }
                }
            }
            let place = sum.map(|sum| sum as f64 / f64::from(size));
            self.graph.nodes.push(Node { place, kind, size });
        }
        Ok(())
    }

    fn trace_from_nodes(&mut self) -> Result<()> {
        let voxels = self.voxels;
        for start in 0..self.classes.len() {
            if start.is_multiple_of(CHECK) {
                self.monitor.check()?;
            }
            if self.node[start] == NONE {
                continue;
            }
            for next in voxels.neighbours(start) {
                // Two nodes that touch meet twice; a way that was gone is not gone back.
                let fresh = if self.node[next] == NONE {
                    !self.visited[next]
                } else {
                    self.node[next] != self.node[start] && start < next
                };
                if fresh {
                    self.trace(start, next)?;
                }
            }
        }
        Ok(())
    }

    /// Follows the way that begins at a node's voxel and goes on with `next`.
    fn trace(&mut self, start: usize, next: usize) -> Result<()> {
        let first = self.graph.voxels.len();
        if self.classes[start] == Class::End {
            self.graph.voxels.push(self.voxels.place(start));
        }
        let end = self.follow(start, next)?;
        if self.classes[end] == Class::End {
            self.graph.voxels.push(self.voxels.place(end));
        }
        self.finish(first, [self.node[start], self.node[end]]);
        Ok(())
    }

    /// Passes the voxels on the way; returns the voxel of a node where it ends.
    fn follow(&mut self, mut before: usize, mut at: usize) -> Result<usize> {
        while self.node[at] == NONE {
            if self.graph.voxels.len().is_multiple_of(CHECK) {
                self.monitor.check()?;
            }
            self.visited[at] = true;
            self.graph.voxels.push(self.voxels.place(at));
            let next = self.voxels.neighbours(at).find(|&next| next != before);
            (before, at) = (at, next.unwrap_or(before));
        }
        Ok(at)
    }

    /// Enters the branch whose voxels begin at `first`.
    fn finish(&mut self, first: usize, nodes: [u32; 2]) {
        let [from, to] = nodes.map(|node| self.graph.nodes[node as usize].place);
        let mut at = from;
        let mut length = 0.0;
        for place in &self.graph.voxels[first..] {
            let place = place.map(f64::from);
            length += self.distance(at, place);
            at = place;
        }
        length += self.distance(at, to);
        self.graph.branches.push(Branch { nodes, length, start: first });
    }

    fn distance(&self, a: [f64; 3], b: [f64; 3]) -> f64 {
        let steps = [0, 1, 2].map(|i| (a[i] - b[i]) * self.voxel_size[i]);
        steps.iter().map(|step| step * step).sum::<f64>().sqrt()
    }

    /// Each ring that is left gets a node at its first voxel.
    fn trace_rings(&mut self) -> Result<()> {
        for start in 0..self.classes.len() {
            if self.node[start] != NONE || self.visited[start] {
                continue;
            }
            let place = self.voxels.place(start);
            let node = self.graph.nodes.len() as u32;
            self.node[start] = node;
            let kind = Kind::Ring;
            self.graph.nodes.push(Node { place: place.map(f64::from), kind, size: 1 });
            let first = self.graph.voxels.len();
            self.graph.voxels.push(place);
            if let Some(next) = self.voxels.neighbours(start).next() {
                self.follow(start, next)?;
            }
            self.finish(first, [node, node]);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array3;

    use super::*;

    fn graph_of(shape: (usize, usize, usize), voxels: &[[usize; 3]]) -> Graph {
        let mut skeleton = Array3::from_elem(shape, false);
        for &voxel in voxels {
            skeleton[voxel] = true;
        }
        graph(skeleton.view(), [1.0, 2.0, 3.0], &Monitor::silent()).unwrap()
    }

    fn kinds(graph: &Graph) -> Vec<Kind> {
        graph.nodes.iter().map(|node| node.kind).collect()
    }

    #[test]
    fn nothing_and_one_voxel() {
        assert_eq!(graph_of((0, 3, 3), &[]), Graph::default());
        assert_eq!(graph_of((2, 3, 40), &[]), Graph::default());
        let one = graph_of((2, 3, 40), &[[1, 2, 39]]);
        assert_eq!(kinds(&one), [Kind::Isolated]);
        assert_eq!(one.nodes[0].place.map(|i| i as i32), [1, 2, 39]);
        assert!(one.branches.is_empty() && one.voxels.is_empty());
    }

    #[test]
    fn a_line() {
        let places: Vec<_> = (0..40).map(|i| [0, 1, i]).collect();
        for n in [2, 3, 33, 40] {
            let line = graph_of((1, 2, 40), &places[..n]);
            assert_eq!(kinds(&line), [Kind::End, Kind::End]);
            assert_eq!(line.branches.len(), 1);
            assert!((line.branches[0].length - 3.0 * (n - 1) as f64).abs() < 1e-9);
            assert_eq!(line.voxels.len(), n);
        }
    }

    #[test]
    fn a_cross_has_four_branches() {
        let mut places: Vec<_> = (0..7).map(|i| [i, 3, 3]).collect();
        places.extend((0..7).map(|i| [3, i, 3]));
        let cross = graph_of((7, 7, 7), &places);
        let junctions: Vec<_> = cross.nodes.iter().filter(|n| n.kind == Kind::Junction).collect();
        assert_eq!(junctions.len(), 1);
        // The four voxels round the middle touch each other and belong to the junction.
        assert_eq!((junctions[0].place.map(|i| i as i32), junctions[0].size), ([3; 3], 5));
        assert_eq!(cross.branches.len(), 4);
        let length: f64 = cross.branches.iter().map(|b| b.length).sum();
        assert!((length - (6.0 + 12.0)).abs() < 1e-9);
    }

    #[test]
    fn a_ring_has_a_node_of_its_own() {
        let ring = graph_of((3, 3, 3), &[[1, 0, 1], [1, 1, 0], [1, 1, 2], [1, 2, 1]]);
        assert_eq!(kinds(&ring), [Kind::Ring]);
        assert_eq!(ring.branches[0].nodes, [0, 0]);
        assert_eq!(ring.voxels.len(), 4);
        assert!((ring.branches[0].length - 4.0 * 13.0_f64.sqrt()).abs() < 1e-9);
    }

    #[test]
    fn voxels_that_all_touch_are_one_node() {
        let three = graph_of((2, 2, 2), &[[0, 0, 0], [0, 0, 1], [0, 1, 0]]);
        assert_eq!(kinds(&three), [Kind::Junction]);
        assert!(three.branches.is_empty());
    }

    #[test]
    fn bad_voxel_sizes_are_named() {
        let skeleton = Array3::from_elem((2, 2, 2), true);
        let result = graph(skeleton.view(), [1.0, 0.0, 1.0], &Monitor::silent());
        assert!(matches!(result, Err(Error::Parameter { parameter: "voxel_size", .. })));
    }
}
