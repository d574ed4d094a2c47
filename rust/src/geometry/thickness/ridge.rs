//! Balls that are not part of a neighbour's.

use ndarray::{Array3, ArrayView3, s};
use rayon::prelude::*;

use super::Space;
use super::balls::{Ball, CELL};
use crate::error::Result;
use crate::monitor::Monitor;
use crate::volume::Boundary;

/// Largest radius in voxels for which [`Needed::table`] is made; it takes the cube of it.
const LARGEST_IN_TABLE: usize = 512;

/// The neighbours of a voxel, without itself.
const NEIGHBOURS: [[isize; 3]; 26] = {
    let mut steps = [[0; 3]; 26];
    let mut i = 0;
    while i < 26 {
        let number = (if i < 13 { i } else { i + 1 }) as isize;
        steps[i] = [number / 9 - 1, number / 3 % 3 - 1, number % 3 - 1];
        i += 1;
    }
    steps
};

/// The balls of a phase, in slabs of [`CELL`] planes, without those whose voxels all lie in the ball
/// of a neighbour that is as thick.
pub(super) fn ridge(
    reach: &Array3<f32>,
    diameters: &Array3<f32>,
    space: &Space,
    monitor: &Monitor<'_>,
) -> Result<Vec<Vec<Ball>>> {
    let (nz, ny, nx) = reach.dim();
    let most = reach.as_slice().unwrap_or(&[]).par_iter().copied().reduce(|| 0.0, f32::max);
    let needed = Needed::new(space, most);
    (0..nz.div_ceil(CELL))
        .into_par_iter()
        .map(|slab| {
            let mut rows = Rows::new(nx);
            let mut balls = Vec::new();
            for z in slab * CELL..((slab + 1) * CELL).min(nz) {
                for y in 0..ny {
                    monitor.check()?;
                    if !rows.load(reach.view(), diameters.view(), [z, y], space.boundary) {
                        continue;
                    }
                    needed.fill(&rows.reach[4][1..=nx], &mut rows.needed);
                    rows.find_parts();
                    for x in (0..nx).filter(|&x| !rows.part[x]) {
                        let at = [z, y, x];
                        balls.push(Ball {
                            at: [0, 1, 2].map(|axis| (at[axis] as f64 * space.size[axis]) as f32),
                            reach: rows.reach[4][x + 1] * needed.inside,
                            diameter: rows.diameters[4][x + 1],
                        });
                    }
                }
            }
            Ok(balls)
        })
        .collect()
}

/// A row of voxels and its eight neighbours, each with one more voxel at both ends.
struct Rows {
    reach: [Vec<f32>; 9],
    diameters: [Vec<f32>; 9],
    /// What a neighbour's square must be at least, by the axes along which it differs.
    needed: [Vec<f32>; 8],
    /// Whether a ball is part of another's, or none.
    part: Vec<bool>,
}

impl Rows {
    fn new(nx: usize) -> Self {
        let padded = || std::array::from_fn(|_| vec![0.0; nx + 2]);
        Self {
            reach: padded(),
            diameters: padded(),
            needed: std::array::from_fn(|_| vec![0.0; nx]),
            part: vec![false; nx],
        }
    }

    /// Copies the rows; false if the middle one holds no voxel of the phase.
    fn load(
        &mut self,
        reach: ArrayView3<'_, f32>,
        diameters: ArrayView3<'_, f32>,
        [z, y]: [usize; 2],
        boundary: Boundary,
    ) -> bool {
        let (nz, ny, nx) = reach.dim();
        let place = |i: usize, step: usize, n: usize| match boundary {
            Boundary::Periodic => Some((i + n + step - 1) % n),
            Boundary::Open => (i + step).checked_sub(1).filter(|&i| i < n),
        };
        for i in [4, 0, 1, 2, 3, 5, 6, 7, 8] {
            let from = place(z, i / 3, nz).zip(place(y, i % 3, ny));
            for (all, rows) in [(reach, &mut self.reach), (diameters, &mut self.diameters)] {
                let row = &mut rows[i];
                let Some((z, y)) = from else {
                    row.fill(0.0);
                    continue;
                };
                if let Some(values) = all.slice(s![z, y, ..]).to_slice() {
                    row[1..=nx].copy_from_slice(values);
                }
                if boundary == Boundary::Periodic {
                    row[0] = row[nx];
                    row[nx + 1] = row[1];
                }
            }
            if i == 4 && self.reach[4][1..=nx].iter().all(|&square| square <= 0.0) {
                return false;
            }
        }
        true
    }

    fn find_parts(&mut self) {
        let nx = self.part.len();
        let own = &self.diameters[4][1..=nx];
        for (part, &square) in self.part.iter_mut().zip(&self.reach[4][1..]) {
            *part = square <= 0.0;
        }
        for [dz, dy, dx] in NEIGHBOURS {
            let row = (3 * (dz + 1) + dy + 1) as usize;
            let class = usize::from(dz != 0) * 4 + usize::from(dy != 0) * 2 + usize::from(dx != 0);
            let shift = (dx + 1) as usize;
            mark_parts(
                &mut self.part,
                (&self.reach[row][shift..], &self.needed[class]),
                (&self.diameters[row][shift..], own),
            );
        }
    }
}

#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn mark_parts(part: &mut [bool], squares: (&[f32], &[f32]), diameters: (&[f32], &[f32])) {
    let squares = squares.0.iter().zip(squares.1);
    let diameters = diameters.0.iter().zip(diameters.1);
    for ((part, (square, needed)), (diameter, own)) in part.iter_mut().zip(squares).zip(diameters) {
        let holds = square >= needed;
        *part |= holds && diameter >= own;
    }
}

/// The squared distance that a neighbour must have for its ball to hold that of a voxel.
struct Needed {
    /// By squared distance in voxels, and by how many axes the neighbour differs along.
    table: Option<[Vec<f32>; 3]>,
    /// Distance of a neighbour, by the axes along which it differs.
    steps: [f32; 8],
    /// What squares are multiplied by so that a rounded one does not reach the voxels outside.
    inside: f32,
}

impl Needed {
    fn new(space: &Space, most: f32) -> Self {
        let most = (most / 4.0) as usize;
        let table = space.is_cubic() && most <= LARGEST_IN_TABLE.pow(2);
        Self {
            table: table.then(|| Self::table(most)),
            steps: std::array::from_fn(|class| {
                let along = |axis: usize| if class & (4 >> axis) == 0 { 0.0 } else { 1.0 };
                let square: f64 = (0..3).map(|axis| along(axis) * space.size[axis].powi(2)).sum();
                square.sqrt() as f32
            }),
            inside: if space.is_cubic() { 1.0 } else { 1.0 - 1e-6 },
        }
    }

    /// Where squares are whole numbers, a ball of a voxel may lie in that of a neighbour though its
    /// real one does not (Rémy and Thiel 2002). The farthest voxel v of a ball from the neighbour
    /// at −e has the square |v|² + 2 v·e + |e|²; the neighbour's must be larger by one at least.
    fn table(most: usize) -> [Vec<f32>; 3] {
        let mut sums = vec![[None::<usize>; 3]; most + 1];
        let root = most.isqrt();
        for a in 0..=root {
            for b in 0..=a.min((most - a * a).isqrt()) {
                for c in 0..=b.min((most - a * a - b * b).isqrt()) {
                    let of = &mut sums[a * a + b * b + c * c];
                    for (largest, sum) in of.iter_mut().zip([a, a + b, a + b + c]) {
                        *largest = (*largest).max(Some(sum));
                    }
                }
            }
        }
        [0, 1, 2].map(|axes| {
            let mut farthest = 0;
            let mut needed = vec![0.0; most + 1];
            for square in 1..=most {
                if let Some(sum) = sums[square - 1][axes] {
                    farthest = farthest.max(square - 1 + 2 * sum + axes + 1);
                }
                needed[square] = 4.0 * (farthest + 1) as f32;
            }
            needed
        })
    }

    fn fill(&self, squares: &[f32], needed: &mut [Vec<f32>; 8]) {
        if let Some(table) = &self.table {
            let [faces, edges, corners] = table;
            for (x, &square) in squares.iter().enumerate() {
                let square = (square as u32 / 4) as usize;
                let (face, edge, corner) = (faces[square], edges[square], corners[square]);
                let all = [0.0, face, face, edge, face, edge, edge, corner];
                for (needed, value) in needed.iter_mut().zip(all) {
                    needed[x] = value;
                }
            }
        } else {
            for (needed, step) in needed.iter_mut().zip(self.steps) {
                for (needed, square) in needed.iter_mut().zip(squares) {
                    *needed = (square.sqrt() + step).powi(2) * (1.0 + 4e-6);
                }
            }
        }
    }
}
