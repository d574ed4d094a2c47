//! Windows in cosines: a basis that all windows of a volume reach axis by axis.
//!
//! A principal component of edge w costs w³ products a window. Windows of porous media vary mostly in a
//! few slow cosines, and a volume's windows share the sums along each axis, so that a cosine costs
//! little more than w products. The principal components are then found among the cosines.

use std::ops::Range;

use ndarray::{Array2, ArrayView2, Axis, s};
use rayon::prelude::*;

use super::field::Field;
use super::symmetry::View;
use crate::volume::{Shape, position, voxels};

/// Windows, of those sampled, that decide which cosines vary most.
const CHOOSERS: usize = 1024;

/// Values a step of the inner loops takes; rows are padded to a multiple of it.
const LANES: usize = 16;

/// The products of cosines (DCT-II, orthonormal) that vary most among some windows.
pub struct Cosines {
    window: Shape,
    /// Along each axis `table[k * window + i]`, the k-th cosine at i.
    tables: [Vec<f32>; 3],
    /// Channel and wave numbers along (z, y, x), ascending.
    chosen: Vec<(usize, [usize; 3])>,
    /// Share of the variance that the others hold.
    pub lost: f64,
}

impl Cosines {
    /// Chooses among the cosines of windows, one a row, each channel × window values.
    pub fn choose(windows: ArrayView2<'_, f32>, window: Shape, count: usize) -> Self {
        let tables = window.map(table);
        let step = windows.nrows().div_ceil(CHOOSERS).max(1);
        let few = windows.slice(s![..;step, ..]);
        let rows: Vec<_> = few.axis_iter(Axis(0)).collect();
        let coefficients: Vec<Vec<f32>> =
            rows.into_par_iter().map(|row| transform(row.to_vec(), window, &tables)).collect();
        let n = coefficients.len() as f64;
        let variance: Vec<f64> = (0..windows.ncols())
            .map(|i| {
                let (sum, squares) = coefficients.iter().fold((0.0, 0.0), |(sum, squares), row| {
                    let v = f64::from(row[i]);
                    (sum + v, squares + v * v)
                });
                (squares / n - (sum / n).powi(2)).max(0.0)
            })
            .collect();
        let mut order: Vec<usize> = (0..variance.len()).collect();
        order.sort_by(|&a, &b| variance[b].total_cmp(&variance[a]));
        order.truncate(count);
        order.sort_unstable();
        let total: f64 = variance.iter().sum();
        let kept: f64 = order.iter().map(|&i| variance[i]).sum();
        let chosen = order
            .iter()
            .map(|&i| (i / voxels(window), position(window, i % voxels(window))))
            .collect();
        let lost = if total > 0.0 { 1.0 - kept / total } else { 0.0 };
        Self { window, tables, chosen, lost }
    }

    /// Number of cosines.
    pub fn len(&self) -> usize {
        self.chosen.len()
    }

    fn cosine(&self, axis: usize, k: usize) -> &[f32] {
        &self.tables[axis][k * self.window[axis]..][..self.window[axis]]
    }

    /// The cosines as columns, of shape (channels · window, cosines).
    pub fn matrix(&self, channels: usize) -> Array2<f32> {
        let length = voxels(self.window);
        let mut out = Array2::zeros((channels * length, self.len()));
        for (&(c, wave), mut column) in self.chosen.iter().zip(out.columns_mut()) {
            let [k, j, i] = std::array::from_fn(|a| self.cosine(a, wave[a]));
            for (v, at) in column.iter_mut().skip(c * length).zip(0..length) {
                let [z, y, x] = position(self.window, at);
                *v = k[z] * j[y] * i[x];
            }
        }
        out
    }

    /// Visits rows of windows with the coefficients of their windows, of shape (cosines, windows):
    /// those with their origins in some planes of a view, as `visit(z, y, coefficients)`.
    pub fn visit_rows(
        &self,
        field: &Field,
        view: &View,
        planes: Range<usize>,
        visit: impl FnMut(usize, usize, ArrayView2<'_, f32>),
    ) {
        visit_rows(self, field, view, planes, visit);
    }
}

#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
fn visit_rows(
    cosines: &Cosines,
    field: &Field,
    view: &View,
    planes: Range<usize>,
    mut visit: impl FnMut(usize, usize, ArrayView2<'_, f32>),
) {
    let [wz, wy, wx] = cosines.window;
    let [_, ny, nx] = view.shape;
    let windows = nx + 1 - wx;
    let width = windows.next_multiple_of(LANES);
    let pitch = width + wx;
    let depth = planes.len() + wz - 1;
    // The planes as they lie in the view, one padded row after the other.
    let slabs: Vec<Vec<f32>> = (0..field.channels())
        .map(|c| {
            let values = field.channel(c);
            let mut slab = vec![0.0; depth * ny * pitch];
            for (row, out) in slab.chunks_exact_mut(pitch).enumerate() {
                let mut at = view.index([planes.start + row / ny, row % ny, 0]) as isize;
                for v in &mut out[..nx] {
                    *v = values[at as usize];
                    at += view.stride[2];
                }
            }
            slab
        })
        .collect();
    // Sums along y, for each wave number and plane, and of these along z.
    let mut along_y = vec![0.0; wy * depth * pitch];
    let mut line = vec![0.0; pitch];
    let mut out = vec![Array2::zeros((cosines.len(), width)); planes.len()];
    for y in 0..=ny - wy {
        let mut first = 0;
        for group in cosines.chosen.chunk_by(|a, b| a.0 == b.0) {
            let slab = &slabs[group[0].0];
            for j in (0..wy).filter(|&j| group.iter().any(|(_, wave)| wave[1] == j)) {
                for z in 0..depth {
                    let sums = &mut along_y[(j * depth + z) * pitch..][..pitch];
                    combine(sums, cosines.cosine(1, j), |dy| &slab[(z * ny + y + dy) * pitch..]);
                }
            }
            for lines in group.chunk_by(|a, b| a.1[..2] == b.1[..2]) {
                let [k, j, _] = lines[0].1;
                for (z, out) in out.iter_mut().enumerate() {
                    let rows = &along_y[(j * depth + z) * pitch..];
                    combine(&mut line, cosines.cosine(0, k), |dz| &rows[dz * pitch..]);
                    for (n, (_, wave)) in lines.iter().enumerate() {
                        let mut row = out.row_mut(first + n);
                        let Some(row) = row.as_slice_mut() else { continue };
                        combine(row, cosines.cosine(2, wave[2]), |dx| &line[dx..]);
                    }
                }
                first += lines.len();
            }
        }
        for (z, out) in planes.clone().zip(&out) {
            visit(z, y, out.slice(s![.., ..windows]));
        }
    }
}

/// Sets `out` to the sum of some rows, each times its factor.
#[inline(always)]
fn combine<'a>(out: &mut [f32], factors: &[f32], row: impl Fn(usize) -> &'a [f32]) {
    let whole = out.len() / LANES * LANES;
    let (blocks, rest) = out.split_at_mut(whole);
    for (block, out) in blocks.chunks_exact_mut(LANES).enumerate() {
        let mut sums = [0.0f32; LANES];
        for (i, factor) in factors.iter().enumerate() {
            let from = &row(i)[block * LANES..][..LANES];
            for (sum, v) in sums.iter_mut().zip(from) {
                *sum += factor * v;
            }
        }
        out.copy_from_slice(&sums);
    }
    for (x, out) in rest.iter_mut().enumerate() {
        *out = factors.iter().enumerate().map(|(i, factor)| factor * row(i)[whole + x]).sum();
    }
}

fn table(window: usize) -> Vec<f32> {
    let n = window as f64;
    (0..window * window)
        .map(|at| {
            let (k, i) = ((at / window) as f64, (at % window) as f64);
            let scale = if k == 0.0 { 1.0 / n } else { 2.0 / n };
            (scale.sqrt() * (std::f64::consts::PI * k * (i + 0.5) / n).cos()) as f32
        })
        .collect()
}

/// All cosine coefficients of windows that lie one after the other.
fn transform(mut values: Vec<f32>, window: Shape, tables: &[Vec<f32>; 3]) -> Vec<f32> {
    let [_, wy, wx] = window;
    for ((w, table), stride) in window.into_iter().zip(tables).zip([wy * wx, wx, 1]) {
        let mut out = vec![0.0; values.len()];
        for (at, v) in out.iter_mut().enumerate() {
            let k = at / stride % w;
            let first = at - k * stride;
            *v = (0..w).map(|i| table[k * w + i] * values[first + i * stride]).sum();
        }
        values = out;
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Key;
    use crate::texture::symmetry::Symmetry;

    fn noise(rows: usize, columns: usize) -> Array2<f32> {
        Array2::from_shape_fn((rows, columns), |(i, j)| Key::new(1).unit((i * columns + j) as u64))
    }

    #[test]
    fn all_cosines_are_an_orthonormal_basis_that_loses_nothing() {
        let cosines = Cosines::choose(noise(300, 54).view(), [3; 3], 54);
        let matrix = cosines.matrix(2);
        for ((i, j), v) in matrix.t().dot(&matrix).indexed_iter() {
            assert!((v - f32::from(u8::from(i == j))).abs() < 1e-5);
        }
        assert!(cosines.lost.abs() < 1e-9);
    }

    #[test]
    fn the_cosines_that_vary_are_chosen() {
        let w = 4;
        let table = table(w);
        let mut windows = Array2::from_elem((50, 64), 7.0);
        for (i, mut row) in windows.outer_iter_mut().enumerate() {
            for (at, v) in row.iter_mut().enumerate() {
                *v += (i % 5) as f32 * table[2 * w + at / 16] * table[w + at % 4];
            }
        }
        let cosines = Cosines::choose(windows.view(), [w; 3], 1);
        assert_eq!(cosines.chosen, [(0, [2, 0, 1])]);
        assert!(cosines.lost < 1e-9);
    }

    #[test]
    fn rows_of_windows_have_the_coefficients_of_each_window() {
        let (w, shape) = (4, [9, 7, 8]);
        let field = Field::new(shape, 2, noise(1, 1008).into_raw_vec_and_offset().0).unwrap();
        let cosines = Cosines::choose(noise(200, 128).view(), [w; 3], 40);
        let matrix = cosines.matrix(2);
        for orientation in Symmetry::Full.orientations(None) {
            let view = orientation.view(shape);
            let mut rows = 0;
            cosines.visit_rows(&field, &view, 1..4, |z, y, coefficients| {
                rows += 1;
                for (x, found) in coefficients.columns().into_iter().enumerate() {
                    let cube = |c: usize| {
                        (0..w * w * w)
                            .map(move |i| (c, [z + i / (w * w), y + i / w % w, x + i % w]))
                    };
                    let window = ndarray::Array1::from_iter(
                        cube(0).chain(cube(1)).map(|(c, at)| field.channel(c)[view.index(at)]),
                    );
                    for (a, b) in matrix.t().dot(&window).iter().zip(found) {
                        assert!((a - b).abs() < 1e-4);
                    }
                }
            });
            assert_eq!(rows, 3 * (view.shape[1] - w + 1));
        }
    }
}
