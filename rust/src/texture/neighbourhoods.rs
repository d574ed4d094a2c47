//! All complete windows of the exemplar, as short quantised descriptors.

use ndarray::{Array2, ArrayView2, linalg::general_mat_mul};
use rayon::prelude::*;

use super::cosines::Cosines;
use super::field::Field;
use super::match_map::Match;
use super::pca::{Basis, product};
use super::symmetry::{Orientation, View};
use crate::error::{Error, Result};
use crate::monitor::Monitor;
use crate::rng::Key;
use crate::volume::{Shape, position, voxels};

/// Windows from which the principal directions are learned. With 4096 of them the captured variance
/// is within 1 % of that of all windows on bone, sandstone and foam.
const SAMPLES: usize = 4096;

/// Cosines for each principal component. With two, 32 components hold at least 99.4 % of the variance
/// that they hold without the detour, on distances 99.9 % (bone, sandstone, foam, windows 8 and 10).
const COSINES: usize = 2;

/// Planes of windows that a task describes.
const PLANES: usize = 8;

/// Windows a task projects at once: their vectors at window 8 fill half of a 512 KB cache.
pub const BLOCK: usize = 128;

/// Room above the largest projection among the samples before a descriptor is clipped.
const HEADROOM: f32 = 1.25;

/// Largest value of a descriptor of this length: the sum of `dims` squared differences of two such
/// values fits an i32.
pub fn limit_of(dims: usize) -> f32 {
    ((i32::MAX as f32 / dims as f32).sqrt() / 2.0).floor()
}

/// Every complete window of an exemplar under every orientation (zhang_2017 §4.2, §5.1).
///
/// Descriptors are the leading principal components as int16, padded with zeros to a multiple of 16,
/// so that 32 of them fill one cache line. Memory: 2·dims bytes a window and orientation.
pub struct Neighbourhoods<'a> {
    field: &'a Field,
    window: Shape,
    views: Vec<View>,
    starts: Vec<usize>,
    limits: Vec<Shape>,
    basis: Basis,
    dims: usize,
    scale: f32,
    limit: f32,
    descriptors: Vec<i16>,
}

impl<'a> Neighbourhoods<'a> {
    /// Collects the windows of these edges, with at most `cap` components for `share` of the
    /// variance.
    ///
    /// # Errors
    /// If the window does not fit into the exemplar, or the caller cancels.
    pub fn new(
        field: &'a Field,
        window: Shape,
        orientations: &[Orientation],
        (cap, share): (usize, f32),
        key: Key,
        monitor: &Monitor<'_>,
    ) -> Result<Self> {
        let views: Vec<View> = orientations.iter().map(|o| o.view(field.shape())).collect();
        let fits = |view: &View| (0..3).all(|a| (1..=view.shape[a]).contains(&window[a]));
        if !views.iter().all(fits) {
            return Err(Error::parameter(
                "window",
                window,
                format!(
                    "must be from 1 to the exemplar's edges, {:?} at this level",
                    field.shape()
                ),
            ));
        }
        let corners = |view: &View| std::array::from_fn(|a| view.shape[a] - window[a]);
        let limits: Vec<Shape> = views.iter().map(corners).collect();
        let mut starts = vec![0];
        for limit in &limits {
            starts.push(starts[starts.len() - 1] + voxels(limit.map(|n| n + 1)));
        }
        let total = starts[views.len()];
        let length = field.channels() * voxels(window);

        let mut this = Self {
            field,
            window,
            views,
            starts,
            limits,
            basis: Basis::fit(&mut Array2::zeros((1, 1)), 1, 1.0, 0.0, key),
            dims: 0,
            scale: 1.0,
            limit: 0.0,
            descriptors: Vec::new(),
        };
        let mut samples = Array2::zeros((SAMPLES.min(total), length));
        for (i, mut row) in samples.outer_iter_mut().enumerate() {
            let at = if total <= SAMPLES { i } else { key.below(i as u64, total) };
            if let Some(row) = row.as_slice_mut() {
                this.gather(this.match_at(at), row);
            }
        }
        let cosines = Cosines::choose(samples.view(), window, COSINES * cap);
        let matrix = cosines.matrix(field.channels());
        let mut coefficients = product(samples.view(), matrix.view());
        drop(samples);
        let mut basis = Basis::fit(&mut coefficients, cap, share, cosines.lost, key.with(1));
        this.dims = basis.dims().next_multiple_of(16);
        this.limit = limit_of(this.dims);
        let largest = coefficients.dot(&basis.vectors).iter().fold(0.0f32, |m, v| m.max(v.abs()));
        this.scale = if largest > 0.0 { this.limit / (HEADROOM * largest) } else { 1.0 };
        let of_cosines = basis.vectors;
        basis.vectors = matrix.dot(&of_cosines);
        this.basis = basis;

        let mut descriptors = vec![0i16; total * this.dims];
        for (o, view) in this.views.iter().enumerate() {
            let [_, gy, gx] = this.limits[o].map(|n| n + 1);
            let plane = gy * gx * this.dims;
            descriptors[this.starts[o] * this.dims..this.starts[o + 1] * this.dims]
                .par_chunks_mut(PLANES * plane)
                .enumerate()
                .try_for_each(|(task, out)| {
                    monitor.check()?;
                    let first = task * PLANES;
                    let planes = first..first + out.len() / plane;
                    let mut projected = Array2::zeros((gx, this.basis.dims()));
                    cosines.visit_rows(field, view, planes, |z, y, coefficients| {
                        let windows = coefficients.t();
                        general_mat_mul(1.0, &windows, &of_cosines, 0.0, &mut projected);
                        projected -= &this.basis.mean;
                        let row = ((z - first) * gy + y) * gx * this.dims;
                        this.quantise(&projected, &mut out[row..row + gx * this.dims]);
                    });
                    Ok(())
                })?;
        }
        this.descriptors = descriptors;
        Ok(this)
    }

    /// Windows that are described already, one at each voxel of `grid`, whose values do not matter.
    ///
    /// `descriptors` holds as many values a window, a multiple of 16, none above [`limit_of`].
    pub fn described(grid: &'a Field, descriptors: Vec<i16>) -> Self {
        let total = voxels(grid.shape());
        let dims = descriptors.len() / total;
        Self {
            field: grid,
            window: [1; 3],
            views: vec![Orientation::IDENTITY.view(grid.shape())],
            starts: vec![0, total],
            limits: vec![grid.shape().map(|n| n - 1)],
            basis: Basis::fit(&mut Array2::zeros((1, 1)), 1, 1.0, 0.0, Key::new(0)),
            dims,
            scale: 1.0,
            limit: limit_of(dims),
            descriptors,
        }
    }

    /// Edges of the windows.
    pub const fn window(&self) -> Shape {
        self.window
    }

    /// The exemplar.
    pub const fn field(&self) -> &Field {
        self.field
    }

    /// Length of a descriptor, a multiple of 16.
    pub const fn dims(&self) -> usize {
        self.dims
    }

    /// Length of a window's vector of values: channels × voxels.
    pub const fn length(&self) -> usize {
        self.field.channels() * voxels(self.window)
    }

    /// Number of windows over all orientations.
    pub fn len(&self) -> usize {
        self.starts[self.views.len()]
    }

    /// Never: an exemplar holds at least one window.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The exemplar under every orientation.
    pub fn views(&self) -> &[View] {
        &self.views
    }

    /// The exemplar under a match's orientation.
    pub fn view(&self, m: Match) -> &View {
        &self.views[usize::from(m.orientation)]
    }

    /// Largest window origin under an orientation.
    #[inline(always)]
    pub fn limit(&self, orientation: u16) -> Shape {
        self.limits[usize::from(orientation)]
    }

    /// Position of a window among all.
    #[inline(always)]
    pub fn index(&self, m: Match) -> usize {
        let grid = self.limit(m.orientation).map(|n| n + 1);
        self.starts[usize::from(m.orientation)]
            + crate::volume::index(grid, m.origin.map(usize::from))
    }

    /// The window at a position.
    #[inline(always)]
    pub fn match_at(&self, index: usize) -> Match {
        let orientation = self.starts.partition_point(|&s| s <= index) - 1;
        let grid = self.limit(orientation as u16).map(|n| n + 1);
        let origin = position(grid, index - self.starts[orientation]).map(|o| o as u16);
        Match { orientation: orientation as u16, origin }
    }

    /// Descriptor of the window at a position.
    #[inline(always)]
    pub fn descriptor(&self, index: usize) -> &[i16] {
        &self.descriptors[index * self.dims..(index + 1) * self.dims]
    }

    /// Descriptors of all windows.
    pub fn descriptors(&self) -> &[i16] {
        &self.descriptors
    }

    /// Summed variance of the descriptors, in their own squared unit.
    pub fn spread(&self) -> f32 {
        self.basis.variance.iter().sum::<f32>() * self.scale * self.scale
    }

    /// Copies the values of a window into a vector: channel, z, y, x.
    pub fn gather(&self, m: Match, out: &mut [f32]) {
        let w = self.window;
        let view = self.view(m);
        let [z, y, x] = m.origin.map(usize::from);
        let start = |dz: usize, dy: usize| view.index([z + dz, y + dy, x]);
        for (c, out) in out.chunks_exact_mut(voxels(w)).enumerate() {
            let values = self.field.channel(c);
            if view.stride[2] == 1 || w[2] == 1 {
                copy_rows(values, w, start, out);
            } else {
                for (row, out) in out.chunks_exact_mut(w[2]).enumerate() {
                    let mut at = start(row / w[1], row % w[1]) as isize;
                    for o in out {
                        *o = values[at as usize];
                        at += view.stride[2];
                    }
                }
            }
        }
    }

    /// Mean squared difference of a window and a vector of values.
    pub fn mean_square_difference(&self, m: Match, values: &[f32]) -> f32 {
        let w = self.window;
        let view = self.view(m);
        let [z, y, x] = m.origin.map(usize::from);
        let start = |dz: usize, dy: usize| view.index([z + dz, y + dy, x]);
        let mut sum = 0.0;
        for (c, own) in values.chunks_exact(voxels(w)).enumerate() {
            sum += squared_difference(self.field.channel(c), (start, view.stride[2]), w, own);
        }
        sum / values.len() as f32
    }

    /// Descriptors of vectors that lie one after the other.
    pub fn describe(&self, vectors: &[f32], projection: &mut Projection, out: &mut [i16]) {
        let (length, used) = (self.length(), self.basis.dims());
        let rows = vectors.len() / length;
        if projection.0.dim() != (rows, used) {
            projection.0 = Array2::zeros((rows, used));
        }
        let Ok(vectors) = ArrayView2::from_shape((rows, length), vectors) else { return };
        self.basis.project(vectors, &mut projection.0);
        self.quantise(&projection.0, out);
    }

    fn quantise(&self, projected: &Array2<f32>, out: &mut [i16]) {
        let Some(values) = projected.as_slice() else { return };
        let used = projected.ncols();
        quantise(values, used, (self.scale, self.limit), out, self.dims);
    }
}

/// Scratch memory of a projection.
#[derive(Default)]
pub struct Projection(Array2<f32>);

/// Copies the rows of a window of edges `w`, which start in `values` where `start(z, y)` says.
///
/// The usual edges have loops of their own: for four values a call of the library's copy costs more
/// than the copy.
#[inline(always)]
pub fn copy_rows(values: &[f32], w: Shape, start: impl Fn(usize, usize) -> usize, out: &mut [f32]) {
    #[inline(always)]
    fn fixed<const W: usize>(
        values: &[f32],
        height: usize,
        start: impl Fn(usize, usize) -> usize,
        out: &mut [f32],
    ) {
        for (z, plane) in out.chunks_exact_mut(height * W).enumerate() {
            for (y, out) in plane.as_chunks_mut::<W>().0.iter_mut().enumerate() {
                if let Some(from) = values[start(z, y)..].first_chunk() {
                    *out = *from;
                }
            }
        }
    }
    let [_, height, length] = w;
    match length {
        1 => fixed::<1>(values, height, start, out),
        4 => fixed::<4>(values, height, start, out),
        8 => fixed::<8>(values, height, start, out),
        10 => fixed::<10>(values, height, start, out),
        _ => {
            for (row, out) in out.chunks_exact_mut(length).enumerate() {
                out.copy_from_slice(&values[start(row / height, row % height)..][..length]);
            }
        }
    }
}

/// Rounds rows of `used` values, each times the scale and clipped, to rows of `dims` integers.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
fn quantise(values: &[f32], used: usize, (scale, limit): (f32, f32), out: &mut [i16], dims: usize) {
    for (values, out) in values.chunks_exact(used).zip(out.chunks_exact_mut(dims)) {
        for (o, v) in out.iter_mut().zip(values) {
            *o = (v * scale).round_ties_even().clamp(-limit, limit) as i16;
        }
        out[used..].fill(0);
    }
}

/// Summed squared difference of a window of edges `w`, whose rows start in `values` where `start(z, y)`
/// says and go on in steps of `stride`, and its `own` values.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
fn squared_difference(
    values: &[f32],
    (start, stride): (impl Fn(usize, usize) -> usize, isize),
    [_, height, length]: Shape,
    own: &[f32],
) -> f32 {
    #[inline(always)]
    fn fixed<const W: usize>(
        values: &[f32],
        height: usize,
        start: impl Fn(usize, usize) -> usize,
        own: &[f32],
    ) -> f32 {
        let mut sums = [0.0f32; W];
        for (z, plane) in own.chunks_exact(height * W).enumerate() {
            for (y, own) in plane.as_chunks::<W>().0.iter().enumerate() {
                let from = &values[start(z, y)..][..W];
                for i in 0..W {
                    let d = own[i] - from[i];
                    sums[i] += d * d;
                }
            }
        }
        sums.iter().sum()
    }
    match (length, stride) {
        (1, _) => fixed::<1>(values, height, start, own),
        (4, 1) => fixed::<4>(values, height, start, own),
        (8, 1) => fixed::<8>(values, height, start, own),
        (10, 1) => fixed::<10>(values, height, start, own),
        _ => {
            let mut sum = 0.0;
            for (row, own) in own.chunks_exact(length).enumerate() {
                let mut at = start(row / height, row % height) as isize;
                for o in own {
                    let d = o - values[at as usize];
                    sum += d * d;
                    at += stride;
                }
            }
            sum
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture::symmetry::Symmetry;

    fn exemplar() -> Field {
        let key = Key::new(3);
        Field::new([7, 6, 8], 2, (0..672).map(|i| 255.0 * key.unit(i)).collect()).unwrap()
    }

    #[test]
    fn windows_and_their_positions_agree() {
        let field = exemplar();
        let all = Symmetry::Full.orientations(None);
        let set =
            Neighbourhoods::new(&field, [4; 3], &all, (16, 0.95), Key::new(0), &Monitor::silent())
                .unwrap();
        assert_eq!(set.len(), 48 * 4 * 3 * 5);
        for i in 0..set.len() {
            assert_eq!(set.index(set.match_at(i)), i);
        }
    }

    #[test]
    fn descriptor_distances_follow_true_distances() {
        let field = exemplar();
        let one = Symmetry::None.orientations(None);
        let set =
            Neighbourhoods::new(&field, [3; 3], &one, (60, 1.0), Key::new(0), &Monitor::silent())
                .unwrap();
        let (mut a, mut b) = (vec![0.0; set.length()], vec![0.0; set.length()]);
        for (i, j) in [(0, 1), (3, 70), (10, 100)] {
            set.gather(set.match_at(i), &mut a);
            set.gather(set.match_at(j), &mut b);
            let truth: f32 = a.iter().zip(&b).map(|(a, b)| (a - b).powi(2)).sum();
            let short: f32 = set
                .descriptor(i)
                .iter()
                .zip(set.descriptor(j))
                .map(|(a, b)| (f32::from(*a) - f32::from(*b)).powi(2))
                .sum();
            let ratio = short / set.scale.powi(2) / truth;
            assert!((ratio - 1.0).abs() < 0.02, "{ratio}");
        }
    }

    #[test]
    fn a_window_larger_than_the_exemplar_is_refused() {
        let field = exemplar();
        let one = Symmetry::None.orientations(None);
        let set =
            Neighbourhoods::new(&field, [7; 3], &one, (8, 0.95), Key::new(0), &Monitor::silent());
        assert!(set.is_err());
    }
}
