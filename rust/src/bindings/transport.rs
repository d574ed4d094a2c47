//! Diffusion and flow through the pore.

use numpy::PyReadonlyArray3;
use pyo3::prelude::*;

use super::cancellable;
use crate::error::Error;
use crate::transport::Settings;
use crate::transport::diffusion::{Diffusion, diffuse};
use crate::transport::pore::PoreSpace;
use crate::transport::stokes::{Flow, flow};
use crate::volume::Boundary;

/// How the problem is given in Python: voxel size along (z, y, x), tolerance, most iterations.
type Numbers = ([f64; 3], f64, usize);

/// Axes of the volume, that of the flow first.
fn axes(axis: usize) -> PyResult<[usize; 3]> {
    match axis {
        0 => Ok([0, 1, 2]),
        1 => Ok([1, 0, 2]),
        2 => Ok([2, 0, 1]),
        _ => Err(Error::parameter("axis", axis, "must be 0, 1 or 2").into()),
    }
}

/// `(pore voxels, percolating voxels, diffusivity, flux mismatch, residual, iterations)` of the
/// diffusion along an axis.
#[pyfunction]
#[pyo3(signature = (solid, axis, numbers, *, boundary, threads=0, progress=None))]
pub(super) fn diffusivity<'py>(
    py: Python<'py>,
    solid: PyReadonlyArray3<'py, bool>,
    axis: usize,
    numbers: Numbers,
    boundary: &str,
    threads: usize,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<(usize, usize, f64, f64, f64, usize)> {
    let boundary: Boundary = boundary.parse()?;
    let axes = axes(axis)?;
    let (spacing, tolerance, iterations) = numbers;
    let settings = Settings { spacing: axes.map(|a| spacing[a]), tolerance, iterations };
    let solid = solid.as_array().permuted_axes(axes);
    let (pore, percolating, found) = cancellable::run(py, threads, progress.as_ref(), |monitor| {
        let space = PoreSpace::new(solid, boundary, monitor)?;
        Ok((space.pore, space.len(), diffuse(&space, &settings, monitor)?))
    })?;
    let Diffusion { diffusivity, flux_mismatch, residual, iterations } = found;
    Ok((pore, percolating, diffusivity, flux_mismatch, residual, iterations))
}

/// `(pore voxels, percolating voxels, permeability, flux mismatch, residual, iterations)` of the
/// flow along an axis.
#[pyfunction]
#[pyo3(signature = (solid, axis, numbers, *, boundary, threads=0, progress=None))]
pub(super) fn permeability<'py>(
    py: Python<'py>,
    solid: PyReadonlyArray3<'py, bool>,
    axis: usize,
    numbers: Numbers,
    boundary: &str,
    threads: usize,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<(usize, usize, f64, f64, f64, usize)> {
    let boundary: Boundary = boundary.parse()?;
    let axes = axes(axis)?;
    let (spacing, tolerance, iterations) = numbers;
    let settings = Settings { spacing: axes.map(|a| spacing[a]), tolerance, iterations };
    let solid = solid.as_array().permuted_axes(axes);
    let (pore, percolating, found) = cancellable::run(py, threads, progress.as_ref(), |monitor| {
        let space = PoreSpace::new(solid, boundary, monitor)?;
        Ok((space.pore, space.len(), flow(&space, &settings, monitor)?))
    })?;
    let Flow { permeability, flux_mismatch, residual, iterations } = found;
    Ok((pore, percolating, permeability, flux_mismatch, residual, iterations))
}
