//! The coarse-to-fine schedule and the expectation-maximisation passes.

use super::blend::{Gradients, Mixing, Part, Source, blend};
use super::detail::add_detail;
use super::emphasis::emphasis;
use super::field::Field;
use super::lattice::Lattice;
use super::levels::Levels;
use super::match_map::{MatchMap, random_blocks, random_matches};
use super::matching::{Matched, active_sites, energy, match_sites, weights};
use super::neighbourhoods::Neighbourhoods;
use super::parameters::{
    Constraints, EnergyRecord, Example, IndexWeight, LevelPlan, Parameters, Stage, Start, Synthesis,
};
use super::random_field::random_field;
use super::responses::{ResponseMatching, Target, pooled_quantiles};
use super::search::annealing::Heat;
use super::search::penalty::{IndexHistogram, RunPenalty};
use super::search::{Scene, Search, prepare};
use super::starts::nearest;
use super::symmetry::View;
use super::{poisson, pyramid};
use crate::error::Result;
use crate::fourier::enlarge;
use crate::intensity::Quantiles;
use crate::monitor::Monitor;
use crate::rng::Key;
use crate::volume::{Shape, voxels};

/// Search passes of the very first iteration, when the map knows nothing: after ten the energy no
/// longer falls.
const COLD_PASSES: usize = 10;

/// Search passes of the first iteration of every further stage.
const WARM_PASSES: usize = 2;

/// The temperature falls with this power of the iterations that are left of a window's.
const COOLING: i32 = 2;

/// Eq. 2: the weight factor grows by this share when the energy falls …
const GROWTH: f32 = 0.05;

/// … and shrinks by this share when it rises.
const DECAY: f32 = 0.3;

/// Energies closer than this share are the same to Eq. 2. The lattice's random shift alone moves the
/// energy by up to a tenth; were that a rise, λ would shrink until only the gradient term is left.
const SAME: f64 = 0.1;

/// Makes a field of this shape whose windows all look like windows of the exemplars.
///
/// Memory: about 24 bytes a voxel of the output and channel with the gradient term, 8 without, and
/// `2·dims` bytes a voxel of the exemplars and orientation.
///
/// # Errors
/// If a parameter does not fit the exemplars or the shape, or the caller cancels.
pub fn synthesize(
    examples: &[Example],
    shape: Shape,
    parameters: &Parameters,
    constraints: Constraints,
    key: Key,
    monitor: &Monitor<'_>,
) -> Result<Synthesis> {
    parameters.check(examples, shape, &constraints)?;
    let count = parameters.levels.len();
    let levels = Levels::new(examples, shape, constraints, parameters);
    let work = parameters.levels.iter().map(steps).sum::<usize>();
    let mut run =
        Run { examples, levels: &levels, parameters, monitor, key, done: 0, work: work as f64 };
    let coarsest = count - 1;
    let mut trials = (0..parameters.starts as u64)
        .map(|i| {
            // The first trial's key is the run's own.
            let key = if i == 0 { key } else { key.with(u64::MAX - i) };
            let (field, maps) = start(examples, &levels, parameters, key.with(0), monitor)?;
            Ok(Trial { made: Synthesis { field, maps, energy: Vec::new() }, key })
        })
        .collect::<Result<Vec<_>>>()?;
    run.level(coarsest, &mut trials)?;
    if trials.len() > 1 {
        let fields: Vec<&Field> = trials.iter().map(|trial| &trial.made.field).collect();
        let domain = levels.domains[coarsest].as_deref();
        let best = nearest(&levels.exemplars[coarsest][0], &fields, domain, monitor)?;
        trials.swap(0, best);
        trials.truncate(1);
    }
    for level in (0..coarsest).rev() {
        run.level(level, &mut trials)?;
    }
    Ok(trials.swap_remove(0).made)
}

/// Parts of a level that are reported one by one.
fn steps(plan: &LevelPlan) -> usize {
    plan.stages.len() + plan.response_steps.iter().filter(|n| **n > 0).count()
}

/// The output at the coarsest level, before the first pass.
fn start(
    examples: &[Example],
    levels: &Levels,
    parameters: &Parameters,
    key: Key,
    monitor: &Monitor<'_>,
) -> Result<(Field, Vec<MatchMap>)> {
    let coarsest = levels.shapes.len() - 1;
    let shape = levels.shapes[coarsest];
    let sources = &levels.exemplars[coarsest];
    let boundary = parameters.boundary;
    let field = match (parameters.start, &sources[..]) {
        (Start::Blocks(block), [source]) => {
            let shortest = source.shape().into_iter().chain(shape).min().unwrap_or(1);
            let (field, map) = random_blocks(source, shape, block.min(shortest), boundary, key);
            return Ok((field, vec![map]));
        }
        (Start::RandomField, _) => {
            let quantiles = pooled_quantiles(&targets(examples, sources));
            if let Some(given) = &levels.start {
                let mut field = given.clone();
                for (c, quantiles) in quantiles.iter().enumerate() {
                    quantiles.match_values(field.channel_mut(c), None);
                }
                field
            } else {
                let finest = targets(examples, &levels.exemplars[0]);
                random_field(&finest, 1 << coarsest, shape, &quantiles, key, monitor)?
            }
        }
        _ => random_voxels(sources, shape, key),
    };
    let stage = parameters.levels[coarsest].stages[0];
    let maps = examples.iter().zip(sources).enumerate().map(|(i, (example, source))| {
        let window = example.extent(stage.window);
        let lattice = Lattice::new(shape, window, example.extent(stage.step), [0; 3], boundary);
        let limit = |view: View| std::array::from_fn(|a| view.shape[a] - window[a]);
        let limits: Vec<Shape> =
            example.orientations.iter().map(|o| limit(o.view(source.shape()))).collect();
        random_matches(lattice, &limits, key.with(1 + i as u64))
    });
    Ok((field, maps.collect()))
}

/// Each voxel that of a random place of a random exemplar.
fn random_voxels(sources: &[Field], shape: Shape, key: Key) -> Field {
    let mut field = Field::zeros(shape, sources[0].channels());
    for voxel in 0..voxels(shape) {
        let key = key.with(voxel as u64);
        let source = &sources[key.below(0, sources.len())];
        let from = key.below(1, voxels(source.shape()));
        for c in 0..field.channels() {
            field.channel_mut(c)[voxel] = source.channel(c)[from];
        }
    }
    field
}

/// What the slices should look like, for images.
fn targets<'a>(examples: &[Example], sources: &'a [Field]) -> Vec<Target<'a>> {
    let of_example = |(example, image): (&Example, &'a Field)| {
        let symmetric = example.orientations.len() > 1;
        example.normal.map(|axis| Target { axis, image, symmetric, weight: example.weight })
    };
    examples.iter().zip(sources).filter_map(of_example).collect()
}

/// A synthesis under way.
struct Run<'a> {
    examples: &'a [Example],
    levels: &'a Levels,
    parameters: &'a Parameters,
    monitor: &'a Monitor<'a>,
    key: Key,
    /// Parts that are done, of all.
    done: usize,
    work: f64,
}

/// A volume under way: at the coarsest level several, of which one goes on.
struct Trial {
    made: Synthesis,
    key: Key,
}

/// What all parts of a level need.
struct Level<'a> {
    index: usize,
    quantiles: Vec<Quantiles>,
    matching: Option<ResponseMatching<'a>>,
}

impl Level<'_> {
    /// What progress calls a neighbourhood size.
    fn name(&self, stage: Stage) -> String {
        format!("level {}, window {}", self.index, stage.window)
    }
}

/// One exemplar at one level, ready for one neighbourhood size.
struct Side<'a> {
    example: &'a Example,
    set: Neighbourhoods<'a>,
    backend: Box<dyn Search>,
    laplacian: Option<Field>,
}

impl<'a> Run<'a> {
    /// Does all of one level.
    fn level(&mut self, index: usize, trials: &mut [Trial]) -> Result<()> {
        let p = self.parameters;
        let plan = &p.levels[index];
        for trial in &mut *trials {
            self.enter(index, trial)?;
        }
        let sources = &self.levels.exemplars[index];
        let quantiles = (0..sources[0].channels())
            .map(|c| {
                let all: Vec<f32> = sources.iter().flat_map(|f| f.channel(c)).copied().collect();
                Quantiles::new(&all)
            })
            .collect();
        let matching = match plan.filters {
            Some(bank) => {
                let size = (sources[0].channels(), self.levels.shapes[index]);
                Some(ResponseMatching::new(&targets(self.examples, sources), size, bank)?)
            }
            None => None,
        };
        let level = Level { index, quantiles, matching };
        let first = 1 + index * plan.stages.len();
        let [before, after] = plan.response_steps;
        self.respond(&level, trials, before, [first as u64, u64::MAX])?;
        for (s, &stage) in plan.stages.iter().enumerate() {
            self.stage(&level, stage, trials, (first + s) as u64)?;
        }
        self.respond(&level, trials, after, [first as u64, u64::MAX - 1])
    }

    /// Brings field and maps to the resolution of a level.
    fn enter(&self, level: usize, Trial { made, key }: &mut Trial) -> Result<()> {
        let shape = self.levels.shapes[level];
        let Synthesis { field, maps, .. } = made;
        let plan = &self.parameters.levels[level];
        if shape != field.shape() {
            *field = if plan.filters.is_some() {
                let mut values = Vec::new();
                for c in 0..field.channels() {
                    // Interpolation would leave a lattice, which the responses of few voxels show.
                    let fine = enlarge(field.channel(c), field.shape(), shape, self.monitor)?;
                    values.extend(fine);
                }
                let mut fine = Field::new(shape, field.channels(), values)?;
                if plan.detail {
                    let targets = targets(self.examples, &self.levels.exemplars[level]);
                    let key = key.with(u64::MAX).with(level as u64);
                    add_detail(&targets, &mut fine, field.shape(), key, self.monitor)?;
                }
                fine
            } else {
                pyramid::enlarge(field, shape, self.parameters.boundary)
            };
            for map in maps {
                *map = map.doubled(shape);
            }
        }
        self.levels.keep_known(level, field);
        Ok(())
    }

    /// Takes steps of response matching.
    fn respond(
        &mut self,
        level: &Level<'_>,
        trials: &mut [Trial],
        steps: usize,
        [stage, part]: [u64; 2],
    ) -> Result<()> {
        if steps == 0 {
            return Ok(());
        }
        let name = format!("level {}, responses", level.index);
        for step in 0..steps {
            let share = step as f64 / steps as f64;
            self.monitor.report(&*name, (self.done as f64 + share) / self.work);
            for Trial { made, key } in &mut *trials {
                let key = key.with(stage).with(part).with(step as u64);
                self.response_step(level, &mut made.field, key)?;
            }
        }
        self.done += 1;
        Ok(())
    }

    fn response_step(&self, level: &Level<'_>, field: &mut Field, key: Key) -> Result<()> {
        if let Some(matching) = &level.matching {
            matching.step(field, &level.quantiles, key, self.monitor)?;
            self.levels.keep_known(level.index, field);
        }
        Ok(())
    }

    /// Does one neighbourhood size.
    fn stage(
        &mut self,
        level: &Level<'_>,
        stage: Stage,
        trials: &mut [Trial],
        number: u64,
    ) -> Result<()> {
        let part = self.done as f64;
        self.monitor.report(&*level.name(stage), part / self.work);
        let iterations = self.parameters.levels[level.index].iterations;
        if iterations > 0 {
            let sides = self.sides(level.index, stage, self.key.with(number))?;
            let count = trials.len() as f64;
            for (i, Trial { made, key }) in trials.iter_mut().enumerate() {
                let done = part + i as f64 / count;
                self.iterate(level, stage, &sides, made, key.with(number), |share| {
                    (done + share / count) / self.work
                })?;
            }
        }
        self.done += 1;
        Ok(())
    }

    /// Iterates with one neighbourhood size until the energy settles; `done` turns the share of the
    /// iterations into that of all work.
    fn iterate(
        &self,
        level: &Level<'_>,
        stage: Stage,
        sides: &[Side<'_>],
        made: &mut Synthesis,
        key: Key,
        done: impl Fn(f64) -> f64,
    ) -> Result<()> {
        let p = self.parameters;
        let Level { index, quantiles, .. } = level;
        let index = *index;
        let plan = &p.levels[index];
        let cold = made.energy.is_empty();
        let name = level.name(stage);
        let mut factor = 1.0f32;
        let (mut before, mut lowest, mut stale) = (f64::INFINITY, f64::INFINITY, 0);
        for iteration in 0..plan.iterations {
            let key = key.with(2 + iteration as u64);
            let left = 1.0 - iteration as f32 / plan.iterations as f32;
            let temperature = plan.temperature * left.powi(COOLING);
            let mut found = Vec::with_capacity(sides.len());
            for (i, side) in sides.iter().enumerate() {
                let passes = match (iteration, side.backend.improves()) {
                    (0, true) if cold => COLD_PASSES,
                    (0, true) => WARM_PASSES,
                    _ => 1,
                };
                // The first exemplar's key is the iteration's own.
                let key = if i == 0 { key } else { key.with(i as u64) };
                found.push(self.search(
                    index,
                    stage,
                    (i, side),
                    made,
                    (passes, temperature),
                    key,
                )?);
            }
            let (data, gradient) = energy(&found, p.gradient);
            let energy = data + gradient;
            // Fed with the energy at λ = 1: with λ inside, its own growth would read as a rise.
            if p.adaptive && before.is_finite() && energy < (1.0 - SAME) * before {
                factor *= 1.0 + GROWTH;
            } else if p.adaptive && energy > (1.0 + SAME) * before {
                factor *= 1.0 - DECAY;
            }
            self.optimise(index, sides, made, &weights(&found, factor), quantiles)?;
            // Beyond the iterations' own keys, whatever their number.
            self.response_step(level, &mut made.field, key.with(u64::MAX))?;
            made.energy.push(EnergyRecord {
                level: index,
                window: stage.window,
                iteration,
                energy,
                data,
                gradient,
                factor,
            });
            let share = (iteration + 1) as f64 / plan.iterations as f64;
            self.monitor.report(&*name, done(share));
            stale = if energy < (1.0 - f64::from(p.tolerance)) * lowest { 0 } else { stale + 1 };
            if stale == p.patience {
                break;
            }
            (before, lowest) = (energy, lowest.min(energy));
        }
        Ok(())
    }

    /// The exemplars of a level, ready to be searched.
    fn sides(&self, level: usize, stage: Stage, key: Key) -> Result<Vec<Side<'a>>> {
        let p = self.parameters;
        let sources = &self.levels.exemplars[level];
        let mut sides = Vec::with_capacity(sources.len());
        for (example, source) in self.examples.iter().zip(sources) {
            let set = Neighbourhoods::new(
                source,
                example.extent(stage.window),
                &example.orientations,
                (p.components, p.variance),
                key,
                self.monitor,
            )?;
            let backend = prepare(p.levels[level].backend, &set)?;
            let laplacian = (p.gradient > 0.0).then(|| laplacian_of(source));
            sides.push(Side { example, set, backend, laplacian });
        }
        Ok(sides)
    }

    /// The search phase of one exemplar, on a lattice shifted at random: without the shift the windows'
    /// borders would always fall on the same planes and show.
    fn search(
        &self,
        level: usize,
        stage: Stage,
        (i, side): (usize, &Side<'_>),
        made: &mut Synthesis,
        (passes, temperature): (usize, f32),
        key: Key,
    ) -> Result<Matched> {
        let p = self.parameters;
        let set = &side.set;
        let shift = std::array::from_fn(|a| key.below(a as u64, stage.step));
        let shape = made.field.shape();
        let (window, step) = (set.window(), side.example.extent(stage.step));
        let lattice = Lattice::new(shape, window, step, shift, p.boundary);
        let active = active_sites(&lattice, self.levels.domains[level].as_deref());
        let run = (p.run_penalty > 0.0)
            .then(|| RunPenalty { reach: p.run_reach, cost: p.run_penalty * set.spread() });
        let mut found = Matched::default();
        for pass in 0..passes {
            let map = &mut made.maps[i];
            let histogram = match p.index_weight {
                IndexWeight::Off => None,
                IndexWeight::Literal => Some(IndexHistogram::new(map, set, false)),
                IndexWeight::Normalised => Some(IndexHistogram::new(map, set, true)),
            };
            let key = key.with(pass as u64);
            let heat = (temperature > 0.0).then(|| Heat::new(temperature * set.spread()));
            let scene = Scene::new(set, map, &lattice, histogram, run, key).heated(heat);
            let (field, fit) = (&made.field, (p.exponent, p.gradient > 0.0));
            let backend = &*side.backend;
            let (matches, fits) = match_sites(&scene, backend, field, &active, fit, self.monitor)?;
            *map = MatchMap { lattice: lattice.clone(), matches };
            found = fits;
        }
        Ok(found)
    }

    /// The optimisation phase: least squares, gradients, histogram, known voxels.
    fn optimise(
        &self,
        level: usize,
        sides: &[Side<'_>],
        made: &mut Synthesis,
        weights: &[Vec<f32>],
        quantiles: &[Quantiles],
    ) -> Result<()> {
        let p = self.parameters;
        let Synthesis { field, maps, .. } = made;
        let emphases: Vec<Option<Vec<f32>>> = sides
            .iter()
            .zip(&*maps)
            .map(|(side, map)| emphasis(p.emphasis, &side.set, map, field))
            .collect();
        let sources: Vec<Source<'_>> = sides
            .iter()
            .zip(&emphases)
            .map(|(side, emphasis)| Source {
                field: side.set.field(),
                emphasis: emphasis.as_deref(),
                laplacian: side.laplacian.as_ref(),
                views: side.set.views(),
            })
            .collect();
        let parts: Vec<Part<'_>> = sources
            .iter()
            .zip(&*maps)
            .zip(weights)
            .map(|((source, map), weights)| Part { source, map, weights })
            .collect();
        let &LevelPlan { mixing, mode_steps, .. } = &p.levels[level];
        let first = if mode_steps > 0 { Mixing::MEAN } else { mixing };
        let gradients = blend(&parts, first, field, self.monitor)?;
        for _ in 0..mode_steps {
            blend(&parts, mixing, field, self.monitor)?;
        }
        let shape = field.shape();
        for (c, quantiles) in quantiles.iter().enumerate() {
            self.monitor.check()?;
            if let Some(Gradients { weight, laplacian }) = &gradients {
                let wanted = laplacian.channel(c);
                let values = field.channel_mut(c);
                poisson::solve(values, weight, wanted, p.gradient, shape, p.boundary);
            }
            if p.match_histogram {
                quantiles.match_values(field.channel_mut(c), self.levels.domains[level].as_deref());
            }
        }
        self.levels.keep_known(level, field);
        Ok(())
    }
}

fn laplacian_of(field: &Field) -> Field {
    let mut out = Field::zeros(field.shape(), field.channels());
    for c in 0..field.channels() {
        out.channel_mut(c).copy_from_slice(&poisson::laplacian(field.channel(c), field.shape()));
    }
    out
}

#[cfg(test)]
mod tests;
