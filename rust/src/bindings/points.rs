//! `rust/src/points` for Python.

use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;

use crate::error::Error;
use crate::points::Grids;
use crate::threads::with_threads;
use crate::volume::Shape;

/// Distances to the nearest random points, one after the other, grid by grid; 3 or 4 of a place.
#[pyfunction]
#[pyo3(signature = (points, sites, cells, fractions, *, count, kept, farthest, threads=0))]
#[allow(clippy::too_many_arguments)]
pub(super) fn point_distances<'py>(
    py: Python<'py>,
    points: PyReadonlyArray1<'py, f32>,
    sites: Shape,
    cells: [PyReadonlyArray1<'py, i64>; 3],
    fractions: [PyReadonlyArray1<'py, f32>; 3],
    count: usize,
    kept: usize,
    farthest: f32,
    threads: usize,
) -> PyResult<Bound<'py, PyArray1<f32>>> {
    let [a, b, c] = &cells;
    let [u, v, w] = &fractions;
    let grids = Grids {
        sites,
        points: points.as_slice()?,
        cells: [a.as_slice()?, b.as_slice()?, c.as_slice()?],
        fractions: [u.as_slice()?, v.as_slice()?, w.as_slice()?],
        count,
    };
    // Some milliseconds: too short to be stopped.
    let found = py.detach(|| {
        with_threads(threads, || match kept {
            3 => grids.nearest::<3>(farthest),
            4 => grids.nearest::<4>(farthest),
            _ => Err(Error::parameter("kept", kept, "must be 3 or 4")),
        })?
    })?;
    Ok(found.into_pyarray(py))
}
