//! `rust/src/geometry` for Python.

use numpy::{IntoPyArray, PyArray3, PyArrayMethods, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;

use super::cancellable;
use crate::geometry;
use crate::volume::Boundary;

/// Distance of each voxel of a phase to the nearest voxel centre outside it.
#[pyfunction]
#[pyo3(signature = (phase, voxel_size, *, boundary, cap=None, threads=0))]
pub(super) fn distance_transform<'py>(
    py: Python<'py>,
    phase: PyReadonlyArray3<'py, bool>,
    voxel_size: [f64; 3],
    boundary: &str,
    cap: Option<f64>,
    threads: usize,
) -> PyResult<Bound<'py, PyArray3<f32>>> {
    let boundary: Boundary = boundary.parse()?;
    // NumPy's allocator asks for huge pages.
    let out = PyArray3::zeros(py, phase.dims(), phase.is_fortran_contiguous());
    let phase = phase.as_array();
    let mut writable = out.readwrite();
    let view = writable.as_array_mut();
    cancellable::run(py, threads, None, |monitor| {
        geometry::distance_transform(phase, voxel_size, boundary, cap, view, monitor)
    })?;
    drop(writable);
    Ok(out)
}

/// Local thickness of each voxel of a phase: the diameter of the largest ball that contains it.
#[pyfunction]
#[pyo3(signature = (phase, voxel_size, *, boundary, threads=0))]
pub(super) fn local_thickness<'py>(
    py: Python<'py>,
    phase: PyReadonlyArray3<'py, bool>,
    voxel_size: [f64; 3],
    boundary: &str,
    threads: usize,
) -> PyResult<Bound<'py, PyArray3<f32>>> {
    let boundary: Boundary = boundary.parse()?;
    let out = PyArray3::zeros(py, phase.dims(), phase.is_fortran_contiguous());
    let phase = phase.as_array();
    let mut writable = out.readwrite();
    let view = writable.as_array_mut();
    cancellable::run(py, threads, None, |monitor| {
        geometry::local_thickness(phase, voxel_size, boundary, view, monitor)
    })?;
    drop(writable);
    Ok(out)
}

/// Clipped signed distance of a phase in voxels, positive inside; voxels that are not valid are unknown.
#[pyfunction]
#[pyo3(signature = (phase, clip, *, boundary, valid=None))]
pub(super) fn signed_distance<'py>(
    py: Python<'py>,
    phase: PyReadonlyArray3<'py, bool>,
    clip: usize,
    boundary: &str,
    valid: Option<PyReadonlyArray3<'py, bool>>,
) -> PyResult<Bound<'py, PyArray3<f32>>> {
    let view = phase.as_array();
    let (z, y, x) = view.dim();
    let boundary = boundary.parse()?;
    let valid = valid.as_ref().map(|v| v.as_array());
    let out = py.detach(|| geometry::signed_distance(view, valid, clip, boundary))?;
    out.into_pyarray(py).reshape([z, y, x])
}
