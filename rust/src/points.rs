//! Distances to the nearest of random points, one of which lies in each cell of a lattice (Worley
//! 1996).

use std::ops::Range;

use multiversion::multiversion;
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::volume::Shape;

/// Places along the last axis that are handled at once.
const LANES: usize = 8;

/// Grids that one thread handles at a time.
const GRIDS: usize = 16;

/// Grids of places, each in a window of a lattice, all of one shape.
pub struct Grids<'a> {
    /// Sites of each window.
    pub sites: Shape,
    /// Place of each point in its cell along each axis, 0 to 1, shape (grid, axis, site).
    pub points: &'a [f32],
    /// Cell of the places along each axis, counted from the first site; shape (grid, place).
    pub cells: [&'a [i64]; 3],
    /// Where in it, 0 to 1; the same shape.
    pub fractions: [&'a [f32]; 3],
    /// How many there are.
    pub count: usize,
}

/// One of them.
struct Grid<'a> {
    sites: Shape,
    points: [&'a [f32]; 3],
    cells: [&'a [i64]; 3],
    fractions: [&'a [f32]; 3],
}

impl<'a> Grids<'a> {
    /// Returns the `KEPT` smallest distances in cells, ascending; shape (grid, places, …, distance).
    ///
    /// Only points of the cells around that of a place are looked at, so that distances beyond those,
    /// which are left out, must be larger than `farthest`, which larger ones become.
    pub fn nearest<const KEPT: usize>(&self, farthest: f32) -> Result<Vec<f32>> {
        self.check()?;
        let each = KEPT * self.places().iter().product::<usize>();
        let mut out = vec![farthest; self.count * each];
        if each > 0 {
            out.par_chunks_mut(GRIDS * each).enumerate().for_each(|(part, out)| {
                for (i, out) in out.chunks_mut(each).enumerate() {
                    fill::<KEPT>(&self.grid(part * GRIDS + i), farthest, out);
                }
            });
        }
        Ok(out)
    }

    /// Places of a grid along each axis.
    fn places(&self) -> Shape {
        self.cells.map(|cells| cells.len() / self.count.max(1))
    }

    fn check(&self) -> Result<()> {
        let points = 3 * self.count * self.sites.iter().product::<usize>();
        if self.points.len() != points {
            let allowed = format!("must be {points}, three a site");
            return Err(Error::parameter("points", self.points.len(), allowed));
        }
        let lines =
            self.cells.iter().zip(&self.fractions).zip(self.sites.iter().zip(self.places()));
        for ((cells, fractions), (&sites, places)) in lines {
            if [cells.len(), fractions.len()] != [self.count * places; 2] {
                let allowed = format!("must be as many, a multiple of {}", self.count);
                return Err(Error::parameter("cells", [cells.len(), fractions.len()], allowed));
            }
            let inside = 0..sites as i64;
            if let Some(cell) = cells.iter().find(|cell| !inside.contains(cell)) {
                let allowed = format!("must be within {inside:?}");
                return Err(Error::parameter("cells", cell, allowed));
            }
        }
        Ok(())
    }

    fn grid(&self, number: usize) -> Grid<'a> {
        let size = self.sites.iter().product::<usize>();
        let places = self.places();
        let own = |axis: usize| number * places[axis]..(number + 1) * places[axis];
        Grid {
            sites: self.sites,
            points: [0, 1, 2].map(|axis| &self.points[(3 * number + axis) * size..][..size]),
            cells: [0, 1, 2].map(|axis| &self.cells[axis][own(axis)]),
            fractions: [0, 1, 2].map(|axis| &self.fractions[axis][own(axis)]),
        }
    }
}

impl Grid<'_> {
    /// The sites around that of a place along an axis.
    #[inline(always)]
    fn around(&self, axis: usize, place: usize) -> Range<usize> {
        let cell = self.cells[axis][place] as usize;
        cell.saturating_sub(1)..(cell + 2).min(self.sites[axis])
    }

    /// Square of the distance along an axis from a place to the point of a site, which is `along` it.
    #[inline(always)]
    fn square(&self, axis: usize, place: usize, along: usize, site: usize) -> f32 {
        // Whole cells by themselves: windows from other sites on get the same bits.
        let whole = (self.cells[axis][place] - along as i64) as f32;
        let distance = (self.fractions[axis][place] - self.points[axis][site]) + whole;
        distance * distance
    }
}

#[multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
fn fill<const KEPT: usize>(grid: &Grid<'_>, farthest: f32, out: &mut [f32]) {
    let [n0, n1, n2] = grid.cells.map(<[i64]>::len);
    let [_, s1, s2] = grid.sites;
    let points = grid.points[2];
    for (line, out) in (0..n0 * n1).zip(out.chunks_exact_mut(n2 * KEPT)) {
        let [i, j] = [line / n1, line % n1];
        for (part, out) in out.chunks_mut(LANES * KEPT).enumerate() {
            let (mut low, mut high) = (usize::MAX, 0);
            // What is behind the last place is left out at the end.
            let (mut cells, mut fractions) = ([0.0; LANES], [0.0; LANES]);
            for lane in 0..LANES {
                let place = (part * LANES + lane).min(n2 - 1);
                let around = grid.around(2, place);
                (low, high) = (low.min(around.start), high.max(around.end));
                cells[lane] = grid.cells[2][place] as f32;
                fractions[lane] = grid.fractions[2][place];
            }
            let mut kept = [[f32::INFINITY; LANES]; KEPT];
            for a in grid.around(0, i) {
                for b in grid.around(1, j) {
                    let first = (a * s1 + b) * s2;
                    for (c, &point) in (low..high).zip(&points[first + low..first + high]) {
                        let (site, along) = (first + c, c as f32);
                        let other = grid.square(0, i, a, site) + grid.square(1, j, b, site);
                        let mut squares = [0.0; LANES];
                        for lane in 0..LANES {
                            let distance = (fractions[lane] - point) + (cells[lane] - along);
                            squares[lane] = other + distance * distance;
                        }
                        // Into its place among those kept so far; the farthest falls out.
                        for kept in &mut kept {
                            for lane in 0..LANES {
                                let (own, new) = (kept[lane], squares[lane]);
                                kept[lane] = own.min(new);
                                squares[lane] = own.max(new);
                            }
                        }
                    }
                }
            }
            for (lane, out) in out.chunks_exact_mut(KEPT).enumerate() {
                for (out, kept) in out.iter_mut().zip(&kept) {
                    *out = kept[lane].sqrt().min(farthest);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Key;

    const FARTHEST: f32 = 1.125;

    /// A grid in each of two windows of 4 × 4 × 5 sites.
    fn with_grids<T>(places: Shape, work: impl Fn(&Grids<'_>) -> T) -> T {
        let sites = [4, 4, 5];
        let noise = |n: usize, seed: u64| (0..n).map(move |i| Key::new(seed).unit(i as u64));
        let points: Vec<f32> = noise(2 * 3 * 80, 1).map(|u| 0.125 + 0.75 * u).collect();
        let cells = places.map(|n| noise(2 * n, 2).map(|u| 1 + (2.0 * u) as i64).collect());
        let fractions = places.map(|n| noise(2 * n, 3).collect());
        let cells: &[Vec<i64>; 3] = &cells;
        let fractions: &[Vec<f32>; 3] = &fractions;
        work(&Grids {
            sites,
            points: &points,
            cells: cells.each_ref().map(Vec::as_slice),
            fractions: fractions.each_ref().map(Vec::as_slice),
            count: 2,
        })
    }

    #[test]
    fn they_are_the_nearest_of_all_points() {
        for places in [[2, 3, 11], [1, 1, 1], [3, 2, 8]] {
            with_grids(places, |grids| {
                let found = grids.nearest::<4>(FARTHEST).unwrap();
                let each = places.iter().product::<usize>();
                for (number, found) in found.chunks(4).enumerate() {
                    let grid = grids.grid(number / each);
                    let at = crate::volume::position(places, number % each);
                    let mut all: Vec<f32> = (0..80)
                        .map(|site| {
                            let along = crate::volume::position(grids.sites, site);
                            let squares = [0, 1, 2].map(|k| {
                                let cell = (grid.cells[k][at[k]] - along[k] as i64) as f32;
                                (grid.fractions[k][at[k]] + cell - grid.points[k][site]).powi(2)
                            });
                            squares.iter().sum::<f32>().sqrt().min(FARTHEST)
                        })
                        .collect();
                    all.sort_by(f32::total_cmp);
                    for (found, expected) in found.iter().zip(all) {
                        assert!((found - expected).abs() < 1e-5);
                    }
                }
            });
        }
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        with_grids([2, 2, 2], |grids| {
            let fewer = Grids { points: &grids.points[1..], ..*grids };
            assert!(matches!(
                fewer.nearest::<4>(1.0),
                Err(Error::Parameter { parameter: "points", .. })
            ));
            for cells in [&[0, 1, 1, 5][..], &[0, -1, 1, 1], &[1, 1, 1]] {
                let [a, b, _] = grids.cells;
                let outside = Grids { cells: [a, b, cells], ..*grids };
                assert!(matches!(
                    outside.nearest::<4>(1.0),
                    Err(Error::Parameter { parameter: "cells", .. })
                ));
            }
        });
    }

    #[test]
    fn no_place_has_no_distance() {
        with_grids([0, 2, 2], |grids| assert!(grids.nearest::<4>(1.0).unwrap().is_empty()));
    }
}
