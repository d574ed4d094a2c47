//! Diameters of balls centred on voxels and half-way between them.

use ndarray::{Array3, ArrayView3, ArrayViewMut3, Axis, s};
use rayon::prelude::*;

use super::Space;
use crate::error::Result;
use crate::geometry::distance::outside;
use crate::geometry::distance::transform::{Lattice, squared_distances};
use crate::monitor::Monitor;
use crate::volume::Boundary;

/// The largest diameter of the balls that are centred on each voxel or half a voxel beside it, along
/// any axes. `reach` are the squared distances at the voxels; `scratch` is overwritten.
pub(super) fn largest_nearby(
    phase: ArrayView3<'_, bool>,
    space: &Space,
    reach: &Array3<f32>,
    mut scratch: ArrayViewMut3<'_, f32>,
    monitor: &Monitor<'_>,
) -> Result<Array3<f32>> {
    let mut largest = Array3::zeros(phase.dim());
    // Where voxels are no cubes, half a voxel depends on the direction: see `diameters`.
    let mut counted = if space.is_cubic() { None } else { Some(Array3::zeros(phase.dim())) };
    for number in 0..8 {
        let half = [number & 4 != 0, number & 2 != 0, number & 1 != 0];
        if let Some(counted) = &mut counted {
            let lattice = Lattice { size: [2.0; 3], ..space.lattice(half) };
            squared_distances(outside(phase), &lattice, counted.view_mut(), |_, _| (), monitor)?;
        }
        let finish = |[z, y, x]: [usize; 3], squares: &mut [f32]| match &counted {
            None => cubic_diameters(squares, space.unit as f32),
            Some(counted) => {
                for (i, square) in squares.iter_mut().enumerate() {
                    *square = diameter(*square, counted[[z, y, x + i]], space.unit as f32);
                }
            }
        };
        if number == 0 {
            scratch.assign(reach);
            let rows = scratch.axis_iter_mut(Axis(0)).into_par_iter().enumerate();
            rows.for_each(|(z, mut plane)| {
                for (y, mut row) in plane.rows_mut().into_iter().enumerate() {
                    if let Some(row) = row.as_slice_mut() {
                        finish([z, y, 0], row);
                    }
                }
            });
        } else {
            let lattice = space.lattice(half);
            squared_distances(outside(phase), &lattice, scratch.view_mut(), finish, monitor)?;
        }
        raise(&mut largest, scratch.view(), half, space.boundary, monitor)?;
    }
    Ok(largest)
}

/// Diameter of a ball up to the surface, half a voxel before the nearest voxel outside; `square` is
/// its distance squared, `counted` the same if distances were counted in half voxels.
fn diameter(square: f32, counted: f32, unit: f32) -> f32 {
    if counted > 0.0 { square.sqrt() * unit * (2.0 - 2.0 / counted.sqrt()) } else { 0.0 }
}

/// [`diameter`] where a voxel has the edge 2: what was counted is the distance itself.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
fn cubic_diameters(squares: &mut [f32], unit: f32) {
    for square in squares {
        *square = (square.sqrt() - 1.0) * (2.0 * unit);
    }
}

/// Raises each voxel to the values half a voxel beside it, on both sides along the axes in `half`.
fn raise(
    largest: &mut Array3<f32>,
    values: ArrayView3<'_, f32>,
    half: [bool; 3],
    boundary: Boundary,
    monitor: &Monitor<'_>,
) -> Result<()> {
    let (nz, ny, nx) = values.dim();
    // Where the values next to a position are along an axis: before it and after it. Beyond an open
    // border there are none.
    let beside = |i: usize, n: usize, half: bool| match (half, boundary) {
        (false, _) => [Some(i), None],
        (true, Boundary::Periodic) => [Some((i + n - 1) % n), Some(i)],
        (true, Boundary::Open) => [i.checked_sub(1), Some(i).filter(|i| i + 1 < n)],
    };
    largest.axis_iter_mut(Axis(0)).into_par_iter().enumerate().try_for_each(|(z, mut plane)| {
        for (y, mut row) in plane.rows_mut().into_iter().enumerate() {
            monitor.check()?;
            let Some(row) = row.as_slice_mut() else { continue };
            for from_z in beside(z, nz, half[0]).into_iter().flatten() {
                for from_y in beside(y, ny, half[1]).into_iter().flatten() {
                    let values = values.slice(s![from_z, from_y, ..]);
                    let Some(values) = values.to_slice() else { continue };
                    if half[2] {
                        raise_row(&mut row[..nx - 1], &values[..nx - 1]);
                        raise_row(&mut row[1..], &values[..nx - 1]);
                        if boundary == Boundary::Periodic {
                            raise_row(&mut row[..1], &values[nx - 1..]);
                            raise_row(&mut row[nx - 1..], &values[nx - 1..]);
                        }
                    } else {
                        raise_row(row, values);
                    }
                }
            }
        }
        Ok(())
    })
}

#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
fn raise_row(row: &mut [f32], values: &[f32]) {
    for (out, &value) in row.iter_mut().zip(values) {
        *out = if value > *out { value } else { *out };
    }
}
