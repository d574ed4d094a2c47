//! What touches across the border of a periodic volume.
//!
//! A forest of the components of the open volume, in which each knows how many periods it lies away
//! from its parent. Where two parts of one tree touch at another distance than the tree says, the
//! tree goes round the volume (Newman & Ziff 2001).

use super::contacts::for_each_contact;
use super::forest::{Forest, Tally};
use super::labelling::Connectivity;
use crate::error::Result;
use crate::monitor::Monitor;

/// Half of the neighbours of a row, and the row itself: steps along z and y.
const NEIGHBOURS: [[isize; 2]; 5] = [[0, 0], [0, 1], [1, -1], [1, 0], [1, 1]];

type Periods = [i32; 3];

pub(super) struct Seams {
    parents: Vec<u32>,
    /// Periods from a component's parent to it.
    periods: Vec<Periods>,
    /// For roots: along which axes the tree goes round.
    winding: Vec<[bool; 3]>,
}

impl Seams {
    pub(super) fn new(components: usize) -> Self {
        Self {
            parents: (0..components as u32).collect(),
            periods: vec![[0; 3]; components],
            winding: vec![[false; 3]; components],
        }
    }

    /// Unites the components that touch across the border.
    pub(super) fn sew<T: Tally>(
        &mut self,
        forest: &Forest<T>,
        connectivity: Connectivity,
        monitor: &Monitor<'_>,
    ) -> Result<()> {
        let [nz, ny, nx] = forest.shape;
        let end_of_row = nx as u32;
        for z in 0..nz {
            monitor.check()?;
            for y in 0..ny {
                let (runs, components) = forest.row(z, y);
                let (Some([start, _]), Some([_, end])) = (runs.first(), runs.last()) else {
                    continue;
                };
                let [at_start, at_end] = [*start == 0, *end == end_of_row];
                for [dz, dy] in NEIGHBOURS {
                    let (other_z, periods_z) = wrapped(z as isize + dz, nz);
                    let (other_y, periods_y) = wrapped(y as isize + dy, ny);
                    let across = [periods_z, periods_y] != [0, 0];
                    let steps = dz.unsigned_abs() + dy.unsigned_abs();
                    // Voxels at the two ends of a row share a face.
                    let reach = if steps == 0 { Some(1) } else { connectivity.reach(steps) };
                    let Some(reach) = reach.filter(|_| across || at_start || at_end) else {
                        continue;
                    };
                    let (others, theirs) = forest.row(other_z, other_y);
                    if across {
                        for_each_contact(runs, others, reach, |i, j| {
                            self.unite(components[i], theirs[j], [periods_z, periods_y, 0]);
                        });
                    }
                    let (Some([start, _]), Some([_, end])) = (others.first(), others.last()) else {
                        continue;
                    };
                    let (mine, last) = (components[0], components[components.len() - 1]);
                    if reach > 0 && at_start && *end == end_of_row {
                        self.unite(mine, theirs[theirs.len() - 1], [periods_z, periods_y, -1]);
                    }
                    if reach > 0 && at_end && *start == 0 {
                        self.unite(last, theirs[0], [periods_z, periods_y, 1]);
                    }
                }
            }
        }
        Ok(())
    }

    /// Root of a component's tree, and the periods from the root to the component.
    pub(super) fn root(&mut self, mut component: u32) -> (u32, Periods) {
        let mut sum = [0; 3];
        loop {
            let at = component as usize;
            let parent = self.parents[at];
            if parent == component {
                return (component, sum);
            }
            // Halves the path on the way.
            self.periods[at] = add(self.periods[at], self.periods[parent as usize]);
            self.parents[at] = self.parents[parent as usize];
            sum = add(sum, self.periods[at]);
            component = self.parents[at];
        }
    }

    /// Along which axes the tree of a root goes round.
    pub(super) fn winding(&self, root: u32) -> [bool; 3] {
        self.winding[root as usize]
    }

    /// Joins the trees of two components, of which `b` touches `a` from `periods` away; the smaller
    /// root wins.
    fn unite(&mut self, a: u32, b: u32, periods: Periods) {
        let ((a, to_a), (b, to_b)) = (self.root(a), self.root(b));
        // From the root of a to the root of b.
        let between: Periods = std::array::from_fn(|i| to_a[i] + periods[i] - to_b[i]);
        let [low, high] = [a.min(b) as usize, a.max(b) as usize];
        if low == high {
            for (winds, way) in self.winding[low].iter_mut().zip(between) {
                *winds |= way != 0;
            }
            return;
        }
        self.parents[high] = low as u32;
        self.periods[high] = if a < b { between } else { between.map(|way| -way) };
        let winding = self.winding[high];
        for (winds, other) in self.winding[low].iter_mut().zip(winding) {
            *winds |= other;
        }
    }
}

/// The place inside the volume, and how many periods lie between.
fn wrapped(position: isize, edge: usize) -> (usize, i32) {
    let edge = edge as isize;
    (position.rem_euclid(edge) as usize, position.div_euclid(edge) as i32)
}

fn add(a: Periods, b: Periods) -> Periods {
    std::array::from_fn(|i| a[i] + b[i])
}
