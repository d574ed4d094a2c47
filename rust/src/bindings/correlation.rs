//! Correlation functions, runs, local porosity and novelty.

use numpy::{PyArray1, PyArray3, PyReadonlyArray3, ToPyArray};
use pyo3::prelude::*;

use super::cancellable;
use crate::correlation::two_point::{self as kernel, Lags};
use crate::correlation::{block_match, cluster, local_porosity as windows, runs};
use crate::volume::Boundary;

/// S₂ of the true voxels (of the two phases) for r = 0 … `r_max`: radial, along z, along y, along x.
#[pyfunction]
#[pyo3(signature = (first, r_max, *, boundary, voxel_size, second=None, threads=0))]
pub(super) fn two_point<'py>(
    py: Python<'py>,
    first: PyReadonlyArray3<'py, bool>,
    r_max: usize,
    boundary: &str,
    voxel_size: [f64; 3],
    second: Option<PyReadonlyArray3<'py, bool>>,
    threads: usize,
) -> PyResult<[Bound<'py, PyArray1<f64>>; 4]> {
    let lags = Lags { r_max, boundary: boundary.parse()?, voxel: voxel_size };
    let (first, second) = (first.as_array(), second.as_ref().map(|phase| phase.as_array()));
    let found = cancellable::run(py, threads, None, |monitor| {
        kernel::two_point(first, second, &lags, monitor)
    })?;
    Ok(curves(py, &found))
}

/// S₂ of the true voxels (of the two phases) for each lag from −`r_max` to `r_max`.
#[pyfunction]
#[pyo3(signature = (first, r_max, *, boundary, second=None, threads=0))]
pub(super) fn two_point_map<'py>(
    py: Python<'py>,
    first: PyReadonlyArray3<'py, bool>,
    r_max: usize,
    boundary: &str,
    second: Option<PyReadonlyArray3<'py, bool>>,
    threads: usize,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let lags = Lags::cubic(r_max, boundary.parse()?);
    let (first, second) = (first.as_array(), second.as_ref().map(|phase| phase.as_array()));
    let map = cancellable::run(py, threads, None, |monitor| {
        kernel::two_point_map(first, second, &lags, monitor)
    })?;
    Ok(map.as_standard_layout().to_pyarray(py))
}

/// C₂ of labelled clusters for r = 0 … `r_max`: radial, along z, along y, along x.
#[pyfunction]
#[pyo3(signature = (labels, clusters, r_max, *, boundary, voxel_size, threads=0))]
pub(super) fn two_point_cluster<'py>(
    py: Python<'py>,
    labels: PyReadonlyArray3<'py, u32>,
    clusters: usize,
    r_max: usize,
    boundary: &str,
    voxel_size: [f64; 3],
    threads: usize,
) -> PyResult<[Bound<'py, PyArray1<f64>>; 4]> {
    let lags = Lags { r_max, boundary: boundary.parse()?, voxel: voxel_size };
    let labels = labels.as_array();
    let found = cancellable::run(py, threads, None, |monitor| {
        cluster::two_point_cluster(labels, clusters, &lags, monitor)
    })?;
    Ok(curves(py, &found))
}

/// Numbers of runs by length along z, y and x: inside the volume, and cut by the border.
#[pyfunction]
#[pyo3(signature = (solid, *, boundary, threads=0))]
#[allow(clippy::type_complexity)]
pub(super) fn run_lengths<'py>(
    py: Python<'py>,
    solid: PyReadonlyArray3<'py, bool>,
    boundary: &str,
    threads: usize,
) -> PyResult<[(Bound<'py, PyArray1<u64>>, Bound<'py, PyArray1<u64>>); 3]> {
    let boundary: Boundary = boundary.parse()?;
    let solid = solid.as_array();
    let found =
        cancellable::run(py, threads, None, |monitor| runs::run_lengths(solid, boundary, monitor))?;
    Ok(found.map(|runs| (runs.inner.to_pyarray(py), runs.cut.to_pyarray(py))))
}

/// Windows by porosity, their number, and the sums of their pore voxels and of the squares of these.
#[pyfunction]
#[pyo3(signature = (solid, window, bins, *, boundary, threads=0))]
pub(super) fn local_porosity<'py>(
    py: Python<'py>,
    solid: PyReadonlyArray3<'py, bool>,
    window: [usize; 3],
    bins: usize,
    boundary: &str,
    threads: usize,
) -> PyResult<(Bound<'py, PyArray1<u64>>, u64, u128, u128)> {
    let boundary: Boundary = boundary.parse()?;
    let solid = solid.as_array();
    let found = cancellable::run(py, threads, None, |monitor| {
        windows::local_porosity(solid, window, bins, boundary, monitor)
    })?;
    let histogram = found.histogram.to_pyarray(py);
    Ok((histogram, found.windows, found.sum, found.sum_of_squares))
}

fn curves<'py>(py: Python<'py>, found: &kernel::TwoPoint) -> [Bound<'py, PyArray1<f64>>; 4] {
    let [z, y, x] = &found.axes;
    [&found.radial, z, y, x].map(|curve| curve.to_pyarray(py))
}

/// Novelty of blocks of `edge`³, plain and against the exemplar's mirror images too; none where
/// the exemplar or the volume is too small.
#[pyfunction]
#[pyo3(signature = (exemplar, volume, edge, *, probes, seed, threads=0))]
pub(super) fn novelty(
    py: Python<'_>,
    exemplar: PyReadonlyArray3<'_, f32>,
    volume: PyReadonlyArray3<'_, f32>,
    edge: usize,
    probes: usize,
    seed: u64,
    threads: usize,
) -> PyResult<Option<(f64, f64)>> {
    let (exemplar, volume) = (exemplar.as_array(), volume.as_array());
    let found = cancellable::run(py, threads, None, |monitor| {
        block_match::novelty(exemplar, volume, edge, probes, seed, monitor)
    })?;
    Ok(found.map(|novelty| (novelty.plain, novelty.mirrored)))
}
