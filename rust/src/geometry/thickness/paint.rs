//! Painting a volume with balls.

use std::sync::atomic::{AtomicU32, Ordering};

use ndarray::ArrayViewMut3;
use rayon::prelude::*;

use super::Space;
use super::left::{Frame, Offset};
use super::ridge::Ball;
use crate::volume::{Boundary, Shape, index, voxels};

/// The rank of the thickest ball that has come to each voxel, as bits: those of positive numbers are
/// in order. Balls come from all threads and in any order.
pub(super) struct Canvas<'a> {
    ranks: Vec<AtomicU32>,
    shape: Shape,
    space: &'a Space,
}

impl<'a> Canvas<'a> {
    pub(super) fn new(shape: (usize, usize, usize), space: &'a Space) -> Self {
        let shape = shape.into();
        let ranks = std::iter::repeat_with(AtomicU32::default).take(voxels(shape)).collect();
        Self { ranks, shape, space }
    }

    /// Paints what is left of a ball.
    pub(super) fn paint(&self, ball: &Ball, left: &[Offset], frame: Frame) {
        let rank = ball.rank.to_bits();
        let radius = ball.reach.sqrt();
        let inside = (0..3).all(|axis| {
            let steps = (radius / self.space.size[axis] as f32) as usize + 1;
            ball.at[axis] >= steps && ball.at[axis] + steps < self.shape[axis]
        });
        if inside {
            let strides = [self.shape[1] * self.shape[2], self.shape[2], 1];
            let strides = [0, 1, 2].map(|i| frame.signs[i] * strides[frame.axes[i]] as i32);
            let middle = index(self.shape, ball.at);
            for offset in left {
                let steps = [0, 1, 2].map(|i| i32::from(offset[i]) * strides[i]);
                let step = steps[0] + steps[1] + steps[2];
                self.raise(middle.wrapping_add_signed(step as isize), rank);
            }
        } else {
            for offset in left {
                if let Some(place) = self.place(ball.at, *offset, frame) {
                    self.raise(place, rank);
                }
            }
        }
    }

    fn raise(&self, place: usize, rank: u32) {
        let voxel = &self.ranks[place];
        if voxel.load(Ordering::Relaxed) < rank {
            voxel.fetch_max(rank, Ordering::Relaxed);
        }
    }

    /// Where an offset from a voxel leads; nowhere beyond an open border.
    fn place(&self, mut at: Shape, offset: Offset, frame: Frame) -> Option<usize> {
        for i in 0..3 {
            let axis = frame.axes[i];
            let n = self.shape[axis];
            let steps = (frame.signs[i] * i32::from(offset[i])) as isize;
            at[axis] = match self.space.boundary {
                Boundary::Open => at[axis].checked_add_signed(steps).filter(|&to| to < n)?,
                Boundary::Periodic => (at[axis] as isize + steps).rem_euclid(n as isize) as usize,
            };
        }
        Some(index(self.shape, at))
    }

    /// Writes the diameters of the balls, and 0 where none came.
    pub(super) fn write(self, mut out: ArrayViewMut3<'_, f32>) {
        let Some(out) = out.as_slice_mut() else { return };
        out.par_iter_mut().zip(self.ranks).for_each(|(out, rank)| {
            let rank = f32::from_bits(rank.into_inner());
            *out = if rank > 0.0 { self.space.diameter(rank) } else { 0.0 };
        });
    }
}
