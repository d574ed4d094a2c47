//! Numbers in fewer bytes than are calculated with.
//!
//! A cycle only preconditions, and a direction is exact for what it is once it has been rounded: 16
//! bits do for both. A residual must keep what many steps take from it: 48 bits do, for their errors of
//! 10⁻¹¹ are of random sign, or 24 where one that is rounded is right as well.

use half::f16;
use half::slice::HalfFloatSliceExt;
use multiversion::multiversion;

/// Writes numbers in single precision.
pub(super) fn widen(from: &[f16], to: &mut Vec<f32>) {
    to.clear();
    to.resize(from.len(), 0.0);
    from.convert_to_f32_slice(to);
}

/// The number in single precision. To be inlined in loops: what [`widen`] does for a vector asks what the
/// processor has, which takes longer than a short one.
#[inline(always)]
pub(super) fn single_of(half: f16) -> f32 {
    const BIAS: u32 = (127 - 15) << 23;
    const LEAST: u32 = BIAS + (1 << 23);
    let bits = u32::from(half.to_bits());
    let size = (bits & 0x7fff) << 13;
    let normal = f32::from_bits(size + BIAS);
    let small = f32::from_bits(size + LEAST) - f32::from_bits(LEAST);
    let size = if size < 1 << 23 { small } else { normal };
    f32::from_bits(size.to_bits() | (bits & 0x8000) << 16)
}

/// Writes numbers in 16 bits, the largest one instead of infinity.
pub(super) fn narrow(from: &mut [f32], to: &mut [f16]) {
    let most = f16::MAX.to_f32();
    for value in &mut *from {
        *value = value.clamp(-most, most);
    }
    to.convert_from_f32_slice(from);
}

/// A number in double precision without its last 16 bits.
#[derive(Clone, Copy, Default, PartialEq, Debug)]
pub(super) struct Long([u16; 3]);

impl Long {
    #[inline(always)]
    pub fn new(value: f64) -> Self {
        // To the nearest one; a carry into the exponent is as it should be.
        let bits = value.to_bits() + (1 << 15);
        // Spelled out, for closures of arrays are not always inlined.
        Self([(bits >> 16) as u16, (bits >> 32) as u16, (bits >> 48) as u16])
    }

    #[inline(always)]
    pub fn get(self) -> f64 {
        let [low, middle, high] = self.0;
        f64::from_bits(u64::from(low) << 16 | u64::from(middle) << 32 | u64::from(high) << 48)
    }
}

/// A number in single precision without its last 8 bits.
#[derive(Clone, Copy, Default, PartialEq, Debug)]
pub(super) struct Short([u8; 3]);

impl Short {
    #[inline(always)]
    pub fn new(value: f32) -> Self {
        let [_, low, middle, high] = (value.to_bits() + (1 << 7)).to_le_bytes();
        Self([low, middle, high])
    }

    #[inline(always)]
    pub fn get(self) -> f32 {
        let [low, middle, high] = self.0;
        f32::from_bits(u32::from_le_bytes([0, low, middle, high]))
    }
}

/// Writes numbers in single precision.
#[multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
pub(super) fn single(from: &[Long], to: &mut Vec<f32>) {
    to.clear();
    to.resize(from.len(), 0.0);
    for (to, from) in to.iter_mut().zip(from) {
        *to = from.get() as f32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_no_room_in_sixteen_bits_becomes_the_largest_number() {
        let mut numbers = [0.1, 65519.0, 1e9, -65530.0, -1e-9, f32::NEG_INFINITY];
        let (mut halves, mut back) = ([f16::default(); 6], vec![7.0]);
        narrow(&mut numbers, &mut halves);
        widen(&halves, &mut back);
        assert_eq!(back, [0.099_975_586, 65504.0, 65504.0, -65504.0, -0.0, -65504.0]);
    }

    #[test]
    fn halves_are_widened_as_the_library_does() {
        let all = (0..=u16::MAX).map(f16::from_bits).filter(|half| half.is_finite());
        assert!(all.into_iter().all(|half| single_of(half).to_bits() == half.to_f32().to_bits()));
    }

    #[test]
    fn twenty_four_bits_keep_four_digits() {
        for value in [0.0, 1.0, -1.0, 0.1, -3e-7, 1e30, 1.0 - f32::EPSILON] {
            let found = Short::new(value).get();
            assert!((found - value).abs() <= value.abs() * 2f32.powi(-17));
        }
        assert_eq!(Short::new(0.0), Short::default());
    }

    #[test]
    fn forty_eight_bits_keep_ten_digits() {
        for value in [0.0, 1.0, -1.0, 0.1, -3e-7, 1e30, 1.0 - 2f64.powi(-50)] {
            let found = Long::new(value).get();
            assert!((found - value).abs() <= value.abs() * 2f64.powi(-37));
        }
        assert_eq!(Long::new(0.0), Long::default());
    }
}
