//! A multigrid cycle whose finest level is the voxels of a pore space, to precondition with.
//!
//! The voxels of a cube of 2³ that hang together inside it are one node of the next level, from which
//! on [`multigrid`](super::multigrid) goes on with lists of links. On the voxels there are none, and
//! no more vectors than two: a step of the smoother overwrites the values of two steps before.

use std::ops::Range;

use rayon::prelude::*;

use super::chebyshev;
use super::links::{self, Conductances, with_inflow};
use super::multigrid::{DEGREE, Graph, Multigrid, OVERCORRECTION, SMOOTHED};
use super::pore::PoreSpace;
use super::vectors::{CHUNK, Parts};
use crate::bits::WORD;
use crate::error::Result;
use crate::monitor::Monitor;
use crate::volume::{index, position};

/// The cycle for the conductances of the voxels.
pub(super) struct Cycle<C> {
    pub links: C,
    cubes: Cubes,
    /// The node of the next level that each voxel belongs to.
    parents: Vec<u32>,
    coarse: Multigrid,
    /// What the cycle found.
    pub solution: Vec<f32>,
    other: Vec<f32>,
}

impl<C: Conductances> Cycle<C> {
    /// Memory: 12 bytes a voxel of the pore space, and 80 a node of the next level, of which there is
    /// one for six or seven voxels.
    pub fn new(links: C, monitor: &Monitor<'_>) -> Result<Self> {
        let space = links.space();
        let cubes = Cubes::new(space);
        let mut parents = vec![0; space.len()];
        space.parts.map(&mut parents, monitor, |rows, mut first, parents| {
            let start = first;
            for row in rows {
                first = cubes.name_row(space, row, first, &mut parents[first - start..]);
            }
        });
        monitor.check()?;
        let places = cubes.places(space);
        let graph = join(&links, &parents, &places, monitor)?;
        let coarse = Multigrid::new(graph, places, cubes.shape, monitor)?;
        let (solution, other) = (vec![0.0; space.len()], vec![0.0; space.len()]);
        Ok(Self { links, cubes, parents, coarse, solution, other })
    }

    /// Approximates the solution of A x = b from zero, in `solution`.
    pub fn run(&mut self, right: impl Fn(usize) -> f32 + Sync, monitor: &Monitor<'_>) {
        let [(_, first), (keep, add)] = chebyshev::factors::<DEGREE>(SMOOTHED);
        let Self { links, cubes, parents, coarse, solution, other } = self;
        let links = &*links;
        let space = links.space();
        // D⁻¹ (b − A x) of a voxel
        let step = |voxel: usize, inflow: f32, x: f32| {
            let diagonal = links.diagonal(voxel);
            if diagonal > 0.0 { (right(voxel) + inflow) / diagonal - x } else { 0.0 }
        };

        space.parts.map(other, monitor, |_, start, other| {
            for (i, other) in other.iter_mut().enumerate() {
                *other = first * step(start + i, 0.0, 0.0);
            }
        });
        with_inflow(links, solution, other, monitor, |start, inflow, other, solution| {
            for (i, (x, &o)) in solution.iter_mut().zip(other).enumerate() {
                *x = o + keep * o + add * step(start + i, inflow[i], o);
            }
        });
        cubes.parts.map(coarse.right(), monitor, |rows, start, coarse| {
            let mut inflow = Vec::new();
            coarse.fill(0.0);
            for rows in rows.flat_map(|row| cubes.rows_of(space, row)) {
                links.gather(rows.clone(), solution, &mut inflow);
                for (voxel, &inflow) in space.voxels_of(rows).zip(&inflow) {
                    let outflow = links.diagonal(voxel) * solution[voxel] - inflow;
                    coarse[parents[voxel] as usize - start] += right(voxel) - outflow;
                }
            }
        });
        let correction = coarse.cycle(monitor);
        space.parts.map(solution, monitor, |_, start, solution| {
            for (x, &parent) in solution.iter_mut().zip(&parents[start..]) {
                *x += OVERCORRECTION * correction[parent as usize];
            }
        });
        with_inflow(links, other, solution, monitor, |start, inflow, solution, other| {
            for (i, (o, &x)) in other.iter_mut().zip(solution).enumerate() {
                *o = x + first * step(start + i, inflow[i], x);
            }
        });
        with_inflow(links, solution, other, monitor, |start, inflow, other, solution| {
            for (i, (x, &o)) in solution.iter_mut().zip(other).enumerate() {
                *x = o + keep * (o - *x) + add * step(start + i, inflow[i], o);
            }
        });
    }
}

/// The links between the nodes that voxels are joined to.
fn join(
    links: &impl Conductances,
    parents: &[u32],
    places: &[u32],
    monitor: &Monitor<'_>,
) -> Result<Graph> {
    let space = links.space();
    let of = |parent: usize| children(space, parents, places, parent);
    let ground = |parent: usize| {
        of(parent).map(|([row, _], voxel)| links::ground(links, row, voxel)).sum::<f32>()
    };
    let ground = (0..places.len()).into_par_iter().map(ground).collect();
    let each = |parent: usize, found: &mut Vec<(u32, f32)>| {
        let first = found.len();
        for (at, voxel) in of(parent) {
            for side in 0..6 {
                let (axis, after) = (side / 2, side % 2 == 1);
                let beside = space.place_beside(at, axis, after);
                let Some(other) = beside.and_then(|at| space.number(at)) else { continue };
                let end = parents[other];
                if end as usize == parent {
                    continue;
                }
                let owner = if after { voxel } else { other };
                let conductance = links.after::<f32>(axis, owner);
                match found[first..].iter_mut().find(|(known, _)| *known == end) {
                    Some((_, sum)) => *sum += conductance,
                    None => found.push((end, conductance)),
                }
            }
        }
    };
    Graph::new(ground, each, monitor)
}

/// The voxels of a node of the next level: row and place in it, number.
fn children<'a>(
    space: &'a PoreSpace,
    parents: &'a [u32],
    places: &[u32],
    parent: usize,
) -> impl Iterator<Item = ([usize; 2], usize)> + 'a {
    let shape = space.shape;
    let cube = position(shape.map(|n| n.div_ceil(2)), places[parent] as usize);
    (0..8).filter_map(move |corner| {
        let [z, y, x] = [4, 2, 1].map(|bit| usize::from(corner & bit != 0));
        let at = [2 * cube[0] + z, 2 * cube[1] + y, 2 * cube[2] + x];
        if at[0] >= shape[0] || at[1] >= shape[1] || at[2] >= shape[2] {
            return None;
        }
        let at = [at[0] * shape[1] + at[1], at[2]];
        let voxel = space.number(at).filter(|&voxel| parents[voxel] as usize == parent)?;
        Some((at, voxel))
    })
}

/// The cubes of 2³ voxels, in rows along axis 2, and the nodes that their voxels make.
struct Cubes {
    /// How many there are along each axis.
    shape: [usize; 3],
    /// The number of the first node of each row of cubes, and of one more.
    firsts: Vec<u32>,
    /// Rows of cubes in parts.
    parts: Parts,
}

impl Cubes {
    fn new(space: &PoreSpace) -> Self {
        let shape = space.shape.map(|n| n.div_ceil(2));
        let count = |row: usize| masks(space, row).map(|mask| u32::from(PIECES[mask].count)).sum();
        let counts: Vec<u32> = (0..shape[0] * shape[1]).into_par_iter().map(count).collect();
        let mut firsts = vec![0];
        let mut total = 0;
        firsts.extend(counts.iter().map(|count| {
            total += count;
            total
        }));
        let of = |row: usize| firsts[row] as usize..firsts[row + 1] as usize;
        let parts = Parts::new(counts.len(), CHUNK / 8, of);
        Self { shape, firsts, parts }
    }

    /// The rows of voxels that a row of cubes has, of one plane and of the next.
    fn rows_of(&self, space: &PoreSpace, row: usize) -> impl Iterator<Item = Range<usize>> + use<> {
        let [n0, n1, _] = space.shape;
        let [z, y] = [row / self.shape[1], row % self.shape[1]];
        let planes = 2 * z..(2 * z + 2).min(n0);
        planes.map(move |z| z * n1 + 2 * y..z * n1 + (2 * y + 2).min(n1))
    }

    /// Writes the node of each voxel of a row; returns the number of the first voxel of the next.
    fn name_row(
        &self,
        space: &PoreSpace,
        row: usize,
        mut voxel: usize,
        nodes: &mut [u32],
    ) -> usize {
        let [z, y] = [row / space.shape[1], row % space.shape[1]];
        let line = 4 * (z % 2) + 2 * (y % 2);
        let cubes = z / 2 * self.shape[1] + y / 2;
        let (first, mut node) = (voxel, self.firsts[cubes]);
        for mask in masks(space, cubes) {
            for corner in [line, line + 1] {
                if mask >> corner & 1 == 1 {
                    nodes[voxel - first] = node + u32::from(PIECES[mask].of[corner]);
                    voxel += 1;
                }
            }
            node += u32::from(PIECES[mask].count);
        }
        voxel
    }

    /// The cube of each node, in C order of the cubes.
    fn places(&self, space: &PoreSpace) -> Vec<u32> {
        let mut places = Vec::new();
        for row in 0..self.shape[0] * self.shape[1] {
            let at = [row / self.shape[1], row % self.shape[1], 0];
            let first = index(self.shape, at) as u32;
            for (x, mask) in masks(space, row).enumerate() {
                places.extend((0..PIECES[mask].count).map(|_| first + x as u32));
            }
        }
        places
    }
}

/// Which voxels of each cube of a row of cubes there are: bit 4 z + 2 y + x.
fn masks(space: &PoreSpace, row: usize) -> impl Iterator<Item = usize> + '_ {
    let [n0, n1, n2] = space.shape;
    let per_plane = n1.div_ceil(2);
    let [z, y] = [row / per_plane, row % per_plane];
    let lines = [0, 1, 2, 3].map(|i| {
        let at = [2 * z + i / 2, 2 * y + i % 2];
        (at[0] < n0 && at[1] < n1).then(|| {
            let row = at[0] * n1 + at[1];
            space.bits_of(row..row + 1).words
        })
    });
    (0..n2.div_ceil(2)).map(move |x| {
        let (word, shift) = (2 * x / WORD, 2 * x % WORD);
        let pair = |i: usize| lines[i].map_or(0, |words| (words[word] >> shift & 3) as usize);
        (0..4).fold(0, |mask, i| mask | pair(i) << (2 * i))
    })
}

/// The pieces that some voxels of a cube make.
#[derive(Clone, Copy)]
struct Pieces {
    count: u8,
    /// The piece of each voxel.
    of: [u8; 8],
}

/// The pieces of every choice of voxels, by its bits.
static PIECES: [Pieces; 256] = pieces_of_cubes();

const fn pieces_of_cubes() -> [Pieces; 256] {
    let mut all = [Pieces { count: 0, of: [0; 8] }; 256];
    let mut mask = 0;
    while mask < 256 {
        let mut left: usize = mask;
        while left != 0 {
            // Grows from the first voxel that has no piece yet, across faces inside the cube.
            let mut piece = left & left.wrapping_neg();
            loop {
                let along = (piece & 0x55) << 1 | (piece & 0xaa) >> 1;
                let across = (piece & 0x33) << 2 | (piece & 0xcc) >> 2;
                let up = (piece & 0x0f) << 4 | (piece & 0xf0) >> 4;
                let grown = piece | (along | across | up) & mask;
                if grown == piece {
                    break;
                }
                piece = grown;
            }
            let mut corner = 0;
            while corner < 8 {
                if piece >> corner & 1 == 1 {
                    all[mask].of[corner] = all[mask].count;
                }
                corner += 1;
            }
            all[mask].count += 1;
            left &= !piece;
        }
        mask += 1;
    }
    all
}
