//! What a synthesis is asked for.

use super::blend::Mixing;
use super::field::Field;
use super::match_map::MatchMap;
use super::responses::FilterBank;
use super::symmetry::Orientation;
use crate::error::{Error, Result};
use crate::volume::{Boundary, Shape, voxels};

/// An exemplar, and which windows of the output look like its windows.
#[derive(Debug, Clone, PartialEq)]
pub struct Example {
    /// Its values: a volume, or an image of shape (1, y, x).
    pub field: Field,
    /// How it is laid into the output.
    pub orientations: Vec<Orientation>,
    /// The axis to which its windows are perpendicular; cubic windows without.
    pub normal: Option<usize>,
    /// Factor on the weight of its windows.
    pub weight: f32,
}

impl Example {
    /// A volume, whose windows are cubes.
    pub const fn volume(field: Field, orientations: Vec<Orientation>) -> Self {
        Self { field, orientations, normal: None, weight: 1.0 }
    }

    /// An image of shape (1, y, x) for the planes perpendicular to an axis.
    pub fn image(field: Field, normal: usize, symmetric: bool, weight: f32) -> Self {
        let orientations = Orientation::of_plane(normal, symmetric);
        Self { field, orientations, normal: Some(normal), weight }
    }

    /// Edges of a window or a lattice cell: one voxel along the normal.
    pub fn extent(&self, edge: usize) -> Shape {
        std::array::from_fn(|a| if self.normal == Some(a) { 1 } else { edge })
    }
}

/// One neighbourhood size of the schedule.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stage {
    /// Edge w of the window.
    pub window: usize,
    /// Lattice step t.
    pub step: usize,
}

/// What is done at one level of the pyramid.
#[derive(Debug, Clone, PartialEq)]
pub struct LevelPlan {
    /// Neighbourhood sizes, one after the other.
    pub stages: Vec<Stage>,
    /// Most iterations of a window.
    pub iterations: usize,
    /// Filters of response matching, of which a step also follows every iteration of a window; for a
    /// periodic output of images only.
    pub filters: Option<FilterBank>,
    /// Whether waves that the coarser level could not hold start as noise, as strong as in the images,
    /// where there is response matching.
    pub detail: bool,
    /// Steps of response matching before the first window and after the last.
    pub response_steps: [usize; 2],
    /// How matches are found.
    pub backend: Backend,
    /// Temperature of a window's first iteration, in units of the descriptors' variance: with which
    /// candidates of coherent search are chosen at random; 0 takes the best.
    pub temperature: f32,
    /// How windows become a volume.
    pub mixing: Mixing,
    /// Steps from the plain mean towards the main mode of the windows' values (Kopf et al. 2007); 0:
    /// from the values that the voxels have.
    pub mode_steps: usize,
}

/// How the output's first values are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Start {
    /// Random cubic blocks of this edge of the exemplar, a volume (zhang_2017 §5.1).
    Blocks(usize),
    /// Random voxels of the exemplars (prieto_2011 §2.1).
    Voxels,
    /// A Gaussian random field with the images' covariance and histogram.
    RandomField,
}

/// What keeps some voxels of the exemplars from being used more than others.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Emphasis {
    /// Nothing.
    None,
    /// Values that the output has too much of weigh less (Kopf et al. 2007).
    Histogram,
    /// Voxels that the windows have used too often weigh less (Chen & Wang 2010).
    Position,
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
    pub levels: Vec<LevelPlan>,
    pub tolerance: f32,
    pub patience: usize,
    pub start: Start,
    pub starts: usize,
    pub components: usize,
    pub variance: f32,
    pub emphasis: Emphasis,
    pub match_histogram: bool,
    pub index_weight: IndexWeight,
    pub run_penalty: f32,
    pub run_reach: usize,
    pub exponent: f32,
    pub adaptive: bool,
    pub gradient: f32,
    pub boundary: Boundary,
}

/// Voxels that are given, voxels that matter, and values to start from.
#[derive(Debug, Clone, Default)]
pub struct Constraints {
    /// Values and a mask of the voxels that are kept.
    pub known: Option<(Field, Vec<bool>)>,
    /// The free-form domain: windows that miss it are not searched.
    pub domain: Option<Vec<bool>>,
    /// First values at the coarsest level, of which the order counts, in place of a random field.
    pub start: Option<Field>,
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
    /// Where each window came from, an exemplar each.
    pub maps: Vec<MatchMap>,
    /// One record an iteration.
    pub energy: Vec<EnergyRecord>,
}

impl Parameters {
    /// Refuses what cannot work.
    pub(super) fn check(
        &self,
        examples: &[Example],
        shape: Shape,
        constraints: &Constraints,
    ) -> Result<()> {
        let p = self;
        let most = usize::from(u16::MAX);
        let shapes = examples.iter().map(|example| example.field.shape());
        if shape.into_iter().chain(shapes.flatten()).any(|n| n == 0 || n >= most) {
            return Err(Error::parameter(
                "shape",
                shape,
                format!("must be from 1 to {most} along each axis"),
            ));
        }
        let channels = examples.first().map_or(0, |example| example.field.channels());
        if examples.iter().any(|example| example.field.channels() != channels) || channels == 0 {
            let allowed = "must be given, and all have the same channels";
            return Err(Error::parameter("exemplars", examples.len(), allowed));
        }
        if p.levels.iter().any(|plan| plan.stages.is_empty())
            || p.levels.is_empty()
            || p.components == 0
        {
            return Err(Error::parameter(
                "levels, stages, components",
                (p.levels.len(), p.components),
                "must be at least 1",
            ));
        }
        let images = examples.iter().all(|example| example.normal.is_some());
        let matched = p.levels.iter().any(|plan| plan.filters.is_some());
        let fourier = matched || p.start == Start::RandomField;
        if fourier && !(images && p.boundary == Boundary::Periodic) {
            let allowed = "must be periodic, and made of images, where responses are matched";
            return Err(Error::parameter("boundary", p.boundary, allowed));
        }
        if p.starts == 0 || p.starts > 1 && (examples.len() > 1 || images) {
            let allowed = "must be 1, or more if the only exemplar is a volume";
            return Err(Error::parameter("starts", p.starts, allowed));
        }
        for stage in p.levels.iter().flat_map(|plan| &plan.stages) {
            if stage.step == 0 || stage.step > stage.window {
                return Err(Error::parameter("step", stage.step, "must be from 1 to the window"));
            }
            for example in examples {
                p.check_window(stage.window, example, shape)?;
            }
        }
        let n = voxels(shape);
        let known = constraints
            .known
            .as_ref()
            .is_some_and(|(f, k)| f.shape() != shape || f.channels() != channels || k.len() != n);
        if known || constraints.domain.as_ref().is_some_and(|d| d.len() != n) {
            return Err(Error::parameter(
                "known, mask",
                shape,
                "must have the shape of the output",
            ));
        }
        let coarsest = shape.map(|n| n.div_ceil(1 << (p.levels.len() - 1)));
        if let Some(start) = &constraints.start
            && (p.start != Start::RandomField
                || (start.channels(), start.shape()) != (channels, coarsest))
        {
            let allowed = format!(
                "must be {channels} channels of {coarsest:?}, the coarsest level, where the start \
                 would be a random field"
            );
            return Err(Error::parameter("start", (start.channels(), start.shape()), allowed));
        }
        Ok(())
    }

    /// Refuses what is smaller than a window at the coarsest level.
    fn check_window(&self, window: usize, example: &Example, shape: Shape) -> Result<()> {
        let halvings = self.levels.len() - 1;
        let across = |s: Shape, normal: Option<usize>| {
            let edges = (0..3).filter(move |&a| normal != Some(a)).map(move |a| s[a]);
            edges.min().unwrap_or(0) >> halvings
        };
        // An image lies perpendicular to its own first axis.
        let flat = example.normal.map(|_| 0);
        let own = ("exemplar", example.field.shape(), flat);
        for (name, s, normal) in [own, ("shape", shape, example.normal)] {
            if across(s, normal) < window {
                return Err(Error::parameter(
                    name,
                    s,
                    format!(
                        "must be at least {} along each axis for a window of {window} at {} levels",
                        window << halvings,
                        self.levels.len()
                    ),
                ));
            }
        }
        Ok(())
    }
}
