//! A phase packed into one bit a voxel, with void all round.

use std::sync::atomic::{AtomicU64, Ordering};

use ndarray::{ArrayView3, ArrayViewMut3, Axis, s};
use rayon::prelude::*;

use super::simple_point::Word;
use crate::bits::{ones, pack as pack_word};
use crate::error::Result;
use crate::monitor::Monitor;

/// Voxels of a word.
pub(super) const BITS: usize = 64;

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
    fn bits(&self) -> u64;
}

impl Bits for u64 {
    #[inline(always)]
    fn bits(&self) -> u64 {
        *self
    }
}

impl Bits for AtomicU64 {
    #[inline(always)]
    fn bits(&self) -> u64 {
        self.load(Ordering::Relaxed)
    }
}

/// A word and those of the eight rows round it, in the order of a neighbourhood.
pub(super) struct Around<'a, B> {
    volume: &'a [B],
    layout: &'a Layout,
    at: usize,
    words: [u64; 9],
}

impl<'a, B: Bits> Around<'a, B> {
    #[inline(always)]
    pub(super) fn new(volume: &'a [B], layout: &'a Layout, at: usize) -> Self {
        let mut words = [0; 9];
        for (row, word) in words.iter_mut().enumerate() {
            *word = volume[Self::beside(layout, at, row)].bits();
        }
        Self { volume, layout, at, words }
    }

    #[inline(always)]
    const fn beside(layout: &Layout, at: usize, row: usize) -> usize {
        at + row / 3 * layout.plane() + row % 3 * layout.words - layout.plane() - layout.words
    }

    /// Takes a voxel out of the middle word, here only.
    #[inline(always)]
    pub(super) fn clear(&mut self, bit: u32) {
        self.words[4] &= !(1 << bit);
    }

    /// Neighbourhood of a voxel of the middle word.
    #[inline(always)]
    pub(super) fn neighbourhood(&self, bit: u32) -> Word {
        if bit == 0 || bit == BITS as u32 - 1 {
            return self.at_the_edge(bit);
        }
        let mut neighbours = 0;
        for (row, word) in self.words.iter().enumerate() {
            neighbours |= ((word >> (bit - 1)) as Word & 7) << (3 * row);
        }
        neighbours
    }

    /// The same for a voxel with neighbours in the word before or behind.
    #[inline(never)]
    fn at_the_edge(&self, bit: u32) -> Word {
        let mut neighbours = 0;
        for (row, word) in self.words.iter().enumerate() {
            let at = Self::beside(self.layout, self.at, row);
            let three = if bit == 0 {
                word << 1 | self.volume[at - 1].bits() >> (BITS - 1)
            } else {
                word >> (BITS - 2) | self.volume[at + 1].bits() << 2
            };
            neighbours |= (three as Word & 7) << (3 * row);
        }
        neighbours
    }
}

/// Packs a phase.
pub(super) fn pack(
    solid: ArrayView3<'_, bool>,
    layout: &Layout,
    monitor: &Monitor<'_>,
) -> Result<Vec<u64>> {
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
                        *to = pack_word(voxels);
                    }
                } else {
                    for (x, &voxel) in row.iter().enumerate() {
                        to[x / BITS] |= u64::from(voxel) << (x % BITS);
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
    to: &mut [u64],
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
                    *lane |= u64::from(voxel) << bit;
                }
            }
            for (z, lane) in lanes[..nz].iter().enumerate() {
                to[z * plane + (y + 1) * words + word] = *lane;
            }
        }
    }
}

/// Sets the voxels of `volume` whose bits are set.
pub(super) fn unpack(words: &[AtomicU64], layout: &Layout, mut volume: ArrayViewMut3<'_, bool>) {
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
