//! `min over k of f(i + k) + (k·w)²` for many lanes at once, as far out as a result can reach.

use multiversion::multiversion;

/// Values worked on together: two registers of AVX-512, four of AVX2 for the narrow type.
pub(crate) const LANES: usize = 64;

/// Farthest step of a window. Beyond, the envelope is no dearer.
pub(super) const FARTHEST: usize = 255;

/// Steps that are taken at once, so that the minimum stays in registers.
const STRIDE: usize = 4;

/// How far beyond the ends of a line windows of so many steps read.
pub(super) const fn padding(steps: usize) -> usize {
    steps + STRIDE + 1
}

/// A squared distance: u16 where all are whole numbers, else f32.
pub(crate) trait Lane: Copy + PartialOrd + Send + Sync + 'static {
    /// No voxel outside, or too far to tell.
    const FAR: Self;
    /// Rounds to the type; too large becomes [`Self::FAR`].
    fn from_square(square: f32) -> Self;
    /// The value; [`Self::FAR`] is infinite.
    fn square(self) -> f32;
    /// The value rounded down; [`Self::FAR`] is large.
    fn whole(self) -> u32;
    /// Keeps a count of steps where a square will be.
    fn from_steps(steps: u16) -> Self;
    /// The count that was kept.
    fn steps(self) -> u16;
    /// The square of so many steps; no step has no offset, and `u16::MAX` steps are [`Self::FAR`].
    fn square_of(steps: u16, offset: f32, size: f32) -> Self;
    /// A sum that stops at [`Self::FAR`].
    fn plus(self, other: Self) -> Self;
    /// [`minima`] for this type, with the widest instructions of the processor.
    fn minima(line: &Line<'_, Self>, steps: &Steps<Self>, out: &mut [Self]) -> bool;
    /// [`squares_along`] for this type.
    fn squares_along(steps: &[u16], others: &[u16], offset: f32, size: f32, out: &mut [Self]);
    /// [`to_squares`] for this type.
    fn to_squares(values: &[Self], out: &mut [f32]);
    /// [`from_squares`] for this type.
    fn from_squares(squares: &[f32], out: &mut [Self]);
    /// [`raise`] for this type.
    fn raise(out: &mut [Self], values: &[Self]);
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
    fn whole(self) -> u32 {
        u32::from(self)
    }

    #[inline(always)]
    fn from_steps(steps: u16) -> Self {
        steps
    }

    #[inline(always)]
    fn steps(self) -> u16 {
        self
    }

    #[inline(always)]
    fn square_of(steps: u16, offset: f32, size: f32) -> Self {
        // Whole numbers, see `Lattice::is_whole`.
        let (size, offset) = (size as Self, (offset * size) as Self);
        let most = (255 - offset) / size;
        let distance = steps.wrapping_mul(size).wrapping_add(offset);
        let square = if steps > most { Self::FAR } else { distance.wrapping_mul(distance) };
        if steps == 0 { 0 } else { square }
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        self.saturating_add(other)
    }

    fn minima(line: &Line<'_, Self>, steps: &Steps<Self>, out: &mut [Self]) -> bool {
        minima_u16(line, steps, out)
    }

    fn squares_along(steps: &[u16], others: &[u16], offset: f32, size: f32, out: &mut [Self]) {
        squares_along_u16(steps, others, offset, size, out);
    }

    fn to_squares(values: &[Self], out: &mut [f32]) {
        to_squares_u16(values, out);
    }

    fn from_squares(squares: &[f32], out: &mut [Self]) {
        from_squares_u16(squares, out);
    }

    fn raise(out: &mut [Self], values: &[Self]) {
        raise_u16(out, values);
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
    fn whole(self) -> u32 {
        self as u32
    }

    #[inline(always)]
    fn from_steps(steps: u16) -> Self {
        f32::from(steps)
    }

    #[inline(always)]
    fn steps(self) -> u16 {
        self as u16
    }

    #[inline(always)]
    fn square_of(steps: u16, offset: f32, size: f32) -> Self {
        let distance = if steps == 0 { 0.0 } else { (f32::from(steps) + offset) * size };
        if steps == u16::MAX { Self::FAR } else { distance * distance }
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        self + other
    }

    fn minima(line: &Line<'_, Self>, steps: &Steps<Self>, out: &mut [Self]) -> bool {
        minima_f32(line, steps, out)
    }

    fn squares_along(steps: &[u16], others: &[u16], offset: f32, size: f32, out: &mut [Self]) {
        squares_along_f32(steps, others, offset, size, out);
    }

    fn to_squares(values: &[Self], out: &mut [f32]) {
        to_squares_f32(values, out);
    }

    fn from_squares(squares: &[f32], out: &mut [Self]) {
        from_squares_f32(squares, out);
    }

    fn raise(out: &mut [Self], values: &[Self]) {
        raise_f32(out, values);
    }
}

/// Lines of squared distances, padded at both ends.
pub(crate) struct Line<'a, T> {
    /// The values; those beyond an open end are [`Lane::FAR`].
    pub values: &'a [T],
    /// Where the first of them is that a result belongs to.
    pub start: usize,
    /// How far apart neighbours on a line are: 1, or [`LANES`] if there are so many lines abreast.
    pub step: usize,
    /// How many results of the one line, or of the lines abreast, are asked for: the others, which
    /// fill up lanes, make no window longer.
    pub width: usize,
}

impl<T> Line<'_, T> {
    /// How many of some lanes are asked for.
    #[inline(always)]
    fn asked(&self, at: usize) -> usize {
        let before = if self.step == 1 { at - self.start } else { 0 };
        (self.width - before).min(LANES)
    }
}

/// The squares that steps away from a voxel cost, or from half-way to the next: such a place is level
/// with both of its voxels, and half a step farther from all others.
pub(crate) struct Steps<T> {
    squares: Vec<T>,
    /// Farthest step of a window.
    farthest: usize,
    /// Whether no step beyond it can matter.
    complete: bool,
    /// No result is larger.
    limit: T,
    /// 1 if distances are taken from half-way to the next voxel.
    half: usize,
    /// Whether results may be [`Lane::FAR`].
    far: bool,
}

impl<T: Lane> Steps<T> {
    /// Steps of `size` along lines where no distance is of more than `reach` voxels.
    pub(super) fn new(size: f64, half: bool, reach: usize, limit: f32) -> Self {
        let offset = if half { 0.5 } else { 0.0 };
        let square = |k: usize| match k {
            0 => T::from_square(0.0),
            _ => T::from_square(((k as f64 + offset) * size).powi(2) as f32),
        };
        let limit = T::from_square(limit);
        let needed = (0..=FARTHEST).find(|&k| square(k) >= limit).unwrap_or(FARTHEST);
        let farthest = needed.min(reach);
        Self {
            squares: (0..=farthest + STRIDE + 1).map(square).collect(),
            farthest,
            complete: farthest == reach,
            limit,
            half: usize::from(half),
            far: false,
        }
    }

    /// The same, where it is enough to know that a result is too large for the type.
    pub(super) fn or_far(self) -> Self {
        Self { far: true, ..self }
    }

    /// Farthest step of a window.
    pub(super) const fn farthest(&self) -> usize {
        self.farthest
    }
}

/// Functions for one type of lane, each compiled for the widest instructions.
macro_rules! for_lanes {
    ($type:ty, $minima:ident, $squares:ident, $to:ident, $from:ident, $raise:ident) => {
        #[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
        fn $minima(line: &Line<'_, $type>, steps: &Steps<$type>, out: &mut [$type]) -> bool {
            minima(line, steps, out)
        }

        #[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
        fn $squares(steps: &[u16], others: &[u16], offset: f32, size: f32, out: &mut [$type]) {
            squares_along(steps, others, offset, size, out);
        }

        #[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
        fn $to(values: &[$type], out: &mut [f32]) {
            to_squares(values, out);
        }

        #[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
        fn $from(squares: &[f32], out: &mut [$type]) {
            from_squares(squares, out);
        }

        #[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
        fn $raise(out: &mut [$type], values: &[$type]) {
            raise(out, values);
        }
    };
}

for_lanes!(u16, minima_u16, squares_along_u16, to_squares_u16, from_squares_u16, raise_u16);
for_lanes!(f32, minima_f32, squares_along_f32, to_squares_f32, from_squares_f32, raise_f32);

/// Squared distance of each voxel along an axis, from its steps in two ways.
#[inline(always)]
fn squares_along<T: Lane>(steps: &[u16], others: &[u16], offset: f32, size: f32, out: &mut [T]) {
    for ((out, &steps), &other) in out.iter_mut().zip(steps).zip(others) {
        *out = T::square_of(smaller(steps, other), offset, size);
    }
}

#[inline(always)]
fn to_squares<T: Lane>(values: &[T], out: &mut [f32]) {
    for (out, &value) in out.iter_mut().zip(values) {
        *out = value.square();
    }
}

#[inline(always)]
fn from_squares<T: Lane>(squares: &[f32], out: &mut [T]) {
    for (out, &square) in out.iter_mut().zip(squares) {
        *out = T::from_square(square);
    }
}

/// Raises values to those beside them that are larger.
#[inline(always)]
fn raise<T: Lane>(out: &mut [T], values: &[T]) {
    for (out, &value) in out.iter_mut().zip(values) {
        *out = if value > *out { value } else { *out };
    }
}

/// Lowers values to others that are smaller.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
pub(super) fn lower_to(values: &mut [u16], others: &[u16]) {
    for (value, &other) in values.iter_mut().zip(others) {
        *value = smaller(*value, other);
    }
}

/// Steps from the last target, a row further; `last` is the row before, then this one.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
pub(super) fn count_on(last: &mut [u16], since: &mut [u16], targets: &[bool]) {
    for ((last, since), &target) in last.iter_mut().zip(since).zip(targets) {
        *last = if target { 0 } else { last.saturating_add(1) };
        *since = *last;
    }
}

/// The same, where the counts know their own targets already.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
pub(super) fn carry_on(last: &mut [u16], since: &mut [u16]) {
    for (last, since) in last.iter_mut().zip(since) {
        *last = smaller(*since, last.saturating_add(1));
        *since = *last;
    }
}

/// Steps to the next target, a row back; `next` is the row after, then this one.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
pub(super) fn count_back(next: &mut [u16], since: &[u16]) {
    for (next, &since) in next.iter_mut().zip(since) {
        *next = if since == 0 { 0 } else { next.saturating_add(1) };
    }
}

/// Writes the minima, [`LANES`] at a time; false if some lie beyond the window.
///
/// Plain loops: a closure that is not inlined would be compiled for the baseline.
#[inline(always)]
fn minima<T: Lane>(line: &Line<'_, T>, steps: &Steps<T>, out: &mut [T]) -> bool {
    let ahead = steps.half * line.step;
    let squares = &steps.squares;
    let mut at = line.start;
    for least in out.as_chunks_mut().0 {
        *least = [steps.limit; LANES];
        let asked = line.asked(at);
        lower::<T, 1>(least, line, squares, at, at + ahead);
        let mut k = 1;
        if steps.farthest >= 1 && exceed(least, asked, squares[1]) {
            let reach = line.step;
            lower::<T, 1>(least, line, &squares[1..], at - reach, at + ahead + reach);
            k = 2;
        }
        while k <= steps.farthest && exceed(least, asked, squares[k]) {
            let reach = k * line.step;
            lower::<T, STRIDE>(least, line, &squares[k..], at - reach, at + ahead + reach);
            k += STRIDE;
        }
        let unknown = !steps.complete && exceed(least, asked, squares[k]);
        if unknown || (!steps.far && any_far(least, asked)) {
            return false;
        }
        at += LANES;
    }
    true
}

/// Lowers minima by the values at N pairs of places, each a step further out.
#[inline(always)]
fn lower<T: Lane, const N: usize>(
    least: &mut [T; LANES],
    line: &Line<'_, T>,
    squares: &[T],
    before: usize,
    after: usize,
) {
    let span = (N - 1) * line.step;
    let before = &line.values[before - span..][..span + LANES];
    let after = &line.values[after..][..span + LANES];
    let mut lowered = *least;
    for j in 0..N {
        let square = squares[j];
        let before = &before[span - j * line.step..][..LANES];
        let after = &after[j * line.step..][..LANES];
        for i in 0..LANES {
            lowered[i] = smaller(lowered[i], smaller(before[i], after[i]).plus(square));
        }
    }
    *least = lowered;
}

/// Whether one of those asked for is larger than a square: cheaper than to find the largest.
#[inline(always)]
fn exceed<T: Lane>(least: &[T; LANES], asked: usize, square: T) -> bool {
    if asked < LANES {
        return least[..asked].iter().any(|&value| value > square);
    }
    let mut any = false;
    for &value in least {
        any |= value > square;
    }
    any
}

/// Whether one of those asked for is [`Lane::FAR`].
#[inline(always)]
fn any_far<T: Lane>(least: &[T; LANES], asked: usize) -> bool {
    if asked < LANES {
        return least[..asked].contains(&T::FAR);
    }
    let mut any = false;
    for &value in least {
        any |= value == T::FAR;
    }
    any
}

/// Unlike `f32::min`, one instruction; there is no NaN here.
#[inline(always)]
fn smaller<T: PartialOrd>(a: T, b: T) -> T {
    if a < b { a } else { b }
}
