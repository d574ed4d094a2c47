//! `rust/src/texture/responses` and what goes with it, for Python.

use ndarray::ArrayView3;
use numpy::{PyArray4, PyReadonlyArray3};
use pyo3::prelude::*;

use super::cancellable;
use super::texture::{field_argument, wrap};
use crate::error::Result;
use crate::fourier::enlarge;
use crate::rng::Key;
use crate::texture::Field;
use crate::texture::random_field::random_field as draw;
use crate::texture::responses::{FilterBank, ResponseMatching, Target, pooled_quantiles};
use crate::volume::Shape;

/// `(axis, image (channel, y, x), symmetric, weight)` of a target.
type Image<'py> = (usize, PyReadonlyArray3<'py, f32>, bool, f32);

fn plane(view: ArrayView3<'_, f32>) -> Result<Field> {
    let (channels, y, x) = view.dim();
    Field::new([1, y, x], channels, view.iter().copied().collect())
}

fn planes(images: &[Image<'_>]) -> Result<Vec<Field>> {
    images.iter().map(|(_, image, ..)| plane(image.as_array())).collect()
}

fn targets<'a>(images: &[Image<'_>], planes: &'a [Field]) -> Vec<Target<'a>> {
    let of_image = |((axis, _, symmetric, weight), image): (&Image<'_>, &'a Field)| Target {
        axis: *axis,
        image,
        symmetric: *symmetric,
        weight: *weight,
    };
    images.iter().zip(planes).map(of_image).collect()
}

/// Volume (channel, z, y, x) after some steps of response matching, and the energy of each.
#[pyfunction]
#[pyo3(signature = (
    volume, images, *, steps, filters, edge, seed, deep=false, alike=false, regularisation=0.05,
    threads=0
))]
#[allow(clippy::too_many_arguments)]
pub(super) fn match_responses<'py>(
    py: Python<'py>,
    #[pyo3(from_py_with = field_argument)] volume: Field,
    images: Vec<Image<'py>>,
    steps: usize,
    filters: usize,
    edge: usize,
    seed: u64,
    deep: bool,
    alike: bool,
    regularisation: f32,
    threads: usize,
) -> PyResult<(Bound<'py, PyArray4<f32>>, Vec<f64>)> {
    let planes = planes(&images)?;
    let targets = targets(&images, &planes);
    let mut volume = volume;
    let energies = cancellable::run(py, threads, None, |monitor| {
        let size = (volume.channels(), volume.shape());
        let bank = FilterBank { filters, edge, deep, alike, regularisation };
        let matching = ResponseMatching::new(&targets, size, bank)?;
        let quantiles = pooled_quantiles(&targets);
        let key = Key::new(seed);
        (0..steps as u64)
            .map(|step| matching.step(&mut volume, &quantiles, key.with(step), monitor))
            .collect::<Result<Vec<_>>>()
    })?;
    Ok((wrap(py, volume)?, energies))
}

/// Gaussian random field (channel, z, y, x) with the covariance and distribution of images.
#[pyfunction]
#[pyo3(signature = (images, shape, *, seed, threads=0))]
pub(super) fn random_field<'py>(
    py: Python<'py>,
    images: Vec<Image<'py>>,
    shape: (usize, usize, usize),
    seed: u64,
    threads: usize,
) -> PyResult<Bound<'py, PyArray4<f32>>> {
    let planes = planes(&images)?;
    let targets = targets(&images, &planes);
    let field = cancellable::run(py, threads, None, |monitor| {
        let quantiles = pooled_quantiles(&targets);
        draw(&targets, 1, shape.into(), &quantiles, Key::new(seed), monitor)
    })?;
    wrap(py, field)
}

/// A periodic volume (channel, z, y, x) on a finer grid, by its Fourier series.
#[pyfunction]
#[pyo3(signature = (volume, shape, *, threads=0))]
pub(super) fn enlarge_periodic(
    py: Python<'_>,
    #[pyo3(from_py_with = field_argument)] volume: Field,
    shape: (usize, usize, usize),
    threads: usize,
) -> PyResult<Bound<'_, PyArray4<f32>>> {
    let to: Shape = shape.into();
    let fine = cancellable::run(py, threads, None, |monitor| {
        let mut values = Vec::new();
        for c in 0..volume.channels() {
            values.append(&mut enlarge(volume.channel(c), volume.shape(), to, monitor)?);
        }
        Field::new(to, volume.channels(), values)
    })?;
    wrap(py, fine)
}
