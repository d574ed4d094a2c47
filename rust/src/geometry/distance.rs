//! Exact Euclidean distances to a phase, and its signed distance.

mod envelope;
pub(super) mod transform;
pub(super) mod window;

use ndarray::{Array3, ArrayView3, ArrayViewMut3, s};
use rayon::prelude::*;

use self::transform::{Lattice, squared_distances};
use crate::error::{Error, Result};
use crate::monitor::Monitor;
use crate::volume::Boundary;

/// Writes the distance of each voxel of a phase to the nearest voxel centre outside it, at most
/// `cap`; 0 outside.
///
/// With an open boundary nothing is known beyond the border, which is no wall. If no voxel is
/// outside, the distance is infinite, or the cap. `out` is contiguous, in the memory order of the
/// phase. Memory: nothing but `out` that grows with the volume.
pub fn distance_transform(
    phase: ArrayView3<'_, bool>,
    voxel_size: [f64; 3],
    boundary: Boundary,
    cap: Option<f64>,
    out: ArrayViewMut3<'_, f32>,
    monitor: &Monitor<'_>,
) -> Result<()> {
    let cap = cap.unwrap_or(f64::INFINITY);
    if cap.is_nan() || cap <= 0.0 {
        return Err(Error::parameter("cap", cap, "must be positive"));
    }
    let Aligned { phase, voxel_size, mut out } = Aligned::new(phase, voxel_size, out)?;
    let (scale, size) = relative(voxel_size);
    let limit = (cap / scale).powi(2).ceil() as f32;
    let lattice = Lattice { size, half: [false; 3], boundary, limit };
    let finish = |squares: &mut [f32]| roots(squares, scale as f32, cap as f32);
    squared_distances(outside(phase), &lattice, out.view_mut(), finish, monitor)
}

/// A phase and room for its distances, rows along the axis that is contiguous in memory.
pub(super) struct Aligned<'a> {
    pub phase: ArrayView3<'a, bool>,
    pub voxel_size: [f64; 3],
    /// In C order.
    pub out: ArrayViewMut3<'a, f32>,
}

impl<'a> Aligned<'a> {
    pub(super) fn new(
        mut phase: ArrayView3<'a, bool>,
        mut voxel_size: [f64; 3],
        mut out: ArrayViewMut3<'a, f32>,
    ) -> Result<Self> {
        if out.dim() != phase.dim() {
            return Err(Error::parameter("out.shape", out.dim(), "must be that of the volume"));
        }
        if !out.is_standard_layout() {
            phase = phase.reversed_axes();
            voxel_size.reverse();
            out = out.reversed_axes();
        }
        if !out.is_standard_layout() {
            return Err(Error::parameter("out.strides", out.strides(), "must be contiguous"));
        }
        Ok(Self { phase, voxel_size, out })
    }
}

/// The shortest edge of a voxel, and all edges in units of it: whole numbers, most often.
pub(super) fn relative(voxel_size: [f64; 3]) -> (f64, [f64; 3]) {
    let shortest = voxel_size.into_iter().fold(f64::INFINITY, f64::min);
    (shortest, voxel_size.map(|edge| edge / shortest))
}

/// The voxels outside a phase, row by row.
pub(super) fn outside(
    phase: ArrayView3<'_, bool>,
) -> impl Fn(usize, usize, &mut [bool]) + Sync + '_ {
    move |z, y, row| {
        let inside = phase.slice(s![z, y, ..]);
        if let Some(inside) = inside.as_slice() {
            row.iter_mut().zip(inside).for_each(|(target, &inside)| *target = !inside);
        } else {
            row.iter_mut().zip(inside).for_each(|(target, &inside)| *target = !inside);
        }
    }
}

#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
fn roots(squares: &mut [f32], scale: f32, cap: f32) {
    for value in squares {
        let distance = value.sqrt() * scale;
        *value = if distance < cap { distance } else { cap };
    }
}

/// Signed distance of a phase, clipped: positive inside, in `-clip..=clip` voxels.
///
/// The interface lies half-way between two voxels of different phase, so the voxels next to it have
/// ±0.5. Where `valid` is false the phase is unknown: such voxels are no one's opposite.
/// Memory: 8 bytes a voxel besides the input.
///
/// # Errors
/// If `clip` is 0.
pub fn signed_distance(
    phase: ArrayView3<'_, bool>,
    valid: Option<ArrayView3<'_, bool>>,
    clip: usize,
    boundary: Boundary,
) -> Result<Vec<f32>> {
    if clip == 0 {
        return Err(Error::parameter("clip", clip, "must be at least 1"));
    }
    if valid.is_some_and(|v| v.dim() != phase.dim()) {
        return Err(Error::parameter("valid", "another shape", "must have the shape of the phase"));
    }
    let mut signed = to_opposite(phase, valid, true, clip, boundary)?;
    let outside = to_opposite(phase, valid, false, clip, boundary)?;
    let limit = clip as f32;
    let shape = phase.dim();
    let row = shape.2.max(1);
    let rows = signed.par_chunks_mut(row).zip(outside.par_chunks(row));
    rows.enumerate().for_each(|(i, (signed, outside))| {
        let phase = phase.slice(s![i / shape.1, i % shape.1, ..]);
        for ((d, &o), &inside) in signed.iter_mut().zip(outside).zip(phase) {
            *d = (if inside { *d - 0.5 } else { 0.5 - o }).clamp(-limit, limit);
        }
    });
    Ok(signed)
}

/// Distance of every voxel to the nearest known one that is not `of` a phase, a bit beyond the clip.
fn to_opposite(
    phase: ArrayView3<'_, bool>,
    valid: Option<ArrayView3<'_, bool>>,
    of: bool,
    clip: usize,
    boundary: Boundary,
) -> Result<Vec<f32>> {
    let targets = |z, y, row: &mut [bool]| {
        let slice = s![z, y, ..];
        for (target, &inside) in row.iter_mut().zip(phase.slice(slice)) {
            *target = inside != of;
        }
        if let Some(valid) = valid {
            row.iter_mut().zip(valid.slice(slice)).for_each(|(target, &v)| *target &= v);
        }
    };
    let cap = clip.saturating_add(1) as f32; // so that the half voxel does not show at the clip
    let lattice = Lattice { size: [1.0; 3], half: [false; 3], boundary, limit: cap * cap };
    let mut out = Array3::zeros(phase.dim());
    let finish = |squares: &mut [f32]| roots(squares, 1.0, cap);
    squared_distances(targets, &lattice, out.view_mut(), finish, &Monitor::silent())?;
    Ok(out.into_raw_vec_and_offset().0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Key;
    use crate::volume::{index, position, voxels};

    fn brute(target: &Array3<bool>, cap: usize, boundary: Boundary) -> Vec<f32> {
        let (nz, ny, nx) = target.dim();
        let shape = [nz, ny, nx];
        (0..voxels(shape))
            .map(|i| {
                let p = position(shape, i);
                let mut best = (cap * cap) as f32;
                for (q, &t) in target.indexed_iter() {
                    if t {
                        let q = [q.0, q.1, q.2];
                        let square: usize = (0..3)
                            .map(|a| {
                                let d = p[a].abs_diff(q[a]);
                                match boundary {
                                    Boundary::Open => d,
                                    Boundary::Periodic => d.min(shape[a] - d),
                                }
                                .pow(2)
                            })
                            .sum();
                        best = best.min(square as f32);
                    }
                }
                best.sqrt()
            })
            .collect()
    }

    fn transformed(phase: ArrayView3<'_, bool>, boundary: Boundary, cap: Option<f64>) -> Vec<f32> {
        let mut out = Array3::zeros(phase.dim());
        let monitor = Monitor::silent();
        distance_transform(phase, [1.0; 3], boundary, cap, out.view_mut(), &monitor).unwrap();
        out.into_raw_vec_and_offset().0
    }

    #[test]
    fn equals_brute_force_for_both_boundaries() {
        for (seed, share) in [(1, 0.02), (2, 0.3), (3, 0.0), (4, 1.1)] {
            let key = Key::new(seed);
            let shape = [7, 9, 11];
            let target = Array3::from_shape_fn((7, 9, 11), |(z, y, x)| {
                key.unit(index(shape, [z, y, x]) as u64) < share
            });
            for boundary in [Boundary::Open, Boundary::Periodic] {
                for cap in [1, 3, 20] {
                    let got = transformed(target.mapv(|t| !t).view(), boundary, Some(cap as f64));
                    assert_eq!(got, brute(&target, cap, boundary), "{seed} {boundary:?} {cap}");
                }
            }
        }
    }

    #[test]
    fn signed_distance_of_a_half_space_is_linear() {
        let phase = Array3::from_shape_fn((2, 2, 12), |(_, _, x)| x >= 6);
        let d = signed_distance(phase.view(), None, 4, Boundary::Open).unwrap();
        let expected = [-4.0, -4.0, -3.5, -2.5, -1.5, -0.5, 0.5, 1.5, 2.5, 3.5, 4.0, 4.0];
        assert_eq!(d[..12], expected);
    }

    #[test]
    fn unknown_voxels_are_no_ones_opposite() {
        let phase = Array3::from_shape_fn((1, 1, 8), |(_, _, x)| x >= 6);
        let valid = Array3::from_shape_fn((1, 1, 8), |(_, _, x)| !(2..6).contains(&x));
        let d = signed_distance(phase.view(), Some(valid.view()), 9, Boundary::Open).unwrap();
        assert_eq!((d[1], d[6]), (-4.5, 4.5));
    }

    #[test]
    fn empty_volume_and_bad_cap() {
        let none = Array3::from_elem((0, 3, 3), true);
        assert!(transformed(none.view(), Boundary::Open, None).is_empty());
        assert!(signed_distance(none.view(), None, 3, Boundary::Open).unwrap().is_empty());
        let one = Array3::from_elem((1, 1, 1), true);
        assert_eq!(signed_distance(one.view(), None, 3, Boundary::Open).unwrap(), [3.0]);
        assert!(signed_distance(one.view(), None, 0, Boundary::Open).is_err());
    }
}
