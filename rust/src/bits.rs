//! Rows of voxels as bits of words.

/// Voxels in a word.
pub(crate) const WORD: usize = 64;

/// Bit i is voxel i, for up to 64 voxels.
#[inline(always)]
pub(crate) fn pack(voxels: &[bool]) -> u64 {
    /// Gathers the lowest bits of eight bytes in the top byte of the product.
    const GATHER: u64 = 0x0102_0408_1020_4080;
    let (eights, rest) = voxels.as_chunks::<8>();
    let mut bits = 0;
    for (i, eight) in eights.iter().enumerate() {
        // Compilers make one load of this; `eight.map(u8::from)` they do not always inline.
        let bytes = (0..8).fold(0, |bytes, k| bytes | u64::from(eight[k]) << (8 * k));
        bits |= (bytes.wrapping_mul(GATHER) >> 56) << (8 * i);
    }
    for (i, &voxel) in rest.iter().enumerate() {
        bits |= u64::from(voxel) << (8 * eights.len() + i);
    }
    bits
}

/// Writes a row to `words`, which must be as many as it fills.
#[inline(always)]
pub(crate) fn pack_row(row: &[bool], words: &mut [u64]) {
    let (full, rest) = row.as_chunks::<WORD>();
    for (word, voxels) in words.iter_mut().zip(full) {
        *word = pack(voxels);
    }
    if !rest.is_empty()
        && let Some(word) = words.last_mut()
    {
        *word = pack(rest);
    }
}

/// Positions of the set bits, lowest first.
#[inline(always)]
pub(crate) fn ones(word: u64) -> Ones {
    Ones(word)
}

/// See `ones`.
pub(crate) struct Ones(u64);

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

/// Takes the first run of set bits out of a word that has one: where it begins, and how long it is.
#[inline(always)]
pub(crate) fn take_run(word: &mut u64) -> (usize, usize) {
    let start = word.trailing_zeros();
    let length = (!(*word >> start)).trailing_zeros();
    *word &= u64::MAX.checked_shl(start + length).unwrap_or(0);
    (start as usize, length as usize)
}
