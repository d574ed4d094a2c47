//! Places of a volume in C order, and the ways from one to its neighbours.

use crate::volume::{Boundary, Shape, index, position};

/// A way from a voxel to another.
pub(super) struct Step {
    by: [isize; 3],
    /// Between positions in C order, where the border is not crossed.
    offset: isize,
    pub(super) length: f32,
}

pub(super) struct Grid {
    shape: Shape,
    /// Along which axes there is a neighbour beyond the border. A volume of one plane has none: what
    /// touches across its border touches in the plane.
    wraps: [bool; 3],
}

impl Grid {
    pub(super) fn new((nz, ny, nx): (usize, usize, usize), boundary: Boundary) -> Self {
        let shape = [nz, ny, nx];
        Self { shape, wraps: shape.map(|n| n > 1 && boundary == Boundary::Periodic) }
    }

    /// Steps along at most `axes` axes, by at most one voxel each, in C order without the step to the
    /// voxel itself: the opposite of a step is as far from the end of the list.
    pub(super) fn steps(&self, axes: usize) -> Vec<Step> {
        (0..27)
            .map(|i| [i / 9 - 1, i / 3 % 3 - 1, i % 3 - 1])
            .filter(|by: &[isize; 3]| (1..=axes).contains(&by.iter().filter(|&&b| b != 0).count()))
            .map(|by| self.step(by))
            .collect()
    }

    /// Steps of a length above 0 and up to `radius`: the nearest first, then in C order.
    pub(super) fn ball(&self, radius: f64) -> Vec<Step> {
        let reach = radius as isize;
        let edge = 2 * reach + 1;
        let mut steps: Vec<Step> = (0..edge * edge * edge)
            .map(|i| [i / (edge * edge), i / edge % edge, i % edge].map(|i| i - reach))
            .filter(|by| *by != [0; 3])
            .map(|by| self.step(by))
            .filter(|step| f64::from(step.length) <= radius)
            .collect();
        steps.sort_by(|a, b| a.length.total_cmp(&b.length));
        steps
    }

    fn step(&self, by: [isize; 3]) -> Step {
        let [_, ny, nx] = self.shape.map(|n| n as isize);
        let offset = (by[0] * ny + by[1]) * nx + by[2];
        Step { by, offset, length: (by.iter().map(|b| b * b).sum::<isize>() as f32).sqrt() }
    }

    /// Where a step leads from a voxel; none beyond the border of an open volume.
    pub(super) fn after(&self, at: usize, step: &Step) -> Option<usize> {
        let mut place = position(self.shape, at);
        for (axis, i) in place.iter_mut().enumerate() {
            let n = self.shape[axis] as isize;
            let to = *i as isize + step.by[axis];
            if !self.wraps[axis] && !(0..n).contains(&to) {
                return None;
            }
            *i = to.rem_euclid(n) as usize;
        }
        Some(index(self.shape, place))
    }

    /// Calls with the number of each step that leads to a neighbour, and where.
    #[inline(always)]
    pub(super) fn for_each(&self, at: usize, steps: &[Step], mut visit: impl FnMut(usize, usize)) {
        let place = position(self.shape, at);
        if (0..3).all(|axis| place[axis] > 0 && place[axis] + 1 < self.shape[axis]) {
            for (number, step) in steps.iter().enumerate() {
                visit(number, at.wrapping_add_signed(step.offset));
            }
        } else {
            for (number, step) in steps.iter().enumerate() {
                if let Some(to) = self.after(at, step) {
                    visit(number, to);
                }
            }
        }
    }
}
