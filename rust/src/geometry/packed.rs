//! A few consecutive planes of a volume, one bit a voxel, for kernels that compare voxels with
//! their neighbours 64 at a time.

use std::ops::Range;

use ndarray::ArrayView3;

use crate::bits::pack_row;
use crate::volume::{Boundary, Shape};

/// A step from voxel to voxel along (z, y, x).
pub type Step = [isize; 3];

/// How planes lie in a [`Window`], and which pairs of voxels a step apart a volume holds.
pub(super) struct Layout {
    shape: Shape,
    boundary: Boundary,
    /// Longest step along any axis.
    reach: usize,
    /// Words of a row.
    words: usize,
    /// For steps of 0, 1, … along x, the voxels of all rows of a plane that are inside with them.
    masks: Vec<Vec<u64>>,
}

impl Layout {
    pub(super) fn new(shape: Shape, reach: usize, boundary: Boundary) -> Self {
        let [_, ny, nx] = shape;
        let words = nx.div_ceil(64);
        let masks = (0..=reach).map(|step| {
            let inside = match boundary {
                Boundary::Open => nx.saturating_sub(step),
                Boundary::Periodic => nx,
            };
            let row: Vec<u64> = (0..words).map(|w| ones(inside.saturating_sub(64 * w))).collect();
            row.repeat(ny)
        });
        Self { shape, boundary, reach, words, masks: masks.collect() }
    }

    /// Where pairs begin that are a step apart along an axis.
    pub(super) fn starts(&self, axis: usize, step: isize) -> Range<usize> {
        let n = self.shape[axis];
        match self.boundary {
            Boundary::Open => {
                let (before, after) = ((-step).max(0) as usize, step.max(0) as usize);
                before.min(n)..n.saturating_sub(after).max(before.min(n))
            }
            Boundary::Periodic => 0..n,
        }
    }

    /// Number of pairs a step apart.
    pub(super) fn pairs(&self, step: Step) -> u64 {
        (0..3).map(|axis| self.starts(axis, step[axis]).len() as u64).product()
    }

    /// Which voxels of `rows` rows are inside together with those `step` further along x.
    pub(super) fn mask(&self, step: usize, rows: usize) -> &[u64] {
        &self.masks[step][..rows * self.words]
    }

    /// Rows of a plane, with those beyond its border.
    const fn rows(&self) -> usize {
        self.shape[1] + 2 * self.reach
    }
}

/// The lowest `count` bits, or all 64.
const fn ones(count: usize) -> u64 {
    if count >= 64 { u64::MAX } else { (1 << count) - 1 }
}

/// The packed planes that steps from one plane can reach.
///
/// Each plane is held as it is and moved by 1, 2, … voxels along x, so that a step along x is a
/// choice of the plane, and steps along y and z are offsets: whole planes are compared as slices.
pub(super) struct Window<'a> {
    solid: ArrayView3<'a, bool>,
    layout: &'a Layout,
    words: Vec<u64>,
    row: Vec<bool>,
}

impl<'a> Window<'a> {
    pub(super) fn new(solid: ArrayView3<'a, bool>, layout: &'a Layout) -> Self {
        let moves = layout.reach + 1;
        let words = vec![0; moves * moves * layout.rows() * layout.words];
        Self { solid, layout, words, row: Vec::new() }
    }

    /// Reads plane `z` in the place of plane `z - reach - 1`; beyond the border the periodic volume
    /// goes on and the open one has nothing.
    pub(super) fn load(&mut self, z: usize) {
        let &Layout { shape: [nz, ny, nx], boundary, reach, words, .. } = self.layout;
        if z >= nz && boundary == Boundary::Open {
            return;
        }
        let plane_words = self.layout.rows() * words;
        let start = z % (reach + 1) * (reach + 1) * plane_words;
        let planes = &mut self.words[start..start + (reach + 1) * plane_words];
        let plane = self.solid.index_axis(ndarray::Axis(0), z % nz);
        let own = reach * words..(reach + ny) * words;
        let rows = planes[own.clone()].chunks_exact_mut(words);
        for (to, from) in rows.zip(plane.outer_iter()) {
            if let Some(row) = from.as_slice() {
                pack_row(row, to);
            } else {
                self.row.clear();
                self.row.extend(from);
                pack_row(&self.row, to);
            }
        }
        let periodic = boundary == Boundary::Periodic;
        for step in 1..=reach {
            let (before, moved) = planes[(step - 1) * plane_words..].split_at_mut(plane_words);
            let rows = moved[own.clone()].chunks_exact_mut(words);
            for (to, from) in rows.zip(before[own.clone()].chunks_exact(words)) {
                move_by_one(from, to, if periodic { nx } else { 0 });
            }
        }
        if periodic {
            for moved in planes.chunks_exact_mut(plane_words) {
                for row in (0..reach).chain(reach + ny..2 * reach + ny) {
                    let from = (row as isize - reach as isize).rem_euclid(ny as isize) as usize;
                    let from = (from + reach) * words;
                    moved.copy_within(from..from + words, row * words);
                }
            }
        }
    }

    /// `count` rows of plane `z` from row `y` on, moved by `x` voxels: bit i is voxel i + x.
    pub(super) fn rows(&self, z: usize, y: isize, x: isize, count: usize) -> &[u64] {
        let &Layout { reach, words, .. } = self.layout;
        let plane = z % (reach + 1) * (reach + 1) + x as usize;
        let row = plane * self.layout.rows() + (y + reach as isize) as usize;
        &self.words[row * words..(row + count) * words]
    }
}

/// Bit i of `to` is bit i + 1 of `from`; if `period` is not 0, its last bit is the first.
fn move_by_one(from: &[u64], to: &mut [u64], period: usize) {
    let next = from.iter().skip(1).chain([&0]);
    for ((to, &word), &next) in to.iter_mut().zip(from).zip(next) {
        *to = word >> 1 | next << 63;
    }
    if let Some(last) = period.checked_sub(1) {
        to[last / 64] |= (from[0] & 1) << (last % 64);
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array3;

    use super::*;

    #[test]
    fn a_bit_is_the_voxel_a_step_away() {
        let (nz, ny, nx) = (3, 4, 130);
        let solid = Array3::from_shape_fn((nz, ny, nx), |(z, y, x)| (z + y * 3 + x * x) % 7 < 3);
        for boundary in [Boundary::Open, Boundary::Periodic] {
            let layout = Layout::new([nz, ny, nx], 2, boundary);
            let mut window = Window::new(solid.view(), &layout);
            (1..4).for_each(|z| window.load(z));
            let (dy, dx) = (-2, 2);
            let range = layout.starts(1, dy);
            for dz in 0..2 {
                let rows = window.rows(1 + dz, range.start as isize + dy, dx, range.len());
                let mask = layout.mask(dx as usize, range.len());
                for (i, (row, mask)) in rows.chunks(3).zip(mask.chunks(3)).enumerate() {
                    for x in 0..192 {
                        let inside = x < if boundary == Boundary::Open { nx - 2 } else { nx };
                        assert_eq!(mask[x / 64] >> (x % 64) & 1 == 1, inside);
                        let y = (range.start + i) as isize + dy;
                        let y = y.rem_euclid(ny as isize) as usize;
                        let bit = row[x / 64] >> (x % 64) & 1 == 1;
                        assert!(!inside || bit == solid[[1 + dz, y, (x + 2) % nx]]);
                    }
                }
            }
        }
    }

    #[test]
    fn pairs_inside() {
        let open = Layout::new([5, 6, 2], 3, Boundary::Open);
        assert_eq!(open.pairs([1, -2, 1]), 4 * 4);
        assert_eq!(open.pairs([0, 0, 3]), 0);
        assert_eq!(open.pairs([0, 0, -3]), 0);
        let periodic = Layout::new([5, 6, 2], 3, Boundary::Periodic);
        assert_eq!(periodic.pairs([0, 0, 3]), 60);
    }
}
