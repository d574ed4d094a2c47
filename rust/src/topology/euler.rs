//! Euler number of a phase.
//!
//! 26-connected voxels are closed cubes, and a cell of the cubic lattice (vertex, edge, face, cube)
//! is in the phase where any of the voxels round it is; 6-connected voxels are the vertices of the
//! dual lattice, and a cell is in the phase where all of its voxels are. In both cases the cells
//! along a row x cancel but for one a run, so that V − E + F − C is
//!
//! runs(rows) − runs(pairs along y) − runs(pairs along z) + runs(fours),
//!
//! where pairs and fours of adjacent rows are joined by OR or by AND. Rows are bits of words, and a
//! run is a bit whose predecessor is not set.

use std::cmp::Reverse;
use std::ops::Range;

use ndarray::{ArrayView2, ArrayView3, Axis, s};
use rayon::prelude::*;

use super::labelling::Connectivity;
use crate::bits::{WORD, pack_row};
use crate::error::{Error, Result};
use crate::monitor::Monitor;
use crate::volume::Boundary;

/// Euler number of the true voxels: components − tunnels + cavities.
///
/// `connectivity` is that of the phase, 26 or 6; its complement has the other one. With an open
/// boundary the phase ends at the border; with a periodic one it is a part of the 3-torus.
///
/// Fast where one axis is contiguous. Peak memory: 2 bits a voxel of a plane, for each thread.
pub fn euler_number(
    solid: ArrayView3<'_, bool>,
    connectivity: Connectivity,
    boundary: Boundary,
    monitor: &Monitor<'_>,
) -> Result<i64> {
    let any = match connectivity {
        Connectivity::Corners => true,
        Connectivity::Faces => false,
        Connectivity::Edges => {
            return Err(Error::parameter("connectivity", 18, "must be 6 or 26"));
        }
    };
    if solid.is_empty() {
        return Ok(0);
    }
    let solid = contiguous_along_x(solid);
    let periodic = boundary == Boundary::Periodic;
    // Beyond the last plane of an open volume lies an empty one.
    let planes = solid.dim().0 + usize::from(!periodic);
    // A slab packs a plane of its neighbour, so that slabs should not be too thin.
    let thickness = planes.div_ceil(4 * rayon::current_num_threads()).max(8);
    let starts: Vec<usize> = (0..planes).step_by(thickness).collect();
    starts
        .into_par_iter()
        .map(|start| {
            let slab = start..planes.min(start + thickness);
            if any {
                of_slab::<true>(solid, periodic, slab, monitor)
            } else {
                of_slab::<false>(solid, periodic, slab, monitor)
            }
        })
        .sum()
}

/// Euler number of an open volume, and eight times its share in the Euler number of a body that goes
/// on beyond the border.
///
/// What lies in a face of the volume belongs to two volumes, in an edge to four, in a corner to
/// eight: Δχ = χ − ½ Σ χ(faces) + ¼ Σ χ(edges) − ⅛ Σ χ(corners) (Odgaard & Gundersen 1993).
pub fn corrected(
    solid: ArrayView3<'_, bool>,
    connectivity: Connectivity,
    monitor: &Monitor<'_>,
) -> Result<(i64, i64)> {
    let whole = euler_number(solid, connectivity, Boundary::Open, monitor)?;
    if solid.is_empty() {
        return Ok((whole, 0));
    }
    let (nz, ny, nx) = solid.dim();
    let sides = |n: usize| [0..n, 0..1, n - 1..n];
    let mut eighths = 0;
    for (i, z) in sides(nz).into_iter().enumerate() {
        for (j, y) in sides(ny).into_iter().enumerate() {
            for (k, x) in sides(nx).into_iter().enumerate() {
                let part = solid.slice(s![z.clone(), y.clone(), x]);
                let borders = [i, j, k].iter().filter(|&&side| side > 0).count();
                let weight = [8, -4, 2, -1][borders];
                let euler = match borders {
                    0 => whole,
                    _ => euler_number(part, connectivity, Boundary::Open, monitor)?,
                };
                eighths += weight * euler;
            }
        }
    }
    Ok((whole, eighths))
}

/// The volume with its axes in another order and direction, which do not change the Euler number,
/// so that x is the one along which voxels are closest in memory.
fn contiguous_along_x(mut solid: ArrayView3<'_, bool>) -> ArrayView3<'_, bool> {
    let mut axes = [0, 1, 2];
    // An axis of one voxel may have any stride.
    axes.sort_by_key(|&axis| {
        (solid.shape()[axis] > 1, Reverse(solid.strides()[axis].unsigned_abs()))
    });
    for axis in axes {
        if solid.strides()[axis] < 0 {
            solid.invert_axis(Axis(axis));
        }
    }
    solid.permuted_axes(axes)
}

/// Share of the planes `slab` and of their pairs with the planes below.
fn of_slab<const ANY: bool>(
    solid: ArrayView3<'_, bool>,
    periodic: bool,
    slab: Range<usize>,
    monitor: &Monitor<'_>,
) -> Result<i64> {
    let (nz, ny, nx) = solid.dim();
    let plane = |z: Option<usize>| z.filter(|&z| z < nz).map(|z| solid.index_axis_move(Axis(0), z));
    let mut below = Plane::new(ny, nx, periodic);
    let mut above = Plane::new(ny, nx, periodic);
    let wrapped = periodic.then_some(nz - 1);
    below.fill(plane(slab.start.checked_sub(1).or(wrapped)));
    let mut sum = 0;
    for z in slab {
        monitor.check()?;
        above.fill(plane(Some(z)));
        sum += of_planes::<ANY>(&below, &above);
        std::mem::swap(&mut below, &mut above);
    }
    Ok(sum)
}

/// A plane as bits.
struct Plane {
    /// Rows of words: the row before the first, all rows, and an empty row.
    words: Vec<u64>,
    rows: usize,
    row_length: usize,
    words_per_row: usize,
    periodic: bool,
}

impl Plane {
    fn new(rows: usize, row_length: usize, periodic: bool) -> Self {
        let words_per_row = row_length.div_ceil(WORD);
        let words = vec![0; (rows + 2) * words_per_row];
        Self { words, rows, row_length, words_per_row, periodic }
    }

    /// Takes the voxels of a plane, none for an empty one.
    fn fill(&mut self, plane: Option<ArrayView2<'_, bool>>) {
        let Some(plane) = plane else {
            self.words.fill(0);
            return;
        };
        let width = self.words_per_row;
        pack_rows(plane, &mut self.words[width..], width);
        if self.periodic {
            self.words.copy_within(self.rows * width..(self.rows + 1) * width, 0);
        }
    }

    /// A row and the one before it; the first row is 0, and in an open plane there is an empty one
    /// after the last.
    #[inline(always)]
    fn pair(&self, row: usize) -> [&[u64]; 2] {
        let width = self.words_per_row;
        let words = &self.words[row * width..(row + 2) * width];
        let (before, row) = words.split_at(width);
        [before, row]
    }
}

/// Not multiversion: products of 64 bits are slower in wide registers than in plain ones.
fn pack_rows(plane: ArrayView2<'_, bool>, words: &mut [u64], words_per_row: usize) {
    let mut copy = Vec::new();
    for (row, words) in plane.outer_iter().zip(words.chunks_exact_mut(words_per_row)) {
        if let Some(row) = row.as_slice() {
            pack_row(row, words);
        } else {
            copy.clear();
            copy.extend(row);
            pack_row(&copy, words);
        }
    }
}

/// Share of a plane and of its pairs with the plane below it.
#[multiversion::multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512vl+avx512vpopcntdq+popcnt",
    "x86_64+avx2+popcnt",
    "x86_64+popcnt"
))]
fn of_planes<const ANY: bool>(below: &Plane, above: &Plane) -> i64 {
    let join = |a: u64, b: u64| if ANY { a | b } else { a & b };
    let width = above.words_per_row;
    let last = (above.row_length - 1) % WORD;
    let mut sum = 0;
    for row in 0..above.rows + usize::from(!above.periodic) {
        let [before, at] = above.pair(row);
        let [before_below, at_below] = below.pair(row);
        let fours = |i: usize| join(join(before[i], at[i]), join(before_below[i], at_below[i]));
        let mut runs = [Runs::default(); 4];
        if above.periodic {
            // The row's last voxel comes before its first.
            let end = width - 1;
            runs[0].last = at[end] >> last;
            runs[1].last = join(before[end], at[end]) >> last;
            runs[2].last = join(at_below[end], at[end]) >> last;
            runs[3].last = fours(end) >> last;
        }
        for i in 0..width {
            runs[0].take(at[i]);
            runs[1].take(join(before[i], at[i]));
            runs[2].take(join(at_below[i], at[i]));
            runs[3].take(fours(i));
        }
        sum += runs[0].count - runs[1].count - runs[2].count + runs[3].count;
    }
    sum
}

/// Runs in a row of words.
#[derive(Clone, Copy, Default)]
struct Runs {
    count: i64,
    /// The voxel before the next word, in the lowest bit.
    last: u64,
}

impl Runs {
    #[inline(always)]
    fn take(&mut self, word: u64) {
        self.count += i64::from((word & !(word << 1 | self.last & 1)).count_ones());
        self.last = word >> (WORD - 1);
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array3;
    use proptest::prelude::*;

    use super::*;
    use crate::threads::with_threads;

    /// Counts the cells of the lattice one by one.
    fn twin(solid: &Array3<bool>, any: bool, periodic: bool) -> i64 {
        let shape = [solid.dim().0, solid.dim().1, solid.dim().2].map(|n| n as isize);
        let at = |place: [isize; 3]| {
            let inside = [0, 1, 2].map(|i| place[i].rem_euclid(shape[i]));
            (periodic || inside == place)
                && solid[[inside[0] as usize, inside[1] as usize, inside[2] as usize]]
        };
        let beyond = isize::from(!periodic);
        let mut sum = 0;
        for joined in (0..8).map(|bits| [bits & 1, bits >> 1 & 1, bits >> 2 & 1]) {
            let pairs: isize = joined.iter().sum();
            let dimension = if any { 3 - pairs } else { pairs };
            for z in 0..shape[0] + beyond {
                for y in 0..shape[1] + beyond {
                    for x in 0..shape[2] + beyond {
                        let mut voxels = (0..8)
                            .map(|bits| [bits & 1, bits >> 1 & 1, bits >> 2 & 1])
                            .filter(|step| (0..3).all(|i| step[i] <= joined[i]))
                            .map(|step| at([z - step[0], y - step[1], x - step[2]]));
                        let filled =
                            if any { voxels.any(|voxel| voxel) } else { voxels.all(|voxel| voxel) };
                        sum += i64::from(filled) * if dimension % 2 == 0 { 1 } else { -1 };
                    }
                }
            }
        }
        sum
    }

    fn volumes() -> impl Strategy<Value = Array3<bool>> {
        (1..20usize, 1..5usize, 1..70usize, 0.0..1.0f64).prop_flat_map(|(z, y, x, fraction)| {
            proptest::collection::vec(proptest::bool::weighted(fraction), z * y * x)
                .prop_map(move |voxels| Array3::from_shape_vec((z, y, x), voxels).unwrap())
        })
    }

    proptest! {
        #[test]
        fn agrees_with_counting_cells(solid in volumes(), any: bool, periodic: bool) {
            let boundary = if periodic { Boundary::Periodic } else { Boundary::Open };
            let connectivity = if any { Connectivity::Corners } else { Connectivity::Faces };
            let expected = twin(&solid, any, periodic);
            let fortran = solid.t().as_standard_layout().into_owned().reversed_axes();
            for view in [solid.view(), fortran.view(), solid.slice(s![..;-1, .., ..;-1])] {
                for threads in [1, 3] {
                    let monitor = Monitor::silent();
                    let found = with_threads(threads, || {
                        euler_number(view, connectivity, boundary, &monitor)
                    });
                    prop_assert_eq!(found.unwrap().unwrap(), expected);
                }
            }
        }
    }

    #[test]
    fn a_full_block_is_no_end_of_a_body() {
        let solid = Array3::from_elem((3, 4, 5), true);
        for connectivity in [Connectivity::Corners, Connectivity::Faces] {
            let found = corrected(solid.view(), connectivity, &Monitor::silent());
            assert_eq!(found.unwrap(), (1, 0));
        }
    }

    #[test]
    fn no_voxels() {
        for shape in [(0, 3, 4), (3, 0, 4), (3, 4, 0)] {
            let solid = Array3::from_elem(shape, true);
            let found = corrected(solid.view(), Connectivity::Corners, &Monitor::silent());
            assert_eq!(found.unwrap(), (0, 0));
        }
    }

    #[test]
    fn edge_neighbours_have_no_complement() {
        let solid = Array3::from_elem((2, 2, 2), true);
        let found =
            euler_number(solid.view(), Connectivity::Edges, Boundary::Open, &Monitor::silent());
        assert!(matches!(found, Err(Error::Parameter { parameter: "connectivity", .. })));
    }
}
