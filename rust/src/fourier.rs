//! What the Fourier kernels share, and the transform of a periodic volume.

use std::sync::Arc;

use ndarray::{Array3, ArrayViewMut2, Axis};
use rayon::prelude::*;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use rustfft::num_complex::Complex32;
use rustfft::{Fft, FftPlanner};

use crate::error::{Error, Result};
use crate::monitor::Monitor;
use crate::volume::{Shape, voxels};

/// Rows that are transformed before they are written out transposed: 16 complex numbers are two
/// cache lines, so that neither side of the transposition wastes what it loads.
pub(crate) const ROWS: usize = 16;

/// The smallest length from `n` on whose transform is fast: a multiple of 4 with no other factors
/// than 2, 3 and at most one 5. Further 5s and 7s cost more than the padding they save (100
/// points take 1.8 ns a point, 108 take 0.9).
pub(crate) fn fast_length(n: usize) -> usize {
    let is_fast = |mut m: usize| {
        for factor in [2, 3] {
            while m.is_multiple_of(factor) {
                m /= factor;
            }
        }
        m == 1 || m == 5
    };
    let mut quarter = n.div_ceil(4).max(1);
    while !is_fast(quarter) {
        quarter += 1;
    }
    4 * quarter
}

/// Writes up to [`ROWS`] rows of `length` as columns `start..` of a matrix with rows of `stride`.
pub(crate) fn write_columns(
    rows: &[Complex32],
    length: usize,
    columns: &mut [Complex32],
    stride: usize,
    start: usize,
) {
    let count = rows.len() / length;
    for (k, out) in columns.chunks_exact_mut(stride).enumerate().take(length) {
        for (i, value) in out[start..start + count].iter_mut().enumerate() {
            *value = rows[i * length + k];
        }
    }
}

/// The plans make their own buffers, so that a transform cannot fail.
pub(crate) fn transformed(result: std::result::Result<(), realfft::FftError>) {
    debug_assert!(result.is_ok(), "{result:?}");
}

/// The Fourier transform of volumes of one shape that tile space.
pub struct Transform {
    shape: Shape,
    forward_x: Arc<dyn RealToComplex<f32>>,
    inverse_x: Arc<dyn ComplexToReal<f32>>,
    /// Along z and y.
    forward: [Arc<dyn Fft<f32>>; 2],
    inverse: [Arc<dyn Fft<f32>>; 2],
}

/// What a thread needs to transform columns.
struct Columns {
    rows: Vec<Complex32>,
    scratch: Vec<Complex32>,
}

impl Transform {
    /// A transform of volumes of this shape, no axis of which is empty.
    pub fn new(shape: Shape) -> Self {
        let [z, y, x] = shape;
        let (mut planner, mut real) = (FftPlanner::new(), RealFftPlanner::new());
        Self {
            shape,
            forward_x: real.plan_fft_forward(x),
            inverse_x: real.plan_fft_inverse(x),
            forward: [z, y].map(|n| planner.plan_fft_forward(n)),
            inverse: [z, y].map(|n| planner.plan_fft_inverse(n)),
        }
    }

    /// Length of the spectrum along x: the other half is its conjugate.
    pub const fn half(&self) -> usize {
        self.shape[2] / 2 + 1
    }

    /// The spectrum of real values, wave numbers along (z, y, x), not scaled. Memory: that of the
    /// spectrum, about 4 bytes a voxel.
    pub fn forward(&self, values: &[f32], monitor: &Monitor<'_>) -> Result<Array3<Complex32>> {
        let [nz, ny, nx] = self.shape;
        let half = self.half();
        let mut spectrum = Array3::zeros((nz, ny, half));
        spectrum.axis_iter_mut(Axis(0)).into_par_iter().enumerate().try_for_each_init(
            || (vec![0.0; nx], self.forward_x.make_scratch_vec(), columns(&*self.forward[1])),
            |(row, scratch, columns), (z, mut plane)| {
                monitor.check()?;
                for (y, mut out) in plane.rows_mut().into_iter().enumerate() {
                    row.copy_from_slice(&values[(z * ny + y) * nx..][..nx]);
                    let out = out.as_slice_mut().unwrap_or_default();
                    transformed(self.forward_x.process_with_scratch(row, out, scratch));
                }
                transform_columns(plane, &*self.forward[1], columns);
                Ok(())
            },
        )?;
        along_z(&mut spectrum, &*self.forward[0], monitor)?;
        Ok(spectrum)
    }

    /// The values that have a spectrum; `inverse(forward(values))` is `values`.
    pub fn inverse(
        &self,
        mut spectrum: Array3<Complex32>,
        values: &mut [f32],
        monitor: &Monitor<'_>,
    ) -> Result<()> {
        let [_, ny, nx] = self.shape;
        let scale = 1.0 / voxels(self.shape) as f32;
        along_z(&mut spectrum, &*self.inverse[0], monitor)?;
        let planes = spectrum.axis_iter_mut(Axis(0)).into_par_iter();
        planes.zip(values.par_chunks_exact_mut(ny * nx)).try_for_each_init(
            || (self.inverse_x.make_scratch_vec(), columns(&*self.inverse[1])),
            |(scratch, columns), (mut plane, values)| {
                monitor.check()?;
                transform_columns(plane.view_mut(), &*self.inverse[1], columns);
                for (mut row, values) in plane.rows_mut().into_iter().zip(values.chunks_mut(nx)) {
                    // Real by symmetry, up to rounding.
                    row[0].im = 0.0;
                    if nx.is_multiple_of(2) {
                        row[nx / 2].im = 0.0;
                    }
                    let row = row.as_slice_mut().unwrap_or_default();
                    transformed(self.inverse_x.process_with_scratch(row, values, scratch));
                    for v in values {
                        *v *= scale;
                    }
                }
                Ok(())
            },
        )
    }

    /// Replaces values by the sums of their products at all lags, which wrap; lag 0 comes first.
    pub fn autocorrelate(&self, values: &mut [f32], monitor: &Monitor<'_>) -> Result<()> {
        let mut spectrum = self.forward(values, monitor)?;
        spectrum.mapv_inplace(|value| value.norm_sqr().into());
        self.inverse(spectrum, values, monitor)
    }
}

fn columns(fft: &dyn Fft<f32>) -> Columns {
    let zeros = |n| vec![Complex32::default(); n];
    Columns { rows: zeros(ROWS * fft.len()), scratch: zeros(fft.get_inplace_scratch_len()) }
}

fn along_z(
    spectrum: &mut Array3<Complex32>,
    fft: &dyn Fft<f32>,
    monitor: &Monitor<'_>,
) -> Result<()> {
    spectrum.axis_iter_mut(Axis(1)).into_par_iter().try_for_each_init(
        || columns(fft),
        |columns, plane| {
            monitor.check()?;
            transform_columns(plane, fft, columns);
            Ok(())
        },
    )
}

/// Transforms each column of a plane, [`ROWS`] at a time.
fn transform_columns(
    mut plane: ArrayViewMut2<'_, Complex32>,
    fft: &dyn Fft<f32>,
    Columns { rows, scratch }: &mut Columns,
) {
    let (length, width) = plane.dim();
    if length == 1 {
        return;
    }
    for start in (0..width).step_by(ROWS) {
        let end = width.min(start + ROWS);
        let rows = &mut rows[..(end - start) * length];
        for (k, from) in plane.rows().into_iter().enumerate() {
            let from = from.to_slice().unwrap_or_default();
            for (i, value) in from[start..end].iter().enumerate() {
                rows[i * length + k] = *value;
            }
        }
        fft.process_with_scratch(rows, scratch);
        for (k, mut to) in plane.rows_mut().into_iter().enumerate() {
            let to = to.as_slice_mut().unwrap_or_default();
            for (i, value) in to[start..end].iter_mut().enumerate() {
                *value = rows[i * length + k];
            }
        }
    }
}

/// Values of a periodic volume on a finer grid: its Fourier series, evaluated there.
///
/// Voxel 0 keeps its place, so that voxel i of n goes to i·m/n of m. Unlike linear interpolation it
/// leaves no trace of the coarse grid.
pub fn enlarge(values: &[f32], from: Shape, to: Shape, monitor: &Monitor<'_>) -> Result<Vec<f32>> {
    if (0..3).any(|a| to[a] < from[a]) {
        let allowed = format!("must be at least {from:?} along each axis");
        return Err(Error::parameter("shape", to, allowed));
    }
    let coarse = Transform::new(from).forward(values, monitor)?;
    let fine = Transform::new(to);
    let mut spectrum = Array3::zeros((to[0], to[1], fine.half()));
    let scale = voxels(to) as f32 / voxels(from) as f32;
    for ((kz, ky, kx), value) in coarse.indexed_iter() {
        for (z, share_z) in places(kz, from[0], to[0]) {
            for (y, share_y) in places(ky, from[1], to[1]) {
                let share_x = if 2 * kx == from[2] && to[2] > from[2] { 0.5 } else { 1.0 };
                spectrum[[z, y, kx]] += value * (scale * share_z * share_y * share_x);
            }
        }
    }
    let mut out = vec![0.0; voxels(to)];
    fine.inverse(spectrum, &mut out, monitor)?;
    Ok(out)
}

/// Where a wave number of n goes among those of m, with its share: the highest of an even n stands
/// for both signs.
fn places(k: usize, n: usize, m: usize) -> impl Iterator<Item = (usize, f32)> {
    let highest = 2 * k == n && m > n;
    let first = if 2 * k < n || highest || m == n { k } else { m - (n - k) };
    let share = if highest { 0.5 } else { 1.0 };
    std::iter::once((first, share)).chain(highest.then_some((m - k, share)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Key;
    use crate::threads::with_threads;
    use crate::volume::position;

    const SHAPES: [Shape; 7] =
        [[1, 1, 1], [1, 1, 5], [1, 6, 1], [7, 1, 2], [2, 3, 4], [5, 4, 3], [17, 18, 35]];

    fn noise(shape: Shape) -> Vec<f32> {
        (0..voxels(shape) as u64).map(|i| Key::new(1).unit(i)).collect()
    }

    /// One number of the spectrum, as it is defined.
    fn coefficient(values: &[f32], shape: Shape, k: [usize; 3]) -> [f64; 2] {
        let mut sums = [0.0; 2];
        for (i, &v) in values.iter().enumerate() {
            let p = position(shape, i);
            let turns: f64 = (0..3).map(|a| (k[a] * p[a]) as f64 / shape[a] as f64).sum();
            let (sin, cos) = (-std::f64::consts::TAU * turns).sin_cos();
            sums[0] += f64::from(v) * cos;
            sums[1] += f64::from(v) * sin;
        }
        sums
    }

    #[test]
    fn the_spectrum_is_what_it_is_defined_as_and_comes_back() {
        for shape in SHAPES {
            let (values, silent) = (noise(shape), Monitor::silent());
            let transform = Transform::new(shape);
            let spectrum = transform.forward(&values, &silent).unwrap();
            let step = spectrum.len().div_ceil(50);
            for ((z, y, x), found) in spectrum.indexed_iter().step_by(step) {
                let [re, im] = coefficient(&values, shape, [z, y, x]);
                let off = (f64::from(found.re) - re).hypot(f64::from(found.im) - im);
                assert!(off < 1e-5 * voxels(shape) as f64, "{shape:?} {found} {re} {im}");
            }
            let mut back = vec![0.0; values.len()];
            transform.inverse(spectrum, &mut back, &silent).unwrap();
            assert!(back.iter().zip(&values).all(|(a, b)| (a - b).abs() < 1e-5), "{shape:?}");
        }
    }

    #[test]
    fn any_number_of_threads_gives_the_same_spectrum() {
        let shape = [17, 18, 35];
        let spectrum = || Transform::new(shape).forward(&noise(shape), &Monitor::silent()).unwrap();
        let [one, three] = [1, 3].map(|n| with_threads(n, spectrum).unwrap());
        assert!(one == three);
    }

    #[test]
    fn a_wave_stays_a_wave_when_enlarged() {
        let wave = |shape: Shape| -> Vec<f32> {
            let at = |p: [usize; 3]| {
                let turn = |a: usize, k: f64| k * p[a] as f64 / shape[a] as f64;
                std::f64::consts::TAU * (turn(0, 1.0) + turn(1, 2.0) - turn(2, 1.0))
            };
            (0..voxels(shape)).map(|i| 3.0 + at(position(shape, i)).cos() as f32).collect()
        };
        for (from, to) in
            [([4, 5, 6], [8, 10, 12]), ([3, 5, 4], [3, 9, 11]), ([3, 5, 3], [3, 5, 3])]
        {
            let found = enlarge(&wave(from), from, to, &Monitor::silent()).unwrap();
            assert!(found.iter().zip(wave(to)).all(|(a, b)| (a - b).abs() < 1e-5));
        }
        assert!(enlarge(&wave([3; 3]), [3; 3], [3, 2, 3], &Monitor::silent()).is_err());
    }

    #[test]
    fn fast_lengths_cover_what_is_asked_for() {
        let expected = [(0, 4), (1, 4), (100, 108), (306, 320), (450, 480), (512, 512)];
        for (n, length) in expected {
            assert_eq!(fast_length(n), length, "{n}");
        }
    }

    #[test]
    fn columns_are_the_rows_transposed() {
        let rows: Vec<_> = (0..6).map(|i| Complex32::new(i as f32, 0.0)).collect();
        let mut columns = vec![Complex32::default(); 3 * 4];
        write_columns(&rows, 3, &mut columns, 4, 1);
        let real: Vec<_> = columns.iter().map(|c| c.re).collect();
        assert_eq!(real, [0.0, 0.0, 3.0, 0.0, 0.0, 1.0, 4.0, 0.0, 0.0, 2.0, 5.0, 0.0]);
    }
}
