//! The search phase by itself, on descriptors that lie open: what tests check and races measure.

use ndarray::{Array3, Array4, ArrayView3, ArrayView4, CowArray, Ix4};
use rayon::prelude::*;

use super::field::Field;
use super::lattice::Lattice;
use super::match_map::{Match, MatchMap};
use super::matching::Scratch;
use super::neighbourhoods::{BLOCK, Neighbourhoods, limit_of};
use super::parameters::{Backend, Stage};
use super::search::{Scene, prepare};
use super::symmetry::Orientation;
use crate::error::{Error, Result};
use crate::monitor::Monitor;
use crate::rng::Key;
use crate::volume::{Boundary, Shape, voxels};

/// Descriptors (z, y, x, component) of all windows of an exemplar, and of the windows of a volume on
/// a lattice that is not shifted.
///
/// # Errors
/// If a window does not fit into the exemplar or the volume, their channels differ, the step is not
/// from 1 to the window, or the caller cancels.
pub fn describe(
    exemplar: &Field,
    volume: &Field,
    Stage { window, step }: Stage,
    components: (usize, f32),
    key: Key,
    monitor: &Monitor<'_>,
) -> Result<[Array4<i16>; 2]> {
    if step == 0 || step > window {
        return Err(Error::parameter("step", step, "must be from 1 to the window"));
    }
    let fits = volume.shape().iter().all(|&n| n >= window);
    if !fits || volume.channels() != exemplar.channels() {
        let value = (volume.channels(), volume.shape());
        let allowed = "must hold a window, and have the exemplar's channels";
        return Err(Error::parameter("volume", value, allowed));
    }
    let set = Neighbourhoods::new(
        exemplar,
        [window; 3],
        &[Orientation::IDENTITY],
        components,
        key,
        monitor,
    )?;
    let lattice = Lattice::new(volume.shape(), [window; 3], [step; 3], [0; 3], Boundary::Open);
    let (sites, dims) = (lattice.sites(), set.dims());
    let mut queries = vec![0i16; voxels(sites) * dims];
    queries.par_chunks_mut(BLOCK * dims).enumerate().try_for_each_init(
        Scratch::default,
        |scratch, (block, out)| {
            monitor.check()?;
            let all = vec![true; out.len() / dims];
            scratch.describe(&set, volume, &lattice, block * BLOCK, &all);
            out.copy_from_slice(&scratch.queries);
            Ok(())
        },
    )?;
    let grid = set.limit(0).map(|n| n + 1);
    Ok([shaped(grid, set.descriptors().to_vec()), shaped(sites, queries)])
}

/// Positions, in C order, of the windows that match: one pass without penalties.
///
/// Windows are described as by [`describe`]; the queries lie `step` voxels apart, and `start` holds
/// the positions that the pass before found.
///
/// # Errors
/// If the arrays do not fit together, a value is out of range, or the caller cancels.
pub fn find(
    descriptors: ArrayView4<'_, i16>,
    queries: ArrayView4<'_, i16>,
    start: ArrayView3<'_, i64>,
    step: usize,
    backend: Backend,
    key: Key,
    monitor: &Monitor<'_>,
) -> Result<Array3<i64>> {
    let (grid, dims) = split(&descriptors);
    let (sites, _) = split(&queries);
    check(&descriptors, &queries, &start, step)?;
    let (descriptors, queries) = (descriptors.as_standard_layout(), queries.as_standard_layout());
    let queries = values(&queries);
    // A window that is described is a point: only the way from one to the next counts.
    let grid = Field::zeros(grid, 1);
    let set = Neighbourhoods::described(&grid, values(&descriptors).to_vec());
    let shape = sites.map(|n| (n - 1) * step + 1);
    let lattice = Lattice::new(shape, [1; 3], [step; 3], [0; 3], Boundary::Open);
    let matches = start.iter().map(|&at| set.match_at(at as usize)).collect();
    let previous = MatchMap { lattice: lattice.clone(), matches };
    let scene = Scene::new(&set, &previous, &lattice, None, None, key);
    let backend = prepare(backend, &set)?;
    let mut found = vec![Match::NONE; voxels(sites)];
    found.par_chunks_mut(BLOCK).enumerate().try_for_each(|(block, out)| {
        monitor.check()?;
        let first = block * BLOCK;
        let own = &queries[first * dims..(first + out.len()) * dims];
        backend.search(&scene, first, own, &vec![true; out.len()], out);
        Ok(())
    })?;
    let positions = found.iter().map(|&m| set.index(m) as i64).collect();
    Ok(Array3::from_shape_vec(sites, positions).unwrap_or_default())
}

fn check(
    descriptors: &ArrayView4<'_, i16>,
    queries: &ArrayView4<'_, i16>,
    start: &ArrayView3<'_, i64>,
    step: usize,
) -> Result<()> {
    let most = usize::from(u16::MAX);
    let (grid, dims) = split(descriptors);
    let (sites, others) = split(queries);
    if dims == 0 || !dims.is_multiple_of(16) || others != dims {
        let allowed = "must have the same length, a multiple of 16";
        return Err(Error::parameter("descriptors, queries", (dims, others), allowed));
    }
    if grid.iter().chain(&sites).any(|&n| n == 0 || n >= most) {
        let allowed = format!("must have from 1 to {} windows along each axis", most - 1);
        return Err(Error::parameter("descriptors, queries", (grid, sites), allowed));
    }
    if step == 0 || sites.iter().any(|n| n.saturating_mul(step) >= most) {
        let allowed = format!("must be at least 1, and reach over fewer than {most} voxels");
        return Err(Error::parameter("step", step, allowed));
    }
    let limit = limit_of(dims);
    for values in [descriptors, queries] {
        let largest = values.iter().fold(0, |most: u16, v| most.max(v.unsigned_abs()));
        if f32::from(largest) > limit {
            let allowed = format!("must be from −{limit} to {limit} for {dims} components");
            return Err(Error::parameter("descriptors, queries", largest, allowed));
        }
    }
    let within = 0..voxels(grid) as i64;
    if start.dim() != sites.into() || !start.iter().all(|at| within.contains(at)) {
        let allowed = format!("must have the queries' shape and values in {within:?}");
        return Err(Error::parameter("start", start.dim(), allowed));
    }
    Ok(())
}

/// The grid of windows, and the length of a descriptor.
fn split(windows: &ArrayView4<'_, i16>) -> (Shape, usize) {
    let (z, y, x, dims) = windows.dim();
    ([z, y, x], dims)
}

fn values<'a>(windows: &'a CowArray<'_, i16, Ix4>) -> &'a [i16] {
    windows.as_slice().unwrap_or_default()
}

fn shaped([z, y, x]: Shape, values: Vec<i16>) -> Array4<i16> {
    let dims = values.len() / (z * y * x);
    Array4::from_shape_vec([z, y, x, dims], values).unwrap_or_default()
}
