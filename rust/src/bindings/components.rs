//! What connected components are like, and phases without some of them.

use ndarray::Array;
use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray3,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use super::cancellable;
use crate::topology::labelling::Connectivity;
use crate::topology::parts::{self, Keep};
use crate::topology::statistics;
use crate::volume::Boundary;

/// Sizes (n,), bounding boxes (n, 3, 2), centroids (n, 3) and spans (n, 3) of the components of the
/// true voxels, and labels (uint32, 0 outside the phase) if wanted.
#[pyfunction]
#[pyo3(signature = (solid, *, connectivity, boundary, labels=false, threads=0))]
#[allow(clippy::type_complexity)]
pub(super) fn component_statistics<'py>(
    py: Python<'py>,
    solid: PyReadonlyArray3<'py, bool>,
    connectivity: i64,
    boundary: &str,
    labels: bool,
    threads: usize,
) -> PyResult<(
    Bound<'py, PyArray1<u64>>,
    Bound<'py, PyArray3<i64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<bool>>,
    Option<Bound<'py, PyArray3<u32>>>,
)> {
    let connectivity = Connectivity::try_from(connectivity)?;
    let boundary: Boundary = boundary.parse()?;
    let labels = labels.then(|| PyArray3::zeros(py, solid.dims(), solid.is_fortran_contiguous()));
    let solid = solid.as_array();
    let mut writable = labels.as_ref().map(PyArrayMethods::readwrite);
    let view = writable.as_mut().map(|labels| labels.as_array_mut());
    let found = cancellable::run(py, threads, None, |monitor| {
        statistics::component_statistics(solid, connectivity, boundary, view, monitor)
    })?;
    drop(writable);
    let n = found.len();
    let sizes = Array::from_iter(found.iter().map(|c| c.size));
    let bounds = Array::from_shape_fn((n, 3, 2), |(i, axis, side)| found[i].bounds[axis][side]);
    let centroids = Array::from_shape_fn((n, 3), |(i, axis)| found[i].centroid[axis]);
    let spans = Array::from_shape_fn((n, 3), |(i, axis)| found[i].spans[axis]);
    Ok((
        sizes.into_pyarray(py),
        bounds.into_pyarray(py),
        centroids.into_pyarray(py),
        spans.into_pyarray(py),
        labels,
    ))
}

/// Number of components of the false voxels that do not touch the border.
#[pyfunction]
#[pyo3(signature = (solid, *, connectivity, threads=0))]
pub(super) fn cavities(
    py: Python<'_>,
    solid: PyReadonlyArray3<'_, bool>,
    connectivity: i64,
    threads: usize,
) -> PyResult<usize> {
    let connectivity = Connectivity::try_from(connectivity)?;
    let solid = solid.as_array();
    cancellable::run(py, threads, None, |monitor| {
        statistics::enclosed_components(solid, false, connectivity, monitor)
    })
}

/// The components of at least `size` voxels, or the largest one if no size is given.
#[pyfunction]
#[pyo3(signature = (solid, size, *, connectivity, boundary, threads=0))]
pub(super) fn keep_parts<'py>(
    py: Python<'py>,
    solid: PyReadonlyArray3<'py, bool>,
    size: Option<u64>,
    connectivity: i64,
    boundary: &str,
    threads: usize,
) -> PyResult<Bound<'py, PyArray3<bool>>> {
    let connectivity = Connectivity::try_from(connectivity)?;
    let boundary: Boundary = boundary.parse()?;
    let keep = size.map_or(Keep::Largest, Keep::AtLeast);
    let kept = PyArray3::zeros(py, solid.dims(), solid.is_fortran_contiguous());
    let solid = solid.as_array();
    let mut writable = kept.readwrite();
    let view = writable.as_array_mut();
    cancellable::run(py, threads, None, |monitor| {
        parts::keep_parts(solid, keep, connectivity, boundary, view, monitor)
    })?;
    drop(writable);
    Ok(kept)
}
