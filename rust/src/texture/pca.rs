//! Principal components of neighbourhood vectors (zhang_2017 §4.2: PCA to 95 % of the variance).

use ndarray::{Array1, Array2, ArrayView2, Axis, linalg::general_mat_mul, s};
use rayon::prelude::*;

use crate::rng::Key;

/// Directions beyond the cap that the subspace iteration carries: they speed its convergence.
const EXTRA: usize = 8;

/// Iterations of the subspace method. Porous exemplars' spectra fall fast: after four the captured
/// variance is within 0.5 % of the exact one, which the tests check against the full spectrum.
const ITERATIONS: usize = 4;

/// Rows a task multiplies; fixed, so that sums do not depend on the number of threads.
const ROWS: usize = 256;

/// Leading principal directions of a set of vectors.
#[derive(Debug, Clone)]
pub struct Basis {
    /// Orthonormal directions as columns, most important first.
    pub vectors: Array2<f32>,
    /// Projection of the mean vector.
    pub mean: Array1<f32>,
    /// Variance along each direction.
    pub variance: Vec<f32>,
}

impl Basis {
    /// Fits at most `cap` directions, fewer where `share` of the variance needs no more; `lost` is the
    /// share of the variance that the samples do not show.
    ///
    /// `samples` holds a vector a row and is centred in place. Randomised subspace iteration: only the
    /// leading directions are wanted.
    pub fn fit(samples: &mut Array2<f32>, cap: usize, share: f32, lost: f64, key: Key) -> Self {
        let (m, n) = samples.dim();
        let mean = samples.mean_axis(Axis(0)).unwrap_or_else(|| Array1::zeros(n));
        *samples -= &mean;
        let x = samples.view();
        let shown = x.iter().map(|v| f64::from(v * v)).sum::<f64>() / m as f64;
        let total = shown / (1.0 - lost);
        let k = (cap + EXTRA).min(n).min(m);
        let mut v = Array2::from_shape_fn((n, k), |(i, j)| key.unit((i * k + j) as u64) - 0.5);
        orthonormalise(&mut v);
        for _ in 0..ITERATIONS {
            v = transposed_product(x, product(x, v.view()).view());
            orthonormalise(&mut v);
        }
        let y = product(x, v.view());
        let gram = transposed_product(y.view(), y.view()).mapv(|g| f64::from(g) / m as f64);
        let (values, rotation) = symmetric_eigen(gram);
        let mut order: Vec<usize> = (0..k).collect();
        order.sort_by(|&a, &b| values[b].total_cmp(&values[a]));
        let mut dims = 0;
        let mut captured = 0.0;
        while dims < cap.min(k) && captured < f64::from(share) * total {
            captured += values[order[dims]];
            dims += 1;
        }
        order.truncate(dims.max(1));
        let rotation = rotation.select(Axis(1), &order).mapv(|r| r as f32);
        let vectors = v.dot(&rotation);
        Self {
            mean: mean.dot(&vectors),
            variance: order.iter().map(|&i| values[i].max(0.0) as f32).collect(),
            vectors,
        }
    }

    /// Number of directions.
    pub fn dims(&self) -> usize {
        self.variance.len()
    }

    /// Projects vectors, one a row, into `out` of shape (rows, dims).
    pub fn project(&self, vectors: ArrayView2<'_, f32>, out: &mut Array2<f32>) {
        general_mat_mul(1.0, &vectors, &self.vectors, 0.0, out);
        *out -= &self.mean;
    }
}

/// `a · b`, rows in parallel.
pub(super) fn product(a: ArrayView2<'_, f32>, b: ArrayView2<'_, f32>) -> Array2<f32> {
    let mut out = Array2::zeros((a.nrows(), b.ncols()));
    out.axis_chunks_iter_mut(Axis(0), ROWS)
        .into_par_iter()
        .zip(a.axis_chunks_iter(Axis(0), ROWS))
        .for_each(|(mut out, rows)| general_mat_mul(1.0, &rows, &b, 0.0, &mut out));
    out
}

/// `aᵀ · b`, partial sums in parallel, added in order.
fn transposed_product(a: ArrayView2<'_, f32>, b: ArrayView2<'_, f32>) -> Array2<f32> {
    let parts: Vec<Array2<f32>> = a
        .axis_chunks_iter(Axis(0), ROWS)
        .into_par_iter()
        .zip(b.axis_chunks_iter(Axis(0), ROWS))
        .map(|(a, b)| a.t().dot(&b))
        .collect();
    let mut sum = Array2::zeros((a.ncols(), b.ncols()));
    for part in parts {
        sum += &part;
    }
    sum
}

/// Gram–Schmidt, twice over for stability; columns that vanish become zero.
fn orthonormalise(v: &mut Array2<f32>) {
    for j in 0..v.ncols() {
        let before = v.column(j).dot(&v.column(j)).sqrt();
        for _ in 0..2 {
            let (done, mut rest) = v.view_mut().split_at(Axis(1), j);
            let mut column = rest.slice_mut(s![.., 0]);
            let along = done.t().dot(&column);
            column -= &done.dot(&along);
        }
        let norm = v.column(j).dot(&v.column(j)).sqrt();
        let scale = if norm > 1e-5 * before { 1.0 / norm } else { 0.0 };
        v.column_mut(j).mapv_inplace(|x| x * scale);
    }
}

/// Eigenvalues and eigenvectors (columns) of a small symmetric matrix by cyclic Jacobi rotations.
fn symmetric_eigen(mut a: Array2<f64>) -> (Vec<f64>, Array2<f64>) {
    let n = a.nrows();
    let mut v = Array2::eye(n);
    let scale: f64 = a.iter().map(|x| x * x).sum();
    for _ in 0..60 {
        let off: f64 = (0..n).flat_map(|p| (0..p).map(move |q| (p, q))).map(|i| a[i] * a[i]).sum();
        if off <= 1e-22 * scale {
            break;
        }
        for p in 0..n {
            for q in p + 1..n {
                if a[[p, q]] == 0.0 {
                    continue;
                }
                let theta = (a[[q, q]] - a[[p, p]]) / (2.0 * a[[p, q]]);
                let t = theta.signum() / (theta.abs() + theta.hypot(1.0));
                let c = 1.0 / t.hypot(1.0);
                let s = t * c;
                for k in 0..n {
                    let (x, y) = (a[[k, p]], a[[k, q]]);
                    (a[[k, p]], a[[k, q]]) = (c * x - s * y, s * x + c * y);
                }
                for k in 0..n {
                    let (x, y) = (a[[p, k]], a[[q, k]]);
                    (a[[p, k]], a[[q, k]]) = (c * x - s * y, s * x + c * y);
                    let (x, y) = (v[[k, p]], v[[k, q]]);
                    (v[[k, p]], v[[k, q]]) = (c * x - s * y, s * x + c * y);
                }
            }
        }
    }
    (a.diag().to_vec(), v)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples(m: usize, n: usize) -> Array2<f32> {
        let key = Key::new(1);
        let white = Array2::from_shape_fn((m, n), |(i, j)| key.unit((i * n + j) as u64) - 0.5);
        let mix = Array2::from_shape_fn((n, n), |(i, j)| {
            (key.with(1).unit((i * n + j) as u64) - 0.5) * 3.0f32.powi(-(i as i32))
        });
        white.dot(&mix) + 5.0
    }

    #[test]
    fn directions_are_orthonormal_and_capture_the_leading_variance() {
        let mut x = samples(600, 20);
        let plain = x.clone();
        let basis = Basis::fit(&mut x, 6, 1.0, 0.0, Key::new(2));
        assert_eq!(basis.dims(), 6);
        let gram = basis.vectors.t().dot(&basis.vectors);
        for ((i, j), g) in gram.indexed_iter() {
            assert!((g - f32::from(u8::from(i == j))).abs() < 1e-4);
        }
        let (mut exact, _) = symmetric_eigen(x.t().dot(&x).mapv(|g| f64::from(g) / 600.0));
        exact.sort_by(|a, b| b.total_cmp(a));
        for (got, want) in basis.variance.iter().zip(&exact) {
            assert!((f64::from(*got) - want).abs() < 5e-3 * exact[0], "{got} {want}");
        }
        let mut projected = Array2::zeros((600, 6));
        basis.project(plain.view(), &mut projected);
        assert!(projected.mean_axis(Axis(0)).unwrap().iter().all(|m| m.abs() < 1e-3));
    }

    #[test]
    fn the_share_decides_the_number_of_directions() {
        let mut x = samples(400, 16);
        let few = Basis::fit(&mut x.clone(), 16, 0.8, 0.0, Key::new(3)).dims();
        let many = Basis::fit(&mut x, 16, 0.99, 0.0, Key::new(3)).dims();
        assert!(few < many, "{few} {many}");
    }

    #[test]
    fn one_sample_and_constant_samples_give_one_harmless_direction() {
        let basis = Basis::fit(&mut Array2::from_elem((1, 8), 4.0), 4, 0.95, 0.0, Key::new(4));
        assert_eq!(basis.variance, [0.0]);
        let basis = Basis::fit(&mut Array2::from_elem((50, 8), 4.0), 4, 0.95, 0.0, Key::new(4));
        assert_eq!(basis.variance, [0.0]);
    }
}
