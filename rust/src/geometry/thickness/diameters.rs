//! Balls centred on voxels, and how thick those are that are centred near them.

use ndarray::{Array3, ArrayView2, ArrayView3, ArrayViewMut2, Axis, s};
use rayon::prelude::*;

use super::Space;
use crate::error::Result;
use crate::geometry::distance::outside;
use crate::geometry::distance::transform::{Columns, Kept, Lattice, planes};
use crate::geometry::distance::window::{LANES, Lane, Steps};
use crate::monitor::Monitor;
use crate::volume::Boundary;

/// The ball of each voxel.
pub(super) struct Balls<T> {
    /// Squared distance to the nearest voxel outside.
    pub reach: Array3<T>,
    /// How thick the thickest ball is that is centred on the voxel or half a voxel beside it, along
    /// any axes: the square of its reach if voxels are cubes, else its diameter.
    pub rank: Array3<T>,
}

impl<T: Lane + Kept<T>> Balls<T> {
    /// None if squares are too large to be kept, or if there are no voxels.
    pub(super) fn new(
        phase: ArrayView3<'_, bool>,
        space: &Space,
        monitor: &Monitor<'_>,
    ) -> Result<Option<Self>> {
        let volume = || Array3::from_elem(phase.dim(), T::default());
        let mut balls = Self { reach: volume(), rank: volume() };
        let mut beside = volume();
        // Where voxels are no cubes, half a voxel depends on the direction: see `diameter`.
        let mut counted = if space.is_cubic() { None } else { Some(volume()) };
        for half in [[false, false], [false, true], [true, false], [true, true]] {
            let lattice = space.lattice([false, half[0], half[1]]);
            let mut done = planes::<T, _>(outside(phase), &lattice, beside.view_mut(), monitor)?;
            if let Some(counted) = &mut counted {
                let lattice = in_halves(lattice);
                done &= planes::<T, _>(outside(phase), &lattice, counted.view_mut(), monitor)?;
            }
            if !done {
                return Ok(None);
            }
            let along_z = AlongZ::new(lattice, phase.dim().0, space);
            let on_voxels = half == [false, false];
            let rows = beside.axis_iter_mut(Axis(1)).into_par_iter();
            let done = rows
                .zip(balls.reach.axis_iter_mut(Axis(1)))
                .enumerate()
                .map_init(
                    || Work::new(&along_z),
                    |work, (y, (beside, reach))| {
                        let reach = on_voxels.then_some(reach);
                        let counted = counted.as_ref().map(|all| all.index_axis(Axis(1), y));
                        work.run(&along_z, beside, reach, counted, monitor)
                    },
                )
                .try_reduce(|| true, |a, b| Ok(a && b))?;
            if !done {
                return Ok(None);
            }
            raise_beside(&mut balls.rank, beside.view(), half, space.boundary, monitor)?;
        }
        Ok(Some(balls))
    }
}

/// The same lattice where a step is counted as 2 along every axis.
fn in_halves(lattice: Lattice) -> Lattice {
    Lattice { size: [2.0; 3], ..lattice }
}

/// The last pass, on voxels and half-way between them.
struct AlongZ<T> {
    lattices: [Lattice; 2],
    steps: [Steps<T>; 2],
    /// The steps of [`in_halves`].
    counted: [Steps<T>; 2],
    nz: usize,
    unit: f32,
}

impl<T: Lane> AlongZ<T> {
    fn new(lattice: Lattice, nz: usize, space: &Space) -> Self {
        let [_, y, x] = lattice.half;
        let lattices = [false, true].map(|half| Lattice { half: [half, y, x], ..lattice });
        Self {
            steps: lattices.map(|lattice| lattice.steps(0, nz)),
            counted: lattices.map(|lattice| in_halves(lattice).steps(0, nz)),
            lattices,
            nz,
            unit: space.unit as f32,
        }
    }
}

/// Room to work on [`LANES`] columns.
struct Work<T> {
    columns: Columns<T, T>,
    counted: Columns<T, T>,
    ranks: [Vec<T>; 2],
}

impl<T: Lane + Kept<T>> Work<T> {
    fn new(along_z: &AlongZ<T>) -> Self {
        let lines = || vec![T::default(); along_z.nz * LANES];
        Self {
            columns: Columns::new(along_z.nz, &along_z.steps[0]),
            counted: Columns::new(along_z.nz, &along_z.counted[0]),
            ranks: [lines(), lines()],
        }
    }

    /// Turns squares in planes into the ranks of the balls at voxels or half a voxel beside them
    /// along z; writes what reach they have at the voxels. False if squares cannot be kept.
    fn run(
        &mut self,
        along_z: &AlongZ<T>,
        mut squares: ArrayViewMut2<'_, T>,
        mut reach: Option<ArrayViewMut2<'_, T>>,
        counted: Option<ArrayView2<'_, T>>,
        monitor: &Monitor<'_>,
    ) -> Result<bool> {
        let (nz, nx) = squares.dim();
        for x in (0..nx).step_by(LANES) {
            monitor.check()?;
            let columns = s![.., x..(x + LANES).min(nx)];
            let part = squares.slice_mut(columns);
            let boundary = along_z.lattices[0].boundary;
            self.columns.load(part.view(), boundary);
            let counted = counted.as_ref().map(|all| all.slice(columns));
            if let Some(counted) = counted {
                self.counted.load(counted, boundary);
            }
            for (half, lattice) in along_z.lattices.iter().enumerate() {
                if !self.columns.lower(lattice, &along_z.steps[half], part.view()) {
                    return Ok(false);
                }
                let ranks = &mut self.ranks[half];
                ranks.copy_from_slice(self.columns.lowered());
                if let Some(reach) = reach.as_mut().filter(|_| half == 0) {
                    store(ranks, reach.slice_mut(columns));
                }
                let Some(counted) = counted else { continue };
                if !self.counted.lower(&in_halves(*lattice), &along_z.counted[half], counted) {
                    return Ok(false);
                }
                for (rank, counted) in ranks.iter_mut().zip(self.counted.lowered()) {
                    let diameter = diameter(rank.square(), counted.square(), along_z.unit);
                    *rank = T::from_square(diameter);
                }
            }
            // Half-way to the next voxel is beside both; beyond an open border there is nothing.
            let [ranks, half] = &mut self.ranks;
            let last = (nz - 1) * LANES;
            T::raise(&mut ranks[LANES..], &half[..last]);
            T::raise(ranks, &half[..last]);
            if boundary == Boundary::Periodic {
                T::raise(&mut ranks[..LANES], &half[last..]);
                T::raise(&mut ranks[last..], &half[last..]);
            }
            store(ranks, part);
        }
        Ok(true)
    }
}

/// Writes rows of [`LANES`] columns, of which there may be fewer.
fn store<T: Copy>(lines: &[T], mut part: ArrayViewMut2<'_, T>) {
    for (mut row, line) in part.rows_mut().into_iter().zip(lines.chunks(LANES)) {
        if let Some(row) = row.as_slice_mut() {
            row.copy_from_slice(&line[..row.len()]);
        }
    }
}

/// Diameter of a ball up to the surface, half a voxel before the nearest voxel outside; `square` is
/// its distance squared, `counted` the same if distances were counted in half voxels.
fn diameter(square: f32, counted: f32, unit: f32) -> f32 {
    if counted > 0.0 { square.sqrt() * unit * (2.0 - 2.0 / counted.sqrt()) } else { 0.0 }
}

/// Raises each voxel to the values half a voxel beside it along y and x, on both sides.
fn raise_beside<T: Lane>(
    rank: &mut Array3<T>,
    values: ArrayView3<'_, T>,
    half: [bool; 2],
    boundary: Boundary,
    monitor: &Monitor<'_>,
) -> Result<()> {
    let planes = rank.axis_iter_mut(Axis(0)).into_par_iter().zip(values.axis_iter(Axis(0)));
    planes.try_for_each(|(mut rank, values)| {
        monitor.check()?;
        let (ny, nx) = values.dim();
        for (y, mut row) in rank.rows_mut().into_iter().enumerate() {
            let Some(row) = row.as_slice_mut() else { continue };
            // The values before a row and after it; beyond an open border there are none.
            let beside = if half[0] {
                [boundary.before(y, ny), boundary.after(y, ny).map(|_| y)]
            } else {
                [Some(y), None]
            };
            for from in beside.into_iter().flatten() {
                let values = values.row(from);
                let Some(values) = values.to_slice() else { continue };
                if half[1] {
                    T::raise(&mut row[..nx - 1], &values[..nx - 1]);
                    T::raise(&mut row[1..], &values[..nx - 1]);
                    if boundary == Boundary::Periodic {
                        T::raise(&mut row[..1], &values[nx - 1..]);
                        T::raise(&mut row[nx - 1..], &values[nx - 1..]);
                    }
                } else {
                    T::raise(row, values);
                }
            }
        }
        Ok(())
    })
}
