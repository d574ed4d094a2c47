//! The optimisation step: overlapping windows become one volume (zhang_2017 §4.3).

use rayon::prelude::*;

use super::field::Field;
use super::lattice::Lattice;
use super::match_map::{Match, MatchMap};
use super::symmetry::View;
use crate::error::Result;
use crate::monitor::Monitor;
use crate::volume::voxels;

/// What the windows carry.
pub struct Source<'a> {
    /// The exemplar.
    pub field: &'a Field,
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

/// Sets `field` to the weighted means of the windows that cover each voxel (the E-step's least
/// squares); voxels that no window covers keep what they have. Gradients are found if the source has a
/// Laplacian.
///
/// Each voxel receives its windows in the order of the sites, on any number of threads. Memory: what is
/// returned, and two planes a thread.
///
/// # Errors
/// If the caller cancels.
pub fn blend(
    source: &Source<'_>,
    map: &MatchMap,
    weights: &[f32],
    field: &mut Field,
    monitor: &Monitor<'_>,
) -> Result<Option<Gradients>> {
    let [_, ny, nx] = map.lattice.shape;
    let mut gradients = source.laplacian.map(|laplacian| Gradients {
        weight: vec![0.0; voxels(map.lattice.shape)],
        laplacian: Field::zeros(map.lattice.shape, laplacian.channels()),
    });
    let mut planes: Vec<Plane<'_>> = (0..map.lattice.shape[0])
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
    let coverage: [Vec<u32>; 3] = std::array::from_fn(|a| map.lattice.coverage(a));
    planes.par_iter_mut().try_for_each_init(Vec::new, |sums, plane| {
        monitor.check()?;
        plane.fill(source, map, weights, sums, &coverage);
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
    fn fill(
        &mut self,
        source: &Source<'_>,
        map: &MatchMap,
        weights: &[f32],
        sums: &mut Vec<f32>,
        coverage: &[Vec<u32>; 3],
    ) {
        let Lattice { shape: [nz, ny, nx], window, origins, .. } = &map.lattice;
        let voxels = ny * nx;
        sums.clear();
        sums.resize((1 + self.means.len()) * voxels, 0.0);
        let (total, means) = sums.split_at_mut(voxels);
        for (sz, &oz) in origins[0].iter().enumerate() {
            let dz = (self.z + nz - oz) % nz;
            if dz >= *window {
                continue;
            }
            let layer = Layer { source, map, weights, sz, dz };
            add_weights(&layer, total);
            for (c, sums) in means.chunks_exact_mut(voxels).enumerate() {
                add_layer(&layer, source.field.channel(c), sums);
            }
            for (c, sums) in self.laplacians.iter_mut().enumerate() {
                if let Some(laplacian) = source.laplacian {
                    add_layer(&layer, laplacian.channel(c), sums);
                }
            }
        }
        for (mean, sums) in self.means.iter_mut().zip(means.chunks_exact(voxels)) {
            for ((mean, sum), total) in mean.iter_mut().zip(sums).zip(&*total) {
                *mean = if *total > 0.0 { sum / total } else { *mean };
            }
        }
        for sums in &mut self.laplacians {
            for (sum, total) in sums.iter_mut().zip(&*total) {
                *sum = if *total > 0.0 { *sum / total } else { *sum };
            }
        }
        if let Some(weight) = &mut self.weight {
            let rows = weight.chunks_mut(*nx).zip(total.chunks(*nx));
            for ((row, total), lines) in rows.zip(&coverage[1]) {
                let lines = coverage[0][self.z] * lines;
                for ((weight, total), count) in row.iter_mut().zip(total).zip(&coverage[2]) {
                    *weight = total / (lines * count) as f32;
                }
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
    let Lattice { shape: [_, ny, nx], window, origins, .. } = &layer.map.lattice;
    let mut line = vec![0.0f32; *nx];
    for (sy, oy) in origins[1].iter().enumerate() {
        line.fill(0.0);
        layer.for_each_site(sy, |ox, _, weight| {
            let head = *window.min(&(nx - ox));
            line[ox..ox + head].iter_mut().for_each(|sum| *sum += weight);
            line[..window - head].iter_mut().for_each(|sum| *sum += weight);
        });
        for dy in 0..*window {
            let row = &mut plane[(oy + dy) % ny * nx..][..*nx];
            row.iter_mut().zip(&line).for_each(|(sum, weight)| *sum += weight);
        }
    }
}

/// Adds rows of values, each times its site's weight, to a plane.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
fn add_layer(layer: &Layer<'_>, values: &[f32], plane: &mut [f32]) {
    let Lattice { shape: [_, ny, nx], window, origins, .. } = &layer.map.lattice;
    let (window, nx) = (*window, *nx);
    let mut rows = vec![0; window];
    for (sy, oy) in origins[1].iter().enumerate() {
        rows.iter_mut().enumerate().for_each(|(dy, row)| *row = (oy + dy) % ny * nx);
        layer.for_each_site(sy, |ox, m, weight| {
            let view = &layer.source.views[usize::from(m.orientation)];
            let [mz, my, mx] = m.origin.map(usize::from);
            let head = window.min(nx - ox);
            for (dy, &row) in rows.iter().enumerate() {
                let start = view.index([mz + layer.dz, my + dy, mx]);
                let row = &mut plane[row..row + nx];
                if view.stride[2] == 1 {
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
        4 => fixed::<4>(row, from, weight),
        8 => fixed::<8>(row, from, weight),
        10 => fixed::<10>(row, from, weight),
        _ => row.iter_mut().zip(from).for_each(|(v, e)| *v += weight * e),
    }
}
