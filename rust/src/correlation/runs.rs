//! Lengths of the runs of a phase along the axes: what lineal paths and chords are made of.
//!
//! Rows are packed to bits, so that whole words of voxels that do not change cost one comparison.

use ndarray::{ArrayView3, s};
use rayon::prelude::*;

use crate::bits::pack_row;
use crate::error::{Error, Result};
use crate::monitor::Monitor;
use crate::volume::Boundary;

/// How many runs have which length, in voxels, along one axis; `n + 1` entries each.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunLengths {
    /// Runs that end inside the volume on both sides.
    pub inner: Vec<u64>,
    /// Runs that the border cuts; with a periodic boundary, lines without an end.
    pub cut: Vec<u64>,
}

impl RunLengths {
    fn new(n: usize) -> Self {
        Self { inner: vec![0; n + 1], cut: vec![0; n + 1] }
    }

    fn add(mut self, other: &Self) -> Self {
        for (own, other) in [(&mut self.inner, &other.inner), (&mut self.cut, &other.cut)] {
            own.iter_mut().zip(other).for_each(|(own, other)| *own += other);
        }
        self
    }

    /// Enters what is left at the end of a line of `n` voxels: the run that began it, of `head`
    /// voxels, and the run that is still open since `open`.
    fn end(&mut self, n: usize, head: u32, open: Option<u32>, boundary: Boundary) {
        let tail = open.map_or(0, |start| n - start as usize);
        let head = head as usize;
        if tail == n {
            self.cut[n] += 1;
        } else if boundary == Boundary::Periodic {
            self.inner[head + tail] += u64::from(head + tail > 0);
        } else {
            self.cut[head] += u64::from(head > 0);
            self.cut[tail] += u64::from(tail > 0);
        }
    }
}

/// Lengths of the runs of true voxels along z, y and x.
///
/// With a periodic boundary a run goes on at the opposite face. Peak memory: 1/8 byte a voxel.
pub fn run_lengths(
    solid: ArrayView3<'_, bool>,
    boundary: Boundary,
    monitor: &Monitor<'_>,
) -> Result<[RunLengths; 3]> {
    let reversed = solid.strides()[0] == 1 && solid.strides()[2] != 1;
    let solid = if reversed { solid.reversed_axes() } else { solid };
    let (nz, ny, nx) = solid.dim();
    if [nz, ny, nx].into_iter().any(|n| u32::try_from(n).is_err()) {
        return Err(Error::parameter("shape", (nz, ny, nx), "must be below 2^32 along each axis"));
    }
    if solid.is_empty() {
        let shape = if reversed { [nx, ny, nz] } else { [nz, ny, nx] };
        return Ok(shape.map(RunLengths::new));
    }
    let words = nx.div_ceil(64);
    let packed = pack(solid, monitor)?;
    let row = |z: usize, y: usize| &packed[(z * ny + y) * words..][..words];

    let along_z = (0..ny)
        .into_par_iter()
        .map(|y| {
            monitor.check()?;
            Ok(across_rows((0..nz).map(|z| row(z, y)), [nz, nx], boundary))
        })
        .try_reduce(|| RunLengths::new(nz), |a, b| Ok(a.add(&b)))?;
    let along_y = (0..nz)
        .into_par_iter()
        .map(|z| {
            monitor.check()?;
            Ok(across_rows((0..ny).map(|y| row(z, y)), [ny, nx], boundary))
        })
        .try_reduce(|| RunLengths::new(ny), |a, b| Ok(a.add(&b)))?;
    let along_x = (0..nz)
        .into_par_iter()
        .map(|z| {
            monitor.check()?;
            let mut runs = RunLengths::new(nx);
            (0..ny).for_each(|y| along_row(row(z, y), nx, boundary, &mut runs));
            Ok(runs)
        })
        .try_reduce(|| RunLengths::new(nx), |a, b| Ok(a.add(&b)))?;
    Ok(if reversed { [along_x, along_y, along_z] } else { [along_z, along_y, along_x] })
}

/// The rows, one bit a voxel, in whole words.
fn pack(solid: ArrayView3<'_, bool>, monitor: &Monitor<'_>) -> Result<Vec<u64>> {
    let (nz, ny, nx) = solid.dim();
    let words = nx.div_ceil(64);
    let mut packed = vec![0u64; nz * ny * words];
    packed.par_chunks_mut((ny * words).max(1)).enumerate().try_for_each_init(
        Vec::new,
        |copy, (z, plane)| {
            monitor.check()?;
            for (y, packed) in plane.chunks_exact_mut(words).enumerate() {
                let row = solid.slice(s![z, y, ..]);
                let row = if let Some(row) = row.to_slice() {
                    row
                } else {
                    copy.clear();
                    copy.extend(row);
                    copy.as_slice()
                };
                pack_row(row, packed);
            }
            Ok(())
        },
    )?;
    Ok(packed)
}

/// Runs along an axis that `rows` of `nx` voxels follow each other on, `n` of them.
fn across_rows<'a>(
    rows: impl Iterator<Item = &'a [u64]>,
    [n, nx]: [usize; 2],
    boundary: Boundary,
) -> RunLengths {
    let mut runs = RunLengths::new(n);
    let (mut starts, mut heads) = (vec![0u32; nx], vec![0u32; nx]);
    let mut last = vec![0u64; nx.div_ceil(64)];
    for (at, row) in (0u32..).zip(rows) {
        for (word, (&bits, before)) in row.iter().zip(&mut last).enumerate() {
            let mut changes = bits ^ *before;
            *before = bits;
            while changes != 0 {
                let bit = changes.trailing_zeros();
                changes &= changes - 1;
                let x = 64 * word + bit as usize;
                if bits >> bit & 1 == 1 {
                    starts[x] = at;
                } else if starts[x] == 0 {
                    heads[x] = at;
                } else {
                    runs.inner[(at - starts[x]) as usize] += 1;
                }
            }
        }
    }
    for (x, (&start, &head)) in starts.iter().zip(&heads).enumerate() {
        let open = (last[x / 64] >> (x % 64) & 1 == 1).then_some(start);
        runs.end(n, head, open, boundary);
    }
    runs
}

/// Runs along a row of `nx` voxels.
fn along_row(row: &[u64], nx: usize, boundary: Boundary, runs: &mut RunLengths) {
    let (mut open, mut head) = (None, 0);
    for (word, &bits) in row.iter().enumerate() {
        let mut changes = bits ^ (bits << 1 | u64::from(open.is_some()));
        while changes != 0 {
            let at = (64 * word) as u32 + changes.trailing_zeros();
            changes &= changes - 1;
            open = match open {
                None => Some(at),
                // The bits behind the last voxel are no voxels.
                Some(start) if at as usize == nx => Some(start),
                Some(0) => {
                    head = at;
                    None
                }
                Some(start) => {
                    runs.inner[(at - start) as usize] += 1;
                    None
                }
            };
        }
    }
    runs.end(nx, head, open, boundary);
}

#[cfg(test)]
mod tests {
    use ndarray::{Array3, Axis};
    use proptest::prelude::*;

    use super::*;
    use crate::threads::with_threads;

    /// Voxel by voxel.
    fn twin(solid: &Array3<bool>, axis: usize, boundary: Boundary) -> RunLengths {
        let n = solid.len_of(Axis(axis));
        let mut found = RunLengths::new(n);
        for line in solid.lanes(Axis(axis)) {
            let mut line = line.to_vec();
            if boundary == Boundary::Periodic
                && let Some(void) = line.iter().position(|s| !s)
            {
                line.rotate_left(void);
            }
            let mut at = 0;
            while at < n {
                let length = line[at..].iter().take_while(|s| **s).count();
                if length > 0 {
                    let ends = usize::from(at == 0) + usize::from(at + length == n);
                    let cut = ends > 0 && (boundary == Boundary::Open || length == n);
                    let counts = if cut { &mut found.cut } else { &mut found.inner };
                    counts[length] += 1;
                }
                at += length + 1;
            }
        }
        found
    }

    proptest! {
        #[test]
        fn agrees_with_counting(
            (z, y, x) in (0..6usize, 0..6usize, 0..140usize),
            fraction in 0.0..1.0f64,
            seed: u64,
            periodic: bool,
        ) {
            let key = crate::rng::Key::new(seed);
            let solid = Array3::from_shape_fn((z, y, x), |(i, j, k)| {
                f64::from(key.unit(((i * 6 + j) * 140 + k) as u64)) < fraction
            });
            let boundary = if periodic { Boundary::Periodic } else { Boundary::Open };
            let expected = [0, 1, 2].map(|axis| twin(&solid, axis, boundary));
            let fortran = solid.t().as_standard_layout().into_owned().reversed_axes();
            for view in [solid.view(), fortran.view()] {
                let measure = || run_lengths(view, boundary, &Monitor::silent()).unwrap();
                prop_assert_eq!(&measure(), &expected);
                prop_assert_eq!(&with_threads(3, measure).unwrap(), &expected);
            }
        }
    }

    #[test]
    fn views_that_are_not_contiguous() {
        let solid = Array3::from_shape_fn((9, 10, 300), |(z, y, x)| (z * y + x * x) % 3 == 0);
        let strided = solid.slice(s![..;2, ..;-1, 1..;2]);
        let found = run_lengths(strided, Boundary::Open, &Monitor::silent()).unwrap();
        let owned = strided.to_owned();
        assert_eq!(found, [0, 1, 2].map(|axis| twin(&owned, axis, Boundary::Open)));
    }
}
