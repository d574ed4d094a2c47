//! The optimisation step: overlapping windows become one volume (zhang_2017 §4.3).

use rayon::prelude::*;

use super::field::Field;
use super::lattice::Lattice;
use super::match_map::{Match, MatchMap};
use super::symmetry::View;
use crate::error::Result;
use crate::monitor::Monitor;
use crate::volume::Shape;

/// Weighted means over the windows that cover each voxel.
pub struct Blend {
    /// Mean of the exemplar's values; voxels that no window covers keep what they had.
    pub mean: Field,
    /// Mean weight of the covering windows.
    pub weight: Vec<f32>,
    /// Mean of the exemplar's Laplacian, if it was asked for.
    pub laplacian: Option<Field>,
}

/// What the windows carry.
pub struct Source<'a> {
    /// The exemplar.
    pub field: &'a Field,
    /// Its Laplacian, for the gradient term.
    pub laplacian: Option<&'a Field>,
    /// The exemplar under each orientation.
    pub views: &'a [View],
}

/// Averages the matched windows into a volume (the E-step's least squares), `slab` planes at a time.
///
/// Each voxel receives its windows in the order of the sites, whatever the slabs, so the result does
/// not depend on them. Memory: what is returned, and as much again for the slabs in work.
///
/// # Errors
/// If the caller cancels.
pub fn blend(
    source: &Source<'_>,
    map: &MatchMap,
    weights: &[f32],
    previous: &Field,
    slab: usize,
    monitor: &Monitor<'_>,
) -> Result<Blend> {
    let shape = map.lattice.shape;
    let channels = source.field.channels();
    let plane = shape[1] * shape[2];
    let mut mean = Field::zeros(shape, channels);
    let mut laplacian = source.laplacian.map(|_| Field::zeros(shape, channels));
    let mut weight = vec![0.0f32; shape[0] * plane];

    // Every slab's part of every array: the sums are made in place.
    let length = slab.max(1) * plane;
    let mut parts: Vec<Slab<'_>> = weight
        .chunks_mut(length)
        .enumerate()
        .map(|(i, weight)| Slab {
            first: i * slab.max(1),
            weight,
            mean: Vec::new(),
            laplacian: Vec::new(),
        })
        .collect();
    for c in split_channels(&mut mean, channels, length) {
        for (part, values) in parts.iter_mut().zip(c) {
            part.mean.push(values);
        }
    }
    if let Some(laplacian) = &mut laplacian {
        for c in split_channels(laplacian, channels, length) {
            for (part, values) in parts.iter_mut().zip(c) {
                part.laplacian.push(values);
            }
        }
    }
    let coverage: [Vec<u32>; 3] = std::array::from_fn(|a| map.lattice.coverage(a));
    parts.par_iter_mut().try_for_each(|part| {
        monitor.check()?;
        part.add_windows(source, map, weights);
        part.normalise(previous, &coverage, shape);
        Ok(())
    })?;
    drop(parts);
    Ok(Blend { mean, weight, laplacian })
}

fn split_channels(
    field: &mut Field,
    channels: usize,
    length: usize,
) -> Vec<std::slice::ChunksMut<'_, f32>> {
    let n = crate::volume::voxels(field.shape());
    let mut rest = field.values_mut();
    (0..channels)
        .map(|_| {
            let (channel, tail) = std::mem::take(&mut rest).split_at_mut(n);
            rest = tail;
            channel.chunks_mut(length)
        })
        .collect()
}

struct Slab<'a> {
    first: usize,
    weight: &'a mut [f32],
    mean: Vec<&'a mut [f32]>,
    laplacian: Vec<&'a mut [f32]>,
}

impl Slab<'_> {
    fn add_windows(&mut self, source: &Source<'_>, map: &MatchMap, weights: &[f32]) {
        let Lattice { shape, window, origins, .. } = &map.lattice;
        let plane = shape[1] * shape[2];
        let planes = self.weight.len() / plane.max(1);
        for (sz, &oz) in origins[0].iter().enumerate() {
            for dz in 0..*window {
                let z = (oz + dz) % shape[0];
                if !(self.first..self.first + planes).contains(&z) {
                    continue;
                }
                let start = (z - self.first) * plane;
                let layer = Layer { source, map, weights, sz, dz };
                let plane = start..start + plane;
                let mut sums = vec![(None, &mut self.weight[plane.clone()])];
                for (c, mean) in self.mean.iter_mut().enumerate() {
                    sums.push((Some(source.field.channel(c)), &mut mean[plane.clone()]));
                }
                let laplacians = source.laplacian.iter().zip(&mut self.laplacian);
                sums.extend(
                    laplacians
                        .enumerate()
                        .map(|(c, (from, sum))| (Some(from.channel(c)), &mut sum[plane.clone()])),
                );
                add_layer(&layer, &mut sums);
            }
        }
    }

    fn normalise(&mut self, previous: &Field, coverage: &[Vec<u32>; 3], shape: Shape) {
        let [_, ny, nx] = shape;
        for (row, weight) in self.weight.chunks_mut(nx).enumerate() {
            let (inside, first) = (row * nx, self.first * ny * nx + row * nx);
            for (c, mean) in self.mean.iter_mut().enumerate() {
                let previous = &previous.channel(c)[first..first + nx];
                let mean = mean[inside..inside + nx].iter_mut().zip(previous);
                for ((mean, previous), &sum) in mean.zip(&*weight) {
                    *mean = if sum > 0.0 { *mean / sum } else { *previous };
                }
            }
            for laplacian in &mut self.laplacian {
                for (value, &sum) in laplacian[inside..inside + nx].iter_mut().zip(&*weight) {
                    *value = if sum > 0.0 { *value / sum } else { *value };
                }
            }
            let lines = coverage[0][self.first + row / ny] * coverage[1][row % ny];
            for (weight, count) in weight.iter_mut().zip(&coverage[2]) {
                *weight /= (lines * count) as f32;
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
    /// Calls `visit(x origin, output rows, match, weight)` for the sites of the layer, in order.
    #[inline(always)]
    fn for_each_site(&self, mut visit: impl FnMut(usize, &[usize], Match, f32)) {
        let Lattice { shape, window, origins, .. } = &self.map.lattice;
        let (ny, nx) = (origins[1].len(), origins[2].len());
        let mut rows = Vec::with_capacity(*window);
        for (sy, &oy) in origins[1].iter().enumerate() {
            rows.clear();
            rows.extend((oy..oy + window).map(|y| y % shape[1]));
            // Every second site first: neighbours overlap, and a sum waits for the one just stored.
            for sx in (0..nx).step_by(2).chain((1..nx).step_by(2)) {
                let site = (self.sz * ny + sy) * nx + sx;
                let m = self.map.matches[site];
                if m.is_some() {
                    visit(origins[2][sx], &rows, m, self.weights[site]);
                }
            }
        }
    }
}

/// Adds the rows of some arrays, or ones, each times its site's weight, to a plane of sums of each.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
fn add_layer(layer: &Layer<'_>, sums: &mut [(Option<&[f32]>, &mut [f32])]) {
    let window = layer.map.lattice.window;
    let nx = layer.map.lattice.shape[2];
    let ones = vec![1.0; window];
    layer.for_each_site(|ox, rows, m, weight| {
        let view = &layer.source.views[usize::from(m.orientation)];
        let [mz, my, mx] = m.origin.map(usize::from);
        let head = window.min(nx - ox);
        for (dy, &y) in rows.iter().enumerate() {
            let start = view.index([mz + layer.dz, my + dy, mx]);
            for (values, plane) in &mut *sums {
                let row = &mut plane[y * nx..(y + 1) * nx];
                if let Some(values) = values.filter(|_| view.stride[2] != 1) {
                    let mut at = start as isize;
                    for dx in 0..window {
                        let x = if dx < head { ox + dx } else { dx - head };
                        row[x] += weight * values[at as usize];
                        at += view.stride[2];
                    }
                    continue;
                }
                let from = values.map_or(&ones[..], |values| &values[start..start + window]);
                if head == window {
                    add_row(&mut row[ox..ox + window], from, weight);
                } else {
                    add_row(&mut row[ox..], &from[..head], weight);
                    add_row(&mut row[..window - head], &from[head..], weight);
                }
            }
        }
    });
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
