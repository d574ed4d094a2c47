//! Balls centred on voxels, and how thick those are that are centred near them.
//!
//! Distances are taken on voxels and half-way between them along each axis, which makes eight
//! lattices. What they have in common, the steps to the next voxel outside along y, is counted first.
//! The rest is done row by row along y, each with those before and behind it, which a cache can hold:
//! to write the distances of each lattice and read them again would take half the time.

use std::ops::Range;

use bytemuck::Pod;
use ndarray::{Array2, ArrayView2, ArrayView3, ArrayViewMut2, ArrayViewMut3, Axis, s};
use rayon::prelude::*;

use super::Space;
use crate::error::Result;
use crate::geometry::distance::outside;
use crate::geometry::distance::transform::{
    Columns, Kept, Lattice, Rows, copy_lanes, steps_along_y,
};
use crate::geometry::distance::window::{LANES, Lane, Steps};
use crate::monitor::Monitor;
use crate::volume::Boundary;

/// Rows along y that are done one after the other: where they begin, one is done twice.
const BAND: usize = 16;

/// The ball of each voxel.
pub(super) struct Balls<'a, T> {
    /// Squared distance to the nearest voxel outside.
    pub reach: ArrayViewMut3<'a, T>,
    /// How thick the thickest ball is that is centred on the voxel or half a voxel beside it, along
    /// any axes: the square of its reach if voxels are cubes, else its diameter.
    pub rank: ArrayViewMut3<'a, T>,
    /// The largest reach.
    pub most: T,
}

impl<'a, T: Lane + Kept<T> + Pod> Balls<'a, T> {
    /// None if squares are too large to be kept.
    ///
    /// There is one voxel at least. `room` is as many values as there are voxels; if that is too
    /// little, `more` is filled.
    pub(super) fn new(
        phase: ArrayView3<'_, bool>,
        space: &Space,
        room: &'a mut [f32],
        more: &'a mut Vec<T>,
        monitor: &Monitor<'_>,
    ) -> Result<Option<Self>> {
        let (rank, mut reach) = bytemuck::cast_slice_mut(room).split_at_mut(phase.len());
        if reach.is_empty() {
            more.resize(phase.len(), T::default());
            reach = more;
        }
        let (Ok(mut rank), Ok(mut reach)) = (
            ArrayViewMut3::from_shape(phase.dim(), rank),
            ArrayViewMut3::from_shape(phase.dim(), reach),
        ) else {
            return Ok(None);
        };
        // The steps of a row are needed no more when its reach is found.
        steps_along_y(outside(phase), space.boundary, reach.view_mut(), monitor)?;
        let beyond = rows_beyond_bands(reach.view(), space.boundary);
        let lattices = Lattices::new(phase.dim(), space);
        let most = reach
            .axis_chunks_iter_mut(Axis(1), BAND)
            .into_par_iter()
            .zip(rank.axis_chunks_iter_mut(Axis(1), BAND))
            .zip(beyond)
            .map_init(
                || Work::new(&lattices),
                |work, ((reach, rank), beyond)| work.run_band(beyond, reach, rank, monitor),
            )
            .try_reduce(
                || Some(T::default()),
                |a, b| Ok(a.zip(b).map(|(a, b)| if b > a { b } else { a })),
            )?;
        Ok(most.map(|most| Self { reach, rank, most }))
    }
}

/// The steps of a row along y, in planes of z and x; none beyond an open border.
type Row = Option<Array2<u16>>;

/// The rows before and after each band.
fn rows_beyond_bands<T: Lane>(steps: ArrayView3<'_, T>, boundary: Boundary) -> Vec<[Row; 2]> {
    let ny = steps.dim().1;
    let of_band = |first: usize| {
        let last = (first + BAND).min(ny) - 1;
        [boundary.before(first, ny), boundary.after(last, ny)]
            .map(|y| Some(steps.index_axis(Axis(1), y?).mapv(T::steps)))
    };
    (0..ny).into_par_iter().step_by(BAND).map(of_band).collect()
}

/// Takes the steps of a row, plane by plane, each of which is contiguous.
fn load<T: Lane>(steps: ArrayView2<'_, T>, row: &mut Array2<u16>) {
    for (mut to, from) in row.rows_mut().into_iter().zip(steps.rows()) {
        if let (Some(to), Some(from)) = (to.as_slice_mut(), from.to_slice()) {
            to.iter_mut().zip(from).for_each(|(to, from)| *to = from.steps());
        }
    }
}

/// What distances are measured on.
struct Lattices<T> {
    /// Voxels along (z, x).
    plane: [usize; 2],
    real: Passes<T>,
    /// Where voxels are no cubes, half a voxel depends on the direction: see [`diameter`]. This is the
    /// same where a step is counted as 2 along every axis.
    counted: Option<Passes<T>>,
    unit: f32,
}

/// The passes along x and z, on voxels and half-way between them.
struct Passes<T> {
    lattice: Lattice,
    along_x: [Steps<T>; 2],
    along_z: [Steps<T>; 2],
}

impl<T: Lane + Kept<T>> Lattices<T> {
    fn new((nz, _, nx): (usize, usize, usize), space: &Space) -> Self {
        let passes = |size| {
            let lattice = |half| Lattice { size, ..space.lattice([half; 3]) };
            let halves = [lattice(false), lattice(true)];
            Passes {
                lattice: halves[0],
                along_x: halves.map(|lattice| T::steps_in_planes(lattice.steps(2, nx))),
                along_z: halves.map(|lattice| lattice.steps(0, nz)),
            }
        };
        Self {
            plane: [nz, nx],
            real: passes(space.size),
            counted: (!space.cubic).then(|| passes([2.0; 3])),
            unit: space.unit as f32,
        }
    }
}

/// Room to find the squares of a row along y.
struct Squares<'a, T> {
    passes: &'a Passes<T>,
    rows: Rows<T>,
    columns: Columns<T, T>,
    /// Those in planes across z.
    in_planes: Array2<T>,
}

impl<'a, T: Lane + Kept<T>> Squares<'a, T> {
    fn new(passes: &'a Passes<T>, [nz, nx]: [usize; 2]) -> Self {
        Self {
            passes,
            rows: Rows::new(nx, &passes.along_x[0]),
            columns: Columns::new(nz, &passes.along_z[0]),
            in_planes: Array2::from_elem((nz, nx), T::default()),
        }
    }

    /// Finds those in planes, given the steps along y of the row, and again or of the next one; false
    /// if some cannot be kept.
    fn lower_rows(&mut self, half: [bool; 3], [steps, beside]: [&Array2<u16>; 2]) -> bool {
        let lattice = Lattice { half, ..self.passes.lattice };
        let along_x = &self.passes.along_x[usize::from(half[2])];
        let both = steps.rows().into_iter().zip(beside.rows());
        both.zip(self.in_planes.rows_mut()).all(|((steps, beside), mut squares)| {
            match (steps.to_slice(), beside.to_slice(), squares.as_slice_mut()) {
                (Some(steps), Some(beside), Some(squares)) => {
                    self.rows.lower([steps, beside], &lattice, along_x, squares)
                }
                _ => false,
            }
        })
    }

    /// Takes columns of those in planes.
    fn load(&mut self, xs: &Range<usize>) {
        let columns = self.in_planes.slice(s![.., xs.clone()]);
        self.columns.load(columns, self.passes.lattice.boundary);
    }

    /// Writes the squares of the columns that were loaded; false if some cannot be kept.
    fn lower_columns(&mut self, half: [bool; 3], xs: &Range<usize>, lowered: &mut [T]) -> bool {
        let lattice = Lattice { half, ..self.passes.lattice };
        let along_z = &self.passes.along_z[usize::from(half[0])];
        let columns = self.in_planes.slice(s![.., xs.clone()]);
        self.columns.lower(&lattice, along_z, columns, lowered)
    }
}

/// Room to work on rows along y: planes of z and x.
struct Work<'a, T> {
    lattices: &'a Lattices<T>,
    real: Squares<'a, T>,
    counted: Option<Squares<'a, T>>,
    /// Steps along y of the row and of the next one.
    here: Array2<u16>,
    next: Array2<u16>,
    /// [`LANES`] columns on voxels and half-way between them along z.
    ranks: [Vec<T>; 2],
    ranks_counted: Vec<T>,
    /// The ranks of the row, and of what is half-way to the row before and to the next.
    own: Vec<T>,
    before: Vec<T>,
    after: Vec<T>,
}

impl<'a, T: Lane + Kept<T>> Work<'a, T> {
    fn new(lattices: &'a Lattices<T>) -> Self {
        let [nz, nx] = lattices.plane;
        let squares = |passes| Squares::new(passes, lattices.plane);
        let plane = || vec![T::default(); nz * nx];
        let lines = || vec![T::default(); nz * LANES];
        Self {
            lattices,
            real: squares(&lattices.real),
            counted: lattices.counted.as_ref().map(squares),
            here: Array2::zeros((nz, nx)),
            next: Array2::zeros((nz, nx)),
            ranks: [lines(), lines()],
            ranks_counted: lines(),
            own: plane(),
            before: plane(),
            after: plane(),
        }
    }

    /// Turns the steps of a band to the reach of its voxels and writes their rank; returns the largest
    /// reach. None if squares cannot be kept.
    fn run_band(
        &mut self,
        [row_before, mut row_after]: [Row; 2],
        mut reach: ArrayViewMut3<'_, T>,
        mut rank: ArrayViewMut3<'_, T>,
        monitor: &Monitor<'_>,
    ) -> Result<Option<T>> {
        let mut most = T::default();
        load(reach.index_axis(Axis(1), 0), &mut self.next);
        // Beyond an open border there is nothing.
        self.after.fill(T::default());
        if let Some(row) = row_before {
            self.here = row;
            if !self.run_half_way() {
                return Ok(None);
            }
        }
        let rows = reach.len_of(Axis(1));
        for y in 0..rows {
            monitor.check()?;
            std::mem::swap(&mut self.here, &mut self.next);
            std::mem::swap(&mut self.before, &mut self.after);
            self.after.fill(T::default());
            let goes_on = if y + 1 < rows {
                load(reach.index_axis(Axis(1), y + 1), &mut self.next);
                true
            } else if let Some(row) = row_after.take() {
                self.next = row;
                true
            } else {
                false
            };
            if goes_on && !self.run_half_way() {
                return Ok(None);
            }
            let mut reach = reach.index_axis_mut(Axis(1), y);
            if !self.run_own(reach.view_mut()) {
                return Ok(None);
            }
            let mut rank = rank.index_axis_mut(Axis(1), y);
            for (mut rank, own) in rank.rows_mut().into_iter().zip(self.own.chunks(reach.ncols())) {
                if let Some(rank) = rank.as_slice_mut() {
                    rank.copy_from_slice(own);
                }
            }
            most = largest(reach.view(), most);
        }
        Ok(Some(most))
    }

    /// Finds the ranks half-way to the next row, in `after`; false if squares cannot be kept.
    fn run_half_way(&mut self) -> bool {
        let mut after = std::mem::take(&mut self.after);
        let done = self.run(true, &mut after, None);
        self.after = after;
        done
    }

    /// Finds the ranks of the row, in `own`, and writes its reach; false if squares cannot be kept.
    fn run_own(&mut self, reach: ArrayViewMut2<'_, T>) -> bool {
        let mut own = std::mem::take(&mut self.own);
        own.copy_from_slice(&self.before);
        T::raise(&mut own, &self.after);
        let done = self.run(false, &mut own, Some(reach));
        self.own = own;
        done
    }

    /// Raises ranks to those of the balls that are centred on the voxels of the row or half a voxel
    /// beside them along z and x, if not half-way to the next row; writes what reach they have at the
    /// voxels. False if squares cannot be kept.
    fn run(
        &mut self,
        half: bool,
        raised: &mut [T],
        mut reach: Option<ArrayViewMut2<'_, T>>,
    ) -> bool {
        let [_, nx] = self.lattices.plane;
        for half_x in [false, true] {
            let rows = [&self.here, if half { &self.next } else { &self.here }];
            let half = [false, half, half_x];
            if !self.real.lower_rows(half, rows)
                || !self.counted.as_mut().is_none_or(|counted| counted.lower_rows(half, rows))
            {
                return false;
            }
            for x in (0..nx).step_by(LANES) {
                let reach = reach.as_mut().filter(|_| !half_x).map(|reach| reach.view_mut());
                if !self.run_columns(x..(x + LANES).min(nx), half, raised, reach) {
                    return false;
                }
            }
        }
        true
    }

    /// The same for some columns, at most [`LANES`].
    fn run_columns(
        &mut self,
        xs: Range<usize>,
        [_, half_y, half_x]: [bool; 3],
        raised: &mut [T],
        mut reach: Option<ArrayViewMut2<'_, T>>,
    ) -> bool {
        let Lattices { plane: [nz, nx], real, unit, .. } = self.lattices;
        let boundary = real.lattice.boundary;
        self.real.load(&xs);
        if let Some(counted) = &mut self.counted {
            counted.load(&xs);
        }
        for (half_z, ranks) in [false, true].into_iter().zip(&mut self.ranks) {
            let half = [half_z, half_y, half_x];
            if !self.real.lower_columns(half, &xs, ranks) {
                return false;
            }
            if !half_z && let Some(reach) = &mut reach {
                store(ranks, reach.slice_mut(s![.., xs.clone()]));
            }
            let Some(counted) = &mut self.counted else { continue };
            if !counted.lower_columns(half, &xs, &mut self.ranks_counted) {
                return false;
            }
            for (rank, counted) in ranks.iter_mut().zip(&self.ranks_counted) {
                *rank = T::from_square(diameter(rank.square(), counted.square(), *unit));
            }
        }
        // Half-way to the next voxel is beside both; beyond an open border there is nothing.
        let [ranks, half_way] = &mut self.ranks;
        let last = (nz - 1) * LANES;
        T::raise(&mut ranks[LANES..], &half_way[..last]);
        T::raise(ranks, &half_way[..last]);
        if boundary == Boundary::Periodic {
            T::raise(&mut ranks[..LANES], &half_way[last..]);
            T::raise(&mut ranks[last..], &half_way[last..]);
        }
        for (raised, ranks) in raised.chunks_mut(*nx).zip(ranks.chunks(LANES)) {
            let ranks = &ranks[..xs.len()];
            if half_x {
                let inside = xs.end.min(nx - 1) - xs.start;
                T::raise(&mut raised[xs.start..], &ranks[..inside]);
                T::raise(&mut raised[xs.start + 1..], &ranks[..inside]);
                if boundary == Boundary::Periodic && xs.end == *nx {
                    T::raise(&mut raised[nx - 1..], &ranks[inside..]);
                    T::raise(raised, &ranks[inside..]);
                }
            } else {
                T::raise(&mut raised[xs.start..], ranks);
            }
        }
        true
    }
}

/// The largest of some rows, or a value that is larger.
fn largest<T: Copy + PartialOrd>(rows: ArrayView2<'_, T>, most: T) -> T {
    let larger = |most, &value: &T| if value > most { value } else { most };
    rows.rows().into_iter().fold(most, |most, row| row.iter().fold(most, larger))
}

/// Writes rows of [`LANES`] columns, of which there may be fewer.
fn store<T: Copy>(lines: &[T], mut part: ArrayViewMut2<'_, T>) {
    for (mut row, line) in part.rows_mut().into_iter().zip(lines.chunks(LANES)) {
        if let Some(row) = row.as_slice_mut() {
            copy_lanes(line, row);
        }
    }
}

/// Diameter of a ball up to the surface, half a voxel before the nearest voxel outside; `square` is
/// its distance squared, `counted` the same if distances were counted in half voxels.
fn diameter(square: f32, counted: f32, unit: f32) -> f32 {
    if counted > 0.0 { square.sqrt() * unit * (2.0 - 2.0 / counted.sqrt()) } else { 0.0 }
}
