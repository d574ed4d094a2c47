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
