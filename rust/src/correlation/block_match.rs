//! How new a volume is: how far its blocks differ from every place in the exemplar.
//!
//! The squared difference of a probe and every place is box sums of squares minus twice a
//! correlation. Along x and y the correlation is a product of spectra; along z it is summed
//! directly, because few planes are valid there and because the products of one probe serve two of
//! its mirror images at once: a reversed probe has the conjugate spectrum.

use std::collections::VecDeque;
use std::sync::Arc;

use multiversion::multiversion;
use ndarray::{Array2, Array3, ArrayView2, ArrayView3, Axis, s};
use rayon::prelude::*;
use realfft::{RealFftPlanner, RealToComplex};
use rustfft::num_complex::Complex32;
use rustfft::{Fft, FftPlanner};

use crate::error::{Error, Result};
use crate::fourier::{ROWS, fast_length, transformed, write_columns};
use crate::monitor::Monitor;
use crate::rng::Key;
use crate::volume::Shape;

/// Novelty of blocks of one edge length: 0 where they are verbatim copies, 1 where they differ from
/// every place in the exemplar as much as one half of the exemplar differs from the other; NaN where
/// the halves do not differ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Novelty {
    /// Against the exemplar as it is.
    pub plain: f64,
    /// Against the exemplar and its mirror images.
    pub mirrored: f64,
}

/// Novelty of `volume` for blocks of `edge`³, as a median over `probes` random blocks; none where
/// the volume or half of the exemplar, cut across z, is not larger than a block along every axis.
///
/// Both are brought to zero mean and unit deviation first. Peak memory: 13 bytes a voxel of the
/// exemplar, and for each thread 16 bytes a voxel of `edge` of its planes.
pub fn novelty(
    exemplar: ArrayView3<'_, f32>,
    volume: ArrayView3<'_, f32>,
    edge: usize,
    probes: usize,
    seed: u64,
    monitor: &Monitor<'_>,
) -> Result<Option<Novelty>> {
    if edge == 0 || probes == 0 {
        return Err(Error::parameter("(edge, probes)", (edge, probes), "must be positive"));
    }
    let thickness = exemplar.dim().0 / 2;
    let (_, ny, nx) = exemplar.dim();
    let smallest = [volume.dim().0, volume.dim().1, volume.dim().2].into_iter().min();
    if thickness.min(ny).min(nx) <= edge || smallest.unwrap_or(0) <= edge {
        return Ok(None);
    }
    let exemplar = Standardised::of(exemplar).array(exemplar);
    let standardised = Standardised::of(volume);
    let plan = Plan::new(ny, nx);
    let halves = [0, 1]
        .into_par_iter()
        .map(|half| {
            let planes = half * thickness..(half + 1) * thickness;
            Half::new(exemplar.slice(s![planes, .., ..]), edge, &plan, monitor)
        })
        .collect::<Result<Vec<_>>>()?;

    // Even tasks take a probe from one half and look for it in the other; odd ones take it from
    // the volume and look for it in both.
    let keys = [0, 1].map(|source| Key::new(seed).with(edge as u64).with(source));
    let found = (0..2 * probes)
        .into_par_iter()
        .map(|task| {
            let probe = (task / 2) as u64;
            if task % 2 == 0 {
                let own = halves[task / 2 % 2].voxels;
                let other = &halves[1 - task / 2 % 2..][..1];
                best_match(&random_block(own, edge, keys[0], probe), other, &plan, monitor)
            } else {
                let block = random_block(volume, edge, keys[1], probe);
                best_match(&standardised.array(block.view()), &halves, &plan, monitor)
            }
        })
        .collect::<Result<Vec<_>>>()?;
    let ratio = |value: fn(&Differences) -> f64| {
        let median_of = |first| median(found.iter().skip(first).step_by(2).map(value).collect());
        let own = median_of(0);
        if own < SMALLEST { f64::NAN } else { median_of(1) / own }
    };
    Ok(Some(Novelty { plain: ratio(|d| d.plain), mirrored: ratio(|d| d.mirrored) }))
}

/// Difference between the halves of an exemplar, in units of its variance, below which they are
/// copies of each other and novelty has no measure.
const SMALLEST: f64 = 1e-3;

/// Mean and deviation of a volume.
struct Standardised {
    mean: f64,
    deviation: f64,
}

impl Standardised {
    fn of(volume: ArrayView3<'_, f32>) -> Self {
        let n = volume.len() as f64;
        let mean = volume.iter().map(|&v| f64::from(v)).sum::<f64>() / n;
        let variance = volume.iter().map(|&v| (f64::from(v) - mean).powi(2)).sum::<f64>() / n;
        Self { mean, deviation: if variance > 0.0 { variance.sqrt() } else { 1.0 } }
    }

    fn array(&self, volume: ArrayView3<'_, f32>) -> Array3<f32> {
        volume.mapv(|v| ((f64::from(v) - self.mean) / self.deviation) as f32)
    }
}

fn random_block(volume: ArrayView3<'_, f32>, edge: usize, key: Key, probe: u64) -> Array3<f32> {
    let start = |axis: u64, n: usize| key.below(3 * probe + axis, n - edge + 1);
    let (nz, ny, nx) = volume.dim();
    let (z, y, x) = (start(0, nz), start(1, ny), start(2, nx));
    volume.slice(s![z..z + edge, y..y + edge, x..x + edge]).to_owned()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let n = values.len();
    f64::midpoint(values[(n - 1) / 2], values[n / 2])
}

/// Transforms of planes of one size.
struct Plan {
    padded_y: usize,
    padded_x: usize,
    /// Length of the halved spectrum along x.
    half: usize,
    forward_y: Arc<dyn Fft<f32>>,
    inverse_y: Arc<dyn Fft<f32>>,
    forward_x: Arc<dyn RealToComplex<f32>>,
    inverse_x: Arc<dyn Fft<f32>>,
}

impl Plan {
    fn new(ny: usize, nx: usize) -> Self {
        let (padded_y, padded_x) = (fast_length(ny), fast_length(nx));
        let mut planner = FftPlanner::new();
        Self {
            padded_y,
            padded_x,
            half: padded_x / 2 + 1,
            forward_y: planner.plan_fft_forward(padded_y),
            inverse_y: planner.plan_fft_inverse(padded_y),
            forward_x: RealFftPlanner::new().plan_fft_forward(padded_x),
            inverse_x: planner.plan_fft_inverse(padded_x),
        }
    }

    /// Complex numbers in the spectrum of a plane, [kx][ky], with padding up to whole [`Lanes`].
    fn columns(&self) -> usize {
        (self.half * self.padded_y).next_multiple_of(LANES)
    }

    fn scratch(&self) -> Vec<Complex32> {
        let lengths = [
            self.forward_y.get_inplace_scratch_len(),
            self.inverse_y.get_inplace_scratch_len(),
            self.forward_x.get_scratch_len(),
            self.inverse_x.get_inplace_scratch_len(),
        ];
        vec![Complex32::default(); lengths.into_iter().max().unwrap_or(0)]
    }

    /// Spectrum of a plane.
    fn forward(
        &self,
        plane: ArrayView2<'_, f32>,
        spectrum: &mut [Complex32],
        scratch: &mut [Complex32],
    ) {
        let mut voxels = vec![0.0; self.padded_x];
        let mut rows = vec![Complex32::default(); ROWS * self.half];
        let spectrum = &mut spectrum[..self.half * self.padded_y];
        spectrum.fill(Complex32::default());
        for (block, lines) in plane.axis_chunks_iter(Axis(0), ROWS).enumerate() {
            for (line, row) in lines.outer_iter().zip(rows.chunks_exact_mut(self.half)) {
                for (to, &from) in voxels.iter_mut().zip(line) {
                    *to = from;
                }
                voxels[line.len()..].fill(0.0);
                transformed(self.forward_x.process_with_scratch(&mut voxels, row, scratch));
            }
            let rows = &rows[..lines.dim().0 * self.half];
            write_columns(rows, self.half, spectrum, self.padded_y, block * ROWS);
        }
        self.forward_y.process_with_scratch(spectrum, scratch);
    }
}

/// Complex numbers that are worked side by side: their real parts, then their imaginary parts.
type Lanes = [f32; 2 * LANES];
const LANES: usize = 8;

/// Spectra of a stack of planes, the planes of each [`Lanes`] side by side: `lanes[column][z]`.
struct Stack {
    planes: usize,
    lanes: Vec<Lanes>,
}

impl Stack {
    /// `mirrored` turns y to −y.
    fn new(planes: ArrayView3<'_, f32>, mirrored: bool, plan: &Plan) -> Self {
        let count = planes.dim().0;
        let mut lanes = vec![[0.0; 2 * LANES]; count * plan.columns() / LANES];
        let mut spectrum = vec![Complex32::default(); plan.columns()];
        let mut scratch = plan.scratch();
        for (z, plane) in planes.outer_iter().enumerate() {
            plan.forward(plane, &mut spectrum, &mut scratch);
            if mirrored {
                for row in spectrum[..plan.half * plan.padded_y].chunks_exact_mut(plan.padded_y) {
                    row[1..].reverse();
                }
            }
            for (values, lanes) in spectrum.chunks_exact(LANES).zip(lanes.chunks_exact_mut(count)) {
                for (i, value) in values.iter().enumerate() {
                    lanes[z][i] = value.re;
                    lanes[z][LANES + i] = value.im;
                }
            }
        }
        Self { planes: count, lanes }
    }
}

/// One half of the exemplar, ready to be searched.
struct Half<'a> {
    voxels: ArrayView3<'a, f32>,
    stack: Stack,
    /// Sum of squares of the block at each place.
    squares: Array3<f32>,
}

impl<'a> Half<'a> {
    fn new(
        voxels: ArrayView3<'a, f32>,
        edge: usize,
        plan: &Plan,
        monitor: &Monitor<'_>,
    ) -> Result<Self> {
        monitor.check()?;
        let squares = box_sums_of_squares(voxels, edge);
        let stack = Stack::new(voxels, false, plan);
        Ok(Self { voxels, stack, squares })
    }
}

/// Sums of squares over the blocks of `edge`³ at every place, by running sums along each axis.
fn box_sums_of_squares(voxels: ArrayView3<'_, f32>, edge: usize) -> Array3<f32> {
    let [nz, ny, nx] = <[usize; 3]>::from(voxels.dim()).map(|n| n - edge + 1);
    let mut sums = Array3::zeros((nz, ny, nx));
    let mut sum = Array2::<f64>::zeros((ny, nx));
    let mut last = VecDeque::with_capacity(edge);
    for (z, plane) in voxels.outer_iter().enumerate() {
        let mut squares = plane.mapv(|v| f64::from(v).powi(2));
        for axis in [Axis(0), Axis(1)] {
            squares = window_sums(squares, axis, edge);
        }
        sum += &squares;
        last.push_back(squares);
        if last.len() == edge {
            sums.index_axis_mut(Axis(0), z + 1 - edge).zip_mut_with(&sum, |to, &v| *to = v as f32);
            if let Some(before) = last.pop_front() {
                sum -= &before;
            }
        }
    }
    sums
}

/// Sums over the windows of `edge` values at every place along an axis.
fn window_sums(mut sums: Array2<f64>, axis: Axis, edge: usize) -> Array2<f64> {
    sums.accumulate_axis_inplace(axis, |&before, sum| *sum += before);
    let places = sums.len_of(axis) - edge + 1;
    let mut upper = sums.clone();
    upper.slice_axis_inplace(axis, (edge - 1..).into());
    let lower = sums.slice_axis(axis, (..places - 1).into());
    upper.slice_axis_mut(axis, (1..).into()).zip_mut_with(&lower, |u, l| *u -= l);
    upper
}

/// Smallest mean squared differences of a probe to any place.
#[derive(Debug, Clone, Copy)]
struct Differences {
    plain: f64,
    mirrored: f64,
}

/// Which axes of the probe are reversed.
type Image = [bool; 3];

/// Where an image of the probe matches, and how well.
#[derive(Debug, Clone, Copy)]
struct Match {
    /// Sum of squared differences, as found in single precision.
    difference: f32,
    half: usize,
    place: Shape,
    image: Image,
}

/// The smallest mean squared differences of the probe to any place in `halves`.
fn best_match(
    probe: &Array3<f32>,
    halves: &[Half<'_>],
    plan: &Plan,
    monitor: &Monitor<'_>,
) -> Result<Differences> {
    let square = probe.iter().map(|v| v * v).sum();
    let mut search = Search {
        plan,
        edge: probe.dim().0,
        square,
        products: [(); 2].map(|()| vec![Complex32::default(); TILE * plan.columns()]),
        rows: vec![Complex32::default(); (plan.padded_y / 2 + 1) * plan.padded_x],
        scratch: plan.scratch(),
        plain: None,
        mirrored: None,
    };
    // Twice the correlation comes out, and the transforms do not normalise.
    let scaled = probe * (2.0 / (plan.padded_y * plan.padded_x) as f32);
    for y_reversed in [false, true] {
        let stack = Stack::new(scaled.view(), y_reversed, plan);
        for z_reversed in [false, true] {
            for (index, half) in halves.iter().enumerate() {
                search.scan(&stack, index, half, z_reversed, y_reversed, monitor)?;
            }
        }
    }
    let exact = |found: Option<Match>| found.map_or(f64::NAN, |m| m.exact(probe, halves));
    Ok(Differences { plain: exact(search.plain), mirrored: exact(search.mirrored) })
}

impl Match {
    /// Mean squared difference in double precision.
    fn exact(&self, probe: &Array3<f32>, halves: &[Half<'_>]) -> f64 {
        let mut image = probe.view();
        for axis in (0..3).filter(|&axis| self.image[axis]) {
            image.invert_axis(Axis(axis));
        }
        let [z, y, x] = self.place;
        let edge = probe.dim().0;
        let block = halves[self.half].voxels.slice(s![z..z + edge, y..y + edge, x..x + edge]);
        let sum: f64 = block.iter().zip(image).map(|(&a, &b)| f64::from(a - b).powi(2)).sum();
        sum / probe.len() as f64
    }
}

/// Planes of results that are made at a time, so that they stay in the cache.
const TILE: usize = 8;

/// The search for one probe.
struct Search<'a> {
    plan: &'a Plan,
    edge: usize,
    /// Sum of squares of the probe.
    square: f32,
    /// Spectra of the tile's planes for the two images that share their products.
    products: [Vec<Complex32>; 2],
    /// Pairs of rows of a plane, transformed as the real and imaginary part of one.
    rows: Vec<Complex32>,
    scratch: Vec<Complex32>,
    /// Best match of the probe itself, and of all its images.
    plain: Option<Match>,
    mirrored: Option<Match>,
}

impl Search<'_> {
    /// Looks for two images of the probe in one half: as its stack holds it, and reversed along
    /// both y and x.
    fn scan(
        &mut self,
        stack: &Stack,
        index: usize,
        half: &Half<'_>,
        z_reversed: bool,
        y_reversed: bool,
        monitor: &Monitor<'_>,
    ) -> Result<()> {
        let columns = self.plan.columns();
        let places = half.stack.planes - self.edge + 1;
        for start in (0..places).step_by(TILE) {
            monitor.check()?;
            let count = TILE.min(places - start);
            let products = self.products.each_mut().map(|p| &mut p[..count * columns]);
            multiply(stack, &half.stack, start, z_reversed, columns, products);
            for both_reversed in [false, true] {
                let image = [z_reversed, y_reversed ^ both_reversed, both_reversed];
                for z in 0..count {
                    self.scan_plane(z, start + z, index, half, image);
                }
            }
        }
        Ok(())
    }

    /// Looks for one image in one plane of places.
    fn scan_plane(&mut self, tile_z: usize, z: usize, index: usize, half: &Half<'_>, image: Image) {
        let plan = self.plan;
        let which = usize::from(image[2]);
        let from = tile_z * plan.columns();
        let spectrum = &mut self.products[which][from..from + plan.half * plan.padded_y];
        plan.inverse_y.process_with_scratch(spectrum, &mut self.scratch);

        // A reversed probe keeps its place by its last voxel.
        let offset = |axis: usize| if image[axis] { self.edge - 1 } else { 0 };
        let (offset_y, offset_x) = (offset(1), offset(2));
        let squares = half.squares.index_axis(Axis(0), z);
        let last = squares.dim().0 - 2;
        // Two rows make one complex transform; of an odd number the last pair repeats a row.
        let pairs = (0..last + 2).step_by(2).map(|y| y.min(last));
        let rows = &mut self.rows[..pairs.len() * plan.padded_x];
        for (y, row) in pairs.clone().zip(rows.chunks_exact_mut(plan.padded_x)) {
            merge_rows(spectrum, plan.padded_y, y + offset_y, row);
        }
        plan.inverse_x.process_with_scratch(rows, &mut self.scratch);

        let is_plain = image == [false; 3];
        let best = if is_plain { &mut self.plain } else { &mut self.mirrored };
        for (first, row) in pairs.zip(rows.chunks_exact(plan.padded_x)) {
            let twice = &row[offset_x..];
            let squares = [first, first + 1].map(|y| squares.row(y).to_slice().unwrap_or_default());
            for (row, smallest) in smallest_differences(squares, twice).into_iter().enumerate() {
                let difference = self.square + smallest;
                if best.is_none_or(|m| difference < m.difference) {
                    let mut differences = squares[row]
                        .iter()
                        .zip(twice)
                        .map(|(square, twice)| square - if row == 0 { twice.re } else { twice.im });
                    let x = differences.position(|d| d <= smallest).unwrap_or(0);
                    let place = [z, first + row, x];
                    *best = Some(Match { difference, half: index, place, image });
                }
            }
        }
        if self.plain.is_some_and(|p| self.mirrored.is_none_or(|m| p.difference < m.difference)) {
            self.mirrored = self.plain;
        }
    }
}

/// Sums over z of the probe's planes times the volume's, from place `start` on: with the probe's
/// spectrum conjugate (the probe itself), and as it is (the probe reversed along y and x).
#[multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
fn multiply(
    probe: &Stack,
    volume: &Stack,
    start: usize,
    z_reversed: bool,
    columns: usize,
    [correlated, convolved]: [&mut [Complex32]; 2],
) {
    let count = correlated.len() / columns;
    for block in 0..columns / LANES {
        let volume = &volume.lanes[block * volume.planes + start..];
        let probe = &probe.lanes[block * probe.planes..(block + 1) * probe.planes];
        let mut write = |z: usize, sums: &Sums| {
            let at = z * columns + block * LANES;
            for (i, out) in correlated[at..at + LANES].iter_mut().enumerate() {
                *out = Complex32::new(sums.rr[i] + sums.ii[i], sums.ri[i] - sums.ir[i]);
            }
            for (i, out) in convolved[at..at + LANES].iter_mut().enumerate() {
                *out = Complex32::new(sums.rr[i] - sums.ii[i], sums.ri[i] + sums.ir[i]);
            }
        };
        for z in (0..count - count % 2).step_by(2) {
            let [first, second] = sum_products::<2>(probe, &volume[z..], z_reversed);
            write(z, &first);
            write(z + 1, &second);
        }
        if count % 2 == 1 {
            let [last] = sum_products::<1>(probe, &volume[count - 1..], z_reversed);
            write(count - 1, &last);
        }
    }
}

/// Sums of products of the real and imaginary parts of probe and volume.
#[derive(Clone, Copy, Default)]
struct Sums {
    rr: [f32; LANES],
    ri: [f32; LANES],
    ir: [f32; LANES],
    ii: [f32; LANES],
}

/// `N` adjacent places at once use each number of the probe `N` times.
#[inline(always)]
fn sum_products<const N: usize>(probe: &[Lanes], volume: &[Lanes], reversed: bool) -> [Sums; N] {
    let mut sums = [Sums::default(); N];
    let edge = probe.len();
    for j in 0..edge {
        let p = &probe[if reversed { edge - 1 - j } else { j }];
        for (sums, v) in sums.iter_mut().zip(&volume[j..j + N]) {
            for i in 0..LANES {
                sums.rr[i] += p[i] * v[i];
                sums.ri[i] += p[i] * v[LANES + i];
                sums.ir[i] += p[LANES + i] * v[i];
                sums.ii[i] += p[LANES + i] * v[LANES + i];
            }
        }
    }
    sums
}

/// Makes the spectra of rows `y` and `y` + 1 the spectrum of one row with them as its real and
/// imaginary part.
fn merge_rows(spectrum: &[Complex32], stride: usize, y: usize, row: &mut [Complex32]) {
    let n = row.len();
    for (kx, column) in spectrum.chunks_exact(stride).enumerate() {
        let (a, b) = (column[y], column[y + 1]);
        row[kx] = Complex32::new(a.re - b.im, a.im + b.re);
        if kx > 0 {
            row[n - kx] = Complex32::new(a.re + b.im, b.re - a.im);
        }
    }
}

/// The smallest of `squares` − `twice` for two rows, of which `twice` holds one as its real and
/// one as its imaginary part.
#[multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
fn smallest_differences([first, second]: [&[f32]; 2], twice: &[Complex32]) -> [f32; 2] {
    // Unlike f32::min, a comparison is one instruction; there is no NaN here.
    let smaller = |a: f32, b: f32| if a < b { a } else { b };
    let mut smallest = [[f32::MAX; LANES]; 2];
    let twice = &twice[..first.len()];
    let ((firsts, first), (seconds, second)) = (first.as_chunks(), second.as_chunks());
    let (twices, twice) = twice.as_chunks::<LANES>();
    for ((first, second), twice) in firsts.iter().zip(seconds).zip(twices) {
        let (first, second): (&[f32; LANES], &[f32; LANES]) = (first, second);
        for i in 0..LANES {
            smallest[0][i] = smaller(first[i] - twice[i].re, smallest[0][i]);
            smallest[1][i] = smaller(second[i] - twice[i].im, smallest[1][i]);
        }
    }
    let mut smallest = smallest.map(|lanes| lanes.into_iter().fold(f32::MAX, smaller));
    for ((first, second), twice) in first.iter().zip(second).zip(twice) {
        smallest[0] = smaller(first - twice.re, smallest[0]);
        smallest[1] = smaller(second - twice.im, smallest[1]);
    }
    smallest
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::threads::with_threads;

    fn random(shape: (usize, usize, usize), seed: u64) -> Array3<f32> {
        let mut index = 0;
        Array3::from_shape_simple_fn(shape, || {
            index += 1;
            Key::new(seed).unit(index) - 0.5
        })
    }

    /// Every place and every image, voxel by voxel.
    fn twin(probe: &Array3<f32>, halves: &[Array3<f32>]) -> Differences {
        let edge = probe.dim().0;
        let mut found = Differences { plain: f64::MAX, mirrored: f64::MAX };
        for image in 0..8 {
            let mut probe = probe.view();
            (0..3)
                .filter(|axis| image >> axis & 1 == 1)
                .for_each(|axis| probe.invert_axis(Axis(axis)));
            for half in halves {
                for place in half.windows((edge, edge, edge)) {
                    let difference =
                        place.iter().zip(probe).map(|(&a, &b)| f64::from(a - b).powi(2));
                    let mean = difference.sum::<f64>() / probe.len() as f64;
                    found.mirrored = found.mirrored.min(mean);
                    if image == 0 {
                        found.plain = found.plain.min(mean);
                    }
                }
            }
        }
        found
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(60))]
        #[test]
        fn the_best_match_is_the_best_of_all_places(
            edge in 1..6usize,
            (z, y, x) in (0..10usize, 1..12usize, 1..24usize),
            count in 1..3usize,
            seed: u64,
        ) {
            let shape = (edge + z, edge + y, edge + x);
            let volumes: Vec<_> = (0..count as u64).map(|i| random(shape, seed ^ i)).collect();
            let plan = Plan::new(shape.1, shape.2);
            let silent = Monitor::silent();
            let halves: Vec<_> =
                volumes.iter().map(|v| Half::new(v.view(), edge, &plan, &silent).unwrap()).collect();
            let probe = random((edge, edge, edge), !seed);
            let found = best_match(&probe, &halves, &plan, &silent).unwrap();
            let expected = twin(&probe, &volumes);
            prop_assert!((found.plain - expected.plain).abs() < 1e-5, "{found:?} {expected:?}");
            prop_assert!((found.mirrored - expected.mirrored).abs() < 1e-5, "{found:?} {expected:?}");
        }
    }

    #[test]
    fn a_copy_is_not_new_and_its_mirror_image_only_to_the_plain_figure() {
        let exemplar = random((30, 14, 15), 1);
        let silent = Monitor::silent();
        let of = |volume: ArrayView3<'_, f32>| {
            novelty(exemplar.view(), volume, 5, 9, 0, &silent).unwrap().unwrap()
        };
        let half = exemplar.slice(s![..15, .., ..]).to_owned();
        let plain = of(half.view()).plain;
        assert!(plain < 1e-3, "{plain}");
        for axis in 0..3 {
            let mut volume = half.view();
            volume.invert_axis(Axis(axis));
            let found = of(volume);
            assert!(found.plain > 0.5 && found.mirrored < 1e-3, "{axis}: {found:?}");
        }
    }

    #[test]
    fn the_same_for_any_number_of_threads() {
        let (exemplar, volume) = (random((26, 15, 16), 2), random((14, 14, 20), 3));
        let of = |threads| {
            with_threads(threads, || {
                novelty(exemplar.view(), volume.view(), 6, 5, 7, &Monitor::silent())
            })
        };
        assert_eq!(of(1), of(2));
        assert_eq!(of(1), of(8));
    }

    #[test]
    fn a_block_must_be_smaller_than_the_volume_and_half_the_exemplar() {
        let silent = Monitor::silent();
        let of = |exemplar, volume, edge| {
            let (exemplar, volume) = (random(exemplar, 1), random(volume, 2));
            novelty(exemplar.view(), volume.view(), edge, 2, 0, &silent).unwrap()
        };
        assert!(of((12, 6, 6), (6, 6, 6), 5).is_some());
        assert!(of((11, 6, 6), (6, 6, 6), 5).is_none());
        assert!(of((12, 5, 6), (6, 6, 6), 5).is_none());
        assert!(of((12, 6, 6), (6, 6, 5), 5).is_none());
        assert!(of((0, 0, 0), (0, 0, 0), 5).is_none());
    }

    #[test]
    fn an_exemplar_whose_halves_are_copies_measures_nothing() {
        let half = random((8, 8, 8), 4);
        let exemplar = ndarray::concatenate![Axis(0), half, half];
        for exemplar in [exemplar, Array3::from_elem((16, 8, 8), 3.0)] {
            let volume = random((9, 9, 9), 5);
            let silent = Monitor::silent();
            let found = novelty(exemplar.view(), volume.view(), 4, 3, 0, &silent).unwrap().unwrap();
            assert!(found.plain.is_nan() && found.mirrored.is_nan());
        }
    }

    #[test]
    fn bad_input_is_named() {
        let volume = random((12, 8, 8), 1);
        for (edge, probes) in [(0, 3), (4, 0)] {
            let result = novelty(volume.view(), volume.view(), edge, probes, 0, &Monitor::silent());
            assert!(matches!(result, Err(Error::Parameter { .. })));
        }
    }
}
