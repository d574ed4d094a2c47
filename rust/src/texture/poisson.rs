//! The gradient term: a screened Poisson equation with voxel-wise weights (zhang_2017 Eq. 1, §4.3).

use rayon::prelude::*;

use crate::volume::{Boundary, Shape};

/// Sweeps stop when the bound on the remaining error falls below this share of the first.
const REMAINING: f32 = 0.02;

/// No more sweeps than this, whatever the weights.
const MOST_SWEEPS: usize = 60;

/// Solves `weight·(s − mean) + μ·(L s − laplacian) = 0` for `s`, where `L s` is the sum of a voxel's
/// differences to its six neighbours; `mean` holds the start and receives the solution.
///
/// It is the normal equation of the patch term, whose least-squares solution is `mean`, and of the
/// gradient term, whose wanted Laplacian is `laplacian`. Jacobi sweeps: each shrinks the error by
/// `6μ / (weight + 6μ)`, so a handful suffices for the small μ that is useful. At an open border the
/// pairs across it have no other end: they are left out, with their share of the wanted Laplacian.
/// Memory: 12 bytes a voxel.
pub fn solve(
    mean: &mut [f32],
    weight: &[f32],
    laplacian: &[f32],
    mu: f32,
    shape: Shape,
    boundary: Boundary,
) {
    let [nz, ny, nx] = shape;
    let typical = weight.par_chunks(1 << 16).map(|w| w.iter().sum::<f32>()).collect::<Vec<_>>();
    let typical = typical.iter().sum::<f32>() / weight.len().max(1) as f32;
    let rate = 6.0 * mu / (typical + 6.0 * mu);
    let sweeps = (REMAINING.ln() / rate.ln()).ceil().clamp(1.0, MOST_SWEEPS as f32) as usize;
    let data = mean.to_vec();
    let mut current = mean.to_vec();
    let mut next = mean.to_vec();
    for _ in 0..sweeps {
        next.par_chunks_mut(nx).enumerate().for_each(|(row, out)| {
            let (z, y) = (row / ny, row % ny);
            let line = |inside: bool, z: usize, y: usize| {
                let row = if inside { z % nz * ny + y % ny } else { row };
                &current[row * nx..(row + 1) * nx]
            };
            let wraps = boundary == Boundary::Periodic;
            let has = [wraps || z > 0, wraps || z + 1 < nz, wraps || y > 0, wraps || y + 1 < ny];
            let around = [
                line(has[0], z + nz - 1, y),
                line(has[1], z + 1, y),
                line(has[2], z, y + ny - 1),
                line(has[3], z, y + 1),
            ];
            let here = row * nx..(row + 1) * nx;
            let given = [&data[here.clone()], &weight[here.clone()], &laplacian[here.clone()]];
            let pairs = has.iter().filter(|has| **has).count();
            sweep_row(out, &current[here], around, given, (mu, pairs as f32), boundary);
        });
        std::mem::swap(&mut current, &mut next);
    }
    mean.copy_from_slice(&current);
}

#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
fn sweep_row(
    out: &mut [f32],
    own: &[f32],
    around: [&[f32]; 4],
    [data, weight, laplacian]: [&[f32]; 3],
    (mu, pairs): (f32, f32),
    boundary: Boundary,
) {
    let n = out.len();
    let [a, b, c, d] = around.map(|r| &r[..n]);
    // A neighbour that is missing is the voxel itself: a difference of zero.
    let update = |x: usize, left: f32, right: f32, pairs: f32| {
        let neighbours = a[x] + b[x] + c[x] + d[x] + left + right;
        let wanted = neighbours + pairs / 6.0 * laplacian[x];
        (weight[x] * data[x] + mu * wanted) / (weight[x] + 6.0 * mu)
    };
    for x in 1..n.max(1) - 1 {
        out[x] = update(x, own[x - 1], own[x + 1], pairs + 2.0);
    }
    let last = n - 1;
    if boundary == Boundary::Periodic {
        out[0] = update(0, own[last], own[1 % n], pairs + 2.0);
        out[last] = update(last, own[(2 * n - 2) % n], own[0], pairs + 2.0);
    } else if n == 1 {
        out[0] = update(0, own[0], own[0], pairs);
    } else {
        out[0] = update(0, own[0], own[1], pairs + 1.0);
        out[last] = update(last, own[last - 1], own[last], pairs + 1.0);
    }
}

/// The sum of each voxel's differences to its six neighbours. For those that lie beyond the border
/// the mean of the others stands.
pub fn laplacian(values: &[f32], shape: Shape) -> Vec<f32> {
    let [nz, ny, nx] = shape;
    let mut out = vec![0.0; values.len()];
    out.par_chunks_mut(nx.max(1)).enumerate().for_each(|(row, out)| {
        let (z, y) = (row / ny, row % ny);
        for (x, o) in out.iter_mut().enumerate() {
            let own = values[row * nx + x];
            let mut pairs = 0.0;
            let mut add = |inside: bool, at: usize| {
                if inside {
                    *o += own - values[at];
                    pairs += 1.0;
                }
            };
            let i = row * nx + x;
            add(z > 0, i.wrapping_sub(ny * nx));
            add(z + 1 < nz, i + ny * nx);
            add(y > 0, i.wrapping_sub(nx));
            add(y + 1 < ny, i + nx);
            add(x > 0, i.wrapping_sub(1));
            add(x + 1 < nx, i + 1);
            *o *= 6.0 / f32::max(pairs, 1.0);
        }
    });
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Key;
    use crate::volume::voxels;

    #[test]
    fn the_solution_satisfies_the_equation() {
        let shape = [6, 7, 8];
        let n = voxels(shape);
        let key = Key::new(1);
        let draw = |stream| (0..n as u64).map(|i| key.with(stream).unit(i)).collect::<Vec<_>>();
        let (data, wanted) = (draw(0), draw(1));
        let weight: Vec<f32> = draw(2).iter().map(|w| 0.5 + w).collect();
        for mu in [0.1, 0.5] {
            let mut s = data.clone();
            solve(&mut s, &weight, &wanted, mu, shape, Boundary::Periodic);
            for z in 0..6 {
                for y in 0..7 {
                    for x in 0..8 {
                        let at = |z: usize, y: usize, x: usize| s[(z % 6 * 7 + y % 7) * 8 + x % 8];
                        let sum = at(z + 5, y, x)
                            + at(z + 1, y, x)
                            + at(z, y + 6, x)
                            + at(z, y + 1, x)
                            + at(z, y, x + 7)
                            + at(z, y, x + 1);
                        let i = (z * 7 + y) * 8 + x;
                        let residual =
                            weight[i] * (s[i] - data[i]) + mu * (6.0 * s[i] - sum - wanted[i]);
                        assert!(residual.abs() < 0.05, "{residual}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_field_whose_gradients_agree_is_left_alone() {
        let shape = [5, 5, 5];
        let field: Vec<f32> = (0..125).map(|i| (i * i % 17) as f32).collect();
        let mut s = field.clone();
        solve(&mut s, &[1.0; 125], &laplacian(&field, shape), 0.3, shape, Boundary::Open);
        assert!(s.iter().zip(&field).all(|(a, b)| (a - b).abs() < 1e-4));
    }

    #[test]
    fn an_open_border_is_smoothed_like_the_inside() {
        let shape = [24, 24, 24];
        let noise: Vec<f32> = (0..24u64.pow(3)).map(|i| Key::new(2).unit(i)).collect();
        let mut s = noise.clone();
        solve(&mut s, &vec![1.0; noise.len()], &vec![0.0; noise.len()], 0.5, shape, Boundary::Open);
        let spread = |z: usize| {
            let plane = &s[z * 576..(z + 1) * 576];
            let mean = plane.iter().sum::<f32>() / 576.0;
            (plane.iter().map(|v| (v - mean).powi(2)).sum::<f32>() / 576.0).sqrt()
        };
        assert!((spread(0) / spread(12) - 1.0).abs() < 0.2, "{} {}", spread(0), spread(12));
    }

    #[test]
    fn thin_volumes_do_not_panic() {
        for shape in [[1, 1, 1], [1, 4, 1], [2, 1, 3]] {
            let n = voxels(shape);
            for boundary in [Boundary::Open, Boundary::Periodic] {
                let mut s = vec![1.0; n];
                solve(&mut s, &vec![1.0; n], &vec![0.0; n], 0.1, shape, boundary);
                assert!(s.iter().all(|v| (v - 1.0).abs() < 1e-5));
            }
        }
    }
}
