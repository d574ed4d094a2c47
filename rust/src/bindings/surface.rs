//! Surface area, and lines along the directions of the lattice.

use numpy::{PyArray1, PyArray2, PyReadonlyArray3, ToPyArray};
use pyo3::prelude::*;

use super::cancellable;
use crate::geometry::secants::{self as lines, Secant};
use crate::geometry::surface::{self, Method};
use crate::volume::Boundary;

/// Area of the surface of the true voxels, and the area per volume.
#[pyfunction]
#[pyo3(signature = (solid, voxel_size, *, method, boundary, threads=0))]
pub(super) fn surface_area(
    py: Python<'_>,
    solid: PyReadonlyArray3<'_, bool>,
    voxel_size: [f64; 3],
    method: &str,
    boundary: &str,
    threads: usize,
) -> PyResult<(f64, f64)> {
    let method: Method = method.parse()?;
    let boundary: Boundary = boundary.parse()?;
    let solid = solid.as_array();
    let found = cancellable::run(py, threads, None, |monitor| {
        surface::surface_area(solid, voxel_size, method, boundary, monitor)
    })?;
    Ok((found.area, found.specific))
}

/// Steps along all directions whose components are at most `reach`, the changes of phase per length
/// of lines along them, and their weights in a mean over all directions.
#[pyfunction]
#[pyo3(signature = (solid, reach, voxel_size, *, boundary, threads=0))]
#[allow(clippy::type_complexity)]
pub(super) fn secants<'py>(
    py: Python<'py>,
    solid: PyReadonlyArray3<'py, bool>,
    reach: usize,
    voxel_size: [f64; 3],
    boundary: &str,
    threads: usize,
) -> PyResult<(Bound<'py, PyArray2<i64>>, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>)> {
    let boundary: Boundary = boundary.parse()?;
    let solid = solid.as_array();
    let found = cancellable::run(py, threads, None, |monitor| {
        lines::secants(solid, reach, voxel_size, boundary, monitor)
    })?;
    let steps: Vec<_> = found.iter().map(|secant| secant.step.map(|c| c as i64).to_vec()).collect();
    let densities: Vec<_> = found.iter().map(Secant::density).collect();
    let weights: Vec<_> = found.iter().map(|secant| secant.weight).collect();
    let steps = PyArray2::from_vec2(py, &steps)?;
    Ok((steps, densities.to_pyarray(py), weights.to_pyarray(py)))
}
