//! Two-point correlation and novelty.

use numpy::{PyArray1, PyReadonlyArray3, ToPyArray};
use pyo3::prelude::*;

use super::cancellable;
use crate::correlation::{block_match, two_point as kernel};
use crate::volume::Boundary;

/// S₂ of the true voxels for r = 0 … `r_max`: radial, along z, along y, along x.
#[pyfunction]
#[pyo3(signature = (solid, r_max, boundary, threads=0))]
pub(super) fn two_point<'py>(
    py: Python<'py>,
    solid: PyReadonlyArray3<'py, bool>,
    r_max: usize,
    boundary: &str,
    threads: usize,
) -> PyResult<[Bound<'py, PyArray1<f64>>; 4]> {
    let boundary: Boundary = boundary.parse()?;
    let solid = solid.as_array();
    let found = cancellable::run(py, threads, None, |monitor| {
        kernel::two_point(solid, r_max, boundary, monitor)
    })?;
    let [z, y, x] = found.axes;
    Ok([found.radial, z, y, x].map(|curve| curve.to_pyarray(py)))
}

/// Novelty of blocks of `edge`³, plain and against the exemplar's mirror images too; none where
/// the exemplar or the volume is too small.
#[pyfunction]
#[pyo3(signature = (exemplar, volume, edge, probes, seed, threads=0))]
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
