//! Euclidean distance up to a cap, and the signed distance of a phase.

use ndarray::ArrayView3;
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::volume::{Boundary, Shape, voxels};

/// Largest cap: the cost grows with it, and a signed distance clipped further out carries no shape.
pub const MAX_CAP: usize = 64;

/// Distance of every voxel to the nearest voxel where `target` is true, in voxels, at most `cap`.
///
/// Exact below the cap: three passes, one an axis, each the minimum of `f(i + k) + k²` over
/// `|k| ≤ cap`, vectorised over rows. A volume without a target has the cap everywhere.
/// Memory: 8 bytes a voxel besides the input.
///
/// # Errors
/// If `cap` is 0 or above [`MAX_CAP`].
pub fn capped_distance(
    target: ArrayView3<'_, bool>,
    cap: usize,
    boundary: Boundary,
) -> Result<Vec<f32>> {
    if !(1..=MAX_CAP).contains(&cap) {
        return Err(Error::parameter("cap", cap, format!("must be from 1 to {MAX_CAP}")));
    }
    let (nz, ny, nx) = target.dim();
    let shape = [nz, ny, nx];
    let far = (cap * cap) as f32;
    let mut squared: Vec<f32> = target.iter().map(|&t| if t { 0.0 } else { far }).collect();
    if voxels(shape) == 0 {
        return Ok(squared);
    }
    squared.par_chunks_mut(nx).for_each_init(Vec::new, |line, row| {
        line.clear();
        line.extend_from_slice(row);
        for (i, out) in row.iter_mut().enumerate() {
            for (j, k) in reach(i, nx, cap, boundary) {
                *out = out.min(line[j] + (k * k) as f32);
            }
        }
    });
    for axis in [1, 0] {
        squared = minimum_along(&squared, shape, axis, cap, boundary);
    }
    squared.par_iter_mut().for_each(|d| *d = d.min(far).sqrt());
    Ok(squared)
}

/// Neighbours of `i` on a line of `n` voxels within `cap`, with their distance.
fn reach(
    i: usize,
    n: usize,
    cap: usize,
    boundary: Boundary,
) -> impl Iterator<Item = (usize, usize)> {
    let (i, n, cap) = (i as isize, n as isize, cap as isize);
    let (low, high) = match boundary {
        Boundary::Open => (-cap.min(i), cap.min(n - 1 - i)),
        Boundary::Periodic => (-cap, cap),
    };
    (low..=high).map(move |k| ((i + k).rem_euclid(n) as usize, k.unsigned_abs()))
}

/// `min over k of f(i + k) + k²` along axis 0 or 1, whole rows at a time.
fn minimum_along(f: &[f32], shape: Shape, axis: usize, cap: usize, boundary: Boundary) -> Vec<f32> {
    let [_, ny, nx] = shape;
    let mut out = f.to_vec();
    out.par_chunks_mut(nx).enumerate().for_each(|(row, out)| {
        let at = [row / ny, row % ny];
        for (j, k) in reach(at[axis], shape[axis], cap, boundary) {
            let from = if axis == 0 { j * ny + at[1] } else { at[0] * ny + j };
            lower(out, &f[from * nx..(from + 1) * nx], (k * k) as f32);
        }
    });
    out
}

#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
fn lower(out: &mut [f32], f: &[f32], add: f32) {
    for (o, &v) in out.iter_mut().zip(f) {
        *o = o.min(v + add);
    }
}

/// Signed distance of a phase, clipped: positive inside, in `-clip..=clip` voxels.
///
/// The interface lies half-way between two voxels of different phase, so the voxels next to it have
/// ±0.5. Where `valid` is false the phase is unknown: such voxels are no one's opposite.
/// Memory: 18 bytes a voxel besides the input.
///
/// # Errors
/// If `clip` is 0 or above [`MAX_CAP`].
pub fn signed_distance(
    phase: ArrayView3<'_, bool>,
    valid: Option<ArrayView3<'_, bool>>,
    clip: usize,
    boundary: Boundary,
) -> Result<Vec<f32>> {
    if valid.is_some_and(|v| v.dim() != phase.dim()) {
        return Err(Error::parameter("valid", "another shape", "must have the shape of the phase"));
    }
    let cap = clip.saturating_add(1); // so that the half voxel does not show at the clip
    let opposite = |of: bool| {
        let mut target = phase.mapv(|p| p != of);
        if let Some(valid) = valid {
            target.zip_mut_with(&valid, |t, v| *t &= v);
        }
        target
    };
    let mut signed = capped_distance(opposite(true).view(), cap, boundary)?;
    let outside = capped_distance(opposite(false).view(), cap, boundary)?;
    let limit = clip as f32;
    signed.iter_mut().zip(&outside).zip(&phase).for_each(|((d, &o), &inside)| {
        *d = (if inside { *d - 0.5 } else { 0.5 - o }).clamp(-limit, limit);
    });
    Ok(signed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Key;
    use crate::volume::{index, position};
    use ndarray::Array3;

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
                    let got = capped_distance(target.view(), cap, boundary).unwrap();
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
        assert!(capped_distance(none.view(), 3, Boundary::Open).unwrap().is_empty());
        let one = Array3::from_elem((1, 1, 1), true);
        assert_eq!(signed_distance(one.view(), None, 3, Boundary::Open).unwrap(), [3.0]);
        assert!(capped_distance(one.view(), 0, Boundary::Open).is_err());
    }
}
