//! Squared Euclidean distances, one axis after the other.
//!
//! Planes are done one by one: along y by counting, along x by windows over shifted rows. Then
//! columns along z by windows over [`LANES`] columns abreast. A window ends where it cannot lower
//! the largest of its minima; where that is too far, lines go to their [`Envelope`].

use ndarray::{ArrayView2, ArrayViewMut3, Axis, s};
use rayon::prelude::*;

use super::envelope::Envelope;
use super::window::{
    FARTHEST, LANES, Lane, Line, Steps, carry_on, count_back, count_on, lower_to, padding,
};
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
        copy_lanes(kept, lanes);
    }

    fn squares(_: &mut [Self]) -> Option<&mut [f32]> {
        None
    }
}

/// Copies as many of [`LANES`] values as there are on both sides.
pub(crate) fn copy_lanes<T: Copy>(from: &[T], to: &mut [T]) {
    // A copy whose length is known is not worth a call.
    if let (Some(from), Some(to)) = (from.first_chunk::<LANES>(), to.first_chunk_mut()) {
        *to = *from;
    } else {
        to.iter_mut().zip(from).for_each(|(to, &from)| *to = from);
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
    if !planes::<T>(targets, lattice, out.view_mut(), monitor)? {
        return Ok(()); // there are no voxels
    }
    let (nz, _, nx) = out.dim();
    let along_z = lattice.steps::<T>(0, nz);
    out.axis_iter_mut(Axis(1)).into_par_iter().try_for_each_init(
        || (Columns::<T, _>::new(nz, &along_z), vec![0.0; nz * LANES]),
        |(columns, lowered), mut out| {
            for x in (0..nx).step_by(LANES) {
                monitor.check()?;
                let mut part = out.slice_mut(s![.., x..(x + LANES).min(nx)]);
                columns.load(part.view(), lattice.boundary);
                columns.lower(lattice, &along_z, part.view(), lowered);
                for (mut row, lowered) in part.rows_mut().into_iter().zip(lowered.chunks(LANES)) {
                    if let Some(row) = row.as_slice_mut() {
                        copy_lanes(lowered, row);
                        finish(row);
                    }
                }
            }
            Ok(())
        },
    )
}

/// Writes the squared distance of each voxel to the nearest target in its plane; false if there are
/// no voxels.
fn planes<T: Lane>(
    targets: impl Fn(usize, usize, &mut [bool]) + Sync,
    lattice: &Lattice,
    mut out: ArrayViewMut3<'_, f32>,
    monitor: &Monitor<'_>,
) -> Result<bool> {
    let shape = out.dim();
    check_edges(shape)?;
    if out.is_empty() {
        return Ok(false);
    }
    let along_x = f32::steps_in_planes(lattice.steps::<T>(2, shape.2));
    out.axis_iter_mut(Axis(0)).into_par_iter().enumerate().try_for_each_init(
        || (Counts::new(shape.1, shape.2), Rows::<T>::new(shape.2, &along_x)),
        |(counts, rows), (z, mut out)| {
            let steps = counts.run(|y, row| targets(z, y, row), lattice.boundary);
            for (mut out, steps) in out.rows_mut().into_iter().zip(steps.chunks(shape.2)) {
                monitor.check()?;
                if let Some(out) = out.as_slice_mut() {
                    rows.lower([steps; 2], lattice, &along_x, out);
                }
            }
            Ok(())
        },
    )?;
    Ok(true)
}

fn check_edges(shape: (usize, usize, usize)) -> Result<()> {
    if [shape.0, shape.1, shape.2].into_iter().any(|n| n > LONGEST) {
        return Err(Error::parameter("shape", shape, format!("must be at most {LONGEST} an axis")));
    }
    Ok(())
}

/// Writes the steps of each voxel to the nearest target along y; `u16::MAX` if there is none.
pub(crate) fn steps_along_y<T: Lane>(
    targets: impl Fn(usize, usize, &mut [bool]) + Sync,
    boundary: Boundary,
    mut out: ArrayViewMut3<'_, T>,
    monitor: &Monitor<'_>,
) -> Result<()> {
    let shape = out.dim();
    check_edges(shape)?;
    out.axis_iter_mut(Axis(0)).into_par_iter().enumerate().try_for_each_init(
        || Counts::new(shape.1, shape.2),
        |counts, (z, mut out)| {
            monitor.check()?;
            let steps = counts.run(|y, row| targets(z, y, row), boundary);
            for (out, &steps) in out.as_slice_mut().unwrap_or_default().iter_mut().zip(steps) {
                *out = T::from_steps(steps);
            }
            Ok(())
        },
    )
}

/// Room to count steps along y in a plane.
struct Counts {
    /// Steps to the last target, or to the next one.
    count: Vec<u16>,
    row: Vec<bool>,
    /// Steps to the nearest target.
    steps: Vec<u16>,
}

impl Counts {
    fn new(ny: usize, nx: usize) -> Self {
        Self { count: vec![0; nx], row: vec![false; nx], steps: vec![0; ny * nx] }
    }

    /// Returns the steps of each voxel of a plane to the nearest target along y.
    fn run(&mut self, targets: impl Fn(usize, &mut [bool]), boundary: Boundary) -> &[u16] {
        let Self { count, row, steps } = self;
        let nx = row.len();
        count.fill(u16::MAX);
        for (y, since) in steps.chunks_mut(nx).enumerate() {
            targets(y, row);
            count_on(count, since, row);
        }
        if boundary == Boundary::Periodic {
            // The last row goes on in the first.
            for since in steps.chunks_mut(nx) {
                carry_on(count, since);
            }
        }
        count.fill(u16::MAX);
        if boundary == Boundary::Periodic {
            for since in steps.chunks(nx).rev() {
                count_back(count, since);
            }
        }
        for since in steps.chunks_mut(nx).rev() {
            count_back(count, since);
            lower_to(since, count);
        }
        steps
    }
}

/// Room to work on a row.
pub(crate) struct Rows<T> {
    padding: usize,
    padded: Vec<T>,
    least: Vec<T>,
    envelope: Envelope,
}

impl<T: Lane> Rows<T> {
    pub(crate) fn new(nx: usize, steps: &Steps<T>) -> Self {
        let padding = padding(steps.farthest());
        let width = nx.next_multiple_of(LANES);
        Self {
            padding,
            padded: vec![T::FAR; width + 2 * padding],
            least: vec![T::FAR; width],
            envelope: Envelope::default(),
        }
    }

    /// Writes the squared distances of a row in its plane, given the steps along y to the nearest
    /// targets from it, and again or from the next row if that is as near; false if some cannot be
    /// kept.
    pub(crate) fn lower<V: Kept<T>>(
        &mut self,
        [steps_along_y, beside]: [&[u16]; 2],
        lattice: &Lattice,
        steps: &Steps<T>,
        out: &mut [V],
    ) -> bool {
        let Lattice { size, half, limit, boundary } = *lattice;
        let offset = if half[1] { 0.5 } else { 0.0 };
        let padded = &mut self.padded[self.padding..];
        T::squares_along(steps_along_y, beside, offset, size[1] as f32, padded);
        if boundary == Boundary::Periodic {
            wrap(&mut self.padded, self.padding, out.len(), 1);
        }
        let line = Line { values: &self.padded, start: self.padding, step: 1, width: out.len() };
        if T::minima(&line, steps, &mut self.least) {
            V::keep(&self.least, out);
            return true;
        }
        let Some(out) = V::squares(out) else { return false };
        f32::squares_along(steps_along_y, beside, offset, size[1] as f32, out);
        self.envelope.lower(out, size[2], half[2], limit, boundary);
        true
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

    /// Lowers the columns that were loaded, half-way to the next voxel or not, and writes them in rows
    /// of [`LANES`]; false if squares cannot be kept.
    pub(crate) fn lower(
        &mut self,
        lattice: &Lattice,
        steps: &Steps<T>,
        part: ArrayView2<'_, V>,
        lowered: &mut [V],
    ) -> bool {
        let start = self.padding * LANES;
        let line = Line { values: &self.padded, start, step: LANES, width: part.ncols() };
        if T::minima(&line, steps, &mut self.least) {
            V::keep(&self.least, lowered);
            return true;
        }
        let Lattice { size, half, limit, boundary } = *lattice;
        for (x, column) in part.columns().into_iter().enumerate() {
            self.column.iter_mut().zip(column).for_each(|(to, &from)| *to = from);
            let Some(squares) = V::squares(&mut self.column) else { return false };
            self.envelope.lower(squares, size[0], half[0], limit, boundary);
            let places = lowered[x..].iter_mut().step_by(LANES);
            places.zip(&self.column).for_each(|(to, &from)| *to = from);
        }
        true
    }
}

const _: () = assert!(FARTHEST * FARTHEST < u16::MAX as usize);
