//! `rust/src/geometry` for Python.

use numpy::{IntoPyArray, PyArray3, PyArrayMethods, PyReadonlyArray3};
use pyo3::prelude::*;

use crate::geometry;

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
