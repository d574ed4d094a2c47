//! Cubes of 4³ voxels: those of a cube that hang together inside it are one node of a coarse level.
//!
//! Nothing is kept of which voxel belongs to which node. It follows from the bits of a cube.

use std::ops::Range;

use rayon::prelude::*;

use super::links::{self, Conductances};
use super::multigrid::{Graph, add_link};
use super::pore::PoreSpace;
use super::vectors::{CHUNK, Parts};
use crate::bits::{WORD, ones};
use crate::error::Result;
use crate::monitor::Monitor;
use crate::volume::{Shape, index, position};

/// Voxels along the edge of a cube: bit 16 z + 4 y + x of 64 is a voxel.
const EDGE: usize = 4;

/// The first plane of a cube across each axis; the others follow by shifts.
const PLANES: [u64; 3] = [0xffff, 0x000f_000f_000f_000f, 0x1111_1111_1111_1111];
/// By how much the bits of the next voxel along each axis are further on.
const STEPS: [usize; 3] = [16, 4, 1];

/// The cubes, in rows along axis 2, and the nodes that their voxels make.
pub(super) struct Cubes {
    /// How many there are along each axis.
    pub shape: Shape,
    /// Nodes of each cube.
    counts: Vec<u8>,
    /// The number of the first node of each row of cubes, and of one more.
    firsts: Vec<u32>,
    /// Rows of cubes in parts.
    pub parts: Parts,
}

impl Cubes {
    pub fn new(space: &PoreSpace) -> Self {
        let shape = space.shape.map(|n| n.div_ceil(EDGE));
        let rows = shape[0] * shape[1];
        let mut counts = vec![0u8; rows * shape[2]];
        counts.par_chunks_mut(shape[2].max(1)).enumerate().for_each(|(row, counts)| {
            let lines = Lines::new(space, shape, row);
            for (x, count) in counts.iter_mut().enumerate() {
                *count = pieces(lines.mask(x)).count() as u8;
            }
        });
        let mut firsts = vec![0];
        let mut total = 0;
        firsts.extend(counts.chunks(shape[2].max(1)).map(|counts| {
            total += counts.iter().map(|&count| u32::from(count)).sum::<u32>();
            total
        }));
        let of = |row: usize| firsts[row] as usize..firsts[row + 1] as usize;
        let parts = Parts::new(rows, CHUNK / 64, of);
        Self { shape, counts, firsts, parts }
    }

    /// The rows of voxels that a row of cubes has, plane by plane.
    pub fn rows_of(
        &self,
        space: &PoreSpace,
        row: usize,
    ) -> impl Iterator<Item = Range<usize>> + use<> {
        let [n0, n1, _] = space.shape;
        let [z, y] = [row / self.shape[1] * EDGE, row % self.shape[1] * EDGE];
        let planes = z..(z + EDGE).min(n0);
        planes.map(move |z| z * n1 + y..z * n1 + (y + EDGE).min(n1))
    }

    /// The cube of each node, in C order of the cubes.
    pub fn places(&self) -> Vec<u32> {
        let cubes = self.counts.iter().enumerate();
        cubes.flat_map(|(at, &count)| (0..count).map(move |_| at as u32)).collect()
    }

    /// The graph of the nodes, which lie at `places`.
    pub fn graph(
        &self,
        links: &impl Conductances,
        places: &[u32],
        monitor: &Monitor<'_>,
    ) -> Result<Graph> {
        let space = links.space();
        let ground = |node: usize| {
            let cube = Cube::new(space, self, places, places[node]);
            let ends = [0, self.shape[0] - 1].contains(&cube.at[0]);
            let own = if ends { cube.piece(node) } else { 0 };
            let of_voxel = |bit| {
                let at = cube.place(space, bit);
                space.number(at).map_or(0.0, |voxel| links::ground(links, at[0], voxel))
            };
            ones(own).map(of_voxel).sum::<f32>()
        };
        let ground = (0..places.len()).into_par_iter().map(ground).collect();
        let each = |node: usize, found: &mut Vec<(u32, f32)>| {
            let first = found.len();
            let cube = Cube::new(space, self, places, places[node]);
            let own = cube.piece(node);
            for side in 0..6 {
                let (axis, after) = (side / 2, side % 2 == 1);
                let mut beside = None;
                for bit in ones(own & cube.face(space, axis, after)) {
                    let at = cube.place(space, bit);
                    let Some(to) = space.place_beside(at, axis, after) else { continue };
                    let (Some(voxel), Some(other)) = (space.number(at), space.number(to)) else {
                        continue;
                    };
                    // All voxels of a face have theirs in one cube.
                    let beside = beside.get_or_insert_with(|| {
                        let [z, y] = [to[0] / space.shape[1], to[0] % space.shape[1]];
                        let at = [z, y, to[1]].map(|i| i / EDGE);
                        Cube::new(space, self, places, index(self.shape, at) as u32)
                    });
                    let end = beside.node(space, to);
                    if end == node {
                        continue;
                    }
                    let conductance = links.after::<f32>(axis, if after { voxel } else { other });
                    add_link(found, first, (end as u32, conductance));
                }
            }
        };
        Graph::new(ground, each, monitor)
    }
}

/// The nodes of the voxels, row by row.
pub(super) struct Names<'a> {
    space: &'a PoreSpace,
    cubes: &'a Cubes,
    /// The row of cubes that was asked for last, and the pieces of those that have several.
    row: Option<usize>,
    pieces: Vec<u64>,
}

impl<'a> Names<'a> {
    pub fn new(space: &'a PoreSpace, cubes: &'a Cubes) -> Self {
        Self { space, cubes, row: None, pieces: Vec::new() }
    }

    /// Calls `each(node, voxels)` for a row of voxels, so many of which, one after the other, belong to
    /// that node.
    #[inline(always)]
    pub fn for_row(&mut self, row: usize, mut each: impl FnMut(usize, usize)) {
        let Self { space, cubes, .. } = *self;
        let [z, y] = [row / space.shape[1], row % space.shape[1]];
        let of_cubes = z / EDGE * cubes.shape[1] + y / EDGE;
        let counts = &cubes.counts[of_cubes * cubes.shape[2]..][..cubes.shape[2]];
        if self.row.replace(of_cubes) != Some(of_cubes) {
            let lines = Lines::new(space, cubes.shape, of_cubes);
            self.pieces.clear();
            for (x, _) in counts.iter().enumerate().filter(|&(_, &count)| count > 1) {
                self.pieces.extend(pieces(lines.mask(x)));
            }
        }
        let words = space.bits_of(row..row + 1).words;
        let line = STEPS[0] * (z % EDGE) + STEPS[1] * (y % EDGE);
        let mut node = cubes.firsts[of_cubes] as usize;
        let mut left = self.pieces.as_slice();
        for (x, &count) in counts.iter().enumerate() {
            let count = usize::from(count);
            let own = four(words, x);
            if count > 1 {
                let (pieces, rest) = left.split_at(count);
                for bit in ones(own) {
                    let other = |piece: &&u64| *piece >> (line + bit as usize) & 1 == 0;
                    each(node + pieces.iter().take_while(other).count(), 1);
                }
                left = rest;
            } else if own != 0 {
                each(node, own.count_ones() as usize);
            }
            node += count;
        }
    }
}

/// A cube: which voxels it has, and its nodes.
struct Cube {
    at: Shape,
    mask: u64,
    /// Number of its first node.
    first: usize,
}

impl Cube {
    fn new(space: &PoreSpace, cubes: &Cubes, places: &[u32], at: u32) -> Self {
        let place = position(cubes.shape, at as usize);
        let row = place[0] * cubes.shape[1] + place[1];
        let [start, end] = [row, row + 1].map(|row| cubes.firsts[row] as usize);
        let before = places[start..end].partition_point(|&other| other < at);
        let mask = Lines::new(space, cubes.shape, row).mask(place[2]);
        Self { at: place, mask, first: start + before }
    }

    /// The voxels of a node of it.
    fn piece(&self, node: usize) -> u64 {
        pieces(self.mask).nth(node - self.first).unwrap_or(0)
    }

    /// The node of a voxel of it: row and place in it.
    fn node(&self, space: &PoreSpace, [row, x]: [usize; 2]) -> usize {
        let at = [row / space.shape[1], row % space.shape[1], x].map(|i| i % EDGE);
        let bit: usize = at.iter().zip(STEPS).map(|(i, step)| i * step).sum();
        self.first + pieces(self.mask).take_while(|piece| piece >> bit & 1 == 0).count()
    }

    /// Row and place in it of a voxel.
    fn place(&self, space: &PoreSpace, bit: u32) -> [usize; 2] {
        let bit = bit as usize;
        let [z, y, x] = [0, 1, 2].map(|axis| EDGE * self.at[axis] + bit / STEPS[axis] % EDGE);
        [z * space.shape[1] + y, x]
    }

    /// The voxels before or after which another cube begins.
    fn face(&self, space: &PoreSpace, axis: usize, after: bool) -> u64 {
        let left = space.shape[axis] - EDGE * self.at[axis];
        let plane = if after { left.min(EDGE) - 1 } else { 0 };
        PLANES[axis] << (STEPS[axis] * plane)
    }
}

/// The rows of voxels that a row of cubes has.
struct Lines<'a>([Option<&'a [u64]>; EDGE * EDGE]);

impl<'a> Lines<'a> {
    #[inline(always)]
    fn new(space: &'a PoreSpace, shape: Shape, row: usize) -> Self {
        let [n0, n1, _] = space.shape;
        let cube = [row / shape[1], row % shape[1]];
        Self(std::array::from_fn(|i| {
            let [z, y] = [EDGE * cube[0] + i / EDGE, EDGE * cube[1] + i % EDGE];
            (z < n0 && y < n1).then(|| space.bits_of(z * n1 + y..z * n1 + y + 1).words)
        }))
    }

    /// The voxels of a cube of the row.
    #[inline(always)]
    fn mask(&self, x: usize) -> u64 {
        let lines = self.0.iter().enumerate();
        lines.fold(0, |mask, (i, words)| mask | words.map_or(0, |words| four(words, x)) << (4 * i))
    }
}

/// The voxels of a row that are in one cube.
#[inline(always)]
fn four(words: &[u64], cube: usize) -> u64 {
    let at = EDGE * cube;
    words[at / WORD] >> (at % WORD) & 15
}

/// The voxels that hang together across faces, in order of the first of each.
#[inline(always)]
fn pieces(mut left: u64) -> impl Iterator<Item = u64> {
    std::iter::from_fn(move || {
        let piece = (left != 0).then(|| piece(left))?;
        left &= !piece;
        Some(piece)
    })
}

/// What the first voxel hangs together with.
#[inline(always)]
fn piece(mask: u64) -> u64 {
    let [_, across, along] = PLANES;
    let mut piece = mask & mask.wrapping_neg();
    loop {
        let forward = piece << 16 | (piece << 4 & !across) | (piece << 1 & !along);
        let backward = piece >> 16 | (piece & !across) >> 4 | (piece & !along) >> 1;
        let grown = piece | (forward | backward) & mask;
        if grown == piece {
            return piece;
        }
        piece = grown;
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array3;

    use super::*;
    use crate::rng::Key;
    use crate::volume::Boundary;

    /// Component of each voxel inside its cube, by a search.
    fn searched(mask: u64) -> Vec<u64> {
        let touch = |a: usize, b: usize| {
            let apart: usize = STEPS.iter().map(|s| (a / s % EDGE).abs_diff(b / s % EDGE)).sum();
            apart == 1
        };
        let mut left: Vec<usize> = ones(mask).map(|bit| bit as usize).collect();
        let mut found = Vec::new();
        while !left.is_empty() {
            let mut own = vec![left.remove(0)];
            while let Some(i) = left.iter().position(|&a| own.iter().any(|&b| touch(a, b))) {
                own.push(left.remove(i));
            }
            found.push(own.iter().fold(0, |piece, bit| piece | 1 << bit));
        }
        found
    }

    #[test]
    fn pieces_are_those_of_a_search() {
        let masks = (0..300).map(|i| {
            let share = [0.2, 0.4, 0.6][i as usize % 3];
            let has = |bit: u64| u64::from(Key::new(1).unit(64 * i + bit) < share);
            (0..64).fold(0, |mask, bit| mask | has(bit) << bit)
        });
        for mask in masks.chain([0, 1, u64::MAX, 0x8000_0000_0000_0001, 0x0018_0000_0000_0000]) {
            assert_eq!(pieces(mask).collect::<Vec<_>>(), searched(mask));
        }
    }

    #[test]
    fn rows_name_the_nodes_of_their_voxels() {
        for shape in [(1, 1, 1), (4, 4, 4), (5, 3, 70), (6, 9, 64), (3, 4, 130)] {
            let mut i = 0;
            let solid = Array3::from_shape_simple_fn(shape, || {
                i += 1;
                Key::new(2).unit(i) < 0.45
            });
            let silent = Monitor::silent();
            let space = PoreSpace::new(solid.view(), Boundary::Open, &silent).unwrap();
            let cubes = Cubes::new(&space);
            let places = cubes.places();
            let mut names = Names::new(&space, &cubes);
            for row in 0..space.rows() {
                let mut nodes = Vec::new();
                names.for_row(row, |node, count| nodes.extend(vec![node; count]));
                let voxels = (0..shape.2).filter(|&x| space.number([row, x]).is_some());
                let each = voxels.map(|x| {
                    let [z, y] = [row / shape.1, row % shape.1];
                    let at = index(cubes.shape, [z, y, x].map(|i| i / EDGE)) as u32;
                    let cube = Cube::new(&space, &cubes, &places, at);
                    let node = cube.node(&space, [row, x]);
                    assert_eq!(places[node], at);
                    node
                });
                assert_eq!(nodes, each.collect::<Vec<_>>());
            }
        }
    }
}
