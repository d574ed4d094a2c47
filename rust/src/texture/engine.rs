//! The coarse-to-fine schedule and the expectation-maximisation passes.

use super::blend::{Gradients, Source, blend};
use super::field::Field;
use super::lattice::Lattice;
use super::levels::Levels;
use super::match_map::{MatchMap, random_blocks};
use super::matching::{Matched, active_sites, match_sites};
use super::neighbourhoods::Neighbourhoods;
use super::parameters::{Constraints, EnergyRecord, IndexWeight, Parameters, Stage, Synthesis};
use super::search::penalty::{IndexHistogram, RunPenalty};
use super::search::{Scene, Search, prepare};
use super::{poisson, pyramid};
use crate::error::Result;
use crate::intensity::Quantiles;
use crate::monitor::Monitor;
use crate::rng::Key;
use crate::volume::Shape;

/// Search passes of the very first iteration, when the map knows nothing: after ten the energy no
/// longer falls.
const COLD_PASSES: usize = 10;

/// Search passes of the first iteration of every further stage.
const WARM_PASSES: usize = 2;

/// A stage ends after this many iterations in a row without a new lowest energy. The lattice moves at
/// random, and the energy with it by some percent, so that the change of one iteration says little.
const PATIENCE: usize = 3;

/// Eq. 2: the weight factor grows by this share when the energy falls …
const GROWTH: f32 = 0.05;

/// … and shrinks by this share when it rises.
const DECAY: f32 = 0.3;

/// Energies closer than this share are the same to Eq. 2. The lattice's random shift alone moves the
/// energy by up to a tenth; were that a rise, λ would shrink until only the gradient term is left.
const SAME: f64 = 0.1;

/// Makes a field of this shape whose windows all look like windows of the exemplar.
///
/// Memory: about 24 bytes a voxel of the output and channel with the gradient term, 8 without, and
/// `2·dims` bytes a voxel of the exemplar and orientation.
///
/// # Errors
/// If a parameter does not fit the exemplar or the shape, or the caller cancels.
pub fn synthesize(
    exemplar: &Field,
    shape: Shape,
    parameters: &Parameters,
    constraints: Constraints,
    key: Key,
    monitor: &Monitor<'_>,
) -> Result<Synthesis> {
    parameters.check(exemplar, shape, &constraints)?;
    let levels = Levels::new(exemplar, shape, constraints, parameters.levels);
    let coarsest = parameters.levels - 1;
    let start = &levels.exemplars[coarsest];
    let shortest = start.shape().into_iter().chain(levels.shapes[coarsest]).min().unwrap_or(1);
    let block = parameters.block.min(shortest);
    let (field, map) =
        random_blocks(start, levels.shapes[coarsest], block, parameters.boundary, key.with(0));
    let mut run = Run {
        levels: &levels,
        parameters,
        monitor,
        made: Synthesis { field, map, energy: Vec::new() },
    };
    let stages = parameters.stages.len();
    let total = (parameters.levels * stages) as f64;
    for level in (0..parameters.levels).rev() {
        run.enter(level);
        for (s, &stage) in parameters.stages.iter().enumerate() {
            let done = ((coarsest - level) * stages + s) as f64;
            run.stage(level, stage, key.with((1 + level * stages + s) as u64), done, total)?;
        }
    }
    Ok(run.made)
}

/// A synthesis under way.
struct Run<'a> {
    levels: &'a Levels,
    parameters: &'a Parameters,
    monitor: &'a Monitor<'a>,
    made: Synthesis,
}

impl Run<'_> {
    /// Brings field and map to the resolution of a level.
    fn enter(&mut self, level: usize) {
        let shape = self.levels.shapes[level];
        if shape != self.made.field.shape() {
            self.made.field = pyramid::enlarge(&self.made.field, shape, self.parameters.boundary);
            self.made.map = self.made.map.doubled(shape);
        }
        self.levels.keep_known(level, &mut self.made.field);
    }

    /// Iterates with one neighbourhood size until the energy settles.
    fn stage(&mut self, level: usize, stage: Stage, key: Key, done: f64, total: f64) -> Result<()> {
        let p = self.parameters;
        let exemplar = &self.levels.exemplars[level];
        let name = format!("level {level}, window {}", stage.window);
        self.monitor.report(&*name, done / total);
        let components = (p.components, p.variance);
        let set = Neighbourhoods::new(
            exemplar,
            stage.window,
            &p.orientations,
            components,
            key,
            self.monitor,
        )?;
        let backend = prepare(p.backend, &set)?;
        let laplacian = (p.gradient > 0.0).then(|| laplacian_of(exemplar));
        let source = Source { field: exemplar, laplacian: laplacian.as_ref(), views: set.views() };
        let quantiles: Vec<Quantiles> =
            (0..exemplar.channels()).map(|c| Quantiles::new(exemplar.channel(c))).collect();
        let mut factor = 1.0f32;
        let (mut before, mut lowest, mut stale) = (f64::INFINITY, f64::INFINITY, 0);
        for iteration in 0..p.iterations {
            let key = key.with(2 + iteration as u64);
            let passes = match (iteration, backend.improves()) {
                (0, true) if done == 0.0 => COLD_PASSES,
                (0, true) => WARM_PASSES,
                _ => 1,
            };
            let found = self.search(level, stage, &set, &*backend, passes, key)?;
            let (data, gradient) = found.energy(p.gradient);
            let energy = data + gradient;
            // Fed with the energy at λ = 1: with λ inside, its own growth would read as a rise.
            if p.adaptive && before.is_finite() && energy < (1.0 - SAME) * before {
                factor *= 1.0 + GROWTH;
            } else if p.adaptive && energy > (1.0 + SAME) * before {
                factor *= 1.0 - DECAY;
            }
            self.optimise(level, &source, &found.weights(factor), &quantiles)?;
            self.made.energy.push(EnergyRecord {
                level,
                window: stage.window,
                iteration,
                energy,
                data,
                gradient,
                factor,
            });
            let share = (iteration + 1) as f64 / p.iterations as f64;
            self.monitor.report(&*name, (done + share) / total);
            stale = if energy < (1.0 - f64::from(p.tolerance)) * lowest { 0 } else { stale + 1 };
            if stale == PATIENCE {
                break;
            }
            (before, lowest) = (energy, lowest.min(energy));
        }
        Ok(())
    }

    /// The search phase, on a lattice shifted at random: without the shift the windows' borders would
    /// always fall on the same planes and show.
    fn search(
        &mut self,
        level: usize,
        stage: Stage,
        set: &Neighbourhoods<'_>,
        backend: &dyn Search,
        passes: usize,
        key: Key,
    ) -> Result<Matched> {
        let p = self.parameters;
        let shift = std::array::from_fn(|a| key.below(a as u64, stage.step));
        let shape = self.made.field.shape();
        let lattice = Lattice::new(shape, stage.window, stage.step, shift, p.boundary);
        let active = active_sites(&lattice, self.levels.domains[level].as_deref());
        let run = (p.run_penalty > 0.0)
            .then(|| RunPenalty { reach: p.run_reach, cost: p.run_penalty * set.spread() });
        let mut found = Matched::default();
        for pass in 0..passes {
            let histogram = match p.index_weight {
                IndexWeight::Off => None,
                IndexWeight::Literal => Some(IndexHistogram::new(&self.made.map, set, false)),
                IndexWeight::Normalised => Some(IndexHistogram::new(&self.made.map, set, true)),
            };
            let key = key.with(pass as u64);
            let scene = Scene::new(set, &self.made.map, &lattice, histogram, run, key);
            let (field, fit) = (&self.made.field, (p.exponent, p.gradient > 0.0));
            let (matches, fits) = match_sites(&scene, backend, field, &active, fit, self.monitor)?;
            self.made.map = MatchMap { lattice: lattice.clone(), matches };
            found = fits;
        }
        Ok(found)
    }

    /// The optimisation phase: least squares, gradients, histogram, known voxels.
    fn optimise(
        &mut self,
        level: usize,
        source: &Source<'_>,
        weights: &[f32],
        quantiles: &[Quantiles],
    ) -> Result<()> {
        let p = self.parameters;
        let Synthesis { field, map, .. } = &mut self.made;
        let gradients = blend(source, map, weights, field, self.monitor)?;
        let shape = field.shape();
        for (c, quantiles) in quantiles.iter().enumerate() {
            self.monitor.check()?;
            if let Some(Gradients { weight, laplacian }) = &gradients {
                let wanted = laplacian.channel(c);
                let values = field.channel_mut(c);
                poisson::solve(values, weight, wanted, p.gradient, shape, p.boundary);
            }
            quantiles.match_values(field.channel_mut(c), self.levels.domains[level].as_deref());
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
