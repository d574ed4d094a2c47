//! Labels and sizes of the connected components of a phase.

use ndarray::{ArrayView3, ArrayViewMut3, Axis, s};
use rayon::prelude::*;

use super::forest::{Forest, Tally};
use crate::error::{Error, Result};
use crate::monitor::Monitor;
use crate::volume::Boundary;

/// Which neighbours of a voxel touch it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Connectivity {
    /// Those that share a face: 6.
    Faces,
    /// Those that share a face or an edge: 18.
    Edges,
    /// Those that share a face, an edge or a corner: 26.
    Corners,
}

impl TryFrom<i64> for Connectivity {
    type Error = Error;

    fn try_from(neighbours: i64) -> Result<Self> {
        match neighbours {
            6 => Ok(Self::Faces),
            18 => Ok(Self::Edges),
            26 => Ok(Self::Corners),
            _ => Err(Error::parameter("connectivity", neighbours, "must be 6, 18 or 26")),
        }
    }
}

impl Connectivity {
    /// How far two runs may miss each other along x and still touch, in rows that differ by one
    /// step along `steps` of the axes y and z; none if such rows never touch.
    pub(super) const fn reach(self, steps: usize) -> Option<u32> {
        match (self, steps) {
            (Self::Faces, 1) | (Self::Edges, 2) => Some(0),
            (Self::Edges, 1) | (Self::Corners, _) => Some(1),
            _ => None,
        }
    }
}

/// Labels the components of the true voxels: writes 1, 2, … into `labels`, which must be zero, in C
/// order of the components' first voxels. Returns the sizes in voxels of components 1, 2, …
///
/// Fastest where both have contiguous rows along x, or both along z. Peak memory: 1 bit a voxel and 12 bytes a run.
pub fn label(
    solid: ArrayView3<'_, bool>,
    connectivity: Connectivity,
    boundary: Boundary,
    labels: ArrayViewMut3<'_, u32>,
    monitor: &Monitor<'_>,
) -> Result<Vec<u64>> {
    let forest = Forest::grow(solid, true, connectivity, boundary, monitor)?;
    paint(&forest, labels, |component| Some(component + 1))?;
    Ok(forest.tallies)
}

/// Sizes in voxels of the components of the true voxels, in C order of their first voxels.
///
/// Peak memory: 1 bit a voxel and 12 bytes a run.
pub fn component_sizes(
    solid: ArrayView3<'_, bool>,
    connectivity: Connectivity,
    boundary: Boundary,
    monitor: &Monitor<'_>,
) -> Result<Vec<u64>> {
    Ok(Forest::grow(solid, true, connectivity, boundary, monitor)?.tallies)
}

/// Writes a value of its component to each voxel of a phase; leaves alone what gets none.
pub(super) fn paint<T: Tally + Sync, V: Copy + Send>(
    forest: &Forest<T>,
    mut voxels: ArrayViewMut3<'_, V>,
    value: impl Fn(u32) -> Option<V> + Sync,
) -> Result<()> {
    if forest.reversed {
        voxels = voxels.reversed_axes();
    }
    let [nz, ny, nx] = forest.shape;
    if voxels.dim() != (nz, ny, nx) {
        return Err(Error::parameter("output.shape", voxels.dim(), "must be that of the volume"));
    }
    let mut planes = Vec::with_capacity(forest.slabs.len());
    for slab in &forest.slabs {
        let (own, rest) = voxels.split_at(Axis(0), slab.planes);
        planes.push(own);
        voxels = rest;
    }
    planes.into_par_iter().zip(&forest.slabs).for_each(|(mut planes, slab)| {
        let mut components = forest.components[slab.first_run..].iter();
        for (mut row, runs) in planes.rows_mut().into_iter().zip(slab.rows()) {
            let runs =
                runs.iter().zip(&mut components).filter_map(|(&[start, end], &component)| {
                    Some((start as usize..end as usize, value(component)?))
                });
            // Slices of slices cost much less than slices of views, which tells for short runs.
            if let Some(row) = row.as_slice_mut() {
                runs.for_each(|(run, value)| row[run].fill(value));
            } else {
                runs.for_each(|(run, value)| row.slice_mut(s![run]).fill(value));
            }
        }
    });
    Ok(())
        let mut order: Vec<u32> = (0..first.len() as u32).collect();
        order.par_sort_unstable_by_key(|&component| first[component as usize]);
        let mut rank = vec![0; order.len()];
        for (new, &old) in order.iter().enumerate() {
            rank[old as usize] = new as u32;
        }
        self.sizes = order.iter().map(|&old| self.sizes[old as usize]).collect();
        self.components.par_iter_mut().for_each(|component| *component = rank[*component as usize]);
    }
}

fn cut_into_runs(planes: ArrayView3<'_, bool>, monitor: &Monitor<'_>) -> Result<Slab> {
    let (nz, ny, nx) = planes.dim();
    let mut runs: Vec<Run> = Vec::new();
    let mut row_starts = Vec::with_capacity(nz * ny + 1);
    row_starts.push(0);
    let mut copy = Vec::new();
    for plane in planes.outer_iter() {
        monitor.check()?;
        for row in plane.outer_iter() {
            if let Some(row) = row.as_slice() {
                push_runs(row, &mut runs);
            } else {
                copy.clear();
                copy.extend(row);
                push_runs(&copy, &mut runs);
            }
            row_starts.push(u32::try_from(runs.len()).map_err(|_| {
                Error::parameter("shape", (nz, ny, nx), "has too many components in one slab")
            })?);
        }
    }
    Ok(Slab { planes: nz, rows_per_plane: ny, first_run: 0, runs, row_starts })
}

/// Appends the runs of a row, found as the set bits of (row xor row shifted by one).
fn push_runs(row: &[bool], runs: &mut Vec<Run>) {
    let mut open: Option<u32> = None;
    for (word, voxels) in row.chunks(64).enumerate() {
        let before = u64::from(open.is_some());
        let bits = pack(voxels);
        let mut changes = bits ^ (bits << 1 | before);
        while changes != 0 {
            let at = (64 * word) as u32 + changes.trailing_zeros();
            changes &= changes - 1;
            open = match open {
                None => Some(at),
                Some(start) => {
                    runs.push([start, at]);
                    None
                }
            };
        }
    }
    if let Some(start) = open {
        runs.push([start, row.len() as u32]);
    }
}

/// Bit i is voxel i, for up to 64 voxels.
pub(super) fn pack(voxels: &[bool]) -> u64 {
    /// Gathers the lowest bits of eight bytes in the top byte of the product.
    const GATHER: u64 = 0x0102_0408_1020_4080;
    let (eights, rest) = voxels.as_chunks::<8>();
    let mut bits = 0;
    for (i, eight) in eights.iter().enumerate() {
        let bytes = u64::from_le_bytes(eight.map(u8::from));
        bits |= (bytes.wrapping_mul(GATHER) >> 56) << (8 * i);
    }
    for (i, &voxel) in rest.iter().enumerate() {
        bits |= u64::from(voxel) << (8 * eights.len() + i);
    }
    bits
}

/// Which rows and runs touch.
struct Neighbours {
    connectivity: Connectivity,
    periodic: bool,
    rows: usize,
    row_length: u32,
}

impl Neighbours {
    /// Unites runs inside one plane.
    fn unite_within(&self, slab: &Slab, z: usize, parents: &mut [u32]) {
        let reach = self.connectivity.reach(1);
        for y in 1..self.rows {
            self.unite_rows(slab.row(z, y - 1), slab.row(z, y), reach, parents);
        }
        if self.periodic && self.rows > 0 {
            self.unite_rows(slab.row(z, self.rows - 1), slab.row(z, 0), reach, parents);
            for y in 0..self.rows {
                let (runs, first) = slab.row(z, y);
                if let (Some([0, _]), Some(&[_, end])) = (runs.first(), runs.last())
                    && end == self.row_length
                {
                    unite(parents, first, first + runs.len() as u32 - 1);
                }
            }
        }
    }

    /// Unites runs of two adjacent planes, each given as a slab, a plane in it, and what to add to
    /// the slab's run numbers.
    fn unite_planes(
        &self,
        (below, z_below, add_below): (&Slab, usize, u32),
        (above, z_above, add_above): (&Slab, usize, u32),
        parents: &mut [u32],
    ) {
        let shift = |(runs, first): (_, u32), add| (runs, first + add);
        for y in 0..self.rows {
            let row = shift(above.row(z_above, y), add_above);
            if row.0.is_empty() {
                continue;
            }
            let mut unite_with = |y: usize, steps| {
                let other = shift(below.row(z_below, y), add_below);
                self.unite_rows(other, row, self.connectivity.reach(steps), parents);
            };
            unite_with(y, 1);
            if y > 0 || self.periodic {
                unite_with((y + self.rows - 1) % self.rows, 2);
            }
            if y + 1 < self.rows || self.periodic {
                unite_with((y + 1) % self.rows, 2);
            }
        }
    }

    /// Unites the runs of two rows that touch within `reach`.
    fn unite_rows(
        &self,
        (a, first_a): (&[Run], u32),
        (b, first_b): (&[Run], u32),
        reach: Option<u32>,
        parents: &mut [u32],
    ) {
        let Some(reach) = reach else { return };
        let (mut i, mut j) = (0, 0);
        while let (Some(&[start_a, end_a]), Some(&[start_b, end_b])) = (a.get(i), b.get(j)) {
            if start_a < end_b + reach && start_b < end_a + reach {
                unite(parents, first_a + i as u32, first_b + j as u32);
            }
            if end_a < end_b {
                i += 1;
            } else {
                j += 1;
            }
        }
        if self.periodic && reach > 0 {
            let mut across = |(a, first_a): (&[Run], u32), (b, first_b): (&[Run], u32)| {
                if let (Some([0, _]), Some(&[_, end])) = (a.first(), b.last())
                    && end == self.row_length
                {
                    unite(parents, first_a, first_b + b.len() as u32 - 1);
                }
            };
            across((a, first_a), (b, first_b));
            across((b, first_b), (a, first_a));
        }
    }
}

/// Joins two trees; the smaller root wins.
fn unite(parents: &mut [u32], a: u32, b: u32) {
    let (a, b) = (root(parents, a), root(parents, b));
    if a < b {
        parents[b as usize] = a;
    } else {
        parents[a as usize] = b;
    }
}

/// Root of a tree; halves the path to it on the way.
fn root(parents: &mut [u32], mut run: u32) -> u32 {
    loop {
        let parent = parents[run as usize];
        if parent == run {
            return run;
        }
        let grandparent = parents[parent as usize];
        parents[run as usize] = grandparent;
        run = grandparent;
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array3;
    use proptest::prelude::*;

    use super::*;
    use crate::threads::with_threads;

    /// Flood fill, voxel by voxel.
    fn twin(solid: &Array3<bool>, neighbours: i64, periodic: bool) -> (Array3<u32>, Vec<u64>) {
        let mut labels = Array3::zeros(solid.dim());
        let mut sizes = Vec::new();
        let shape = [solid.dim().0, solid.dim().1, solid.dim().2].map(|n| n as i32);
        for (start, &filled) in solid.indexed_iter() {
            if !filled || labels[start] != 0 {
                continue;
            }
            sizes.push(0);
            labels[start] = sizes.len() as u32;
            let mut stack = vec![[start.0, start.1, start.2].map(|i| i as i32)];
            while let Some(at) = stack.pop() {
                *sizes.last_mut().unwrap() += 1;
                for step in (0..27).map(|i| [i / 9 - 1, i / 3 % 3 - 1, i % 3 - 1]) {
                    let order = step.iter().map(|s: &i32| s.abs()).sum::<i32>();
                    if order > [6, 18, 26].iter().position(|&n| n == neighbours).unwrap() as i32 + 1
                    {
                        continue;
                    }
                    let mut to = [0, 1, 2].map(|i| at[i] + step[i]);
                    if periodic {
                        to = [0, 1, 2].map(|i| to[i].rem_euclid(shape[i]));
                    }
                    let to = to.map(|i| i as usize);
                    if solid.get(to) == Some(&true) && labels[to] == 0 {
                        labels[to] = sizes.len() as u32;
                        stack.push(to.map(|i| i as i32));
                    }
                }
            }
        }
        (labels, sizes)
    }

    fn labelled(
        solid: ArrayView3<'_, bool>,
        neighbours: i64,
        boundary: Boundary,
    ) -> (Array3<u32>, Vec<u64>) {
        let mut labels = Array3::zeros(solid.dim());
        let connectivity = Connectivity::try_from(neighbours).unwrap();
        let monitor = Monitor::silent();
        let sizes = label(solid, connectivity, boundary, labels.view_mut(), &monitor).unwrap();
        assert_eq!(sizes, component_sizes(solid, connectivity, boundary, &monitor).unwrap());
        (labels, sizes)
    }

    fn volumes() -> impl Strategy<Value = Array3<bool>> {
        (0..6usize, 0..6usize, 0..80usize, 0.0..1.0f64).prop_flat_map(|(z, y, x, fraction)| {
            proptest::collection::vec(proptest::bool::weighted(fraction), z * y * x)
                .prop_map(move |voxels| Array3::from_shape_vec((z, y, x), voxels).unwrap())
        })
    }

    proptest! {
        #[test]
        fn agrees_with_a_flood_fill(
            solid in volumes(),
            neighbours in prop::sample::select(vec![6i64, 18, 26]),
            periodic: bool,
        ) {
            let boundary = if periodic { Boundary::Periodic } else { Boundary::Open };
            let expected = twin(&solid, neighbours, periodic);
            prop_assert_eq!(&labelled(solid.view(), neighbours, boundary), &expected);
            let fortran = solid.t().as_standard_layout().into_owned().reversed_axes();
            prop_assert_eq!(&labelled(fortran.view(), neighbours, boundary), &expected);
            for threads in [1, 3] {
                let again = with_threads(threads, || labelled(solid.view(), neighbours, boundary));
                prop_assert_eq!(&again.unwrap(), &expected);
            }
        }
    }

    #[test]
    fn voxels_that_share_an_edge_or_a_corner() {
        for (other, counts) in [([0, 1, 1], [2, 1, 1]), ([1, 1, 1], [2, 2, 1])] {
            let mut solid = Array3::from_elem((2, 2, 2), false);
            solid[[0, 0, 0]] = true;
            solid[other] = true;
            let found = [6, 18, 26].map(|n| labelled(solid.view(), n, Boundary::Open).1.len());
            assert_eq!(found, counts);
        }
    }

    #[test]
    fn views_that_are_not_contiguous() {
        let solid = Array3::from_shape_fn((9, 10, 70), |(z, y, x)| (z * y + x * x) % 3 == 0);
        let strided = solid.slice(s![..;2, ..;-1, 1..;3]);
        let expected = twin(&strided.to_owned(), 18, false);
        assert_eq!(labelled(strided, 18, Boundary::Open), expected);
    }

    #[test]
    fn bad_input_is_named() {
        assert!(Connectivity::try_from(8).is_err());
        let solid = Array3::from_elem((2, 2, 2), true);
        let mut labels = Array3::zeros((2, 2, 3));
        let monitor = Monitor::silent();
        let faces = Connectivity::Faces;
        let result = label(solid.view(), faces, Boundary::Open, labels.view_mut(), &monitor);
        assert!(matches!(result, Err(Error::Parameter { parameter: "output.shape", .. })));
    }
}
