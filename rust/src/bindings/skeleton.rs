//! Thinning and the graph of a skeleton.

use numpy::{PyArray3, PyArrayMethods, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;

use super::cancellable;
use crate::topology::thinning::{self, Kind, Method};

/// What thinning leaves of the true voxels, in their memory order.
#[pyfunction]
#[pyo3(signature = (solid, *, kind, method, threads=0))]
pub(super) fn thin<'py>(
    py: Python<'py>,
    solid: PyReadonlyArray3<'py, bool>,
    kind: &str,
    method: &str,
    threads: usize,
) -> PyResult<Bound<'py, PyArray3<bool>>> {
    let kind: Kind = kind.parse()?;
    let method: Method = method.parse()?;
    let skeleton = PyArray3::zeros(py, solid.dims(), solid.is_fortran_contiguous());
    let solid = solid.as_array();
    let mut writable = skeleton.readwrite();
    let view = writable.as_array_mut();
    cancellable::run(py, threads, None, |monitor| {
        thinning::thin(solid, kind, method, view, monitor)
    })?;
    drop(writable);
    Ok(skeleton)
}
