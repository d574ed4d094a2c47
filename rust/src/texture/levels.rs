//! Exemplars and constraints at every resolution.

use super::field::Field;
use super::parameters::{Constraints, Example, Parameters, Start};
use super::pyramid;
use crate::volume::Shape;

/// Exemplars and constraints at every level, 0 the finest.
pub(super) struct Levels {
    /// The exemplars of each level.
    pub(super) exemplars: Vec<Vec<Field>>,
    pub(super) shapes: Vec<Shape>,
    known: Vec<Option<(Field, Vec<bool>)>>,
    pub(super) domains: Vec<Option<Vec<bool>>>,
    /// First values at the coarsest level.
    pub(super) start: Option<Field>,
}

impl Levels {
    pub(super) fn new(
        examples: &[Example],
        shape: Shape,
        constraints: Constraints,
        parameters: &Parameters,
    ) -> Self {
        // Responses of blurred images make what is thin thicker, and lose its correlation.
        let reduce = match parameters.start {
            Start::RandomField => pyramid::halve,
            _ => pyramid::reduce,
        };
        let mut this = Self {
            exemplars: vec![examples.iter().map(|example| example.field.clone()).collect()],
            shapes: vec![shape],
            known: vec![constraints.known],
            domains: vec![constraints.domain],
            start: constraints.start,
        };
        for level in 1..parameters.levels.len() {
            let from = this.shapes[level - 1];
            let to = from.map(|n| n.div_ceil(2));
            let finer = &this.exemplars[level - 1];
            this.exemplars.push(finer.iter().map(reduce).collect());
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

    pub(super) fn keep_known(&self, level: usize, field: &mut Field) {
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
