//! `rust/src/texture` for Python.

use ndarray::ArrayView4;
use numpy::{
    IntoPyArray, PyArray1, PyArray3, PyArray4, PyArrayMethods, PyReadonlyArray3, PyReadonlyArray4,
};
use pyo3::prelude::*;

use super::cancellable;
use crate::error::{Error, Result};
use crate::rng::Key;
use crate::texture::blend::{Mixing, Source};
use crate::texture::parameters::{Backend, Emphasis, Example, IndexWeight, LevelPlan, Start};
use crate::texture::responses::FilterBank;
use crate::texture::symmetry::{Orientation, Symmetry, View};
use crate::texture::{
    Constraints, Field, Parameters, Stage, carry, copying, pyramid, synthesize as optimise, windows,
};
use crate::volume::Shape;

/// Parameters of the optimisation, as the dictionary that Python passes.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(super) struct Options {
    levels: Vec<LevelOptions>,
    tolerance: f32,
    patience: usize,
    start: String,
    block: usize,
    starts: usize,
    components: usize,
    variance: f32,
    emphasis: String,
    match_histogram: bool,
    index_weight: String,
    run_penalty: f32,
    run_reach: usize,
    exponent: f32,
    adaptive: bool,
    gradient: f32,
    boundary: String,
}

/// What is done at one level, 0 the finest.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct LevelOptions {
    stages: Vec<(usize, usize)>,
    iterations: usize,
    filters: usize,
    filter_edge: usize,
    deep: bool,
    alike: bool,
    regularisation: f32,
    detail: bool,
    response_steps: [usize; 2],
    search: String,
    candidates: usize,
    temperature: f32,
    bandwidth: Option<f32>,
    relaxation: f32,
    mode_steps: usize,
}

impl LevelOptions {
    fn plan(&self) -> Result<LevelPlan> {
        Ok(LevelPlan {
            stages: self.stages.iter().map(|&(window, step)| Stage { window, step }).collect(),
            iterations: self.iterations,
            filters: (self.filters > 0).then_some(FilterBank {
                filters: self.filters,
                edge: self.filter_edge,
                deep: self.deep,
                alike: self.alike,
                regularisation: self.regularisation,
            }),
            detail: self.detail,
            response_steps: self.response_steps,
            backend: backend(&self.search, self.candidates)?,
            temperature: self.temperature,
            mixing: Mixing { bandwidth: self.bandwidth, relaxation: self.relaxation },
            mode_steps: self.mode_steps,
        })
    }
}

impl Options {
    fn parameters(&self) -> Result<Parameters> {
        Ok(Parameters {
            levels: self.levels.iter().map(LevelOptions::plan).collect::<Result<_>>()?,
            index_weight: match self.index_weight.as_str() {
                "off" => IndexWeight::Off,
                "literal" => IndexWeight::Literal,
                "normalised" => IndexWeight::Normalised,
                other => {
                    let allowed = "must be 'off', 'literal' or 'normalised'";
                    return Err(Error::parameter("index_weight", other, allowed));
                }
            },
            emphasis: match self.emphasis.as_str() {
                "none" => Emphasis::None,
                "histogram" => Emphasis::Histogram,
                "position" => Emphasis::Position,
                other => {
                    let allowed = "must be 'none', 'histogram' or 'position'";
                    return Err(Error::parameter("emphasis", other, allowed));
                }
            },
            start: match self.start.as_str() {
                "blocks" => Start::Blocks(self.block),
                "voxels" => Start::Voxels,
                "random_field" => Start::RandomField,
                other => {
                    let allowed = "must be 'blocks', 'voxels' or 'random_field'";
                    return Err(Error::parameter("start", other, allowed));
                }
            },
            starts: self.starts,
            boundary: self.boundary.parse()?,
            tolerance: self.tolerance,
            patience: self.patience,
            components: self.components,
            variance: self.variance,
            match_histogram: self.match_histogram,
            run_penalty: self.run_penalty,
            run_reach: self.run_reach,
            exponent: self.exponent,
            adaptive: self.adaptive,
            gradient: self.gradient,
        })
    }
}

/// An exemplar, as the dictionary that Python passes: a volume with its symmetric copies, or an image
/// for the planes perpendicular to an axis.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(super) struct ExampleOptions<'py> {
    field: PyReadonlyArray4<'py, f32>,
    symmetry: String,
    keep_axis: Option<usize>,
    normal: Option<usize>,
    weight: f32,
}

impl ExampleOptions<'_> {
    fn example(&self) -> Result<Example> {
        let values = field(self.field.as_array())?;
        let symmetry = self.symmetry.parse::<Symmetry>()?;
        match self.normal {
            None => Ok(Example::volume(values, symmetry.orientations(self.keep_axis))),
            Some(axis) if axis < 3 && values.shape()[0] == 1 => {
                Ok(Example::image(values, axis, symmetry == Symmetry::Full, self.weight))
            }
            Some(axis) => {
                let allowed = "must be an axis, 0 to 2, of an image of shape (1, y, x)";
                Err(Error::parameter("normal", (axis, values.shape()), allowed))
            }
        }
    }
}

fn backend(search: &str, candidates: usize) -> Result<Backend> {
    match search {
        "brute_force" => Ok(Backend::BruteForce),
        "kd_tree" => Ok(Backend::KdTree(candidates)),
        "coherent" => Ok(Backend::Coherent),
        other => {
            let allowed = "must be 'coherent', 'kd_tree' or 'brute_force'";
            Err(Error::parameter("search", other, allowed))
        }
    }
}

/// Where in the exemplar each window of a synthetic volume comes from.
#[pyclass(frozen, module = "poresynth._core")]
pub(super) struct MatchMap {
    map: crate::texture::MatchMap,
    orientations: Vec<Orientation>,
}

#[pymethods]
impl MatchMap {
    /// Edges (z, y, x) of the windows, voxels.
    #[getter]
    fn window(&self) -> (usize, usize, usize) {
        self.map.lattice.window.into()
    }

    /// Shape (z, y, x) of the volume that the windows cover.
    #[getter]
    fn shape(&self) -> (usize, usize, usize) {
        self.map.lattice.shape.into()
    }

    /// Window origins along (z, y, x).
    #[getter]
    fn origins<'py>(&self, py: Python<'py>) -> [Bound<'py, PyArray1<i64>>; 3] {
        self.map
            .lattice
            .origins
            .each_ref()
            .map(|axis| axis.iter().map(|&o| o as i64).collect::<Vec<_>>().into_pyarray(py))
    }

    /// Matches, shape (sites z, sites y, sites x, 4): orientation, then the window's origin (z, y, x)
    /// in the exemplar under that orientation; orientation 65535 marks a site outside the domain.
    #[getter]
    fn matches<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray4<u16>>> {
        let [z, y, x] = self.map.lattice.sites();
        self.map
            .matches
            .iter()
            .flat_map(|m| [m.orientation, m.origin[0], m.origin[1], m.origin[2]])
            .collect::<Vec<u16>>()
            .into_pyarray(py)
            .reshape([z, y, x, 4])
    }

    /// `(copy_fraction, mean_copied_block)`: the share of the volume in verbatim copies of more than
    /// 12³ voxels, and the edge of the volume-weighted mean copied block in voxels.
    fn copying(&self, py: Python<'_>) -> (f64, f64) {
        let found = py.detach(|| copying::copying(&self.map));
        (found.copy_fraction, found.mean_copied_block)
    }
}

/// `(level, window, iteration, energy, data, gradient, factor)` of one iteration.
type EnergyRow = (usize, usize, usize, f64, f64, f64, f32);

/// `(field, a match map an exemplar, energy records)` of a synthesis.
type Synthesized<'py> = (Bound<'py, PyArray4<f32>>, Vec<MatchMap>, Vec<EnergyRow>);

/// Synthesises a field: exemplars to `(field, a match map each, energy records)`.
#[pyfunction]
#[pyo3(signature = (examples, shape, options, *, seed, start=None, known=None, known_mask=None, domain=None, threads=0, progress=None))]
#[allow(clippy::too_many_arguments)]
pub(super) fn synthesize<'py>(
    py: Python<'py>,
    examples: Vec<ExampleOptions<'py>>,
    shape: (usize, usize, usize),
    options: Options,
    seed: u64,
    start: Option<PyReadonlyArray4<'py, f32>>,
    known: Option<PyReadonlyArray4<'py, f32>>,
    known_mask: Option<PyReadonlyArray3<'py, bool>>,
    domain: Option<PyReadonlyArray3<'py, bool>>,
    threads: usize,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<Synthesized<'py>> {
    let examples: Vec<Example> =
        examples.iter().map(ExampleOptions::example).collect::<Result<_>>()?;
    let parameters = options.parameters()?;
    let mask = |m: PyReadonlyArray3<'py, bool>| m.as_array().iter().copied().collect::<Vec<_>>();
    let known = match (known, known_mask) {
        (Some(values), Some(on)) => Some((field(values.as_array())?, mask(on))),
        _ => None,
    };
    let start = start.map(|values| field(values.as_array())).transpose()?;
    let constraints = Constraints { known, domain: domain.map(mask), start };
    let made = cancellable::run(py, threads, progress.as_ref(), |monitor| {
        optimise(&examples, shape.into(), &parameters, constraints, Key::new(seed), monitor)
    })?;
    let energy = made
        .energy
        .iter()
        .map(|e| (e.level, e.window, e.iteration, e.energy, e.data, e.gradient, e.factor))
        .collect();
    let maps = made
        .maps
        .into_iter()
        .zip(examples)
        .map(|(map, example)| MatchMap { map, orientations: example.orientations })
        .collect();
    Ok((wrap(py, made.field)?, maps, energy))
}

/// Brings values of the exemplar (channel, z, y, x) to a synthetic field through its match map.
#[pyfunction]
#[pyo3(name = "carry", signature = (exemplar, field, values, match_map, *, seed, threads=0))]
#[allow(clippy::too_many_arguments)]
pub(super) fn carry_values<'py>(
    py: Python<'py>,
    exemplar: PyReadonlyArray4<'py, f32>,
    #[pyo3(from_py_with = field_argument)] field: Field,
    values: PyReadonlyArray4<'py, f32>,
    match_map: &MatchMap,
    seed: u64,
    threads: usize,
) -> PyResult<Bound<'py, PyArray4<f32>>> {
    let exemplar = self::field(exemplar.as_array())?;
    let values = self::field(values.as_array())?;
    let fits = values.shape() == exemplar.shape() && field.shape() == match_map.map.lattice.shape;
    if !fits || field.channels() != exemplar.channels() {
        let allowed = "must have the shapes of the exemplar and of the match map";
        return Err(
            Error::parameter("values, field", (values.shape(), field.shape()), allowed).into()
        );
    }
    let views: Vec<View> =
        match_map.orientations.iter().map(|o| o.view(exemplar.shape())).collect();
    let out = cancellable::run(py, threads, None, |monitor| {
        let source = Source { field: &exemplar, emphasis: None, laplacian: None, views: &views };
        carry::carry(&source, &field, &values, &match_map.map, Key::new(seed), monitor)
    })?;
    wrap(py, out)
}

/// Descriptors (z, y, x, component) of all windows of an exemplar, and of every `step`-th window of a
/// volume along each axis.
#[pyfunction]
#[pyo3(signature = (exemplar, volume, *, window, step, components, variance, seed, threads=0))]
#[allow(clippy::too_many_arguments)]
pub(super) fn describe_windows(
    py: Python<'_>,
    #[pyo3(from_py_with = field_argument)] exemplar: Field,
    #[pyo3(from_py_with = field_argument)] volume: Field,
    window: usize,
    step: usize,
    components: usize,
    variance: f32,
    seed: u64,
    threads: usize,
) -> PyResult<[Bound<'_, PyArray4<i16>>; 2]> {
    let (stage, components, key) = (Stage { window, step }, (components, variance), Key::new(seed));
    let described = cancellable::run(py, threads, None, |monitor| {
        windows::describe(&exemplar, &volume, stage, components, key, monitor)
    })?;
    Ok(described.map(|found| found.into_pyarray(py)))
}

/// Positions of the windows that one pass of a search finds for each query, from those that the pass
/// before found.
#[pyfunction]
#[pyo3(signature = (descriptors, queries, start, *, step, search, candidates, seed, threads=0))]
#[allow(clippy::too_many_arguments)]
pub(super) fn match_windows<'py>(
    py: Python<'py>,
    descriptors: PyReadonlyArray4<'py, i16>,
    queries: PyReadonlyArray4<'py, i16>,
    start: PyReadonlyArray3<'py, i64>,
    step: usize,
    search: &str,
    candidates: usize,
    seed: u64,
    threads: usize,
) -> PyResult<Bound<'py, PyArray3<i64>>> {
    let (descriptors, queries, start) =
        (descriptors.as_array(), queries.as_array(), start.as_array());
    let backend = backend(search, candidates)?;
    let found = cancellable::run(py, threads, None, |monitor| {
        windows::find(descriptors, queries, start, step, backend, Key::new(seed), monitor)
    })?;
    Ok(found.into_pyarray(py))
}

/// Gaussian blur of a field (channel, z, y, x), sigma in voxels.
#[pyfunction]
#[pyo3(signature = (field, sigma, *, boundary))]
pub(super) fn gaussian<'py>(
    py: Python<'py>,
    #[pyo3(from_py_with = field_argument)] field: Field,
    sigma: f32,
    boundary: &str,
) -> PyResult<Bound<'py, PyArray4<f32>>> {
    let boundary = boundary.parse()?;
    if !(sigma > 0.0 && sigma <= 100.0) {
        return Err(Error::parameter("sigma", sigma, "must be above 0 and at most 100").into());
    }
    let out = py.detach(|| pyramid::gaussian(&field, sigma, boundary));
    wrap(py, out)
}

pub(super) fn field_argument(argument: &Bound<'_, PyAny>) -> PyResult<Field> {
    let array = argument.extract::<PyReadonlyArray4<'_, f32>>()?;
    Ok(field(array.as_array())?)
}

fn field(view: ArrayView4<'_, f32>) -> Result<Field> {
    let (channels, z, y, x) = view.dim();
    Field::new([z, y, x], channels, view.iter().copied().collect())
}

pub(super) fn wrap(py: Python<'_>, field: Field) -> PyResult<Bound<'_, PyArray4<f32>>> {
    let [z, y, x]: Shape = field.shape();
    let channels = field.channels();
    field.into_values().into_pyarray(py).reshape([channels, z, y, x])
}
