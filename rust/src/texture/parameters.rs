//! What a synthesis is asked for.

use super::field::Field;
use super::match_map::MatchMap;
use super::symmetry::Orientation;
use crate::error::{Error, Result};
use crate::volume::{Boundary, Shape, voxels};

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

impl Parameters {
    /// Refuses what cannot work.
    pub(super) fn check(
        &self,
        exemplar: &Field,
        shape: Shape,
        constraints: &Constraints,
    ) -> Result<()> {
        let p = self;
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
            return Err(Error::parameter(
                "known, mask",
                shape,
                "must have the shape of the output",
            ));
        }
        Ok(())
    }
}
