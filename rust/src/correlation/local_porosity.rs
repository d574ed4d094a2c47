//! Local porosity distribution: the porosities of all windows of one size.
//!
//! The counts of a window follow from those of the window before: planes that enter and leave, then
//! rows, then voxels. A slab of planes keeps one plane of counts.

use ndarray::{ArrayView3, s};
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::monitor::Monitor;
use crate::volume::{Boundary, Shape, voxels};

/// Porosities of all windows of one size.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LocalPorosity {
    /// Windows by porosity, in equal bins from 0 to 1; a porosity of 1 is in the last.
    pub histogram: Vec<u64>,
    /// Number of windows.
    pub windows: u64,
    /// Pore voxels, summed over the windows.
    pub sum: u128,
    /// Squares of the numbers of pore voxels, summed over the windows.
    pub sum_of_squares: u128,
}

impl LocalPorosity {
    fn new(bins: usize) -> Self {
        Self { histogram: vec![0; bins], windows: 0, sum: 0, sum_of_squares: 0 }
    }

    fn add(mut self, other: &Self) -> Self {
        self.histogram.iter_mut().zip(&other.histogram).for_each(|(own, other)| *own += other);
        self.windows += other.windows;
        self.sum += other.sum;
        self.sum_of_squares += other.sum_of_squares;
        self
    }
}

/// Porosity (share of false voxels) of every window of the shape `window`, at every position inside
/// the volume, or, with a periodic boundary, at every voxel.
///
/// Peak memory: 4 bytes a voxel of one plane for each thread.
pub fn local_porosity(
    solid: ArrayView3<'_, bool>,
    window: Shape,
    bins: usize,
    boundary: Boundary,
    monitor: &Monitor<'_>,
) -> Result<LocalPorosity> {
    let reversed = solid.strides()[0] == 1 && solid.strides()[2] != 1;
    let [a, b, c] = window;
    let (solid, window) =
        if reversed { (solid.reversed_axes(), [c, b, a]) } else { (solid, window) };
    let shape = [solid.dim().0, solid.dim().1, solid.dim().2];
    if (0..3).any(|axis| !(1..=shape[axis]).contains(&window[axis])) {
        let allowed = format!("must be from 1 to the volume's edges {:?}", solid.dim());
        return Err(Error::parameter("window", window, allowed));
    }
    if u32::try_from(voxels(window)).is_err() {
        return Err(Error::parameter("window", window, "must have less than 2^32 voxels"));
    }
    if !(1..=MOST_BINS).contains(&bins) {
        return Err(Error::parameter("bins", bins, format!("must be from 1 to {MOST_BINS}")));
    }
    let positions = [0, 1, 2].map(|axis| match boundary {
        Boundary::Open => shape[axis] - window[axis] + 1,
        Boundary::Periodic => shape[axis],
    });
    // A slab starts with the counts of its first window, which must not be most of its work.
    let thickness = positions[0].div_ceil(4 * rayon::current_num_threads()).max(window[0]);
    let starts: Vec<usize> = (0..positions[0]).step_by(thickness).collect();
    starts
        .into_par_iter()
        .map(|start| {
            let planes = start..(start + thickness).min(positions[0]);
            slab(solid, window, positions, planes, bins, monitor)
        })
        .try_reduce(|| LocalPorosity::new(bins), |a, b| Ok(a.add(&b)))
}

/// Bins are found in floating point and then corrected, which is exact up to here.
const MOST_BINS: usize = 1 << 16;

/// The windows that begin in some planes.
fn slab(
    solid: ArrayView3<'_, bool>,
    window: Shape,
    positions: Shape,
    planes: std::ops::Range<usize>,
    bins: usize,
    monitor: &Monitor<'_>,
) -> Result<LocalPorosity> {
    let (nz, ny, nx) = solid.dim();
    let mut found = LocalPorosity::new(bins);
    let tally = Tally { voxels: voxels(window) as u64, bins: bins as u64 };
    // Solid voxels of the window along z, of the windows along z and y, and of whole windows.
    let mut columns = vec![0u32; ny * nx];
    let mut rows = vec![0u32; nx + window[2]];
    let mut counts = vec![0u32; positions[2]];
    for z in planes.start..planes.start + window[0] {
        monitor.check()?;
        add_plane(&mut columns, solid, z % nz, 1);
    }
    for z in planes.clone() {
        monitor.check()?;
        if z > planes.start {
            add_plane(&mut columns, solid, z - 1, u32::MAX);
            add_plane(&mut columns, solid, (z + window[0] - 1) % nz, 1);
        }
        rows[..nx].fill(0);
        for row in columns.chunks_exact(nx).take(window[1]) {
            rows.iter_mut().zip(row).for_each(|(sum, &n)| *sum += n);
        }
        for y in 0..positions[1] {
            if y > 0 {
                let (leaves, enters) = ((y - 1) * nx, (y + window[1] - 1) % ny * nx);
                let leaves = &columns[leaves..leaves + nx];
                let enters = &columns[enters..enters + nx];
                for ((sum, &enters), &leaves) in rows.iter_mut().zip(enters).zip(leaves) {
                    *sum = sum.wrapping_add(enters).wrapping_sub(leaves);
                }
            }
            rows.copy_within(..window[2], nx);
            let mut count: u32 = rows[..window[2]].iter().sum();
            for (to, (&leaves, &enters)) in
                counts.iter_mut().zip(rows.iter().zip(&rows[window[2]..]))
            {
                *to = count;
                count = count.wrapping_add(enters).wrapping_sub(leaves);
            }
            tally.add(&counts, &mut found);
        }
    }
    Ok(found)
}

/// Adds a plane, or takes it away with a `sign` of −1.
fn add_plane(columns: &mut [u32], solid: ArrayView3<'_, bool>, z: usize, sign: u32) {
    let nx = solid.dim().2;
    for (y, columns) in columns.chunks_exact_mut(nx).enumerate() {
        let row = solid.slice(s![z, y, ..]);
        let add = |(sum, &solid): (&mut u32, &bool)| {
            *sum = sum.wrapping_add(sign.wrapping_mul(u32::from(solid)));
        };
        match row.to_slice() {
            Some(row) => columns.iter_mut().zip(row).for_each(add),
            None => columns.iter_mut().zip(row).for_each(add),
        }
    }
}

/// Enters windows by their porosity.
struct Tally {
    voxels: u64,
    bins: u64,
}

impl Tally {
    fn add(&self, counts: &[u32], found: &mut LocalPorosity) {
        let scale = self.bins as f64 / self.voxels as f64;
        let (mut sum, mut squares) = (0, 0);
        for &count in counts {
            let pores = self.voxels - u64::from(count);
            sum += pores;
            squares += u128::from(pores * pores);
            let mut bin = (pores as f64 * scale) as u64;
            // Rounding may miss an edge by one.
            bin -= u64::from(bin * self.voxels > pores * self.bins);
            bin += u64::from((bin + 1) * self.voxels <= pores * self.bins);
            found.histogram[bin.min(self.bins - 1) as usize] += 1;
        }
        found.windows += counts.len() as u64;
        found.sum += u128::from(sum);
        found.sum_of_squares += squares;
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array3;
    use proptest::prelude::*;

    use super::*;
    use crate::threads::with_threads;

    fn twin(solid: &Array3<bool>, window: Shape, bins: usize, boundary: Boundary) -> LocalPorosity {
        let shape = [solid.dim().0, solid.dim().1, solid.dim().2];
        let mut found = LocalPorosity::new(bins);
        for (at, _) in solid.indexed_iter() {
            let at = [at.0, at.1, at.2];
            if boundary == Boundary::Open && (0..3).any(|i| at[i] + window[i] > shape[i]) {
                continue;
            }
            let mut pores = 0;
            for step in 0..voxels(window) {
                let step = crate::volume::position(window, step);
                pores += u64::from(!solid[[0, 1, 2].map(|i| (at[i] + step[i]) % shape[i])]);
            }
            let bin = pores as usize * bins / voxels(window);
            found.histogram[bin.min(bins - 1)] += 1;
            found.windows += 1;
            found.sum += u128::from(pores);
            found.sum_of_squares += u128::from(pores * pores);
        }
        found
    }

    proptest! {
        #[test]
        fn agrees_with_counting(
            shape in prop::array::uniform3(1..9usize),
            cut in prop::array::uniform3(0.0..1.0f64),
            bits in proptest::collection::vec(any::<bool>(), 8 * 8 * 8),
            bins in 1..30usize,
            periodic: bool,
        ) {
            let solid = Array3::from_shape_fn(shape, |(z, y, x)| bits[(z * 8 + y) * 8 + x]);
            let window = [0, 1, 2].map(|i| 1 + (cut[i] * shape[i] as f64) as usize);
            let boundary = if periodic { Boundary::Periodic } else { Boundary::Open };
            let expected = twin(&solid, window, bins, boundary);
            let fortran = solid.t().as_standard_layout().into_owned().reversed_axes();
            for view in [solid.view(), fortran.view()] {
                let silent = Monitor::silent();
                let measure = || local_porosity(view, window, bins, boundary, &silent).unwrap();
                prop_assert_eq!(&measure(), &expected);
                prop_assert_eq!(&with_threads(3, measure).unwrap(), &expected);
            }
        }
    }

    #[test]
    fn bad_input_is_named() {
        let solid = Array3::from_elem((4, 5, 6), true);
        let measure = |window, bins| {
            local_porosity(solid.view(), window, bins, Boundary::Open, &Monitor::silent())
        };
        assert!(measure([4, 5, 6], 1).is_ok());
        assert!(measure([5, 5, 6], 1).is_err());
        assert!(measure([0, 5, 6], 1).is_err());
        assert!(measure([4, 5, 6], 0).is_err());
    }
}
