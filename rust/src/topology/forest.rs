//! Components of a phase, run by run.
//!
//! Touching runs are united in a forest whose roots are the smallest run of each tree. Slabs of
//! planes are worked in parallel and then sewn together. Because runs are numbered in C order, a
//! component is numbered by its first voxel, whatever the number of slabs or threads.

use ndarray::{ArrayView3, Axis};
use rayon::prelude::*;

use super::contacts::unite_plane;
use super::labelling::Connectivity;
use super::runs::{Run, Slab};
use super::seams::Seams;
use crate::error::{Error, Result};
use crate::monitor::Monitor;
use crate::volume::{Boundary, Shape};

/// What is known of a component, gathered from its runs.
pub(super) trait Tally: Default + Clone + Send {
    /// Takes a run in row (z, y).
    fn add(&mut self, z: u32, y: u32, run: Run);

    /// Takes another part of the component, in the copy of the volume that lies `periods` away.
    fn merge(&mut self, other: &Self, periods: [i32; 3], shape: Shape);
}

/// The number of voxels.
impl Tally for u64 {
    #[inline(always)]
    fn add(&mut self, _: u32, _: u32, [start, end]: Run) {
        *self += u64::from(end - start);
    }

    fn merge(&mut self, other: &Self, _: [i32; 3], _: Shape) {
        *self += other;
    }
}

/// The components of a volume.
pub(super) struct Forest<T> {
    /// Whether z and x are exchanged, because rows are contiguous along z.
    pub(super) reversed: bool,
    /// Edges in the order of the forest's own axes.
    pub(super) shape: Shape,
    pub(super) slabs: Vec<Slab>,
    /// Component of each run, from 0.
    pub(super) components: Vec<u32>,
    /// What is known of each component, with the forest's own axes.
    pub(super) tallies: Vec<T>,
    /// Along which of the forest's own axes a component of a periodic volume goes round.
    pub(super) winding: Vec<[bool; 3]>,
}

impl<T: Tally> Forest<T> {
    /// Finds the components of the voxels that are `phase`.
    pub(super) fn grow(
        volume: ArrayView3<'_, bool>,
        phase: bool,
        connectivity: Connectivity,
        boundary: Boundary,
        monitor: &Monitor<'_>,
    ) -> Result<Self> {
        let reversed = volume.strides()[0] == 1 && volume.strides()[2] != 1;
        let volume = if reversed { volume.reversed_axes() } else { volume };
        let (nz, ny, nx) = volume.dim();
        if [nz, ny, nx].iter().any(|&n| u32::try_from(n).is_err()) {
            return Err(Error::parameter("shape", volume.dim(), "must be below 2^32"));
        }
        // More slabs than threads even out the load; their seams cost a plane each.
        let thickness = nz.div_ceil(4 * rayon::current_num_threads()).max(1);

        let chunks: Vec<_> = volume.axis_chunks_iter(Axis(0), thickness).collect();
        let grown = chunks
            .into_par_iter()
            .map(|planes| {
                let slab = Slab::cut(planes, phase, monitor)?;
                let mut parents: Vec<u32> = (0..slab.runs.len() as u32).collect();
                for z in 0..slab.planes {
                    monitor.check()?;
                    let below = z.checked_sub(1).map(|z| slab.plane(z, 0));
                    unite_plane(connectivity, slab.plane(z, 0), true, below, &mut parents);
                }
                Ok((slab, parents))
            })
            .collect::<Result<Vec<_>>>()?;

        let mut slabs = Vec::with_capacity(grown.len());
        let mut parents = Vec::with_capacity(grown.iter().map(|(_, p)| p.len()).sum());
        for (mut slab, local) in grown {
            slab.first_run = parents.len();
            let first = u32::try_from(parents.len() + local.len())
                .map_err(|_| Error::parameter("shape", (nz, ny, nx), "has too many components"))?
                - local.len() as u32;
            parents.extend(local.iter().map(|p| p + first));
            slabs.push(slab);
        }
        for pair in slabs.windows(2) {
            let (below, above) = (&pair[0], &pair[1]);
            let top = below.plane(below.planes - 1, below.first_run as u32);
            let plane = above.plane(0, above.first_run as u32);
            unite_plane(connectivity, plane, false, Some(top), &mut parents);
        }
        let mut forest = Self {
            reversed,
            shape: [nz, ny, nx],
            slabs,
            components: parents,
            tallies: Vec::new(),
            winding: Vec::new(),
        };
        forest.number();
        if boundary == Boundary::Periodic {
            forest.close(connectivity, monitor)?;
        }
        if reversed {
            forest.renumber();
        }
        Ok(forest)
    }

    /// The runs of row (z, y), and the components of each.
    pub(super) fn row(&self, z: usize, y: usize) -> (&[Run], &[u32]) {
        let thickness = self.slabs[0].planes;
        let slab = &self.slabs[z / thickness];
        let (runs, first) = slab.row(z % thickness, y);
        let first = slab.first_run + first as usize;
        (runs, &self.components[first..first + runs.len()])
    }

    /// Turns parents into components, numbered by their roots. A parent is never larger than its
    /// child, so that one pass in order finds every parent already numbered.
    fn number(&mut self) {
        let mut run = 0;
        let rows = self.slabs.iter().flat_map(Slab::rows);
        let (mut z, mut y) = (0, 0);
        for runs in rows {
            for &voxels in runs {
                let parent = self.components[run] as usize;
                let component = if parent == run {
                    self.tallies.push(T::default());
                    self.tallies.len() - 1
                } else {
                    self.components[parent] as usize
                };
                self.components[run] = component as u32;
                self.tallies[component].add(z, y, voxels);
                run += 1;
            }
            y += 1;
            if y as usize == self.shape[1] {
                (z, y) = (z + 1, 0);
            }
        }
    }

    /// Joins the components that touch across the border of a periodic volume.
    fn close(&mut self, connectivity: Connectivity, monitor: &Monitor<'_>) -> Result<()> {
        let mut seams = Seams::new(self.tallies.len());
        seams.sew(self, connectivity, monitor)?;
        let open = std::mem::take(&mut self.tallies);
        let mut numbers = Vec::with_capacity(open.len());
        for (component, tally) in open.into_iter().enumerate() {
            let (root, periods) = seams.root(component as u32);
            if root as usize == component {
                numbers.push(self.tallies.len() as u32);
                self.tallies.push(tally);
                self.winding.push(seams.winding(root));
            } else {
                // A root is the smallest of its tree, hence numbered before.
                let number = numbers[root as usize];
                self.tallies[number as usize].merge(&tally, periods, self.shape);
                numbers.push(number);
            }
        }
        self.components.par_iter_mut().for_each(|c| *c = numbers[*c as usize]);
        Ok(())
    }

    /// Orders the components by their first voxel in the order x, y, z.
    fn renumber(&mut self) {
        let [nx, ny, _] = self.shape;
        let mut first = vec![usize::MAX; self.tallies.len()];
        let mut components = self.components.iter();
        let rows = self.slabs.iter().flat_map(Slab::rows);
        for (row, runs) in rows.enumerate() {
            let (x, y) = (row / ny, row % ny);
            for (&[z, _], &component) in runs.iter().zip(&mut components) {
                let first = &mut first[component as usize];
                *first = (*first).min((z as usize * ny + y) * nx + x);
            }
        }
        let mut order: Vec<u32> = (0..first.len() as u32).collect();
        order.par_sort_unstable_by_key(|&component| first[component as usize]);
        let mut rank = vec![0; order.len()];
        for (new, &old) in order.iter().enumerate() {
            rank[old as usize] = new as u32;
        }
        self.tallies = order.iter().map(|&old| self.tallies[old as usize].clone()).collect();
        if !self.winding.is_empty() {
            self.winding = order.iter().map(|&old| self.winding[old as usize]).collect();
        }
        self.components.par_iter_mut().for_each(|component| *component = rank[*component as usize]);
    }
}
