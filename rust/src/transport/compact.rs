//! Numbers in fewer bytes than are calculated with.
//!
//! A cycle only preconditions, and a direction is exact for what it is once it has been rounded: 16
//! bits do for both. A residual must keep what many steps take from it: 48 bits do, for their errors of
//! 10⁻¹¹ are of random sign.

use multiversion::multiversion;

/// A number in 16 bits (IEEE 754 binary16): 11 significant bits from 6·10⁻⁵ to 65504, steps of 6·10⁻⁸
/// below.
#[derive(Clone, Copy, Default, PartialEq, Debug)]
pub(super) struct Half(u16);

impl Half {
    /// The nearest number, the largest one instead of infinity; NaN is not to be given.
    #[inline(always)]
    pub fn new(value: f32) -> Self {
        const LARGEST: u32 = 0x477f_e000;
        const LEAST_NORMAL: u32 = 113 << 23;
        let bits = value.to_bits();
        let size = (bits & 0x7fff_ffff).min(LARGEST);
        // To even where two are as near.
        let normal = (size.wrapping_sub(112 << 23) + 0xfff + (size >> 13 & 1)) >> 13;
        // The sum's last bit is a step of the small ones.
        let small = (f32::from_bits(size) + 0.5).to_bits().wrapping_sub(0.5f32.to_bits());
        let size = if size < LEAST_NORMAL { small } else { normal };
        Self((size | (bits >> 16 & 0x8000)) as u16)
    }

    #[inline(always)]
    pub fn get(self) -> f32 {
        let bits = u32::from(self.0);
        let size = (bits & 0x7fff) << 13;
        let normal = size + (112 << 23);
        let small = f32::from_bits(size + (113 << 23)) - f32::from_bits(113 << 23);
        let size = if size < 1 << 23 { small.to_bits() } else { normal };
        f32::from_bits(size | (bits & 0x8000) << 16)
    }
}

/// Writes numbers in single precision.
#[multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
pub(super) fn widen(from: &[Half], to: &mut Vec<f32>) {
    widen_inline(from, to);
}

/// The same for functions that are compiled for several processors themselves.
#[inline(always)]
pub(super) fn widen_inline(from: &[Half], to: &mut Vec<f32>) {
    to.clear();
    to.resize(from.len(), 0.0);
    for (to, from) in to.iter_mut().zip(from) {
        *to = from.get();
    }
}

/// Writes numbers in 16 bits.
#[multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
pub(super) fn narrow(from: &[f32], to: &mut [Half]) {
    for (to, &from) in to.iter_mut().zip(from) {
        *to = Half::new(from);
    }
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

    /// What a number in 16 bits stands for, by the definition.
    fn value(bits: u16) -> f32 {
        let sign = if bits >> 15 == 1 { -1.0 } else { 1.0 };
        let (exponent, fraction) = (i32::from(bits >> 10 & 31), f32::from(bits & 1023));
        let size = match exponent {
            0 => fraction * 2f32.powi(-24),
            _ => (1024.0 + fraction) * 2f32.powi(exponent - 25),
        };
        sign * size
    }

    #[test]
    fn all_of_sixteen_bits_come_back() {
        for bits in (0..=u16::MAX).filter(|bits| bits >> 10 & 31 != 31) {
            let found = Half(bits).get();
            assert_eq!(found.to_bits(), value(bits).to_bits());
            assert_eq!(Half::new(found), Half(bits));
        }
    }

    #[test]
    fn what_lies_between_goes_to_the_nearest() {
        for bits in 0..0x7bffu16 {
            let [low, high] = [bits, bits + 1].map(value);
            let middle = f32::midpoint(low, high);
            let even = Half(bits + (bits & 1));
            assert_eq!(Half::new(middle), even);
            assert_eq!(Half::new(-middle).0, even.0 | 0x8000);
            assert_eq!(Half::new(middle.next_down()), Half(bits));
            assert_eq!(Half::new(middle.next_up()), Half(bits + 1));
        }
        assert_eq!([Half::new(1e9), Half::new(-65530.0)], [Half(0x7bff), Half(0xfbff)]);
        assert_eq!([Half::new(1e-9), Half::default()], [Half(0); 2]);
    }

    #[test]
    fn slices_are_converted_one_by_one() {
        let numbers: Vec<f32> = (0..37).map(|i| (i as f32 - 18.0) / 7.0).collect();
        let (mut halves, mut back) = (vec![Half::default(); 37], Vec::new());
        narrow(&numbers, &mut halves);
        assert_eq!(halves, numbers.iter().map(|&n| Half::new(n)).collect::<Vec<_>>());
        widen(&halves, &mut back);
        assert!(back.iter().zip(&halves).all(|(&back, &half)| Half::new(back) == half));
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
