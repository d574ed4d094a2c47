//! Changes of a phase: made one piece, given a number of voxels, freed of branches.

use ndarray::ArrayView3;
use numpy::{
    PyArray1, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3,
    PyUntypedArrayMethods, ToPyArray,
};
use pyo3::prelude::*;

use super::cancellable;
use crate::error::Error;
use crate::topology::cells;
use crate::topology::labelling::Connectivity;
use crate::topology::repair::branches::{self, Skeleton};
use crate::topology::repair::connect::{self, Options};
use crate::topology::repair::recount;
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

/// The phase with a wanted number of voxels, and how many are missing of it.
#[pyfunction]
#[pyo3(signature = (phase, score, wanted, *, connectivity, boundary, free=None, threads=0))]
#[allow(clippy::too_many_arguments)]
pub(super) fn recount_phase<'py>(
    py: Python<'py>,
    phase: PyReadonlyArray3<'py, bool>,
    score: PyReadonlyArray3<'py, f32>,
    wanted: usize,
    connectivity: i64,
    boundary: &str,
    free: Option<PyReadonlyArray3<'py, bool>>,
    threads: usize,
) -> PyResult<(Bound<'py, PyArray3<bool>>, i64)> {
    let topology = (Connectivity::try_from(connectivity)?, boundary.parse()?);
    let (changed, score) = (copy(py, &phase), score.as_array());
    let free = free.as_ref().map(|free| free.as_array());
    let mut writable = changed.readwrite();
    let view = writable.as_array_mut();
    let missing = cancellable::run(py, threads, None, |monitor| {
        recount(view, score, free, topology, wanted, monitor)
    })?;
    drop(writable);
    Ok((changed, missing))
}

/// The phase without branches, and how many voxels each of them lost.
#[pyfunction]
#[pyo3(signature = (phase, places, radii, branches, *, manner, free=None, threads=0))]
#[allow(clippy::too_many_arguments, clippy::type_complexity)]
pub(super) fn remove_branches<'py>(
    py: Python<'py>,
    phase: PyReadonlyArray3<'py, bool>,
    places: PyReadonlyArray2<'py, u32>,
    radii: PyReadonlyArray1<'py, f32>,
    branches: PyReadonlyArray1<'py, i64>,
    manner: &str,
    free: Option<PyReadonlyArray3<'py, bool>>,
    threads: usize,
) -> PyResult<(Bound<'py, PyArray3<bool>>, Bound<'py, PyArray1<u64>>)> {
    let manner = manner.parse()?;
    let places = rows(&places, "places")?;
    let (radii, branches) = (radii.as_array().to_vec(), branches.as_array().to_vec());
    let changed = copy(py, &phase);
    let free = free.as_ref().map(|free| free.as_array());
    let mut writable = changed.readwrite();
    let view = writable.as_array_mut();
    let lost = cancellable::run(py, threads, None, |monitor| {
        let skeleton = Skeleton { places: &places, radii: &radii, branches: &branches };
        branches::remove(view, &skeleton, free, manner, monitor)
    })?;
    drop(writable);
    Ok((changed, lost.to_pyarray(py)))
}

/// The length of the shortest loop through each of the asked nodes, infinite where there is none.
#[pyfunction]
#[pyo3(signature = (nodes, branches, lengths, asked, *, threads=0))]
pub(super) fn cell_perimeters<'py>(
    py: Python<'py>,
    nodes: usize,
    branches: PyReadonlyArray2<'py, u32>,
    lengths: PyReadonlyArray1<'py, f64>,
    asked: PyReadonlyArray1<'py, u32>,
    threads: usize,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let branches = rows(&branches, "branches")?;
    let (lengths, asked) = (lengths.as_array().to_vec(), asked.as_array().to_vec());
    let found = cancellable::run(py, threads, None, |monitor| {
        cells::perimeters(nodes, &branches, &lengths, &asked, monitor)
    })?;
    Ok(found.to_pyarray(py))
}

/// A copy in the same memory order.
fn copy<'py>(py: Python<'py>, phase: &PyReadonlyArray3<'py, bool>) -> Bound<'py, PyArray3<bool>> {
    let copied = PyArray3::zeros(py, phase.dims(), phase.is_fortran_contiguous());
    let view: ArrayView3<'_, bool> = phase.as_array();
    copied.readwrite().as_array_mut().assign(&view);
    copied
}

/// The rows of an array, of `N` numbers each.
fn rows<const N: usize>(
    array: &PyReadonlyArray2<'_, u32>,
    parameter: &'static str,
) -> Result<Vec<[u32; N]>, Error> {
    let array = array.as_array();
    let allowed = || format!("must have {N} columns");
    let row =
        |row: ndarray::ArrayView1<'_, u32>| row.iter().copied().collect::<Vec<_>>().try_into().ok();
    let rows: Option<Vec<_>> = array.outer_iter().map(row).collect();
    rows.ok_or_else(|| Error::parameter(parameter, array.dim(), allowed()))
}
