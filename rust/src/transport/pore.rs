//! The part of a pore space that carries a flow from face to face.

use ndarray::ArrayView3;
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::monitor::Monitor;
use crate::volume::{Boundary, Shape, index, position, voxels};

/// Voxels of a search after which it looks whether it is to stop.
const PATIENCE: usize = 1 << 16;

/// Neighbours of a voxel that share a face with it: before and after it along axes 0, 1, 2.
pub type Neighbours = [u32; 6];

/// The side before (0) or after (1) along an axis, as a place in [`Neighbours`].
pub const fn side(axis: usize, after: usize) -> usize {
    2 * axis + after
}

/// The voxels of the components that percolate along axis 0, numbered in C order.
///
/// With an open boundary a component percolates if it touches the first and the last plane; with a
/// periodic one if it comes back to itself shifted by the volume.
pub struct PoreSpace {
    /// Edges of the volume.
    pub shape: Shape,
    /// What lies beyond its faces.
    pub boundary: Boundary,
    /// Where each voxel is in the volume, in C order.
    pub positions: Vec<u32>,
    /// The voxels that touch each voxel; `positions.len()` where there is none.
    pub neighbours: Vec<Neighbours>,
    /// Voxels of the whole pore, percolating or not.
    pub pore: usize,
}

impl PoreSpace {
    /// Finds the percolating part of the voxels that are not solid.
    ///
    /// Peak memory: 9 bytes a voxel, 28 a percolating one.
    pub fn new(
        solid: ArrayView3<'_, bool>,
        boundary: Boundary,
        monitor: &Monitor<'_>,
    ) -> Result<Self> {
        let (n0, n1, n2) = solid.dim();
        let shape = [n0, n1, n2];
        // One number more marks that there is no neighbour, one plane more the inlet of a flow.
        if u32::try_from(voxels(shape) + n1 * n2 + 1).is_err() {
            return Err(Error::parameter("shape", shape, "must have less than 2^32 voxels"));
        }
        let mut numbers: Vec<u32> = Vec::with_capacity(voxels(shape));
        for plane in solid.outer_iter() {
            monitor.check()?;
            numbers.extend(plane.iter().map(|&s| if s { SOLID } else { PORE }));
        }
        let pore = numbers.par_iter().filter(|&&n| n == PORE).count();
        mark_percolating(&mut numbers, shape, boundary, monitor)?;
        let mut positions = Vec::new();
        for (at, number) in numbers.iter_mut().enumerate() {
            if at.is_multiple_of(PATIENCE) {
                monitor.check()?;
            }
            if *number == FLOWING {
                *number = positions.len() as u32;
                positions.push(at as u32);
            } else {
                *number = u32::MAX;
            }
        }
        let none = positions.len() as u32;
        let neighbours = positions
            .par_iter()
            .map(|&at| {
                monitor.check()?;
                let at = position(shape, at as usize);
                Ok([0, 1, 2, 3, 4, 5].map(|side| {
                    step(at, side, shape, boundary)
                        .map_or(none, |(to, _)| numbers[index(shape, to)].min(none))
                }))
            })
            .collect::<Result<Vec<_>>>()?;
        Ok(Self { shape, boundary, positions, neighbours, pore })
    }

    /// Number of percolating voxels.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether nothing percolates.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// The plane along axis 0 that a voxel lies in.
    pub fn plane(&self, voxel: usize) -> usize {
        self.positions[voxel] as usize / (self.shape[1] * self.shape[2])
    }

    /// Whether a side of a voxel is the border of the volume, where the boundary is open.
    pub fn at_border(&self, voxel: usize, side: usize) -> bool {
        let at = position(self.shape, self.positions[voxel] as usize)[side / 2];
        self.boundary == Boundary::Open
            && at == if side.is_multiple_of(2) { 0 } else { self.shape[side / 2] - 1 }
    }
}

/// States of a voxel before it has a number.
const SOLID: u32 = u32::MAX;
const PORE: u32 = u32::MAX - 1;
const FOUND: u32 = u32::MAX - 2;
const FLOWING: u32 = u32::MAX - 3;

/// The voxel next to `at`, and by how many volumes the step wraps along axis 0.
fn step(at: Shape, side: usize, shape: Shape, boundary: Boundary) -> Option<(Shape, i32)> {
    let axis = side / 2;
    let mut to = at;
    let mut wraps = 0;
    if side.is_multiple_of(2) {
        if at[axis] > 0 {
            to[axis] -= 1;
        } else {
            (to[axis], wraps) = (shape[axis] - 1, -1);
        }
    } else if at[axis] + 1 < shape[axis] {
        to[axis] += 1;
    } else {
        (to[axis], wraps) = (0, 1);
    }
    let inside = wraps == 0 || boundary == Boundary::Periodic;
    inside.then_some((to, if axis == 0 { wraps } else { 0 }))
}

/// Floods every component of [`PORE`] and marks those that percolate as [`FLOWING`].
fn mark_percolating(
    states: &mut [u32],
    shape: Shape,
    boundary: Boundary,
    monitor: &Monitor<'_>,
) -> Result<()> {
    let periodic = boundary == Boundary::Periodic;
    let plane = shape[1] * shape[2];
    // By how many volumes the flood has gone along axis 0 when it reached a voxel.
    let mut wound = vec![0i32; if periodic { states.len() } else { 0 }];
    let mut component: Vec<u32> = Vec::new();
    // Every component that percolates with an open boundary begins in the first plane.
    let starts = if periodic { states.len() } else { plane.min(states.len()) };
    for start in 0..starts {
        if start.is_multiple_of(PATIENCE) {
            monitor.check()?;
        }
        if states[start] != PORE {
            continue;
        }
        states[start] = FOUND;
        component.clear();
        component.push(start as u32);
        let mut percolates = false;
        let mut next = 0;
        while let Some(&from) = component.get(next) {
            let from = from as usize;
            next += 1;
            if next.is_multiple_of(PATIENCE) {
                monitor.check()?;
            }
            percolates |= !periodic && from + plane >= states.len();
            let at = position(shape, from);
            for side in 0..6 {
                let Some((to, wraps)) = step(at, side, shape, boundary) else { continue };
                let to = index(shape, to);
                if states[to] == PORE {
                    states[to] = FOUND;
                    component.push(to as u32);
                    if periodic {
                        wound[to] = wound[from] + wraps;
                    }
                } else if periodic && states[to] == FOUND {
                    percolates |= wound[to] != wound[from] + wraps;
                }
            }
        }
        if percolates {
            for &voxel in &component {
                states[voxel as usize] = FLOWING;
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use ndarray::Array3;

    use super::*;

    fn flowing(solid: &Array3<bool>, boundary: Boundary) -> usize {
        PoreSpace::new(solid.view(), boundary, &Monitor::silent()).unwrap().len()
    }

    #[test]
    fn only_what_reaches_both_faces_carries() {
        let mut solid = Array3::from_elem((5, 4, 4), true);
        solid.slice_mut(ndarray::s![..4, 0, 0]).fill(false);
        assert_eq!(flowing(&solid, Boundary::Open), 0);
        solid[[4, 0, 0]] = false;
        solid[[2, 3, 3]] = false;
        assert_eq!(flowing(&solid, Boundary::Open), 5);
        assert_eq!(flowing(&solid, Boundary::Periodic), 5);
    }

    #[test]
    fn a_periodic_pore_must_meet_itself() {
        // Reaches both faces, but at places that do not meet.
        let mut solid = Array3::from_elem((4, 4, 4), true);
        for (z, y) in [(0, 0), (1, 0), (1, 1), (1, 2), (2, 2), (3, 2)] {
            solid[[z, y, 0]] = false;
        }
        assert_eq!(flowing(&solid, Boundary::Open), 6);
        assert_eq!(flowing(&solid, Boundary::Periodic), 0);
        // Going on round axis 1 brings it back to where it began.
        solid[[3, 3, 0]] = false;
        solid[[3, 0, 0]] = false;
        assert_eq!(flowing(&solid, Boundary::Periodic), 8);
    }

    #[test]
    fn a_helix_of_two_turns_percolates() {
        // One volume on, the pore is half a volume aside: it takes two to come back.
        let mut solid = Array3::from_elem((2, 4, 1), true);
        for (z, y) in [(0, 0), (1, 0), (1, 1), (1, 2), (0, 2), (1, 3)] {
            solid[[z, y, 0]] = false;
        }
        assert_eq!(flowing(&solid, Boundary::Periodic), 6);
    }

    #[test]
    fn a_ring_across_the_flow_does_not_percolate() {
        let mut solid = Array3::from_elem((3, 4, 4), true);
        solid.slice_mut(ndarray::s![1, 2, ..]).fill(false);
        assert_eq!(flowing(&solid, Boundary::Periodic), 0);
    }

    #[test]
    fn no_voxel_and_no_pore() {
        for boundary in [Boundary::Open, Boundary::Periodic] {
            assert_eq!(flowing(&Array3::from_elem((0, 3, 3), false), boundary), 0);
            assert_eq!(flowing(&Array3::from_elem((3, 3, 3), true), boundary), 0);
            assert_eq!(flowing(&Array3::from_elem((1, 1, 1), false), boundary), 1);
        }
    }
}
