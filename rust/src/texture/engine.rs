//! The coarse-to-fine schedule and the passes.

use rayon::prelude::*;

use super::blend::{Source, blend};
use super::field::Field;
use super::lattice::Lattice;
use super::match_map::{Match, MatchMap, random_blocks};
use super::neighbourhoods::{BLOCK, Neighbourhoods, Projection, copy_row};
use super::search::penalty::{IndexHistogram, RunPenalty};
use super::search::{BruteForce, Coherent, KdTree, Scene, Search};
use super::symmetry::Orientation;
use super::{poisson, pyramid};
use crate::error::{Error, Result};
use crate::intensity::Quantiles;
use crate::monitor::Monitor;
use crate::rng::Key;
use crate::volume::{Boundary, Shape, position, voxels};

/// Search passes of the very first iteration, when the map knows nothing: after ten the energy no
/// longer falls.
const COLD_PASSES: usize = 10;

/// Search passes of the first iteration of every further stage.
const WARM_PASSES: usize = 2;

/// Added to a root mean square difference, in field units, before it is raised to r − 2: a window
/// that matches exactly must not take over.
const FLOOR: f32 = 1.0;

/// Eq. 2: the weight factor grows by this share when the energy falls …
const GROWTH: f32 = 0.05;

/// … and shrinks by this share when it rises.
const DECAY: f32 = 0.3;

/// One neighbourhood size of the schedule.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stage {
    /// Edge w of the cubic window.
    pub window: usize,
    /// Lattice step t.
    pub step: usize,
}

/// How matches are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Backend {
    /// Every window.
    BruteForce,
    /// kd-tree with this many re-ranked candidates.
    KdTree(usize),
    /// Propagation and random sampling.
    Coherent,
}

/// The index histogram of zhang_2017 §4.2.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum IndexWeight {
    /// Not used.
    Off,
    /// As printed in the paper.
    Literal,
    /// In units of the expected share.
    Normalised,
}

/// Parameters of the optimisation; see the Python class for their meaning and defaults.
#[derive(Debug, Clone, PartialEq)]
#[allow(missing_docs)]
pub struct Parameters {
    pub levels: usize,
    pub stages: Vec<Stage>,
    pub iterations: usize,
    pub tolerance: f32,
    pub block: usize,
    pub components: usize,
    pub variance: f32,
    pub orientations: Vec<Orientation>,
    pub backend: Backend,
    pub index_weight: IndexWeight,
    pub run_penalty: f32,
    pub run_reach: usize,
    pub exponent: f32,
    pub adaptive: bool,
    pub gradient: f32,
    pub boundary: Boundary,
    pub slab: usize,
}

/// Voxels that are given, and voxels that matter.
#[derive(Debug, Clone, Default)]
pub struct Constraints {
    /// Values and a mask of the voxels that are kept.
    pub known: Option<(Field, Vec<bool>)>,
    /// The free-form domain: windows that miss it are not searched.
    pub domain: Option<Vec<bool>>,
}

/// Energy of Eq. 1 after one iteration, a mean over the voxels of the windows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EnergyRecord {
    /// Level of the pyramid, 0 the finest.
    pub level: usize,
    /// Edge of the window.
    pub window: usize,
    /// Iteration within the stage.
    pub iteration: usize,
    /// Data plus gradient term.
    pub energy: f64,
    /// The weighted patch term.
    pub data: f64,
    /// μ times the gradient term.
    pub gradient: f64,
    /// The adaptive factor λ that the next blend uses.
    pub factor: f32,
}

/// What the optimisation leaves.
#[derive(Debug, Clone)]
pub struct Synthesis {
    /// The field.
    pub field: Field,
    /// Where each window came from.
    pub map: MatchMap,
    /// One record an iteration.
    pub energy: Vec<EnergyRecord>,
}

/// Makes a field of this shape whose windows all look like windows of the exemplar.
///
/// Memory: about 28 bytes a voxel of the output and channel with the gradient term, 12 without, and
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
    check(exemplar, shape, parameters, &constraints)?;
    let levels = parameters.levels;
    let pyramid = Pyramid::new(exemplar, shape, constraints, levels);

    let coarsest = levels - 1;
    let start = &pyramid.exemplars[coarsest];
    let shortest = start.shape().into_iter().chain(pyramid.shapes[coarsest]).min().unwrap_or(1);
    let (mut field, mut map) = random_blocks(
        start,
        pyramid.shapes[coarsest],
        parameters.block.min(shortest),
        parameters.boundary,
        key.with(0),
    );
    let mut energy = Vec::new();
    let total = (levels * parameters.stages.len()) as f64;
    for (done, level) in (0..levels).rev().enumerate() {
        if level != coarsest {
            field = pyramid::enlarge(&field, pyramid.shapes[level], parameters.boundary);
            map = map.doubled(pyramid.shapes[level]);
        }
        pyramid.keep_known(level, &mut field);
        let quantiles: Vec<Quantiles> = (0..exemplar.channels())
            .map(|c| Quantiles::new(pyramid.exemplars[level].channel(c)))
            .collect();
        for (s, stage) in parameters.stages.iter().enumerate() {
            let work = LevelStage {
                level,
                stage: *stage,
                first: done == 0 && s == 0,
                key: key.with((1 + level * parameters.stages.len() + s) as u64),
                progress: ((done * parameters.stages.len() + s) as f64 / total, 1.0 / total),
            };
            work.run(&pyramid, parameters, &quantiles, &mut field, &mut map, &mut energy, monitor)?;
        }
    }
    Ok(Synthesis { field, map, energy })
}

fn check(exemplar: &Field, shape: Shape, p: &Parameters, constraints: &Constraints) -> Result<()> {
    let most = usize::from(u16::MAX);
    if shape.iter().chain(&exemplar.shape()).any(|&n| n == 0 || n >= most) {
        return Err(Error::parameter(
            "shape",
            shape,
            format!("must be from 1 to {most} along each axis"),
        ));
    }
    if p.levels == 0 || p.iterations == 0 || p.stages.is_empty() || p.components == 0 {
        return Err(Error::parameter(
            "levels, iterations, stages, components",
            (p.levels, p.iterations, p.stages.len(), p.components),
            "must be at least 1",
        ));
    }
    let shortest = |s: Shape| s.iter().min().copied().unwrap_or(0) >> (p.levels - 1);
    for stage in &p.stages {
        if stage.step == 0 || stage.step > stage.window {
            return Err(Error::parameter("step", stage.step, "must be from 1 to the window"));
        }
        for (name, s) in [("exemplar", exemplar.shape()), ("shape", shape)] {
            if shortest(s) < stage.window {
                return Err(Error::parameter(
                    name,
                    s,
                    format!(
                        "must be at least {} along each axis for a window of {} at {} levels",
                        stage.window << (p.levels - 1),
                        stage.window,
                        p.levels
                    ),
                ));
            }
        }
    }
    let n = voxels(shape);
    let known = constraints.known.as_ref().is_some_and(|(f, k)| {
        f.shape() != shape || f.channels() != exemplar.channels() || k.len() != n
    });
    if known || constraints.domain.as_ref().is_some_and(|d| d.len() != n) {
        return Err(Error::parameter("known, mask", shape, "must have the shape of the output"));
    }
    Ok(())
}

/// Exemplar and constraints at every level, 0 the finest.
struct Pyramid {
    exemplars: Vec<Field>,
    shapes: Vec<Shape>,
    known: Vec<Option<(Field, Vec<bool>)>>,
    domains: Vec<Option<Vec<bool>>>,
}

impl Pyramid {
    fn new(exemplar: &Field, shape: Shape, constraints: Constraints, levels: usize) -> Self {
        let mut this = Self {
            exemplars: vec![exemplar.clone()],
            shapes: vec![shape],
            known: vec![constraints.known],
            domains: vec![constraints.domain],
        };
        for level in 1..levels {
            let from = this.shapes[level - 1];
            let to = from.map(|n| n.div_ceil(2));
            this.exemplars.push(pyramid::reduce(&this.exemplars[level - 1]));
            // Half of the voxels below must be known for their mean to say something.
            let known = this.known[level - 1].as_ref().map(|(values, known)| {
                (pyramid::reduce_known(values, known, to), pyramid::reduce_mask(known, from, to, 4))
            });
            let domain =
                this.domains[level - 1].as_ref().map(|d| pyramid::reduce_mask(d, from, to, 1));
            this.known.push(known);
            this.domains.push(domain);
            this.shapes.push(to);
        }
        this
    }

    fn keep_known(&self, level: usize, field: &mut Field) {
        if let Some((values, known)) = &self.known[level] {
            for c in 0..field.channels() {
                for (v, (k, on)) in
                    field.channel_mut(c).iter_mut().zip(values.channel(c).iter().zip(known))
                {
                    if *on {
                        *v = *k;
                    }
                }
            }
        }
    }
}

/// One neighbourhood size at one level.
struct LevelStage {
    level: usize,
    stage: Stage,
    first: bool,
    key: Key,
    progress: (f64, f64),
}

impl LevelStage {
    #[allow(clippy::too_many_arguments)]
    fn run(
        &self,
        pyramid: &Pyramid,
        p: &Parameters,
        quantiles: &[Quantiles],
        field: &mut Field,
        map: &mut MatchMap,
        energy: &mut Vec<EnergyRecord>,
        monitor: &Monitor<'_>,
    ) -> Result<()> {
        let Stage { window, step } = self.stage;
        let exemplar = &pyramid.exemplars[self.level];
        let name = format!("level {}, window {window}", self.level);
        monitor.report(&*name, self.progress.0);
        let set = Neighbourhoods::new(
            exemplar,
            window,
            &p.orientations,
            (p.components, p.variance),
            self.key,
            monitor,
        )?;
        let backend: Box<dyn Search> = match p.backend {
            Backend::BruteForce => Box::new(BruteForce),
            Backend::KdTree(candidates) => Box::new(KdTree::new(&set, candidates)?),
            Backend::Coherent => Box::new(Coherent),
        };
        let laplacian = (p.gradient > 0.0).then(|| laplacian_of(exemplar));
        let source = Source { field: exemplar, laplacian: laplacian.as_ref(), views: set.views() };
        let run = (p.run_penalty > 0.0)
            .then(|| RunPenalty { reach: p.run_reach, cost: p.run_penalty * set.spread() });
        let domain = pyramid.domains[self.level].as_deref();
        let shape = field.shape();
        let mut factor = 1.0f32;
        let mut before = f64::INFINITY;
        for iteration in 0..p.iterations {
            let key = self.key.with(2 + iteration as u64);
            let shift = std::array::from_fn(|a| key.below(a as u64, step));
            let lattice = Lattice::new(shape, window, step, shift, p.boundary);
            let passes = match (iteration, backend.improves()) {
                (0, true) if self.first => COLD_PASSES,
                (0, true) => WARM_PASSES,
                _ => 1,
            };
            let active = active_sites(&lattice, domain);
            let mut found = None;
            for pass in 0..passes {
                let histogram = match p.index_weight {
                    IndexWeight::Off => None,
                    IndexWeight::Literal => Some(IndexHistogram::new(map, &set, false)),
                    IndexWeight::Normalised => Some(IndexHistogram::new(map, &set, true)),
                };
                let scene = Scene::new(&set, map, &lattice, histogram, run, key.with(pass as u64));
                let matched = match_sites(&scene, &*backend, field, &active, p, monitor)?;
                *map = MatchMap { lattice: lattice.clone(), matches: matched.matches.clone() };
                found = Some(matched);
            }
            let Some(found) = found else { break };
            let record = found.energy(p.gradient);
            // Eq. 2, fed with the energy at λ = 1: with λ inside, its own growth would read as a rise.
            if p.adaptive && before.is_finite() {
                if record.0 + record.1 < before {
                    factor *= 1.0 + GROWTH;
                } else if record.0 + record.1 > before {
                    factor *= 1.0 - DECAY;
                }
            }
            let weights = found.weights(factor);
            let blended = blend(&source, map, &weights, field, p.slab, monitor)?;
            *field = blended.mean;
            if let Some(laplacian) = blended.laplacian {
                for c in 0..field.channels() {
                    monitor.check()?;
                    let mut values = field.channel(c).to_vec();
                    poisson::solve(
                        &mut values,
                        &blended.weight,
                        laplacian.channel(c),
                        p.gradient,
                        shape,
                        p.boundary,
                    );
                    field.channel_mut(c).copy_from_slice(&values);
                }
            }
            for (c, quantiles) in quantiles.iter().enumerate() {
                quantiles.match_values(field.channel_mut(c), domain);
            }
            pyramid.keep_known(self.level, field);
            let total = record.0 + record.1;
            energy.push(EnergyRecord {
                level: self.level,
                window,
                iteration,
                energy: total,
                data: record.0,
                gradient: record.1,
                factor,
            });
            let share = (iteration + 1) as f64 / p.iterations as f64;
            monitor.report(&*name, self.progress.0 + share * self.progress.1);
            if (before - total).abs() < f64::from(p.tolerance) * before {
                break;
            }
            before = total;
        }
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

/// Which windows touch the domain.
fn active_sites(lattice: &Lattice, domain: Option<&[bool]>) -> Vec<bool> {
    let sites = lattice.sites();
    let Some(domain) = domain else { return vec![true; voxels(sites)] };
    let shape = lattice.shape;
    (0..voxels(sites))
        .into_par_iter()
        .map(|site| {
            let at = position(sites, site);
            let o: [usize; 3] = std::array::from_fn(|a| lattice.origins[a][at[a]]);
            let w = lattice.window;
            (0..w).any(|z| {
                (0..w).any(|y| {
                    let row = ((o[0] + z) % shape[0] * shape[1] + (o[1] + y) % shape[1]) * shape[2];
                    (0..w).any(|x| domain[row + (o[2] + x) % shape[2]])
                })
            })
        })
        .collect()
}

/// Matches of all sites and how well they fit.
struct Matched {
    matches: Vec<Match>,
    /// Unscaled weight ‖s − e‖^(r − 2) of each site; 0 outside the domain.
    weights: Vec<f32>,
    /// Mean squared difference per voxel, and per pair of neighbouring voxels.
    data: Vec<f32>,
    gradient: Vec<f32>,
}

impl Matched {
    /// Data and gradient terms of Eq. 1 at λ = 1, means over the windows' voxels.
    fn energy(&self, mu: f32) -> (f64, f64) {
        let sites = self.weights.iter().filter(|w| **w > 0.0).count().max(1) as f64;
        let data: f64 = self.weights.iter().zip(&self.data).map(|(w, d)| f64::from(w * d)).sum();
        let gradient: f64 = self.gradient.iter().map(|g| f64::from(*g)).sum();
        (data / sites, f64::from(mu) * gradient / sites)
    }

    /// Weights with mean λ: only their ratio to μ matters, which λ then sets.
    fn weights(&self, factor: f32) -> Vec<f32> {
        let sum: f64 = self.weights.iter().map(|w| f64::from(*w)).sum();
        let sites = self.weights.iter().filter(|w| **w > 0.0).count();
        let scale = if sum > 0.0 { factor * (sites as f64 / sum) as f32 } else { 0.0 };
        self.weights.iter().map(|w| w * scale).collect()
    }
}

/// The M-step: describes every window of the output, finds its match and measures the fit.
fn match_sites(
    scene: &Scene<'_>,
    backend: &dyn Search,
    field: &Field,
    active: &[bool],
    p: &Parameters,
    monitor: &Monitor<'_>,
) -> Result<Matched> {
    let set = scene.neighbourhoods;
    let (n, length, dims) = (active.len(), set.length(), set.dims());
    let mut out = Matched {
        matches: vec![Match::NONE; n],
        weights: vec![0.0; n],
        data: vec![0.0; n],
        gradient: vec![0.0; n],
    };
    let sites = scene.lattice.sites();
    out.matches
        .par_chunks_mut(BLOCK)
        .zip(out.weights.par_chunks_mut(BLOCK))
        .zip(out.data.par_chunks_mut(BLOCK).zip(out.gradient.par_chunks_mut(BLOCK)))
        .enumerate()
        .try_for_each_init(
            Scratch::default,
            |scratch, (block, ((matches, weights), (data, gradient)))| {
                monitor.check()?;
                let first = block * BLOCK;
                let count = matches.len();
                let active = &active[first..first + count];
                if !active.contains(&true) {
                    return Ok(());
                }
                scratch.windows.resize(count * length, 0.0);
                scratch.queries.resize(count * dims, 0);
                for (i, window) in scratch.windows.chunks_exact_mut(length).enumerate() {
                    if active[i] {
                        let at = position(sites, first + i);
                        let origin = std::array::from_fn(|a| scene.lattice.origins[a][at[a]]);
                        gather(field, origin, set.window(), window);
                    }
                }
                set.describe(&scratch.windows, &mut scratch.projection, &mut scratch.queries);
                backend.search(scene, first, &scratch.queries, active, matches);
                scratch.candidate.resize(length, 0.0);
                for i in (0..count).filter(|&i| active[i]) {
                    set.gather(matches[i], &mut scratch.candidate);
                    let own = &mut scratch.windows[i * length..(i + 1) * length];
                    let fit = compare(own, &scratch.candidate, set.window(), p.gradient > 0.0);
                    (data[i], gradient[i]) = fit;
                    weights[i] = (data[i].sqrt() + FLOOR).powf(p.exponent - 2.0);
                }
                Ok(())
            },
        )?;
    Ok(out)
}

#[derive(Default)]
struct Scratch {
    windows: Vec<f32>,
    queries: Vec<i16>,
    candidate: Vec<f32>,
    projection: Projection,
}

/// Copies a window of the output, which wraps if the boundary is periodic (an open lattice never
/// reaches over the border).
fn gather(field: &Field, origin: [usize; 3], window: usize, out: &mut [f32]) {
    let [nz, ny, nx] = field.shape();
    let head = window.min(nx - origin[2]);
    for (c, out) in out.chunks_exact_mut(window.pow(3)).enumerate() {
        let values = field.channel(c);
        for (row, out) in out.chunks_exact_mut(window).enumerate() {
            let (z, y) = ((origin[0] + row / window) % nz, (origin[1] + row % window) % ny);
            let line = &values[(z * ny + y) * nx..][..nx];
            if head == window {
                copy_row(&line[origin[2]..origin[2] + window], out);
            } else {
                out[..head].copy_from_slice(&line[origin[2]..]);
                out[head..].copy_from_slice(&line[..window - head]);
            }
        }
    }
}

/// Mean squared difference of two windows, and of their gradients if wanted; `a` becomes the
/// difference.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
fn compare(a: &mut [f32], b: &[f32], w: usize, gradients: bool) -> (f32, f32) {
    let mut sums = [0.0f32; 8];
    for (a, b) in a.chunks_mut(8).zip(b.chunks(8)) {
        for ((s, a), b) in sums.iter_mut().zip(a).zip(b) {
            *a -= b;
            *s += *a * *a;
        }
    }
    let data = sums.iter().sum::<f32>() / a.len() as f32;
    if !gradients {
        return (data, 0.0);
    }
    let (plane, cube) = (w * w, w * w * w);
    let mut gradient = 0.0f32;
    for d in a.chunks_exact(cube) {
        gradient += square_difference(&d[..cube - plane], &d[plane..]);
        for layer in d.chunks_exact(plane) {
            gradient += square_difference(&layer[..plane - w], &layer[w..]);
        }
        // Along x all pairs of the cube at once, then without those that span two rows.
        gradient += square_difference(&d[..cube - 1], &d[1..]);
        gradient -= d[w - 1..cube - 1]
            .iter()
            .step_by(w)
            .zip(d[w..].iter().step_by(w))
            .map(|(a, b)| (a - b) * (a - b))
            .sum::<f32>();
    }
    // Each pair counts for both of its voxels.
    (data, 2.0 * gradient.max(0.0) / a.len() as f32)
}

#[inline(always)]
fn square_difference(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0f32; 8];
    for (a, b) in a.chunks(8).zip(b.chunks(8)) {
        for ((s, a), b) in sums.iter_mut().zip(a).zip(b) {
            *s += (a - b) * (a - b);
        }
    }
    sums.iter().sum()
}

#[cfg(test)]
mod tests;
