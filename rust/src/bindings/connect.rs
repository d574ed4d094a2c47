//! A phase made one piece.

use numpy::{PyArray3, PyArrayMethods, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;

use super::cancellable;
use crate::topology::connect::{self, Options};
use crate::topology::labelling::Connectivity;
use crate::volume::Boundary;

/// The phase with its islands erased or joined; how many were erased, joined and left apart; and how
/// many voxels are missing of its former number.
#[pyfunction]
#[pyo3(signature = (
    phase, score, *, connectivity, boundary, smallest, width, free=None, threads=0
))]
#[allow(clippy::too_many_arguments, clippy::type_complexity)]
pub(super) fn connect_phase<'py>(
    py: Python<'py>,
    phase: PyReadonlyArray3<'py, bool>,
    score: PyReadonlyArray3<'py, f32>,
    connectivity: i64,
    boundary: &str,
    smallest: u64,
    width: f64,
    free: Option<PyReadonlyArray3<'py, bool>>,
    threads: usize,
) -> PyResult<(Bound<'py, PyArray3<bool>>, usize, usize, usize, i64)> {
    let connectivity = Connectivity::try_from(connectivity)?;
    let boundary: Boundary = boundary.parse()?;
    let options = Options { connectivity, boundary, smallest, width };
    let connected = PyArray3::zeros(py, phase.dims(), phase.is_fortran_contiguous());
    let (phase, score) = (phase.as_array(), score.as_array());
    let free = free.as_ref().map(|free| free.as_array());
    let mut writable = connected.readwrite();
    let view = writable.as_array_mut();
    let found = cancellable::run(py, threads, None, |monitor| {
        connect::connect(phase, score, free, &options, view, monitor)
    })?;
    drop(writable);
    Ok((connected, found.erased, found.joined, found.apart, found.missing))
}
