//! How often each of the 256 patterns of 2×2×2 voxels occurs.

use ndarray::{ArrayView3, Axis};
use rayon::prelude::*;

use super::packed::{Layout, Window};
use crate::error::{Error, Result};
use crate::monitor::Monitor;
use crate::volume::Boundary;

/// Number of patterns of 2×2×2 voxels.
pub const PATTERNS: usize = 256;

/// Counts of the patterns: bit 4 z + 2 y + x of a pattern is the voxel (z, y, x) of its eight.
pub type Histogram = [u64; PATTERNS];

/// Counts the patterns of all 2×2×2 voxels, which overlap.
///
/// Memory: two planes, one bit a voxel, for each thread.
///
/// # Errors
/// If the volume is empty.
pub fn configurations(
    solid: ArrayView3<'_, bool>,
    boundary: Boundary,
    monitor: &Monitor<'_>,
) -> Result<Histogram> {
    if solid.is_empty() {
        return Err(Error::parameter("shape", solid.dim(), "must not be empty"));
    }
    let reversed = solid.strides()[0] == 1 && solid.strides()[2] != 1;
    let solid = if reversed { solid.reversed_axes() } else { solid };
    let (nz, ny, nx) = solid.dim();
    let layout = Layout::new([nz, ny, nx], 1, boundary);
    let thickness = nz.div_ceil(4 * rayon::current_num_threads());
    let slabs: Vec<usize> = (0..nz).step_by(thickness).collect();
    let counts = slabs
        .into_par_iter()
        .map(|first| {
            let mut window = Window::new(solid, &layout);
            let mut counts = [0; PATTERNS];
            window.load(first);
            for z in first..solid.len_of(Axis(0)).min(first + thickness) {
                monitor.check()?;
                window.load(z + 1);
                if layout.starts(0, 1).contains(&z) {
                    count_plane(&window, &layout, z, &mut counts);
                }
            }
            Ok(counts)
        })
        .try_reduce(
            || [0; PATTERNS],
            |mut total, counts| {
                total.iter_mut().zip(counts).for_each(|(total, count)| *total += count);
                Ok(total)
            },
        )?;
    if !reversed {
        return Ok(counts);
    }
    let mut turned = [0; PATTERNS];
    for (pattern, count) in counts.into_iter().enumerate() {
        let bits = (0..8).map(|bit| (pattern >> bit & 1) << (bit >> 2 | bit & 2 | (bit & 1) << 2));
        turned[bits.sum::<usize>()] = count;
    }
    Ok(turned)
}

/// Counts the patterns between plane `z` and the next.
fn count_plane(window: &Window<'_>, layout: &Layout, z: usize, counts: &mut Histogram) {
    let rows = layout.starts(1, 1).len();
    let corners: [&[u64]; 8] = std::array::from_fn(|bit| {
        window.rows(z + (bit >> 2), (bit >> 1 & 1) as isize, (bit & 1) as isize, rows)
    });
    for (word, &mask) in layout.mask(1, rows).iter().enumerate() {
        let corners = corners.map(|corner| corner[word]);
        let any = corners.iter().fold(0, |bits, corner| bits | corner) & mask;
        let all = corners.iter().fold(mask, |bits, corner| bits & corner);
        counts[0] += u64::from((mask & !any).count_ones());
        counts[PATTERNS - 1] += u64::from(all.count_ones());
        let mut mixed = any & !all;
        while mixed != 0 {
            // Eight voxels at a time: byte i of the patterns is the one of voxel i.
            let eight = mixed.trailing_zeros() & !7;
            let bytes = corners.map(|corner| (corner >> eight) as u8);
            let patterns = transposed(u64::from_le_bytes(bytes)).to_le_bytes();
            let mut here = mixed >> eight & 0xff;
            while here != 0 {
                counts[usize::from(patterns[here.trailing_zeros() as usize])] += 1;
                here &= here - 1;
            }
            mixed &= !(0xff << eight);
        }
    }
}

/// Exchanges the rows (bytes) and columns (bits) of 8×8 bits.
const fn transposed(mut bits: u64) -> u64 {
    let mut swap = (bits ^ (bits >> 7)) & 0x00aa_00aa_00aa_00aa;
    bits ^= swap ^ (swap << 7);
    swap = (bits ^ (bits >> 14)) & 0x0000_cccc_0000_cccc;
    bits ^= swap ^ (swap << 14);
    swap = (bits ^ (bits >> 28)) & 0x0000_0000_f0f0_f0f0;
    bits ^ swap ^ (swap << 28)
}

#[cfg(test)]
mod tests {
    use ndarray::{Array3, s};
    use proptest::prelude::*;

    use super::*;
    use crate::threads::with_threads;

    fn twin(solid: &Array3<bool>, periodic: bool) -> Vec<u64> {
        let (nz, ny, nx) = solid.dim();
        let mut counts = vec![0; PATTERNS];
        for (z, y, x) in ndarray::indices(solid.dim()) {
            if !periodic && (z + 1 == nz || y + 1 == ny || x + 1 == nx) {
                continue;
            }
            let pattern: usize = (0..8)
                .map(|bit| {
                    let at =
                        [(z + (bit >> 2)) % nz, (y + (bit >> 1 & 1)) % ny, (x + (bit & 1)) % nx];
                    usize::from(solid[at]) << bit
                })
                .sum();
            counts[pattern] += 1;
        }
        counts
    }

    fn counted(solid: ArrayView3<'_, bool>, boundary: Boundary) -> Vec<u64> {
        configurations(solid, boundary, &Monitor::silent()).unwrap().to_vec()
    }

    proptest! {
        #[test]
        fn agrees_with_counting_one_by_one(
            (shape, voxels) in (1..6usize, 1..6usize, 1..140usize, 0.0..1.0f64).prop_flat_map(
                |(z, y, x, fraction)| {
                    let voxel = proptest::bool::weighted(fraction);
                    (Just((z, y, x)), proptest::collection::vec(voxel, z * y * x))
                }
            ),
            periodic: bool,
        ) {
            let solid = Array3::from_shape_vec(shape, voxels).unwrap();
            let boundary = if periodic { Boundary::Periodic } else { Boundary::Open };
            let expected = twin(&solid, periodic);
            prop_assert_eq!(&counted(solid.view(), boundary), &expected);
            let fortran = solid.t().as_standard_layout().into_owned().reversed_axes();
            prop_assert_eq!(&counted(fortran.view(), boundary), &expected);
            let again = with_threads(3, || counted(solid.view(), boundary)).unwrap();
            prop_assert_eq!(&again, &expected);
        }
    }

    #[test]
    fn views_that_are_not_contiguous() {
        let solid = Array3::from_shape_fn((9, 10, 70), |(z, y, x)| (z * y + x * x) % 3 == 0);
        let strided = solid.slice(s![..;2, ..;-1, 1..;3]);
        assert_eq!(counted(strided, Boundary::Open), twin(&strided.to_owned(), false));
    }
}
