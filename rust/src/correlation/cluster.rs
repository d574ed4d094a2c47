//! Two-point cluster function C₂(r): the chance that a segment r has both ends in the same cluster.
//!
//! It is the sum of the two-point correlations of the single clusters. Clusters of few runs are
//! counted directly: a pair of runs along x has a number of pairs of voxels that is a trapezoid in
//! the lag along x, so that four entries of a second difference are all that it costs. Clusters of
//! many runs go through Fourier transforms of their own bounding boxes.

use std::sync::atomic::{AtomicU32, AtomicUsize, Ordering};

use ndarray::{Array3, ArrayView3, Zip, s};
use rayon::prelude::*;

use super::lags::{Layout, products};
use super::two_point::{Lags, TwoPoint, average};
use crate::error::{Error, Result};
use crate::monitor::Monitor;
use crate::volume::Boundary;

/// Pairs of runs that are counted in the time that the transforms take for one voxel of a padded
/// bounding box.
const PAIRS_PER_VOXEL: usize = 4;

/// Clusters of at most so many runs are counted directly without a look at their bounding boxes.
const FEW: u32 = 64;

/// C₂ of labelled clusters, `labels` from 1 to `clusters`, 0 outside the phase.
///
/// Direct counts are exact; the transforms are exact as far as single precision reaches, as those
/// of [`super::two_point::two_point`] are. Peak memory: 16 bytes a run of a directly counted
/// cluster, 8 bytes a cluster, 5 bytes a voxel of the largest bounding box, 8 bytes a lag and thread.
pub fn two_point_cluster(
    labels: ArrayView3<'_, u32>,
    clusters: usize,
    lags: &Lags,
    monitor: &Monitor<'_>,
) -> Result<TwoPoint> {
    lags.check(labels.dim())?;
    let reversed = labels.strides()[0] == 1 && labels.strides()[2] != 1;
    let (labels, lags) =
        if reversed { (labels.reversed_axes(), lags.reversed()) } else { (labels, *lags) };
    let (nz, ny, nx) = labels.dim();
    let layout =
        Layout::new([nz, ny, nx], lags.r_max, [lags.boundary == Boundary::Periodic; 3], false);

    let mut counts = count_runs(labels, clusters, monitor)?;
    let boxes = bounding_boxes(labels, &counts, &layout, monitor)?;
    let (large, _): (Vec<_>, Vec<_>) = boxes.into_iter().partition(|cluster| {
        let runs = counts[cluster.label as usize - 1] as usize;
        runs.saturating_mul(runs) > PAIRS_PER_VOXEL.saturating_mul(cluster.layout.work())
    });
    for cluster in &large {
        counts[cluster.label as usize - 1] = 0;
    }
    let mut total = direct(labels, &counts, &layout, monitor)?;
    for cluster in &large {
        let found = products(
            &|z, y, voxels| cluster.row(labels, z, y, voxels),
            None,
            &cluster.layout,
            monitor,
        )?;
        let ([rz, ry, rx], [_, ty, tx]) = (cluster.layout.reach, layout.reach);
        let own = s![..=rz, ty - ry..=ty + ry, tx - rx..=tx + rx];
        Zip::from(total.slice_mut(own)).and(&found).for_each(|total, found| *total += found);
    }
    let mut result = average(&total, &layout, &lags);
    if reversed {
        result.axes.reverse();
    }
    Ok(result)
}

/// A run of one cluster along x.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Run {
    z: u32,
    y: u32,
    start: u32,
    end: u32,
}

/// Calls `found(label, start, end)` for each run of a row.
fn runs_of(
    labels: ArrayView3<'_, u32>,
    (z, y): (usize, usize),
    mut found: impl FnMut(u32, u32, u32),
) {
    let row = labels.slice_move(s![z, y, ..]);
    let (mut label, mut start) = (0, 0);
    for (x, &next) in row.iter().enumerate() {
        if next != label {
            if label != 0 {
                found(label, start, x as u32);
            }
            (label, start) = (next, x as u32);
        }
    }
    if label != 0 {
        found(label, start, row.len() as u32);
    }
}

/// Number of runs of each cluster.
fn count_runs(
    labels: ArrayView3<'_, u32>,
    clusters: usize,
    monitor: &Monitor<'_>,
) -> Result<Vec<u32>> {
    let counts: Vec<AtomicU32> = (0..clusters).map(|_| AtomicU32::new(0)).collect();
    (0..labels.dim().0).into_par_iter().try_for_each(|z| {
        monitor.check()?;
        let mut largest = 0;
        for y in 0..labels.dim().1 {
            runs_of(labels, (z, y), |label, _, _| {
                largest = largest.max(label);
                if let Some(count) = counts.get(label as usize - 1) {
                    count.fetch_add(1, Ordering::Relaxed);
                }
            });
        }
        if largest as usize > clusters {
            let allowed = format!("must be at most the number of clusters ({clusters})");
            return Err(Error::parameter("labels", largest, allowed));
        }
        Ok(())
    })?;
    Ok(counts.into_iter().map(AtomicU32::into_inner).collect())
}

/// A cluster and the box that it lies in.
struct Boxed {
    label: u32,
    /// Where the box begins in the volume.
    origin: [usize; 3],
    layout: Layout,
}

impl Boxed {
    /// Row (z, y) of the box.
    fn row(&self, labels: ArrayView3<'_, u32>, z: usize, y: usize, voxels: &mut [f32]) {
        let (nz, ny, nx) = labels.dim();
        let row = labels.slice_move(s![(self.origin[0] + z) % nz, (self.origin[1] + y) % ny, ..]);
        let start = self.origin[2];
        let (before, after) = voxels.split_at_mut((nx - start).min(voxels.len()));
        for (voxel, &label) in before.iter_mut().zip(row.slice(s![start..])) {
            *voxel = f32::from(u8::from(label == self.label));
        }
        for (voxel, &label) in after.iter_mut().zip(row) {
            *voxel = f32::from(u8::from(label == self.label));
        }
    }
}

/// Boxes of the clusters of many runs, the smallest that hold them; with a periodic boundary they
/// may go on at the opposite face. An axis stays periodic where a cluster would meet itself.
fn bounding_boxes(
    labels: ArrayView3<'_, u32>,
    counts: &[u32],
    layout: &Layout,
    monitor: &Monitor<'_>,
) -> Result<Vec<Boxed>> {
    let mut many = vec![u32::MAX; counts.len()];
    let candidates: Vec<u32> =
        (0..counts.len() as u32).filter(|&i| counts[i as usize] > FEW).collect();
    for (number, &i) in candidates.iter().enumerate() {
        many[i as usize] = number as u32;
    }
    if candidates.is_empty() {
        return Ok(Vec::new());
    }
    let mut occupied = vec![layout.shape.map(|n| vec![false; n]); candidates.len()];
    for z in 0..layout.shape[0] {
        monitor.check()?;
        for y in 0..layout.shape[1] {
            runs_of(labels, (z, y), |label, start, end| {
                if let Some([planes, rows, columns]) =
                    occupied.get_mut(many[label as usize - 1] as usize)
                {
                    (planes[z], rows[y]) = (true, true);
                    columns[start as usize..end as usize].fill(true);
                }
            });
        }
    }
    let boxed = candidates.iter().zip(&occupied).map(|(&i, occupied)| {
        let mut origin = [0; 3];
        let mut shape = layout.shape;
        let mut periodic = layout.periodic;
        for axis in 0..3 {
            let (start, extent) = smallest_interval(&occupied[axis], periodic[axis]);
            if !periodic[axis] || extent + layout.reach[axis] <= shape[axis] {
                (origin[axis], shape[axis], periodic[axis]) = (start, extent, false);
            }
        }
        let r_max = layout.reach.into_iter().max().unwrap_or(0);
        Boxed { label: i + 1, origin, layout: Layout::new(shape, r_max, periodic, false) }
    });
    Ok(boxed.collect())
}

/// Start and length of the shortest interval that holds all that is occupied, which is something.
fn smallest_interval(occupied: &[bool], periodic: bool) -> (usize, usize) {
    let at: Vec<usize> = (0..occupied.len()).filter(|&i| occupied[i]).collect();
    let (first, last) = (at.first().copied().unwrap_or(0), at.last().copied().unwrap_or(0));
    let mut shortest = (first, last - first + 1);
    if periodic {
        for pair in at.windows(2) {
            // From the second of two neighbours on, round to the first.
            let length = occupied.len() - (pair[1] - pair[0]) + 1;
            if length < shortest.1 {
                shortest = (pair[1], length);
            }
        }
    }
    shortest
}

/// Number of pairs inside each cluster whose count of runs is not 0, for each lag of the layout.
fn direct(
    labels: ArrayView3<'_, u32>,
    counts: &[u32],
    layout: &Layout,
    monitor: &Monitor<'_>,
) -> Result<Array3<f64>> {
    let mut starts = Vec::with_capacity(counts.len() + 1);
    starts.push(0usize);
    for (i, &count) in counts.iter().enumerate() {
        starts.push(starts[i] + count as usize);
    }
    let mut runs = vec![Run { z: 0, y: 0, start: 0, end: 0 }; starts[counts.len()]];
    let mut next = starts[..counts.len()].to_vec();
    for z in 0..layout.shape[0] {
        monitor.check()?;
        for y in 0..layout.shape[1] {
            runs_of(labels, (z, y), |label, start, end| {
                let i = label as usize - 1;
                if counts[i] > 0 {
                    runs[next[i]] = Run { z: z as u32, y: y as u32, start, end };
                    next[i] += 1;
                }
            });
        }
    }
    drop(next);

    let cluster = AtomicUsize::new(0);
    // Sums of integers do not depend on who adds what.
    let maps = (0..rayon::current_num_threads()).into_par_iter().map(|_| {
        let mut map = Differences::new(layout);
        loop {
            let i = cluster.fetch_add(1, Ordering::Relaxed);
            if i >= counts.len() {
                return Ok(map);
            }
            map.add(&runs[starts[i]..starts[i + 1]], monitor)?;
        }
    });
    let map = maps.try_reduce_with(|mut a: Differences<'_>, b| {
        a.rows.iter_mut().zip(&b.rows).for_each(|(a, b)| *a += b);
        Ok(a)
    });
    Ok(map.transpose()?.unwrap_or_else(|| Differences::new(layout)).sum())
}

/// Numbers of pairs as second differences along the lag x.
struct Differences<'a> {
    layout: &'a Layout,
    /// For each lag (z, y): the value before the first lag x, then the second differences.
    rows: Vec<i64>,
    stride: usize,
}

impl<'a> Differences<'a> {
    fn new(layout: &'a Layout) -> Self {
        let [lags_z, lags_y, lags_x] = layout.lags();
        Self { layout, rows: vec![0; lags_z * lags_y * (lags_x + 1)], stride: lags_x + 1 }
    }

    /// Adds all pairs of voxels of one cluster, whose runs are in order.
    fn add(&mut self, runs: &[Run], monitor: &Monitor<'_>) -> Result<()> {
        let (reach, period) = (self.layout.reach[0], self.layout.shape[0]);
        let periodic = self.layout.periodic[0];
        if !periodic {
            return self.add_open(runs, monitor);
        }
        for (i, &a) in runs.iter().enumerate() {
            monitor.check()?;
            self.add_pair(0, a, a);
            for &b in &runs[i + 1..] {
                let lag = (b.z - a.z) as usize;
                if lag <= reach {
                    self.add_pair(lag, a, b);
                }
                if lag == 0 {
                    self.add_pair(0, b, a);
                } else if period - lag <= reach {
                    self.add_pair(period - lag, b, a);
                }
            }
        }
        Ok(())
    }

    /// Adds all pairs of voxels of one cluster that does not go on at the opposite face.
    fn add_open(&mut self, runs: &[Run], monitor: &Monitor<'_>) -> Result<()> {
        let [rz, ry, rx] = self.layout.reach.map(|reach| reach as i32);
        let [stride_z, stride_y] = [self.layout.lags()[1] * self.stride, self.stride];
        for (i, &a) in runs.iter().enumerate() {
            monitor.check()?;
            self.add_pair(0, a, a);
            for &b in &runs[i + 1..] {
                let lag_z = (b.z - a.z) as i32;
                let lag_y = b.y as i32 - a.y as i32;
                if lag_z > rz {
                    break;
                }
                if lag_y.abs() > ry {
                    continue;
                }
                let row = lag_z as usize * stride_z + (lag_y + ry) as usize * stride_y;
                let first = b.start as i32 - a.end as i32 + 1 + rx;
                let lengths = [a.end - a.start, b.end - b.start].map(i64::from);
                let row = &mut self.rows[row..row + stride_y];
                add_trapezoid(row, i64::from(first), lengths);
                if lag_z == 0 {
                    self.add_pair(0, b, a);
                }
            }
        }
        Ok(())
    }

    /// Adds the pairs from one run to another, `lag_z` apart along z.
    fn add_pair(&mut self, lag_z: usize, from: Run, to: Run) {
        let ([_, ry, rx], [_, ny, nx]) = (self.layout.reach, self.layout.shape);
        let [_, lags_y, _] = self.layout.lags();
        let [periodic_y, periodic_x] = [self.layout.periodic[1], self.layout.periodic[2]];
        let lag_y = i64::from(to.y) - i64::from(from.y);
        let first = i64::from(to.start) - i64::from(from.end) + 1 + rx as i64;
        let lengths = [from.end - from.start, to.end - to.start];
        for turn in if periodic_y { -1..=1 } else { 0..=0 } {
            let lag_y = lag_y + turn * ny as i64 + ry as i64;
            if !(0..lags_y as i64).contains(&lag_y) {
                continue;
            }
            let row = (lag_z * lags_y + lag_y as usize) * self.stride;
            let row = &mut self.rows[row..row + self.stride];
            for turn in if periodic_x { -1..=1 } else { 0..=0 } {
                add_trapezoid(row, first + turn * nx as i64, lengths.map(i64::from));
            }
        }
    }

    /// Sums the differences up.
    fn sum(&self) -> Array3<f64> {
        let [lags_z, lags_y, _] = self.layout.lags();
        Array3::from_shape_vec(
            (lags_z, lags_y, self.stride - 1),
            self.rows
                .chunks_exact(self.stride)
                .flat_map(|row| {
                    let (mut value, mut step) = (row[0], 0);
                    row[1..].iter().map(move |second| {
                        step += second;
                        value += step;
                        value as f64
                    })
                })
                .collect(),
        )
        .unwrap_or_else(|_| Array3::zeros(self.layout.lags()))
    }
}

/// Adds the numbers of pairs between two runs of `a` and `b` voxels: 1 at index `first`, rising,
/// level, and falling to 0 at `first + a + b − 1`. Indices outside the row are cut.
fn add_trapezoid(row: &mut [i64], first: i64, [a, b]: [i64; 2]) {
    let lags = row.len() as i64 - 1;
    if first >= 0 && first + a + b < lags {
        let inside = &mut row[first as usize + 1..=(first + a + b) as usize + 1];
        let [a, b] = [a as usize, b as usize];
        inside[0] += 1;
        inside[a] -= 1;
        inside[b] -= 1;
        inside[a + b] += 1;
        return;
    }
    if first >= lags || first + a + b <= 1 {
        return;
    }
    for (at, change) in [(first, 1), (first + a, -1), (first + b, -1), (first + a + b, 1)] {
        if at < 0 {
            row[1] += change;
            row[0] -= change * at;
        } else if at < lags {
            row[at as usize + 1] += change;
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::correlation::two_point::two_point;
    use crate::threads::with_threads;

    /// The sum of the two-point correlations of the single clusters.
    fn twin(labels: &Array3<u32>, clusters: u32, lags: &Lags) -> TwoPoint {
        let mut sum: Option<TwoPoint> = None;
        for cluster in 0..=clusters {
            // Cluster 0 is empty.
            let solid = labels.mapv(|label| label == cluster && label > 0);
            let found = two_point(solid.view(), None, lags, &Monitor::silent()).unwrap();
            sum = Some(match sum {
                None => found,
                Some(mut sum) => {
                    let add = |a: &mut Vec<f64>, b: &Vec<f64>| {
                        a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
                    };
                    add(&mut sum.radial, &found.radial);
                    for axis in 0..3 {
                        add(&mut sum.axes[axis], &found.axes[axis]);
                    }
                    sum
                }
            });
        }
        sum.unwrap()
    }

    fn same(a: &TwoPoint, b: &TwoPoint) -> bool {
        let curves =
            |t: &TwoPoint| [&t.radial, &t.axes[0], &t.axes[1], &t.axes[2]].map(Clone::clone);
        let near = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-12 || (a.is_nan() && b.is_nan());
        curves(a).iter().zip(&curves(b)).all(|(a, b)| a.iter().zip(b).all(near))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(60))]
        #[test]
        fn agrees_with_the_sum_over_clusters(
            (z, y, x) in (1..9usize, 1..9usize, 1..9usize),
            values in proptest::collection::vec(0..4u32, 8 * 8 * 8),
            r_max in 0..7usize,
            periodic: bool,
        ) {
            // Labels need not hang together, so that any pattern is a test.
            let labels = Array3::from_shape_fn((z, y, x), |(z, y, x)| values[(z * 8 + y) * 8 + x]);
            let lags = if periodic {
                Lags::cubic(r_max.min(z.min(y).min(x) / 2), Boundary::Periodic)
            } else {
                Lags::cubic(r_max, Boundary::Open)
            };
            let expected = twin(&labels, 3, &lags);
            let fortran = labels.t().as_standard_layout().into_owned().reversed_axes();
            for view in [labels.view(), fortran.view()] {
                let measure = || two_point_cluster(view, 3, &lags, &Monitor::silent()).unwrap();
                prop_assert!(same(&measure(), &expected), "{:?} {expected:?}", measure());
                prop_assert!(same(&with_threads(3, measure).unwrap(), &expected));
            }
        }
    }

    /// Clusters that are dense enough for transforms, one of them across the border.
    fn balls() -> Array3<u32> {
        let centres = [[0.0f32, 3.0, 20.0], [22.0, 20.0, 20.0], [30.0, 30.0, 2.0]];
        Array3::from_shape_fn((40, 41, 42), |(z, y, x)| {
            let at = [z, y, x].map(|i| i as f32);
            let inside = |centre: &[f32; 3]| {
                let square = |i: usize| {
                    let far = (at[i] - centre[i]).abs();
                    far.min([40.0, 41.0, 42.0][i] - far).powi(2)
                };
                // A checkerboard has the most runs.
                square(0) + square(1) + square(2) < 81.0 && (z + y + x) % 2 == 0
            };
            centres.iter().position(inside).map_or(0, |i| i as u32 + 1)
        })
    }

    #[test]
    fn transforms_and_direct_counts_agree() {
        let labels = balls();
        let silent = Monitor::silent();
        for boundary in [Boundary::Open, Boundary::Periodic] {
            let lags = Lags::cubic(7, boundary);
            let layout = Layout::new([40, 41, 42], 7, [boundary == Boundary::Periodic; 3], false);
            let counts = count_runs(labels.view(), 3, &silent).unwrap();
            let boxes = bounding_boxes(labels.view(), &counts, &layout, &silent).unwrap();
            assert!(boxes.iter().any(|cluster| {
                let runs = counts[cluster.label as usize - 1] as usize;
                runs * runs > PAIRS_PER_VOXEL * cluster.layout.work()
            }));
            let found = two_point_cluster(labels.view(), 3, &lags, &silent).unwrap();
            assert!(same(&found, &twin(&labels, 3, &lags)));
            let direct = direct(labels.view(), &counts, &layout, &silent).unwrap();
            assert!(same(&average(&direct, &layout, &lags), &found));
        }
    }

    #[test]
    fn a_cluster_that_crosses_the_border_has_a_small_box() {
        let occupied = [true, true, false, false, false, true, false, true];
        assert_eq!(smallest_interval(&occupied, false), (0, 8));
        assert_eq!(smallest_interval(&occupied, true), (5, 5));
        assert_eq!(smallest_interval(&[false, true], true), (1, 1));
    }

    #[test]
    fn bad_labels_are_named() {
        let labels = Array3::from_elem((3, 3, 3), 2u32);
        let lags = Lags::cubic(1, Boundary::Open);
        let measure = |n| two_point_cluster(labels.view(), n, &lags, &Monitor::silent());
        assert!(matches!(measure(1), Err(Error::Parameter { parameter: "labels", .. })));
        assert!(measure(2).is_ok());
    }
}
