//! Sizes, extents and centroids of components, from their runs alone.

use ndarray::{ArrayView3, ArrayViewMut3};

use super::forest::{Forest, Tally};
use super::labelling::{Connectivity, paint};
use super::runs::Run;
use crate::error::{Error, Result};
use crate::monitor::Monitor;
use crate::volume::{Boundary, Shape};

/// What is known of a component. All axes are (z, y, x).
///
/// In a periodic volume a component is seen in one piece: its box starts inside the volume and may
/// end beyond, and its centroid lies in its box. Along an axis on which it goes round the volume,
/// its box is the whole edge, and it has no centroid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Component {
    /// Number of voxels.
    pub size: u64,
    /// Start and end (exclusive) along each axis.
    pub bounds: [[i64; 2]; 3],
    /// Mean position of the voxels; NaN where there is none.
    pub centroid: [f64; 3],
    /// Open: whether it touches both faces across an axis. Periodic: whether it goes round.
    pub spans: [bool; 3],
}

/// Describes the components of the true voxels, in C order of their first voxels; writes their
/// numbers 1, 2, … into `labels`, which must be zero.
///
/// Peak memory: 1 bit a voxel and 12 bytes a run and 200 bytes a component.
pub fn component_statistics(
    solid: ArrayView3<'_, bool>,
    connectivity: Connectivity,
    boundary: Boundary,
    labels: Option<ArrayViewMut3<'_, u32>>,
    monitor: &Monitor<'_>,
) -> Result<Vec<Component>> {
    let forest = measured(solid, true, connectivity, boundary, monitor)?;
    if let Some(labels) = labels {
        paint(&forest, labels, |component| Some(component + 1))?;
    }
    let shape = forest.shape.map(|n| n as i64);
    let components = forest.tallies.iter().enumerate().map(|(i, moments)| {
        let mut found = moments.describe(shape, forest.winding.get(i));
        if forest.reversed {
            found.bounds.reverse();
            found.centroid.reverse();
            found.spans.reverse();
        }
        found
    });
    Ok(components.collect())
}

/// Counts the components of the voxels that are `phase` which do not touch the border of an open
/// volume.
///
/// Peak memory: 1 bit a voxel and 12 bytes a run and 80 bytes a component.
pub fn enclosed_components(
    volume: ArrayView3<'_, bool>,
    phase: bool,
    connectivity: Connectivity,
    monitor: &Monitor<'_>,
) -> Result<usize> {
    let forest = measured(volume, phase, connectivity, Boundary::Open, monitor)?;
    let shape = forest.shape.map(|n| n as i64);
    let enclosed = |moments: &&Moments| {
        (0..3).all(|axis| moments.low[axis] > 0 && moments.high[axis] < shape[axis])
    };
    Ok(forest.tallies.iter().filter(enclosed).count())
}

fn measured(
    volume: ArrayView3<'_, bool>,
    phase: bool,
    connectivity: Connectivity,
    boundary: Boundary,
    monitor: &Monitor<'_>,
) -> Result<Forest<Moments>> {
    let longest = volume.shape().iter().max().copied().unwrap_or(0);
    // Sums of positions must fit.
    if i64::try_from(volume.len() as u128 * longest as u128).is_err() {
        return Err(Error::parameter("shape", volume.dim(), "is too large"));
    }
    Forest::grow(volume, phase, connectivity, boundary, monitor)
}

/// Extent and sums of positions.
#[derive(Debug, Clone)]
struct Moments {
    size: u64,
    low: [i64; 3],
    /// Exclusive.
    high: [i64; 3],
    sums: [i64; 3],
}

impl Default for Moments {
    fn default() -> Self {
        Self { size: 0, low: [i64::MAX; 3], high: [i64::MIN; 3], sums: [0; 3] }
    }
}

impl Moments {
    fn describe(&self, shape: [i64; 3], winding: Option<&[bool; 3]>) -> Component {
        let mut found = Component {
            size: self.size,
            bounds: [[0; 2]; 3],
            centroid: [f64::NAN; 3],
            spans: [false; 3],
        };
        for axis in 0..3 {
            let edge = shape[axis];
            if winding.is_some_and(|winding| winding[axis]) {
                found.bounds[axis] = [0, edge];
                found.spans[axis] = true;
                continue;
            }
            // A whole number of periods; none in an open volume.
            let shift = self.low[axis].div_euclid(edge) * edge;
            found.bounds[axis] = [self.low[axis] - shift, self.high[axis] - shift];
            found.centroid[axis] = self.sums[axis] as f64 / self.size as f64 - shift as f64;
            found.spans[axis] = winding.is_none() && found.bounds[axis] == [0, edge];
        }
        found
    }
}

impl Tally for Moments {
    #[inline(always)]
    fn add(&mut self, z: u32, y: u32, [start, end]: Run) {
        let [z, y, start, end] = [z, y, start, end].map(i64::from);
        let voxels = end - start;
        self.size += voxels as u64;
        for (axis, [low, high]) in [[z, z + 1], [y, y + 1], [start, end]].into_iter().enumerate() {
            self.low[axis] = self.low[axis].min(low);
            self.high[axis] = self.high[axis].max(high);
        }
        self.sums[0] += z * voxels;
        self.sums[1] += y * voxels;
        self.sums[2] += (start + end - 1) * voxels / 2;
    }

    fn merge(&mut self, other: &Self, periods: [i32; 3], shape: Shape) {
        self.size += other.size;
        for axis in 0..3 {
            let shift = i64::from(periods[axis]) * shape[axis] as i64;
            self.low[axis] = self.low[axis].min(other.low[axis] + shift);
            self.high[axis] = self.high[axis].max(other.high[axis] + shift);
            self.sums[axis] += other.sums[axis] + shift * other.size as i64;
        }
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array3;

    use super::*;

    fn found(solid: &Array3<bool>, boundary: Boundary) -> Vec<Component> {
        let view = solid.view();
        component_statistics(view, Connectivity::Faces, boundary, None, &Monitor::silent()).unwrap()
    }

    #[test]
    fn a_part_across_the_border_is_seen_in_one_piece() {
        let mut solid = Array3::from_elem((4, 5, 6), false);
        for at in [[3, 4, 5], [0, 4, 5], [3, 0, 5], [3, 4, 0]] {
            solid[at] = true;
        }
        assert_eq!(found(&solid, Boundary::Open).len(), 4);
        let expected = Component {
            size: 4,
            bounds: [[3, 5], [4, 6], [5, 7]],
            centroid: [3.25, 4.25, 5.25],
            spans: [false; 3],
        };
        assert_eq!(found(&solid, Boundary::Periodic), [expected]);
        let fortran = solid.t().as_standard_layout().into_owned().reversed_axes();
        assert_eq!(found(&fortran, Boundary::Periodic), [expected]);
    }

    #[test]
    fn a_part_that_goes_round_has_no_middle() {
        let mut solid = Array3::from_elem((3, 3, 4), false);
        solid.slice_mut(ndarray::s![1, 2, ..]).fill(true);
        let [component] = found(&solid, Boundary::Periodic)[..] else { panic!("one component") };
        assert_eq!(component.spans, [false, false, true]);
        assert_eq!(component.bounds, [[1, 2], [2, 3], [0, 4]]);
        assert_eq!(component.centroid[..2], [1.0, 2.0]);
        assert!(component.centroid[2].is_nan());
    }

    #[test]
    fn cavities_do_not_touch_the_border() {
        let mut solid = Array3::from_elem((5, 5, 5), true);
        solid[[2, 2, 2]] = false;
        solid[[0, 2, 2]] = false;
        let count = |solid: &Array3<bool>| {
            enclosed_components(solid.view(), false, Connectivity::Faces, &Monitor::silent())
        };
        assert_eq!(count(&solid).unwrap(), 1);
        solid[[1, 2, 2]] = false;
        assert_eq!(count(&solid).unwrap(), 0);
    }

    #[test]
    fn no_voxels() {
        for shape in [(0, 3, 4), (3, 0, 4), (3, 4, 0)] {
            let solid = Array3::from_elem(shape, true);
            for boundary in [Boundary::Open, Boundary::Periodic] {
                assert!(found(&solid, boundary).is_empty());
            }
        }
    }
}
