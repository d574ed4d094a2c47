//! Connected components.

use numpy::{
    PyArray1, PyArray3, PyArrayMethods, PyReadonlyArray3, PyUntypedArrayMethods, ToPyArray,
};
use pyo3::prelude::*;

use super::cancellable;
use crate::topology::labelling::{self, Connectivity};
use crate::volume::Boundary;

/// Labels (uint32, 0 outside the phase) and sizes of the components of the true voxels.
#[pyfunction]
#[pyo3(signature = (solid, connectivity, boundary, threads=0))]
#[allow(clippy::type_complexity)]
pub(super) fn label<'py>(
    py: Python<'py>,
    solid: PyReadonlyArray3<'py, bool>,
    connectivity: usize,
    boundary: &str,
    threads: usize,
) -> PyResult<(Bound<'py, PyArray3<u32>>, Bound<'py, PyArray1<u64>>)> {
    let connectivity = Connectivity::try_from(connectivity)?;
    let boundary: Boundary = boundary.parse()?;
    // NumPy's allocator asks for huge pages, which halves the time that writing the labels takes.
    let labels = PyArray3::zeros(py, solid.dims(), solid.is_fortran_contiguous());
    let solid = solid.as_array();
    let mut writable = labels.readwrite();
    let view = writable.as_array_mut();
    let sizes = cancellable::run(py, threads, None, |monitor| {
        labelling::label(solid, connectivity, boundary, view, monitor)
    })?;
    drop(writable);
    Ok((labels, sizes.to_pyarray(py)))
}

/// Sizes in voxels of the components of the true voxels.
#[pyfunction]
#[pyo3(signature = (solid, connectivity, boundary, threads=0))]
pub(super) fn component_sizes<'py>(
    py: Python<'py>,
    solid: PyReadonlyArray3<'py, bool>,
    connectivity: usize,
    boundary: &str,
    threads: usize,
) -> PyResult<Bound<'py, PyArray1<u64>>> {
    let connectivity = Connectivity::try_from(connectivity)?;
    let boundary: Boundary = boundary.parse()?;
    let solid = solid.as_array();
    let sizes = cancellable::run(py, threads, None, |monitor| {
        labelling::component_sizes(solid, connectivity, boundary, monitor)
    })?;
    Ok(sizes.to_pyarray(py))
}
