//! Coarse and fine versions of a field.

use rayon::prelude::*;

use super::field::Field;
use crate::volume::{Boundary, Shape, index, voxels};

/// Blur before a reduction, in voxels: enough against aliasing, little enough to keep thin walls.
const REDUCTION_BLUR: f32 = 0.7;

/// Half the resolution: a Gaussian of 0.7 voxels, then [`halve`].
pub fn reduce(field: &Field) -> Field {
    halve(&gaussian(field, REDUCTION_BLUR, Boundary::Open))
}

/// The means of 2 × 2 × 2 voxels. An odd last plane is dropped, a single one (of an image) is kept.
pub fn halve(field: &Field) -> Field {
    let [nz, ny, nx] = field.shape();
    let shape = field.shape().map(|n| (n / 2).max(1));
    let mut out = Field::zeros(shape, field.channels());
    for c in 0..field.channels() {
        let from = field.channel(c);
        fill(out.channel_mut(c), shape, |[z, y, x]| {
            let mut sum = 0.0;
            for corner in 0..8 {
                let p = [
                    (2 * z + (corner >> 2)).min(nz - 1),
                    (2 * y + (corner >> 1 & 1)).min(ny - 1),
                    (2 * x + (corner & 1)).min(nx - 1),
                ];
                sum += from[index([nz, ny, nx], p)];
            }
            sum / 8.0
        });
    }
    out
}

/// Trilinear interpolation onto a finer grid that covers the same cuboid.
pub fn enlarge(field: &Field, shape: Shape, boundary: Boundary) -> Field {
    let coarse = field.shape();
    let axes: [Vec<(usize, usize, f32)>; 3] = std::array::from_fn(|a| {
        let (n, m) = (shape[a], coarse[a]);
        (0..n)
            .map(|i| {
                let x = (i as f32 + 0.5) * m as f32 / n as f32 - 0.5;
                let low = x.floor();
                let at = |k: f32| match boundary {
                    Boundary::Open => (k.max(0.0) as usize).min(m - 1),
                    Boundary::Periodic => (k as isize).rem_euclid(m as isize) as usize,
                };
                (at(low), at(low + 1.0), x - low)
            })
            .collect()
    });
    let mut out = Field::zeros(shape, field.channels());
    for c in 0..field.channels() {
        let from = field.channel(c);
        fill(out.channel_mut(c), shape, |[z, y, x]| {
            let ((z0, z1, tz), (y0, y1, ty), (x0, x1, tx)) = (axes[0][z], axes[1][y], axes[2][x]);
            let line = |z, y| {
                let (a, b) = (from[index(coarse, [z, y, x0])], from[index(coarse, [z, y, x1])]);
                a + tx * (b - a)
            };
            let plane = |z| {
                let (a, b) = (line(z, y0), line(z, y1));
                a + ty * (b - a)
            };
            let (a, b) = (plane(z0), plane(z1));
            a + tz * (b - a)
        });
    }
    out
}

/// Gaussian blur with a standard deviation in voxels; open borders repeat their last voxel.
pub fn gaussian(field: &Field, sigma: f32, boundary: Boundary) -> Field {
    let radius = (3.0 * sigma).ceil() as isize;
    let weights: Vec<f32> =
        (-radius..=radius).map(|k| (-0.5 * (k as f32 / sigma).powi(2)).exp()).collect();
    let total: f32 = weights.iter().sum();
    let weights: Vec<f32> = weights.iter().map(|w| w / total).collect();
    let shape = field.shape();
    let mut out = field.clone();
    for c in 0..field.channels() {
        for axis in 0..3 {
            let from = out.channel(c).to_vec();
            let near = |at: usize, k: isize| {
                let (i, n) = (at as isize + k, shape[axis] as isize);
                match boundary {
                    Boundary::Open => i.clamp(0, n - 1) as usize,
                    Boundary::Periodic => i.rem_euclid(n) as usize,
                }
            };
            let rows = out.channel_mut(c).par_chunks_mut(shape[2]);
            rows.enumerate().for_each(|(row, out)| {
                out.fill(0.0);
                let own = &from[row * shape[2]..][..shape[2]];
                let places = if axis == 2 { -radius..shape[2] as isize + radius } else { 0..0 };
                let padded: Vec<f32> = places.map(|i| own[near(0, i)]).collect();
                for (k, &weight) in weights.iter().enumerate() {
                    let mut at = [row / shape[1], row % shape[1], 0];
                    let from = if axis == 2 {
                        &padded[k..]
                    } else {
                        at[axis] = near(at[axis], k as isize - radius);
                        &from[index(shape, at)..]
                    };
                    out.iter_mut().zip(from).for_each(|(sum, value)| *sum += weight * value);
                }
            });
        }
    }
    out
}

/// A mask at half the resolution, for an output of this shape: true where at least `least` of the
/// 8 voxels are; voxels beyond the border count as false.
pub fn reduce_mask(mask: &[bool], from: Shape, to: Shape, least: usize) -> Vec<bool> {
    let mut out = vec![false; voxels(to)];
    fill(&mut out, to, |p| block(from, p).filter(|&i| mask[i]).count() >= least);
    out
}

/// Known values at half the resolution: the mean over the known of the 8 voxels.
pub fn reduce_known(field: &Field, known: &[bool], to: Shape) -> Field {
    let from = field.shape();
    let mut out = Field::zeros(to, field.channels());
    for c in 0..field.channels() {
        let values = field.channel(c);
        fill(out.channel_mut(c), to, |p| {
            let (sum, n) = block(from, p)
                .filter(|&i| known[i])
                .fold((0.0, 0u8), |(sum, n), i| (sum + values[i], n + 1));
            sum / f32::from(n.max(1))
        });
    }
    out
}

/// The (up to 8) voxels below a coarse voxel.
fn block(shape: Shape, p: [usize; 3]) -> impl Iterator<Item = usize> {
    (0..8usize).filter_map(move |corner| {
        let q = [2 * p[0] + (corner >> 2), 2 * p[1] + (corner >> 1 & 1), 2 * p[2] + (corner & 1)];
        (0..3).all(|a| q[a] < shape[a]).then(|| index(shape, q))
    })
}

fn fill<T: Send>(out: &mut [T], shape: Shape, value: impl Fn([usize; 3]) -> T + Sync) {
    let [_, ny, nx] = shape;
    if out.is_empty() {
        return;
    }
    out.par_chunks_mut(nx).enumerate().for_each(|(row, line)| {
        for (x, v) in line.iter_mut().enumerate() {
            *v = value([row / ny, row % ny, x]);
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(shape: Shape) -> Field {
        let [_, ny, nx] = shape;
        let data =
            (0..voxels(shape)).map(|i| (i / (ny * nx)) as f32 + 0.5 * (i % nx) as f32).collect();
        Field::new(shape, 1, data).unwrap()
    }

    #[test]
    fn constants_stay_constant() {
        let c = Field::new([6, 5, 7], 1, vec![3.0; 210]).unwrap();
        let close = |f: &Field| f.channel(0).iter().all(|v| (v - 3.0).abs() < 1e-5);
        for boundary in [Boundary::Open, Boundary::Periodic] {
            assert!(close(&gaussian(&c, 0.9, boundary)));
            assert!(close(&enlarge(&reduce(&c), [6, 5, 7], boundary)));
        }
    }

    #[test]
    fn enlarging_a_reduced_ramp_gives_the_ramp_inside() {
        let fine = ramp([16, 16, 16]);
        let back = enlarge(&reduce(&fine), [16, 16, 16], Boundary::Open);
        for p in [[8, 8, 8], [6, 9, 7]] {
            let i = index([16; 3], p);
            assert!((fine.channel(0)[i] - back.channel(0)[i]).abs() < 1e-3);
        }
    }

    #[test]
    fn known_values_average_only_the_known() {
        let field =
            Field::new([2, 2, 2], 1, vec![8.0, 100.0, 4.0, 0.0, 0.0, 0.0, 0.0, 0.0]).unwrap();
        let known = [true, false, true, false, false, false, false, false];
        assert_eq!(reduce_known(&field, &known, [1; 3]).channel(0), [6.0]);
        assert_eq!(reduce_mask(&known, [2; 3], [1; 3], 2), [true]);
        assert_eq!(reduce_mask(&known, [2; 3], [1; 3], 3), [false]);
    }
}
