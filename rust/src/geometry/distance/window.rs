//! `min over k of f(i + k) + (k·w)²` for many lanes at once, as far out as a result can reach.

use multiversion::multiversion;

/// Values worked on together: two registers of AVX-512, four of AVX2 for the narrow type.
pub(super) const LANES: usize = 64;

/// Farthest step of a window. Beyond, the envelope is no dearer.
pub(super) const FARTHEST: usize = 255;

/// Steps that are taken at once, so that the minimum stays in registers.
const STRIDE: usize = 4;

/// Zero voxels to keep beyond each end of a line that windows of `steps` read.
pub(super) const fn padding(steps: usize) -> usize {
    steps + STRIDE + 1
}

/// A squared distance: u16 where all are whole numbers, else f32.
pub(super) trait Lane: Copy + PartialOrd + Send + Sync + 'static {
    /// No voxel outside, or too far to tell.
    const FAR: Self;
    /// Rounds to the type; too large becomes [`Self::FAR`].
    fn from_square(square: f32) -> Self;
    /// The value; [`Self::FAR`] is infinite.
    fn square(self) -> f32;
    /// A sum that stops at [`Self::FAR`].
    fn plus(self, other: Self) -> Self;
    /// [`minima`] for this type, with the widest instructions of the processor.
    fn minima(line: &Line<'_, Self>, steps: &Steps<Self>, out: &mut [Self]) -> bool;
}

impl Lane for u16 {
    const FAR: Self = Self::MAX;

    #[inline(always)]
    fn from_square(square: f32) -> Self {
        // By way of i32, for which there is an instruction.
        (if square < 65_535.0 { square } else { 65_535.0 }) as i32 as Self
    }

    #[inline(always)]
    fn square(self) -> f32 {
        if self == Self::FAR { f32::INFINITY } else { f32::from(self) }
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        self.saturating_add(other)
    }

    fn minima(line: &Line<'_, Self>, steps: &Steps<Self>, out: &mut [Self]) -> bool {
        minima_u16(line, steps, out)
    }
}

impl Lane for f32 {
    const FAR: Self = Self::INFINITY;

    #[inline(always)]
    fn from_square(square: f32) -> Self {
        square
    }

    #[inline(always)]
    fn square(self) -> f32 {
        self
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        self + other
    }

    fn minima(line: &Line<'_, Self>, steps: &Steps<Self>, out: &mut [Self]) -> bool {
        minima_f32(line, steps, out)
    }
}

/// Lines of squared distances, padded at both ends.
pub(super) struct Line<'a, T> {
    /// The values; those beyond an open end are [`Lane::FAR`].
    pub values: &'a [T],
    /// Where the first of them is that a result belongs to.
    pub start: usize,
    /// How far apart neighbours on a line are: 1, or [`LANES`] if there are so many lines abreast.
    pub step: usize,
}

/// The squares that steps away from a voxel, or from half-way to the next, cost.
pub(super) struct Steps<T> {
    squares: Vec<T>,
    /// Farthest step of a window.
    farthest: usize,
    /// Whether no step beyond it can matter.
    complete: bool,
    /// No result is larger.
    limit: T,
    /// 1 if distances are taken from half-way to the next voxel.
    half: usize,
}

impl<T: Lane> Steps<T> {
    /// Steps of `size` along lines where no distance is of more than `reach` voxels.
    pub(super) fn new(size: f64, half: bool, reach: usize, limit: f32) -> Self {
        let offset = if half { 0.5 } else { 0.0 };
        let square = |k: usize| T::from_square(((k as f64 + offset) * size).powi(2) as f32);
        let limit = T::from_square(limit);
        let needed = (0..=FARTHEST).find(|&k| square(k) >= limit).unwrap_or(FARTHEST);
        let farthest = needed.min(reach);
        Self {
            squares: (0..=farthest + STRIDE + 1).map(square).collect(),
            farthest,
            complete: farthest == reach,
            limit,
            half: usize::from(half),
        }
    }

    /// Farthest step of a window.
    pub(super) const fn farthest(&self) -> usize {
        self.farthest
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn minima_u16(line: &Line<'_, u16>, steps: &Steps<u16>, out: &mut [u16]) -> bool {
    minima(line, steps, out)
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn minima_f32(line: &Line<'_, f32>, steps: &Steps<f32>, out: &mut [f32]) -> bool {
    minima(line, steps, out)
}

/// Writes the minima, [`LANES`] at a time; false if some lie beyond the window.
#[inline(always)]
fn minima<T: Lane>(line: &Line<'_, T>, steps: &Steps<T>, out: &mut [T]) -> bool {
    out.as_chunks_mut().0.iter_mut().enumerate().all(|(block, least)| {
        let at = line.start + block * LANES;
        let ahead = steps.half * line.step;
        *least = [steps.limit; LANES];
        let mut most = lower(least, line, steps, [(at, at + ahead)], 0);
        let mut k = 1;
        while most > steps.squares[k] && k <= steps.farthest {
            let pair = |k: usize| (at - k * line.step, at + ahead + k * line.step);
            if k == 1 {
                most = lower(least, line, steps, [pair(k)], k);
                k += 1;
            } else {
                most = lower(least, line, steps, [0, 1, 2, 3].map(|j| pair(k + j)), k);
                k += STRIDE;
            }
        }
        most < T::FAR && (most <= steps.squares[k] || steps.complete)
    })
}

/// Lowers minima by the values at N pairs of places, each a step further out; returns the largest.
#[inline(always)]
fn lower<T: Lane, const N: usize>(
    least: &mut [T; LANES],
    line: &Line<'_, T>,
    steps: &Steps<T>,
    places: [(usize, usize); N],
    first: usize,
) -> T {
    let lanes = |at: usize| &line.values[at..][..LANES];
    let pairs = places.map(|(before, after)| (lanes(before), lanes(after)));
    let squares: [T; N] = std::array::from_fn(|j| steps.squares[first + j]);
    let mut most = *least;
    for i in 0..LANES {
        let mut value = least[i];
        for ((before, after), &square) in pairs.iter().zip(&squares) {
            value = smaller(value, smaller(before[i], after[i]).plus(square));
        }
        least[i] = value;
        most[i] = value;
    }
    most.into_iter().fold(T::from_square(0.0), |a, b| if a > b { a } else { b })
}

/// Unlike `f32::min`, one instruction; there is no NaN here.
#[inline(always)]
fn smaller<T: PartialOrd>(a: T, b: T) -> T {
    if a < b { a } else { b }
}
