//! Euler numbers.

use numpy::PyReadonlyArray3;
use pyo3::prelude::*;

use super::cancellable;
use crate::topology::euler;
use crate::topology::labelling::Connectivity;
use crate::volume::Boundary;

/// Euler number of the true voxels.
#[pyfunction]
#[pyo3(signature = (solid, *, connectivity, boundary, threads=0))]
pub(super) fn euler_number(
    py: Python<'_>,
    solid: PyReadonlyArray3<'_, bool>,
    connectivity: i64,
    boundary: &str,
    threads: usize,
) -> PyResult<i64> {
    let connectivity = Connectivity::try_from(connectivity)?;
    let boundary: Boundary = boundary.parse()?;
    let solid = solid.as_array();
    cancellable::run(py, threads, None, |monitor| {
        euler::euler_number(solid, connectivity, boundary, monitor)
    })
}

/// Euler number of an open volume, and eight times the edge-corrected one.
#[pyfunction]
#[pyo3(signature = (solid, *, connectivity, threads=0))]
pub(super) fn euler_corrected(
    py: Python<'_>,
    solid: PyReadonlyArray3<'_, bool>,
    connectivity: i64,
    threads: usize,
) -> PyResult<(i64, i64)> {
    let connectivity = Connectivity::try_from(connectivity)?;
    let solid = solid.as_array();
    cancellable::run(py, threads, None, |monitor| euler::corrected(solid, connectivity, monitor))
}
