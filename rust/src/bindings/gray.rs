//! Histograms, moments and histogram matching for Python, for every type of gray values.

use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1, ToPyArray};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

use super::cancellable;
use crate::error::Error;
use crate::intensity;
use crate::intensity::matching::{self, Ties};
use crate::intensity::order::{Bits, Kind};
use crate::intensity::statistics;
use crate::rng::Key;

/// Runs `$body` with `$name` bound to the array `$array`, whatever of `$types` it holds.
macro_rules! for_type {
    ($array:expr, $name:ident, [$($types:ty),*], $body:expr) => {{
        $(if let Ok($name) = $array.extract::<PyReadonlyArray1<'_, $types>>() { $body } else)*
        { Err(PyTypeError::new_err("an array of a type that no kernel takes")) }
    }};
}

/// Mean, variance, minimum and maximum.
#[pyfunction]
#[pyo3(signature = (values, *, threads=0))]
pub(super) fn gray_moments(
    py: Python<'_>,
    values: &Bound<'_, PyAny>,
    threads: usize,
) -> PyResult<(f64, f64, f64, f64)> {
    for_type!(values, values, [u8, i8, u16, i16, u32, i32, u64, i64, f32, f64], {
        let values = values.as_slice()?;
        let found =
            cancellable::run(py, threads, None, |monitor| statistics::moments(values, monitor))?;
        Ok((found.mean, found.variance, found.minimum, found.maximum))
    })
}

/// Numbers of values between equidistant edges.
#[pyfunction]
#[pyo3(signature = (values, edges, *, threads=0))]
pub(super) fn binned_counts<'py>(
    py: Python<'py>,
    values: &Bound<'py, PyAny>,
    edges: PyReadonlyArray1<'py, f64>,
    threads: usize,
) -> PyResult<Bound<'py, PyArray1<u64>>> {
    let edges = edges.as_slice()?;
    for_type!(values, values, [u8, i8, u16, i16, u32, i32, u64, i64, f32, f64], {
        let values = values.as_slice()?;
        let found = cancellable::run(py, threads, None, |monitor| {
            statistics::binned_counts(values, edges, monitor)
        })?;
        Ok(found.to_pyarray(py))
    })
}

/// Numbers of values of 8 or 16 bits, given as unsigned bits, by ascending level.
#[pyfunction]
#[pyo3(signature = (values, kind, *, threads=0))]
pub(super) fn level_counts<'py>(
    py: Python<'py>,
    values: &Bound<'py, PyAny>,
    kind: &str,
    threads: usize,
) -> PyResult<Bound<'py, PyArray1<u64>>> {
    let kind = kind_of(kind)?;
    for_type!(values, values, [u8, u16], {
        let values = values.as_slice()?;
        let found = cancellable::run(py, threads, None, |monitor| {
            intensity::level_counts(values, kind, monitor)
        })?;
        Ok(found.to_pyarray(py))
    })
}

/// Writes to `out` the reference's values of the ranks of the source's; all given as unsigned bits.
#[pyfunction]
#[pyo3(signature = (source, source_kind, reference, reference_kind, out, *, seed=None, threads=0))]
#[allow(clippy::too_many_arguments)]
pub(super) fn match_histogram(
    py: Python<'_>,
    source: &Bound<'_, PyAny>,
    source_kind: &str,
    reference: &Bound<'_, PyAny>,
    reference_kind: &str,
    out: &Bound<'_, PyAny>,
    seed: Option<u64>,
    threads: usize,
) -> PyResult<()> {
    let kinds = [kind_of(source_kind)?, kind_of(reference_kind)?];
    let ties = seed.map_or(Ties::Alike, |seed| Ties::Random(Key::new(seed)));
    for_type!(source, source, [u8, u16, u32, u64], {
        let source = source.as_slice()?;
        for_type!(reference, reference, [u8, u16, u32, u64], {
            matched(py, source, reference.as_slice()?, kinds, ties, out, threads)
        })
    })
}

fn matched<S: Bits, R: Bits + numpy::Element>(
    py: Python<'_>,
    source: &[S],
    reference: &[R],
    [source_kind, reference_kind]: [Kind; 2],
    ties: Ties,
    out: &Bound<'_, PyAny>,
    threads: usize,
) -> PyResult<()> {
    let mut out = out.cast::<PyArray1<R>>()?.readwrite();
    let out = out.as_slice_mut()?;
    cancellable::run(py, threads, None, |monitor| {
        let (source, reference) = ((source, source_kind), (reference, reference_kind));
        matching::match_histogram(source, reference, ties, out, monitor)
    })
}

fn kind_of(name: &str) -> PyResult<Kind> {
    match name {
        "b" | "u" => Ok(Kind::Unsigned),
        "i" => Ok(Kind::Signed),
        "f" => Ok(Kind::Float),
        _ => Err(Error::parameter("kind", name, "must be 'b', 'u', 'i' or 'f'").into()),
    }
}
