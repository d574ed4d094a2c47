//! The volume while it is repaired.

use std::borrow::Cow;

use ndarray::ArrayView3;

use super::super::labelling::Connectivity;
use super::super::simple_point::{CENTRE, SIMPLE, Word};
use super::grid::{Grid, Step};
use crate::volume::Boundary;

const PHASE: u8 = 1;
const FREE: u8 = 2;
const BRIDGE: u8 = 4;

/// What is known of each voxel, in C order.
pub(super) struct Scene<'a> {
    pub(super) grid: Grid,
    /// To the voxels that touch one of the phase.
    pub(super) touching: Vec<Step>,
    /// To all 26 neighbours.
    pub(super) around: Vec<Step>,
    pub(super) faces: Vec<Step>,
    /// Of each voxel, if any.
    pub(super) score: Cow<'a, [f32]>,
    flags: Vec<u8>,
    by_corners: bool,
}

impl<'a> Scene<'a> {
    pub(super) fn new(
        phase: ArrayView3<'_, bool>,
        free: Option<ArrayView3<'_, bool>>,
        connectivity: Connectivity,
        boundary: Boundary,
    ) -> Self {
        let grid = Grid::new(phase.dim(), boundary);
        let by_corners = connectivity == Connectivity::Corners;
        let mut flags: Vec<u8> = phase.iter().map(|&in_phase| u8::from(in_phase)).collect();
        match free {
            None => flags.iter_mut().for_each(|flags| *flags |= FREE),
            Some(free) => {
                for (flags, &free) in flags.iter_mut().zip(free) {
                    *flags |= u8::from(free) * FREE;
                }
            }
        }
        Self {
            touching: grid.steps(if by_corners { 3 } else { 1 }),
            around: grid.steps(3),
            faces: grid.steps(1),
            score: Cow::Borrowed(&[]),
            grid,
            flags,
            by_corners,
        }
    }

    /// With what the phase was cut from.
    pub(super) fn scored(mut self, score: ArrayView3<'a, f32>) -> Self {
        self.score =
            score.to_slice().map_or_else(|| score.iter().copied().collect(), Cow::Borrowed);
        self
    }

    pub(super) fn len(&self) -> usize {
        self.flags.len()
    }

    /// Number of voxels of the phase.
    pub(super) fn size(&self) -> usize {
        self.flags.iter().filter(|&&flags| flags & PHASE != 0).count()
    }

    #[inline(always)]
    pub(super) fn phase(&self, at: usize) -> bool {
        self.flags[at] & PHASE != 0
    }

    #[inline(always)]
    pub(super) fn free(&self, at: usize) -> bool {
        self.flags[at] & FREE != 0
    }

    pub(super) fn bridge(&self, at: usize) -> bool {
        self.flags[at] & BRIDGE != 0
    }

    pub(super) fn add(&mut self, at: usize) {
        self.flags[at] |= PHASE;
    }

    pub(super) fn add_bridge(&mut self, at: usize) {
        self.flags[at] |= PHASE | BRIDGE;
    }

    pub(super) fn take(&mut self, at: usize) {
        self.flags[at] &= !PHASE;
    }

    /// Whether the topology is the same with and without the voxel in the phase. What lies beyond an
    /// open border is not the phase.
    pub(super) fn simple(&self, at: usize) -> bool {
        let mut phase: Word = 0;
        self.grid.for_each(at, &self.around, |number, to| {
            // The voxel itself lies between the first 13 and the last 13.
            let bit = number + usize::from(number >= 13);
            phase |= Word::from(self.phase(to)) << bit;
        });
        // The rule takes the phase whose voxels touch by corners.
        let word = if self.by_corners { phase } else { !phase & (2 * (CENTRE << 13) - 1) };
        SIMPLE.ask(word & !CENTRE)
    }
}
