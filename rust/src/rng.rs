//! Random numbers as a pure function of (seed, stream, position).
//!
//! No generator has a state that threads could share: the same key gives the same number in
//! whatever order it is asked for, so results do not depend on threads or schedule.

/// Key of a family of random numbers: the seed mixed with what the numbers are for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Key(u64);

/// The finaliser of SplitMix64: every input bit reaches every output bit.
const fn mix(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    x ^ (x >> 31)
}

const GOLDEN: u64 = 0x9E37_79B9_7F4A_7C15;

impl Key {
    /// The root key of a run.
    pub const fn new(seed: u64) -> Self {
        Self(mix(seed.wrapping_add(GOLDEN)))
    }

    /// A sub-family, for a stream, a pass, a site.
    #[must_use]
    pub const fn with(self, part: u64) -> Self {
        Self(mix(self.0 ^ mix(part.wrapping_mul(GOLDEN).wrapping_add(GOLDEN))))
    }

    /// 64 random bits.
    pub const fn bits(self, index: u64) -> u64 {
        mix(self.0.wrapping_add(index.wrapping_add(1).wrapping_mul(GOLDEN)))
    }

    /// Uniform integer in `0..n`, for `n > 0`.
    pub const fn below(self, index: u64, n: usize) -> usize {
        // Multiply-shift: the bias is n / 2^64.
        ((self.bits(index) as u128 * n as u128) >> 64) as usize
    }

    /// Four uniform integers in `0..n` of their own, each `n` from 1 to 65 536, for the price of one: a
    /// value is as likely as another within a share of n / 65 536.
    #[inline(always)]
    pub fn below_each(self, index: u64, n: [usize; 4]) -> [usize; 4] {
        let bits = self.bits(index);
        std::array::from_fn(|i| (((bits >> (16 * i)) as usize & 0xFFFF) * n[i]) >> 16)
    }

    /// Float of the normal law with mean 0 and variance 1 (Box and Muller).
    pub fn normal(self, index: u64) -> f32 {
        let bits = self.bits(index);
        let (high, low) = (f64::from((bits >> 32) as u32), f64::from(bits as u32));
        let whole = f64::from(u32::MAX) + 1.0;
        // The first is in (0, 1], so that its logarithm is finite.
        let (radius, turn) = ((high + 1.0) / whole, low / whole);
        ((-2.0 * radius.ln()).sqrt() * (std::f64::consts::TAU * turn).cos()) as f32
    }

    /// Uniform float in `[0, 1)`.
    pub fn unit(self, index: u64) -> f32 {
        (self.bits(index) >> 40) as f32 / (1u64 << 24) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_depend_on_every_part_of_the_key() {
        let key = Key::new(1);
        assert_ne!(key.bits(0), key.bits(1));
        assert_ne!(key.bits(0), Key::new(2).bits(0));
        assert_ne!(key.with(0).bits(0), key.with(1).bits(0));
        assert_eq!(key.with(7).bits(3), Key::new(1).with(7).bits(3));
    }

    #[test]
    fn below_is_uniform() {
        let mut counts = [0usize; 7];
        for i in 0..70_000 {
            counts[Key::new(5).below(i, 7)] += 1;
        }
        assert!(counts.iter().all(|&c| c.abs_diff(10_000) < 500), "{counts:?}");
    }

    #[test]
    fn four_at_once_are_uniform_and_independent() {
        let mut counts = [[0usize; 5]; 7];
        for i in 0..70_000 {
            let [a, b, c, d] = Key::new(6).below_each(i, [7, 5, 1, 65_536]);
            counts[a][b] += 1;
            assert!(c == 0 && d < 65_536);
        }
        assert!(counts.iter().flatten().all(|&c| c.abs_diff(2000) < 250), "{counts:?}");
    }

    #[test]
    fn normal_has_the_moments_of_the_normal_law() {
        let n = 100_000u64;
        let x: Vec<f64> = (0..n).map(|i| f64::from(Key::new(8).normal(i))).collect();
        let moment = |power| x.iter().map(|v| v.powi(power)).sum::<f64>() / n as f64;
        let found = [1, 2, 3, 4].map(moment);
        let near =
            found.iter().zip([0.0, 1.0, 0.0, 3.0]).all(|(a, b): (&f64, f64)| (a - b).abs() < 0.1);
        assert!(near, "{found:?}");
    }

    #[test]
    fn unit_has_the_mean_and_variance_of_the_uniform_law() {
        let n = 100_000u64;
        let x: Vec<f64> = (0..n).map(|i| f64::from(Key::new(9).unit(i))).collect();
        let mean = x.iter().sum::<f64>() / n as f64;
        let variance = x.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n as f64;
        assert!((mean - 0.5).abs() < 0.005 && (variance - 1.0 / 12.0).abs() < 0.002);
        assert!(x.iter().all(|v| (0.0..1.0).contains(v)));
    }
}
