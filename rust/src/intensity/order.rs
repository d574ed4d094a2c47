//! Bits of numbers as unsigned integers of the same order.

/// How the bits of a number are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Unsigned integer, or a truth value.
    Unsigned,
    /// Signed integer, two's complement.
    Signed,
    /// Finite floating-point number.
    Float,
}

/// Bits of a number.
pub trait Bits: Copy + Default + Ord + Send + Sync + 'static {
    /// Unsigned integer whose order is that of the numbers; 0.0 and −0.0 are equal.
    #[must_use]
    fn key(self, kind: Kind) -> Self;
    /// The bits of a key.
    #[must_use]
    fn of_key(key: Self, kind: Kind) -> Self;
    /// As a 64-bit integer.
    fn wide(self) -> u64;
    /// The lowest bits of a 64-bit integer.
    fn narrow(wide: u64) -> Self;
    /// Number of bits.
    const WIDTH: u32;
}

macro_rules! bits {
    ($($unsigned:ty),*) => {$(
        impl Bits for $unsigned {
            #[inline(always)]
            fn key(self, kind: Kind) -> Self {
                const SIGN: $unsigned = 1 << (<$unsigned>::BITS - 1);
                match kind {
                    Kind::Unsigned => self,
                    Kind::Signed => self ^ SIGN,
                    Kind::Float if self == SIGN => SIGN,
                    Kind::Float if self & SIGN != 0 => !self,
                    Kind::Float => self | SIGN,
                }
            }

            #[inline(always)]
            fn of_key(key: Self, kind: Kind) -> Self {
                const SIGN: $unsigned = 1 << (<$unsigned>::BITS - 1);
                match kind {
                    Kind::Unsigned => key,
                    Kind::Signed => key ^ SIGN,
                    Kind::Float if key & SIGN != 0 => key ^ SIGN,
                    Kind::Float => !key,
                }
            }

            #[inline(always)]
            fn wide(self) -> u64 {
                u64::from(self)
            }

            #[inline(always)]
            fn narrow(wide: u64) -> Self {
                wide as Self
            }

            const WIDTH: u32 = <$unsigned>::BITS;
        }
    )*};
}

bits!(u8, u16, u32, u64);

#[cfg(test)]
mod tests {
    use super::*;

    fn check<T: Bits + std::fmt::Debug>(bits: &[T], kind: Kind) {
        assert!(bits.windows(2).all(|w| w[0].key(kind) < w[1].key(kind)));
        assert!(bits.iter().all(|&b| T::of_key(b.key(kind), kind) == b));
    }

    #[test]
    fn keys_keep_the_order_and_come_back() {
        let floats = [f32::MIN, -1.5, -1e-40, 0.0, 1e-40, 2.0, f32::MAX].map(f32::to_bits);
        let doubles = [f64::MIN, -1.5, 0.0, 1e-310, 2.0].map(f64::to_bits);
        let signed = [i16::MIN, -3, 0, 7, i16::MAX].map(|v| v as u16);
        check(&floats, Kind::Float);
        check(&doubles, Kind::Float);
        check(&signed, Kind::Signed);
        check(&[0u8, 3, 255], Kind::Unsigned);
        assert_eq!((-0.0f32).to_bits().key(Kind::Float), 0u32.key(Kind::Float));
    }
}
