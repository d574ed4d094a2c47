//! The optimisation step: overlapping windows become one volume (zhang_2017 §4.3).

use rayon::prelude::*;

use super::field::Field;
use super::lattice::Lattice;
use super::match_map::{Match, MatchMap};
use super::symmetry::View;
use crate::error::Result;
use crate::monitor::Monitor;
use crate::volume::{Shape, voxels};

/// What the windows carry.
pub struct Source<'a> {
    /// The exemplar.
    pub field: &'a Field,
    /// Factor on the weight of each of its voxels, one channel.
    pub emphasis: Option<&'a [f32]>,
    /// Its Laplacian, for the gradient term.
    pub laplacian: Option<&'a Field>,
    /// The exemplar under each orientation.
    pub views: &'a [View],
}

/// What the gradient term needs beside the means.
pub struct Gradients {
    /// Mean weight of the windows that cover a voxel.
    pub weight: Vec<f32>,
    /// Weighted mean of the exemplar's Laplacian.
    pub laplacian: Field,
}

/// The windows of one exemplar, with the weight of each site.
pub struct Part<'a> {
    /// What the windows carry.
    pub source: &'a Source<'a>,
    /// Where they come from.
    pub map: &'a MatchMap,
    /// One weight a site.
    pub weights: &'a [f32],
}

/// How the values of the windows become one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mixing {
    /// Distance from a voxel's present value, in field units, at which a window weighs a quarter: only
    /// the main mode of the values is averaged (Kopf et al. 2007; prieto_2011 §2.1.2). None: all of
    /// them.
    pub bandwidth: Option<f32>,
    /// Share of the way to the mean that a voxel goes.
    pub relaxation: f32,
}

impl Mixing {
    /// The plain weighted mean.
    pub const MEAN: Self = Self { bandwidth: None, relaxation: 1.0 };
}

/// Brings `field` to the weighted means of the windows that cover each voxel (the E-step's least
/// squares); voxels that no window covers keep what they have. Gradients are found if the first part's
/// source has a Laplacian.
///
/// Each voxel receives its windows in the order of the parts and their sites, on any number of
/// threads. Memory: what is returned, and two planes a thread.
///
/// # Errors
/// If the caller cancels.
pub fn blend(
    parts: &[Part<'_>],
    mixing: Mixing,
    field: &mut Field,
    monitor: &Monitor<'_>,
) -> Result<Option<Gradients>> {
    let shape = field.shape();
    let [_, ny, nx] = shape;
    let mut gradients =
        parts.first().and_then(|part| part.source.laplacian).map(|laplacian| Gradients {
            weight: vec![0.0; voxels(shape)],
            laplacian: Field::zeros(shape, laplacian.channels()),
        });
    let mut planes: Vec<Plane<'_>> = (0..shape[0])
        .map(|z| Plane { z, means: Vec::new(), weight: None, laplacians: Vec::new() })
        .collect();
    for (z, values) in channel_planes(field) {
        planes[z].means.push(values);
    }
    if let Some(Gradients { weight, laplacian }) = &mut gradients {
        for (plane, weight) in planes.iter_mut().zip(weight.chunks_mut(ny * nx)) {
            plane.weight = Some(weight);
        }
        for (z, values) in channel_planes(laplacian) {
            planes[z].laplacians.push(values);
        }
    }
    let coverage: Vec<[Vec<u32>; 3]> =
        parts.iter().map(|part| std::array::from_fn(|a| part.map.lattice.coverage(a))).collect();
    planes.par_iter_mut().try_for_each_init(Vec::new, |sums, plane| {
        monitor.check()?;
        plane.fill(parts, mixing, sums, shape);
        plane.weigh(&coverage, nx);
        Ok(())
    })?;
    drop(planes);
    Ok(gradients)
}

/// All planes of all channels, with their z.
fn channel_planes(field: &mut Field) -> impl Iterator<Item = (usize, &mut [f32])> {
    let [nz, ny, nx] = field.shape();
    field.values_mut().chunks_mut(ny * nx).enumerate().map(move |(i, values)| (i % nz, values))
}

/// One plane of everything that is summed, a slice a channel.
struct Plane<'a> {
    z: usize,
    means: Vec<&'a mut [f32]>,
    weight: Option<&'a mut [f32]>,
    laplacians: Vec<&'a mut [f32]>,
}

impl Plane<'_> {
    fn fill(&mut self, parts: &[Part<'_>], mixing: Mixing, sums: &mut Vec<f32>, shape: Shape) {
        let [nz, ny, nx] = shape;
        let voxels = ny * nx;
        sums.clear();
        sums.resize((1 + self.means.len()) * voxels, 0.0);
        let (total, means) = sums.split_at_mut(voxels);
        for &Part { source, map, weights } in parts {
            for (sz, &oz) in map.lattice.origins[0].iter().enumerate() {
                let dz = (self.z + nz - oz) % nz;
                if dz >= map.lattice.window[0] {
                    continue;
                }
                let layer = Layer { source, map, weights, sz, dz };
                if source.emphasis.is_some() || mixing.bandwidth.is_some() {
                    add_selected(&layer, mixing.bandwidth, &self.means, total, means);
                } else {
                    add_weights(&layer, total);
                    for (c, sums) in means.chunks_exact_mut(voxels).enumerate() {
                        add_layer(&layer, source.field.channel(c), sums);
                    }
                }
                for (c, sums) in self.laplacians.iter_mut().enumerate() {
                    if let Some(laplacian) = source.laplacian {
                        add_layer(&layer, laplacian.channel(c), sums);
                    }
                }
            }
        }
        let share = mixing.relaxation;
        for (value, sums) in self.means.iter_mut().zip(means.chunks_exact(voxels)) {
            for ((value, sum), total) in value.iter_mut().zip(sums).zip(&*total) {
                let mean = if *total > 0.0 { sum / total } else { *value };
                *value = if share < 1.0 { *value + share * (mean - *value) } else { mean };
            }
        }
        for sums in &mut self.laplacians {
            for (sum, total) in sums.iter_mut().zip(&*total) {
                *sum = if *total > 0.0 { *sum / total } else { *sum };
            }
        }
        if let Some(weight) = &mut self.weight {
            weight.copy_from_slice(total);
        }
    }

    /// Turns summed weights into means over the windows that cover each voxel.
    fn weigh(&mut self, coverage: &[[Vec<u32>; 3]], nx: usize) {
        let Some(weight) = &mut self.weight else { return };
        for (y, row) in weight.chunks_mut(nx).enumerate() {
            for (x, weight) in row.iter_mut().enumerate() {
                let windows: u32 = coverage.iter().map(|c| c[0][self.z] * c[1][y] * c[2][x]).sum();
                *weight /= windows as f32;
            }
        }
    }
}

/// The rows that one layer of sites adds to one plane.
struct Layer<'a> {
    source: &'a Source<'a>,
    map: &'a MatchMap,
    weights: &'a [f32],
    sz: usize,
    dz: usize,
}

impl Layer<'_> {
    /// Calls `visit(x origin, match, weight)` for the sites of a row.
    #[inline(always)]
    fn for_each_site(&self, sy: usize, mut visit: impl FnMut(usize, Match, f32)) {
        let origins = &self.map.lattice.origins;
        let nx = origins[2].len();
        let first = (self.sz * origins[1].len() + sy) * nx;
        // Every second site first: neighbours overlap, and a sum waits for the one just stored.
        for start in 0..2 {
            for sx in (start..nx).step_by(2) {
                let m = self.map.matches[first + sx];
                if m.is_some() {
                    visit(origins[2][sx], m, self.weights[first + sx]);
                }
            }
        }
    }
}

/// Adds the weight of each site to all voxels of its window in a plane.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
fn add_weights(layer: &Layer<'_>, plane: &mut [f32]) {
    let Lattice { shape: [_, ny, nx], window: [_, height, window], origins, .. } =
        &layer.map.lattice;
    let mut line = vec![0.0f32; *nx];
    for (sy, oy) in origins[1].iter().enumerate() {
        line.fill(0.0);
        layer.for_each_site(sy, |ox, _, weight| {
            let head = *window.min(&(nx - ox));
            line[ox..ox + head].iter_mut().for_each(|sum| *sum += weight);
            line[..window - head].iter_mut().for_each(|sum| *sum += weight);
        });
        for dy in 0..*height {
            let row = &mut plane[(oy + dy) % ny * nx..][..*nx];
            row.iter_mut().zip(&line).for_each(|(sum, weight)| *sum += weight);
        }
    }
}

/// Adds rows of values, each times its site's weight, to a plane.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
fn add_layer(layer: &Layer<'_>, values: &[f32], plane: &mut [f32]) {
    let Lattice { shape: [_, ny, nx], window: [_, height, window], origins, .. } =
        &layer.map.lattice;
    let (window, nx) = (*window, *nx);
    let mut rows = vec![0; *height];
    for (sy, oy) in origins[1].iter().enumerate() {
        rows.iter_mut().enumerate().for_each(|(dy, row)| *row = (oy + dy) % ny * nx);
        layer.for_each_site(sy, |ox, m, weight| {
            let view = &layer.source.views[usize::from(m.orientation)];
            let [mz, my, mx] = m.origin.map(usize::from);
            let head = window.min(nx - ox);
            for (dy, &row) in rows.iter().enumerate() {
                let start = view.index([mz + layer.dz, my + dy, mx]);
                let row = &mut plane[row..row + nx];
                if view.stride[2] == 1 || window == 1 {
                    let from = &values[start..start + window];
                    if head == window {
                        add_row(&mut row[ox..ox + window], from, weight);
                    } else {
                        add_row(&mut row[ox..], &from[..head], weight);
                        add_row(&mut row[..window - head], &from[head..], weight);
                    }
                } else {
                    let mut at = start as isize;
                    for dx in 0..window {
                        let x = if dx < head { ox + dx } else { dx - head };
                        row[x] += weight * values[at as usize];
                        at += view.stride[2];
                    }
                }
            }
        });
    }
}

/// Adds the values of all channels to their planes, and their weights to `total`: each times its
/// site's weight, the emphasis of its voxel, and what its distance from the `present` value leaves.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
fn add_selected(
    layer: &Layer<'_>,
    bandwidth: Option<f32>,
    present: &[&mut [f32]],
    total: &mut [f32],
    planes: &mut [f32],
) {
    let Lattice { shape: [_, ny, nx], window: [_, height, window], origins, .. } =
        &layer.map.lattice;
    let (voxels, channels) = (ny * nx, present.len());
    let sharpness = bandwidth.map(|b| b.powi(-2));
    let mut values = vec![0.0f32; channels * window];
    let mut factors = vec![0.0f32; *window];
    for (sy, oy) in origins[1].iter().enumerate() {
        layer.for_each_site(sy, |ox, m, weight| {
            let view = &layer.source.views[usize::from(m.orientation)];
            let [mz, my, mx] = m.origin.map(usize::from);
            let head = *window.min(&(nx - ox));
            for dy in 0..*height {
                let start = view.index([mz + layer.dz, my + dy, mx]);
                for (c, values) in values.chunks_exact_mut(*window).enumerate() {
                    take(layer.source.field.channel(c), start, view.stride[2], values);
                }
                match layer.source.emphasis {
                    Some(emphasis) => take(emphasis, start, view.stride[2], &mut factors),
                    None => factors.fill(1.0),
                }
                let row = (oy + dy) % ny * nx;
                for (at, part) in [(row + ox, 0..head), (row, head..*window)] {
                    let here = at..at + part.len();
                    let factors = &mut factors[part.clone()];
                    if let Some(sharpness) = sharpness {
                        weaken(
                            factors,
                            sharpness,
                            present,
                            here.clone(),
                            &values,
                            *window,
                            part.start,
                        );
                    }
                    for (sum, factor) in total[here.clone()].iter_mut().zip(factors.iter_mut()) {
                        *factor *= weight;
                        *sum += *factor;
                    }
                    for (plane, values) in
                        planes.chunks_exact_mut(voxels).zip(values.chunks_exact(*window))
                    {
                        let values = values[part.clone()].iter().zip(&*factors);
                        for (sum, (value, factor)) in plane[here.clone()].iter_mut().zip(values) {
                            *sum += factor * value;
                        }
                    }
                }
            }
        });
    }
}

/// Copies values that lie `stride` apart.
#[inline(always)]
fn take(from: &[f32], start: usize, stride: isize, out: &mut [f32]) {
    let mut at = start as isize;
    for v in out {
        *v = from[at as usize];
        at += stride;
    }
}

/// Divides the factor of each value by (1 + (distance from the present / bandwidth)²)²: a long tail,
/// so that a voxel whose windows all disagree still follows them.
#[inline(always)]
fn weaken(
    factors: &mut [f32],
    sharpness: f32,
    present: &[&mut [f32]],
    here: std::ops::Range<usize>,
    values: &[f32],
    window: usize,
    first: usize,
) {
    for (i, factor) in factors.iter_mut().enumerate() {
        let mut square = 0.0;
        for (c, plane) in present.iter().enumerate() {
            let off = values[c * window + first + i] - plane[here.start + i];
            square += off * off;
        }
        let far = 1.0 + sharpness * square;
        *factor /= far * far;
    }
}

/// `row += weight * from`; the usual lengths are unrolled.
#[inline(always)]
fn add_row(row: &mut [f32], from: &[f32], weight: f32) {
    #[inline(always)]
    fn fixed<const N: usize>(row: &mut [f32], from: &[f32], weight: f32) {
        if let (Some(row), Some(from)) = (row.first_chunk_mut::<N>(), from.first_chunk::<N>()) {
            for i in 0..N {
                row[i] += weight * from[i];
            }
        }
    }
    match row.len() {
        1 => fixed::<1>(row, from, weight),
        4 => fixed::<4>(row, from, weight),
        8 => fixed::<8>(row, from, weight),
        10 => fixed::<10>(row, from, weight),
        _ => row.iter_mut().zip(from).for_each(|(v, e)| *v += weight * e),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Key;
    use crate::texture::match_map::random_matches;
    use crate::texture::symmetry::Symmetry;
    use crate::volume::{Boundary, position};

    /// A voxel's windows one by one, and the mean that the paper and Kopf et al. (2007) write down.
    fn slow(parts: &[Part<'_>], mixing: Mixing, field: &Field) -> Field {
        let shape = field.shape();
        let mut out = field.clone();
        for at in 0..voxels(shape) {
            let place = position(shape, at);
            let mut total = 0.0f64;
            let mut sums = vec![0.0f64; field.channels()];
            for Part { source, map, weights } in parts {
                let [sz, sy, sx] = map.lattice.sites();
                for site in 0..sz * sy * sx {
                    let number = position([sz, sy, sx], site);
                    let within: [usize; 3] = std::array::from_fn(|a| {
                        let origin = map.lattice.origins[a][number[a]];
                        (place[a] + shape[a] - origin) % shape[a]
                    });
                    if within.iter().zip(map.lattice.window).any(|(d, w)| *d >= w) {
                        continue;
                    }
                    let m = map.matches[site];
                    let from = std::array::from_fn(|a| usize::from(m.origin[a]) + within[a]);
                    let from = source.views[usize::from(m.orientation)].index(from);
                    let mut weight = f64::from(weights[site]);
                    weight *= source.emphasis.map_or(1.0, |e| f64::from(e[from]));
                    let off: f64 = (0..field.channels())
                        .map(|c| source.field.channel(c)[from] - field.channel(c)[at])
                        .map(|off| f64::from(off).powi(2))
                        .sum();
                    if let Some(width) = mixing.bandwidth {
                        weight /= (1.0 + off / f64::from(width).powi(2)).powi(2);
                    }
                    total += weight;
                    for (c, sum) in sums.iter_mut().enumerate() {
                        *sum += weight * f64::from(source.field.channel(c)[from]);
                    }
                }
            }
            for (c, sum) in sums.iter().enumerate() {
                let value = f64::from(field.channel(c)[at]);
                let share = f64::from(mixing.relaxation);
                if total > 0.0 {
                    out.channel_mut(c)[at] = (value + share * (sum / total - value)) as f32;
                }
            }
        }
        out
    }

    #[test]
    fn blends_are_means_with_emphasis_and_bandwidth() {
        let key = Key::new(5);
        let random = |shape: Shape, channels: usize, from: u64| {
            let values = (0..(channels * voxels(shape)) as u64).map(|i| 255.0 * key.unit(from + i));
            Field::new(shape, channels, values.collect()).unwrap()
        };
        let (shape, own) = ([6, 7, 9], [5, 6, 8]);
        let exemplar = random(own, 2, 0);
        let emphasis: Vec<f32> = (0..voxels(own) as u64).map(|i| key.unit(9999 + i)).collect();
        let orientations = Symmetry::Full.orientations(None);
        let views: Vec<View> = orientations.iter().map(|o| o.view(own)).collect();
        let window = [3, 2, 3];
        let limits: Vec<Shape> =
            views.iter().map(|view| std::array::from_fn(|a| view.shape[a] - window[a])).collect();
        let lattice = Lattice::new(shape, window, [2; 3], [1, 0, 2], Boundary::Periodic);
        let map = random_matches(lattice, &limits, Key::new(2));
        let weights: Vec<f32> =
            (0..map.matches.len() as u64).map(|i| 0.1 + key.unit(5555 + i)).collect();
        let start = random(shape, 2, 77_777);
        for emphasis in [None, Some(&emphasis[..])] {
            for bandwidth in [None, Some(40.0)] {
                for relaxation in [1.0, 0.3] {
                    let mixing = Mixing { bandwidth, relaxation };
                    let source =
                        Source { field: &exemplar, emphasis, laplacian: None, views: &views };
                    let part = Part { source: &source, map: &map, weights: &weights };
                    let parts = [part, Part { source: &source, map: &map, weights: &weights }];
                    for parts in [&parts[..1], &parts[..]] {
                        let mut fast = start.clone();
                        blend(parts, mixing, &mut fast, &Monitor::silent()).unwrap();
                        let expected = slow(parts, mixing, &start);
                        for c in 0..2 {
                            for (a, b) in fast.channel(c).iter().zip(expected.channel(c)) {
                                assert!((a - b).abs() < 0.01, "{mixing:?}: {a} {b}");
                            }
                        }
                    }
                }
            }
        }
    }
}
