//! Changes of phase along the directions of the lattice.
//!
//! Two voxels a step apart differ if a surface lies between them. For a flat surface the count of
//! such pairs is right on average whatever its tilt, which no path from voxel to voxel can say of
//! itself: a path crosses every stair of the surface.

use ndarray::{ArrayView3, Axis};
use rayon::prelude::*;

use super::packed::{Layout, Step, Window};
use crate::error::{Error, Result};
use crate::monitor::Monitor;
use crate::volume::Boundary;

/// How often the phase changes along a direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Changes {
    /// Changes of phase between the voxels of all pairs.
    pub changes: u64,
    /// Pairs of voxels one step apart.
    pub pairs: u64,
}

/// Counts the changes of phase in all pairs of voxels a step apart, for each step.
///
/// A pair is looked at from end to end. Beyond the diagonal of a voxel (√3) the middle counts too:
/// if both ends are of one phase and two voxels nearest to the middle, opposite each other, are of
/// the other, the phase changes twice. A flat surface cannot do that, a feature two voxels thin
/// does.
///
/// Memory: the planes that a step reaches, one bit a voxel, for each thread.
///
/// # Errors
/// If the volume is empty.
pub fn phase_changes(
    solid: ArrayView3<'_, bool>,
    steps: &[Step],
    boundary: Boundary,
    monitor: &Monitor<'_>,
) -> Result<Vec<Changes>> {
    if solid.is_empty() {
        return Err(Error::parameter("shape", solid.dim(), "must not be empty"));
    }
    let reversed = solid.strides()[0] == 1 && solid.strides()[2] != 1;
    let solid = if reversed { solid.reversed_axes() } else { solid };
    let segments: Vec<Segment> = steps.iter().map(|&step| Segment::new(step, reversed)).collect();
    let (nz, ny, nx) = solid.dim();
    let reach = steps.iter().flatten().map(|c| c.unsigned_abs()).max().unwrap_or(0);
    let layout = Layout::new([nz, ny, nx], reach, boundary);

    // More slabs than threads even out the load; each packs `reach` planes of the next again.
    let thickness = nz.div_ceil(4 * rayon::current_num_threads());
    let slabs: Vec<usize> = (0..nz).step_by(thickness).collect();
    let counts = slabs
        .into_par_iter()
        .map(|first| {
            let mut window = Window::new(solid, &layout);
            let mut jumped = Vec::new();
            let mut counts = vec![0; segments.len()];
            (first..first + reach).for_each(|z| window.load(z));
            for z in first..solid.len_of(Axis(0)).min(first + thickness) {
                monitor.check()?;
                window.load(z + reach);
                for (count, segment) in counts.iter_mut().zip(&segments) {
                    *count += segment.count(&window, &layout, z, &mut jumped);
                }
            }
            Ok(counts)
        })
        .try_reduce(
            || vec![0; segments.len()],
            |mut total, counts| {
                total.iter_mut().zip(counts).for_each(|(total, count)| *total += count);
                Ok(total)
            },
        )?;
    let counts = counts.into_iter().zip(&segments);
    Ok(counts.map(|(changes, s)| Changes { changes, pairs: layout.pairs(s.step) }).collect())
}

/// A step and what lies half-way.
struct Segment {
    /// Goes up along z, or stays.
    step: Step,
    /// Pairs of voxels nearest to the middle, opposite each other.
    middles: Vec<[Step; 2]>,
}

impl Segment {
    /// The step between the same voxels when the axes may be reversed.
    fn new(step: Step, reversed: bool) -> Self {
        let [z, y, x] = step;
        let [z, y, x] = if reversed { [x, y, z] } else { [z, y, x] };
        let step = if z < 0 { [-z, -y, -x] } else { [z, y, x] };
        Self { step, middles: middles(step) }
    }

    /// Changes between plane `z` and the plane that the step reaches.
    fn count(&self, window: &Window<'_>, layout: &Layout, z: usize, jumped: &mut Vec<u64>) -> u64 {
        let [dz, dy, dx] = self.step;
        let rows = layout.starts(1, dy);
        if !layout.starts(0, dz).contains(&z) || rows.is_empty() {
            return 0;
        }
        let left = (-dx).max(0);
        let at = |[z_step, y_step, x_step]: Step| {
            let y = rows.start as isize + y_step;
            window.rows(z + z_step as usize, y, left + x_step, rows.len())
        };
        let (start, end) = (at([0; 3]), at(self.step));
        let mask = layout.mask(dx.unsigned_abs(), rows.len());
        if self.middles.is_empty() {
            return differing(start, end, mask);
        }
        jumped.clear();
        jumped.resize(start.len(), 0);
        for &[p, q] in &self.middles {
            add_jumped(start, at(p), at(q), jumped);
        }
        differing_or_jumped(start, end, jumped, mask)
    }
}

/// Pairs of voxels nearest to the middle of a step, opposite each other; none for short steps.
fn middles(step: Step) -> Vec<[Step; 2]> {
    if step.iter().map(|c| c * c).sum::<isize>() <= 3 {
        return Vec::new();
    }
    let mut found = Vec::new();
    for corner in 0..8isize {
        // Odd components have two nearest, even ones only one.
        let up = [corner >> 2 & 1, corner >> 1 & 1, corner & 1];
        let p = [0, 1, 2].map(|a| step[a].div_euclid(2) + up[a] * step[a].rem_euclid(2));
        let q = [0, 1, 2].map(|a| step[a] - p[a]);
        if p <= q && !found.contains(&[p, q]) {
            found.push([p, q]);
        }
    }
    found
}

#[multiversion::multiversion(targets(
    "x86_64+avx512f+avx512vl+avx512vpopcntdq",
    "x86_64+avx2+popcnt",
    "x86_64+popcnt"
))]
fn differing(a: &[u64], b: &[u64], mask: &[u64]) -> u64 {
    let words = a.iter().zip(b).zip(mask);
    words.map(|((a, b), mask)| u64::from(((a ^ b) & mask).count_ones())).sum()
}

/// Marks where both `p` and `q` differ from `start`.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
fn add_jumped(start: &[u64], p: &[u64], q: &[u64], jumped: &mut [u64]) {
    for (((jumped, start), p), q) in jumped.iter_mut().zip(start).zip(p).zip(q) {
        *jumped |= (start ^ p) & (start ^ q);
    }
}

/// One change where `a` and `b` differ, else two where both were left and entered again.
#[multiversion::multiversion(targets(
    "x86_64+avx512f+avx512vl+avx512vpopcntdq",
    "x86_64+avx2+popcnt",
    "x86_64+popcnt"
))]
fn differing_or_jumped(a: &[u64], b: &[u64], jumped: &[u64], mask: &[u64]) -> u64 {
    let words = a.iter().zip(b).zip(jumped).zip(mask);
    words
        .map(|(((a, b), jumped), mask)| {
            let (once, twice) = ((a ^ b) & mask, jumped & !(a ^ b) & mask);
            u64::from(once.count_ones()) + 2 * u64::from(twice.count_ones())
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use ndarray::{Array3, s};
    use proptest::prelude::*;

    use super::*;
    use crate::geometry::directions::lattice_directions;
    use crate::threads::with_threads;

    /// Pair by pair.
    fn twin(solid: &Array3<bool>, step: Step, periodic: bool) -> Changes {
        let shape = [solid.dim().0, solid.dim().1, solid.dim().2].map(|n| n as isize);
        let at = |from: [isize; 3], by: Step| {
            let mut to = [0, 1, 2].map(|a| from[a] + by[a]);
            if periodic {
                to = [0, 1, 2].map(|a| to[a].rem_euclid(shape[a]));
            }
            solid.get(to.map(|i| i as usize)).copied()
        };
        let mut found = Changes { changes: 0, pairs: 0 };
        for (from, &start) in solid.indexed_iter() {
            let from = [from.0, from.1, from.2].map(|i| i as isize);
            let Some(end) = at(from, step) else { continue };
            found.pairs += 1;
            let differs = |by| at(from, by).unwrap() != start;
            if start != end {
                found.changes += 1;
            } else if middles(step).iter().any(|pair| pair.iter().all(|&by| differs(by))) {
                found.changes += 2;
            }
        }
        found
    }

    fn counted(solid: ArrayView3<'_, bool>, steps: &[Step], boundary: Boundary) -> Vec<Changes> {
        phase_changes(solid, steps, boundary, &Monitor::silent()).unwrap()
    }

    fn volumes() -> impl Strategy<Value = Array3<bool>> {
        (1..6usize, 1..6usize, 1..80usize, 0.0..1.0f64).prop_flat_map(|(z, y, x, fraction)| {
            proptest::collection::vec(proptest::bool::weighted(fraction), z * y * x)
                .prop_map(move |voxels| Array3::from_shape_vec((z, y, x), voxels).unwrap())
        })
    }

    proptest! {
        #[test]
        fn agrees_with_counting_pair_by_pair(
            solid in volumes(),
            reach in 1..4usize,
            periodic: bool,
        ) {
            let boundary = if periodic { Boundary::Periodic } else { Boundary::Open };
            let steps = lattice_directions(reach);
            let expected: Vec<_> = steps.iter().map(|&s| twin(&solid, s, periodic)).collect();
            prop_assert_eq!(&counted(solid.view(), &steps, boundary), &expected);
            let fortran = solid.t().as_standard_layout().into_owned().reversed_axes();
            prop_assert_eq!(&counted(fortran.view(), &steps, boundary), &expected);
            let again = with_threads(3, || counted(solid.view(), &steps, boundary)).unwrap();
            prop_assert_eq!(&again, &expected);
        }
    }

    #[test]
    fn voxels_near_the_middle() {
        assert!(middles([1, -1, 1]).is_empty());
        assert_eq!(middles([0, 1, 2]), [[[0, 0, 1], [0, 1, 1]]]);
        assert_eq!(middles([2, 2, -1]), [[[1, 1, -1], [1, 1, 0]]]);
        assert_eq!(middles([2, -1, 1]).len(), 2);
        assert_eq!(middles([1, 3, 3]).len(), 4);
    }

    #[test]
    fn views_that_are_not_contiguous() {
        let solid = Array3::from_shape_fn((9, 10, 70), |(z, y, x)| (z * y + x * x) % 3 == 0);
        let strided = solid.slice(s![..;2, ..;-1, 1..;3]);
        let steps = lattice_directions(2);
        let expected: Vec<_> = steps.iter().map(|&s| twin(&strided.to_owned(), s, false)).collect();
        assert_eq!(counted(strided, &steps, Boundary::Open), expected);
    }

    #[test]
    fn an_empty_volume_is_named() {
        let solid = Array3::from_elem((2, 0, 2), true);
        let found = phase_changes(solid.view(), &[], Boundary::Open, &Monitor::silent());
        assert!(matches!(found, Err(Error::Parameter { parameter: "shape", .. })));
    }
}
