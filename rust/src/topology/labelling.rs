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
