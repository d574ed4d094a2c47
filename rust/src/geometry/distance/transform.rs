//! Squared Euclidean distances, one axis after the other.
//!
//! Planes are done one by one: along y by counting, along x by windows over shifted rows. Then
//! columns along z by windows over [`LANES`] columns abreast. A window ends where it cannot lower
//! the largest of its minima; where that is too far, lines go to their [`Envelope`].

use ndarray::{ArrayView2, ArrayViewMut2, ArrayViewMut3, Axis, s};
use rayon::prelude::*;

use super::envelope::Envelope;
use super::window::{FARTHEST, LANES, Lane, Line, Steps, carry_on, count_back, count_on, padding};
use crate::error::{Error, Result};
use crate::monitor::Monitor;
use crate::volume::Boundary;

/// Longest edge: steps to the next voxel are counted in 16 bits.
const LONGEST: usize = u16::MAX as usize - 1;

/// What distances are measured between, and how.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Lattice {
    /// Edges of a voxel along (z, y, x).
    pub size: [f64; 3],
    /// Whether distances are taken half-way to the next voxel along (z, y, x); such a place is level
    /// with both of its voxels: a flat wall is no farther from between two voxels.
    pub half: [bool; 3],
    pub boundary: Boundary,
    /// Larger squares become this one.
    pub limit: f32,
}

impl Lattice {
    /// Whether all squares are whole numbers.
    fn is_whole(&self) -> bool {
        let whole = |(&size, &half): (&f64, &bool)| {
            let smallest = if half { 0.5 * size } else { size };
            smallest.fract() == 0.0 && smallest <= 2.0
        };
        self.size.iter().zip(&self.half).all(whole)
    }

    pub(crate) fn steps<T: Lane>(&self, axis: usize, n: usize) -> Steps<T> {
        let reach = match self.boundary {
            Boundary::Open => n - 1,
            Boundary::Periodic => n / 2 + 1,
        };
        Steps::new(self.size[axis], self.half[axis], reach, self.limit)
    }
}

/// Squared distances as they are kept between the passes.
pub(crate) trait Kept<T: Lane>: Copy + Default + Send + Sync + 'static {
    /// The steps of the passes in planes.
    fn steps_in_planes(steps: Steps<T>) -> Steps<T>;
    fn keep(lanes: &[T], kept: &mut [Self]);
    fn load(kept: &[Self], lanes: &mut [T]);
    /// The squares themselves; none if those beyond a window cannot be kept.
    fn squares(kept: &mut [Self]) -> Option<&mut [f32]>;
}

impl<T: Lane> Kept<T> for f32 {
    fn steps_in_planes(steps: Steps<T>) -> Steps<T> {
        steps
    }

    fn keep(lanes: &[T], kept: &mut [Self]) {
        T::to_squares(lanes, kept);
    }

    fn load(kept: &[Self], lanes: &mut [T]) {
        T::from_squares(kept, lanes);
    }

    fn squares(kept: &mut [Self]) -> Option<&mut [f32]> {
        Some(kept)
    }
}

impl Kept<Self> for u16 {
    /// What is too far in its own plane may be near enough in another.
    fn steps_in_planes(steps: Steps<Self>) -> Steps<Self> {
        steps.or_far()
    }

    fn keep(lanes: &[Self], kept: &mut [Self]) {
        kept.copy_from_slice(&lanes[..kept.len()]);
    }

    fn load(kept: &[Self], lanes: &mut [Self]) {
        lanes[..kept.len()].copy_from_slice(kept);
    }

    fn squares(_: &mut [Self]) -> Option<&mut [f32]> {
        None
    }
}

/// Writes the squared distance of each voxel to the nearest target.
///
/// `targets(z, y, row)` says where in a row the targets are. `finish` gets each part of the result
/// that is done.
pub(crate) fn squared_distances(
    targets: impl Fn(usize, usize, &mut [bool]) + Sync,
    lattice: &Lattice,
    out: ArrayViewMut3<'_, f32>,
    finish: impl Fn(&mut [f32]) + Sync,
    monitor: &Monitor<'_>,
) -> Result<()> {
    // Whole numbers are exact up to 2^24; u16 lanes hand over what they cannot hold.
    if lattice.is_whole() {
        run::<u16>(&targets, lattice, out, &finish, monitor)
    } else {
        run::<f32>(&targets, lattice, out, &finish, monitor)
    }
}

fn run<T: Lane>(
    targets: &(impl Fn(usize, usize, &mut [bool]) + Sync),
    lattice: &Lattice,
    mut out: ArrayViewMut3<'_, f32>,
    finish: &(impl Fn(&mut [f32]) + Sync),
    monitor: &Monitor<'_>,
) -> Result<()> {
    if !planes::<T, _>(targets, lattice, out.view_mut(), monitor)? {
        return Ok(()); // there are no voxels
    }
    let (nz, _, nx) = out.dim();
    let along_z = lattice.steps::<T>(0, nz);
    out.axis_iter_mut(Axis(1)).into_par_iter().try_for_each_init(
        || Columns::<T, _>::new(nz, &along_z),
        |columns, mut out| {
            for x in (0..nx).step_by(LANES) {
                monitor.check()?;
                let mut part = out.slice_mut(s![.., x..(x + LANES).min(nx)]);
                columns.load(part.view(), lattice.boundary);
                columns.lower(lattice, &along_z, part.view());
                for (mut row, lowered) in
                    part.rows_mut().into_iter().zip(columns.lowered().chunks(LANES))
                {
                    if let Some(row) = row.as_slice_mut() {
                        row.copy_from_slice(&lowered[..row.len()]);
                        finish(row);
                    }
                }
            }
            Ok(())
        },
    )
}

/// Writes the squared distance of each voxel to the nearest target in its plane; false if some
/// cannot be kept, or if there are no voxels.
pub(crate) fn planes<T: Lane, V: Kept<T>>(
    targets: impl Fn(usize, usize, &mut [bool]) + Sync,
    lattice: &Lattice,
    mut out: ArrayViewMut3<'_, V>,
    monitor: &Monitor<'_>,
) -> Result<bool> {
    let shape = out.dim();
    if [shape.0, shape.1, shape.2].into_iter().any(|n| n > LONGEST) {
        return Err(Error::parameter("shape", shape, format!("must be at most {LONGEST} an axis")));
    }
    if out.is_empty() {
        return Ok(false);
    }
    let along_x = V::steps_in_planes(lattice.steps(2, shape.2));
    out.axis_iter_mut(Axis(0))
        .into_par_iter()
        .enumerate()
        .map_init(
            || Plane::<T>::new(shape.1, shape.2, &along_x),
            |plane, (z, out)| {
                plane.run(|y, row| targets(z, y, row), lattice, &along_x, out, monitor)
            },
        )
        .try_reduce(|| true, |a, b| Ok(a && b))
}

/// Room to work on a plane.
struct Plane<T> {
    /// Steps from the last target along y, 0 at a target.
    since: Vec<u16>,
    /// Steps to the next target along y of a row, and of the row after it.
    until: Vec<u16>,
    next: Vec<u16>,
    row: Vec<bool>,
    padding: usize,
    padded: Vec<T>,
    least: Vec<T>,
    envelope: Envelope,
}

impl<T: Lane> Plane<T> {
    fn new(ny: usize, nx: usize, steps: &Steps<T>) -> Self {
        let padding = padding(steps.farthest());
        let width = nx.next_multiple_of(LANES);
        Self {
            since: vec![0; ny * nx],
            until: vec![0; nx],
            next: vec![0; nx],
            row: vec![false; nx],
            padding,
            padded: vec![T::FAR; width + 2 * padding],
            least: vec![T::FAR; width],
            envelope: Envelope::default(),
        }
    }

    /// False if some squares cannot be kept.
    fn run<V: Kept<T>>(
        &mut self,
        targets: impl Fn(usize, &mut [bool]),
        lattice: &Lattice,
        steps: &Steps<T>,
        mut out: ArrayViewMut2<'_, V>,
        monitor: &Monitor<'_>,
    ) -> Result<bool> {
        let (ny, nx) = out.dim();
        let periodic = lattice.boundary == Boundary::Periodic;
        self.next.fill(u16::MAX);
        for y in 0..ny {
            targets(y, &mut self.row);
            let since = &mut self.since[y * nx..(y + 1) * nx];
            count_on(&mut self.next, since, &self.row);
        }
        if periodic {
            // The last row goes on in the first.
            for since in self.since.chunks_mut(nx) {
                carry_on(&mut self.next, since);
            }
        }
        let offset = if lattice.half[1] { 0.5 } else { 0.0 };
        self.next.fill(u16::MAX);
        if periodic {
            for since in self.since.chunks(nx).rev() {
                count_back(&mut self.next, since);
            }
        }
        for (y, mut out) in out.rows_mut().into_iter().enumerate().rev() {
            monitor.check()?;
            let since = &self.since[y * nx..(y + 1) * nx];
            self.until.copy_from_slice(&self.next);
            count_back(&mut self.next, since);
            let until = if lattice.half[1] { &self.until } else { &self.next };
            let padded = &mut self.padded[self.padding..];
            T::squares_along(since, until, offset, lattice.size[1] as f32, padded);
            if periodic {
                wrap(&mut self.padded, self.padding, nx, 1);
            }
            let line = Line { values: &self.padded, start: self.padding, step: 1, width: nx };
            let Some(out) = out.as_slice_mut() else { continue };
            if T::minima(&line, steps, &mut self.least) {
                V::keep(&self.least, out);
            } else {
                let Some(out) = V::squares(out) else { return Ok(false) };
                f32::squares_along(since, until, offset, lattice.size[1] as f32, out);
                let Lattice { size, half, limit, boundary } = *lattice;
                self.envelope.lower(out, size[2], half[2], limit, boundary);
            }
        }
        Ok(true)
    }
}

/// Repeats `n` rows of `step` values beyond both ends.
fn wrap<T: Copy>(padded: &mut [T], padding: usize, n: usize, step: usize) {
    for i in 0..padding {
        let from = padding + (n - 1 - i % n);
        padded.copy_within(from * step..(from + 1) * step, (padding - 1 - i) * step);
    }
    for i in padding + n..padded.len() / step {
        padded.copy_within((i - n) * step..(i - n + 1) * step, i * step);
    }
}

/// Room to work on [`LANES`] columns.
pub(crate) struct Columns<T, V> {
    padding: usize,
    padded: Vec<T>,
    least: Vec<T>,
    lowered: Vec<V>,
    column: Vec<V>,
    envelope: Envelope,
}

impl<T: Lane, V: Kept<T>> Columns<T, V> {
    pub(crate) fn new(nz: usize, steps: &Steps<T>) -> Self {
        let padding = padding(steps.farthest());
        Self {
            padding,
            padded: vec![T::FAR; (nz + 2 * padding) * LANES],
            least: vec![T::FAR; nz * LANES],
            lowered: vec![V::default(); nz * LANES],
            column: vec![V::default(); nz],
            envelope: Envelope::default(),
        }
    }

    /// Takes columns, of which there may be fewer than [`LANES`].
    pub(crate) fn load(&mut self, part: ArrayView2<'_, V>, boundary: Boundary) {
        let padded = &mut self.padded[self.padding * LANES..];
        for (row, padded) in part.rows().into_iter().zip(padded.chunks_mut(LANES)) {
            if let Some(row) = row.as_slice() {
                V::load(row, padded);
            }
        }
        if boundary == Boundary::Periodic {
            wrap(&mut self.padded, self.padding, part.nrows(), LANES);
        }
    }

    /// Lowers the columns that were loaded, half-way to the next voxel or not; false if squares
    /// cannot be kept.
    pub(crate) fn lower(
        &mut self,
        lattice: &Lattice,
        steps: &Steps<T>,
        part: ArrayView2<'_, V>,
    ) -> bool {
        let start = self.padding * LANES;
        let line = Line { values: &self.padded, start, step: LANES, width: part.ncols() };
        if T::minima(&line, steps, &mut self.least) {
            V::keep(&self.least, &mut self.lowered);
            return true;
        }
        let Lattice { size, half, limit, boundary } = *lattice;
        for (x, column) in part.columns().into_iter().enumerate() {
            self.column.iter_mut().zip(column).for_each(|(to, &from)| *to = from);
            let Some(squares) = V::squares(&mut self.column) else { return false };
            self.envelope.lower(squares, size[0], half[0], limit, boundary);
            let places = self.lowered[x..].iter_mut().step_by(LANES);
            places.zip(&self.column).for_each(|(to, &from)| *to = from);
        }
        true
    }

    /// Rows of [`LANES`] columns, as they were lowered last.
    pub(crate) fn lowered(&self) -> &[V] {
        &self.lowered
    }
}

const _: () = assert!(FARTHEST * FARTHEST < u16::MAX as usize);
