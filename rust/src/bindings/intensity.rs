//! `rust/src/intensity` for Python.

use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::error::Error;
use crate::intensity;
use crate::rng::Key;

/// Marks the `wanted` largest of the free values.
#[pyfunction]
#[pyo3(signature = (values, wanted, *, seed, free=None))]
pub(super) fn cut_solid<'py>(
    py: Python<'py>,
    values: PyReadonlyArray1<'py, f32>,
    wanted: usize,
    seed: u64,
    free: Option<PyReadonlyArray1<'py, bool>>,
) -> PyResult<Bound<'py, PyArray1<bool>>> {
    let values = values.as_slice()?;
    let free = same_length(values.len(), free.as_ref())?;
    let out = py.detach(|| intensity::cut_solid(values, wanted, free, Key::new(seed)));
    Ok(out.into_pyarray(py))
}

/// Gives each free voxel the phase of its largest score (phase, voxel), `wanted[k]` voxels to phase k.
#[pyfunction]
#[pyo3(signature = (scores, wanted, *, seed, free=None))]
pub(super) fn cut_phases<'py>(
    py: Python<'py>,
    scores: PyReadonlyArray2<'py, f32>,
    wanted: Vec<usize>,
    seed: u64,
    free: Option<PyReadonlyArray1<'py, bool>>,
) -> PyResult<Bound<'py, PyArray1<u8>>> {
    let [phases, voxels] = [scores.shape()[0], scores.shape()[1]];
    let free = same_length(voxels, free.as_ref())?;
    let count = free.map_or(voxels, |f| f.iter().filter(|&&f| f).count());
    if wanted.len() != phases || phases > 255 || wanted.iter().sum::<usize>() != count {
        let allowed = format!("must be {phases} counts, at most 255, with the sum {count}");
        return Err(Error::parameter("wanted", wanted, allowed).into());
    }
    let scores = scores.as_slice()?;
    let out = py.detach(|| intensity::cut_phases(scores, &wanted, free, Key::new(seed)));
    Ok(out.into_pyarray(py))
}

fn same_length<'a>(
    length: usize,
    mask: Option<&'a PyReadonlyArray1<'_, bool>>,
) -> PyResult<Option<&'a [bool]>> {
    mask.map(|mask| check_length(length, mask)).transpose()
}

fn check_length<'a>(length: usize, mask: &'a PyReadonlyArray1<'_, bool>) -> PyResult<&'a [bool]> {
    if mask.len() != length {
        let allowed = format!("must have {length} voxels");
        return Err(Error::parameter("mask", mask.len(), allowed).into());
    }
    Ok(mask.as_slice()?)
}
