//! A phase packed into one bit a voxel, with void all round.

use std::sync::atomic::{AtomicU32, Ordering};

use ndarray::{ArrayView3, ArrayViewMut3, Axis, s};
use rayon::prelude::*;

use super::labelling;
use super::simple_point::Word;
use crate::error::Result;
use crate::monitor::Monitor;

/// Voxels of a word. Half of 64, so that a word and a voxel at either side fit one register.
pub(super) const BITS: usize = 32;

/// Where the rows are. A row has at least one spare bit at its end, which parts it from the next,
/// and the volume one spare row at each side: every voxel has 26 neighbours.
#[derive(Debug, Clone, Copy)]
pub(super) struct Layout {
    /// Rows of a plane and planes, the spare ones counted.
    pub(super) rows: usize,
    pub(super) planes: usize,
    /// Words of a row.
    pub(super) words: usize,
}

impl Layout {
    pub(super) fn of((nz, ny, nx): (usize, usize, usize)) -> Self {
        Self { rows: ny + 2, planes: nz + 2, words: nx / BITS + 1 }
    }

    /// Words from a plane to the next.
    pub(super) const fn plane(&self) -> usize {
        self.rows * self.words
    }

    /// Words of the volume: one more at each end, so that every row has a word before and behind.
    pub(super) const fn len(&self) -> usize {
        self.planes * self.plane() + 2
    }

    /// First word of a row.
    pub(super) const fn at(&self, z: usize, y: usize) -> usize {
        1 + (z * self.rows + y) * self.words
    }
}

/// A word of voxels.
pub(super) trait Bits {
    fn bits(&self) -> u32;
}

impl Bits for u32 {
    #[inline(always)]
    fn bits(&self) -> u32 {
        *self
    }
}

impl Bits for AtomicU32 {
    #[inline(always)]
    fn bits(&self) -> u32 {
        self.load(Ordering::Relaxed)
    }
}

/// The voxels of three words in a row, as far as the middle one's neighbours go: bit i + 1 is bit i
/// of the middle word.
#[inline(always)]
pub(super) fn window([before, word, behind]: [u32; 3]) -> u64 {
    u64::from(before >> 31) | u64::from(word) << 1 | u64::from(behind) << 33
}

/// Neighbourhood of a bit, from the windows of its nine rows.
#[inline(always)]
pub(super) fn neighbourhood(windows: &[u64; 9], bit: u32) -> Word {
    let mut neighbours = 0;
    for (row, window) in windows.iter().enumerate() {
        neighbours |= ((window >> bit) as Word & 7) << (3 * row);
    }
    neighbours
}

/// Loads the windows round a word.
#[inline(always)]
pub(super) fn windows(words: &[impl Bits], layout: &Layout, at: usize) -> [u64; 9] {
    let mut windows = [0; 9];
    let first = at - layout.plane() - layout.words;
    for (row, one) in windows.iter_mut().enumerate() {
        let middle = first + row / 3 * layout.plane() + row % 3 * layout.words;
        let words = &words[middle - 1..middle + 2];
        *one = window([words[0].bits(), words[1].bits(), words[2].bits()]);
    }
    windows
}

/// Packs a phase.
pub(super) fn pack(
    solid: ArrayView3<'_, bool>,
    layout: &Layout,
    monitor: &Monitor<'_>,
) -> Result<Vec<u32>> {
    /// Planes packed at once where z is contiguous.
    const LANES: usize = 64;
    let by_lanes = solid.strides()[0] == 1 && solid.strides()[2] != 1;
    let lanes = if by_lanes { LANES } else { 1 };
    let mut packed = vec![0; layout.len()];
    let (plane, words) = (layout.plane(), layout.words);
    let inner = &mut packed[1 + plane..];
    let blocks: Vec<_> = solid.axis_chunks_iter(Axis(0), lanes).collect();
    inner.par_chunks_mut(lanes * plane).zip(blocks).try_for_each(|(to, block)| {
        monitor.check()?;
        if by_lanes {
            pack_lanes::<LANES>(block, to, plane, words);
        } else {
            for (to, row) in to[words..].chunks_exact_mut(words).zip(block.rows()) {
                if let Some(row) = row.as_slice() {
                    for (to, voxels) in to.iter_mut().zip(row.chunks(BITS)) {
                        *to = labelling::pack(voxels) as u32;
                    }
                } else {
                    for (x, &voxel) in row.iter().enumerate() {
                        to[x / BITS] |= u32::from(voxel) << (x % BITS);
                    }
                }
            }
        }
        Ok(())
    })?;
    Ok(packed)
}

/// Packs at most `N` planes whose voxels are contiguous along z.
fn pack_lanes<const N: usize>(
    block: ArrayView3<'_, bool>,
    to: &mut [u32],
    plane: usize,
    words: usize,
) {
    let (nz, ny, nx) = block.dim();
    for y in 0..ny {
        for word in 0..nx.div_ceil(BITS) {
            let mut lanes = [0; N];
            for bit in 0..BITS.min(nx - BITS * word) {
                let voxels = block.slice(s![.., y, BITS * word + bit]);
                for (lane, &voxel) in lanes.iter_mut().zip(voxels.as_slice().unwrap_or(&[])) {
                    *lane |= u32::from(voxel) << bit;
                }
            }
            for (z, lane) in lanes[..nz].iter().enumerate() {
                to[z * plane + (y + 1) * words + word] = *lane;
            }
        }
    }
}

/// Sets the voxels of `volume` whose bits are set.
pub(super) fn unpack(words: &[AtomicU32], layout: &Layout, mut volume: ArrayViewMut3<'_, bool>) {
    volume.axis_iter_mut(Axis(0)).into_par_iter().enumerate().for_each(|(z, mut plane)| {
        for (y, mut row) in plane.rows_mut().into_iter().enumerate() {
            let at = layout.at(z + 1, y + 1);
            for (word, bits) in words[at..at + layout.words].iter().enumerate() {
                for bit in ones(bits.load(Ordering::Relaxed)) {
                    row[word * BITS + bit as usize] = true;
                }
            }
        }
    });
}

/// Positions of the set bits, lowest first.
#[inline(always)]
pub(super) fn ones(word: u32) -> Ones {
    Ones(word)
}

/// See `ones`.
pub(super) struct Ones(u32);

impl Iterator for Ones {
    type Item = u32;

    #[inline(always)]
    fn next(&mut self) -> Option<u32> {
        if self.0 == 0 {
            return None;
        }
        let bit = self.0.trailing_zeros();
        self.0 &= self.0 - 1;
        Some(bit)
    }
}
