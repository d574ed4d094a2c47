//! Histogram matching by rank: each value becomes the reference's value of the same rank.

use rayon::prelude::*;

use super::buckets::{Buckets, level_counts, sorted_keys};
use super::order::{Bits, Kind};
use super::radix::radix_sort;
use crate::error::{Error, Result};
use crate::monitor::Monitor;
use crate::rng::Key;

/// What equal values become.
#[derive(Debug, Clone, Copy)]
pub enum Ties {
    /// Equal values: the one in the middle of their ranks.
    Alike,
    /// Each another, dealt by random numbers.
    Random(Key),
}

/// Writes to `out`, for each value of `source`, the value of `reference` of the same rank.
///
/// Rank r of n becomes rank ⌊(2 r + 1) m / 2 n⌋ of m, so that volumes of one size without ties
/// exchange their values exactly. Values are given as bits, to be read as their kind says. Values
/// of at most 16 bits whose ties stay alike go through a table. Peak memory: the reference, sorted;
/// without a table also the source and the result, and, for each value that occurs oftener than
/// 32 000 times, 16 bytes for each time.
pub fn match_histogram<S: Bits, R: Bits>(
    (source, source_kind): (&[S], Kind),
    (reference, reference_kind): (&[R], Kind),
    ties: Ties,
    out: &mut [R],
    monitor: &Monitor<'_>,
) -> Result<()> {
    if source.len() != out.len() {
        return Err(Error::parameter("out", out.len(), "must have the source's length"));
    }
    if source.is_empty() || reference.is_empty() {
        return Err(Error::parameter(
            "(source, reference)",
            (source.len(), reference.len()),
            "must hold voxels",
        ));
    }
    if u32::try_from(source.len().max(reference.len())).is_err() {
        let largest = source.len().max(reference.len());
        return Err(Error::parameter("shape", largest, "must have less than 2^32 voxels"));
    }
    let sorted = sorted_keys(reference, reference_kind, monitor)?;
    let target = Target { sorted: &sorted, kind: reference_kind, voxels: source.len() as u64 };

    if S::WIDTH <= 16 && matches!(ties, Ties::Alike) {
        let counts = level_counts(source, source_kind, monitor)?;
        let mut before = 0;
        let table: Vec<R> = counts
            .iter()
            .map(|count| {
                let ranks = [before, before + count];
                before += count;
                target.of_ranks(ranks)
            })
            .collect();
        return out.par_chunks_mut(1 << 20).zip(source.par_chunks(1 << 20)).try_for_each(
            |(out, source)| {
                monitor.check()?;
                for (out, value) in out.iter_mut().zip(source) {
                    *out = table[value.key(source_kind).wide() as usize];
                }
                Ok(())
            },
        );
    }

    let buckets = Buckets::new(source, source_kind, monitor)?;
    let keys = buckets.deal(source, monitor)?;
    let mut found = vec![R::default(); source.len()];
    let parts = buckets.parts(&mut found).into_par_iter().enumerate();
    parts.try_for_each(|(bucket, found)| {
        monitor.check()?;
        let first = buckets.starts[bucket];
        let keys = &keys[first..buckets.starts[bucket + 1]];
        let ties = match ties {
            Ties::Alike => Ties::Alike,
            Ties::Random(key) => Ties::Random(key.with(bucket as u64)),
        };
        // A key and its place, packed, sort faster than a pair.
        if S::WIDTH <= 32 {
            let pack = |key: S, at: u32| key.wide() << 32 | u64::from(at);
            rank(keys, first as u64, ties, &target, found, pack, |pair| (pair >> 32, pair as u32));
        } else {
            let pack = |key: S, at: u32| u128::from(key.wide()) << 32 | u128::from(at);
            let unpack = |pair| ((pair >> 32) as u64, pair as u32);
            rank(keys, first as u64, ties, &target, found, pack, unpack);
        }
        Ok(())
    })?;
    drop(keys);
    drop(sorted);
    buckets.collect(source, &found, out, monitor)
}

/// The reference's values by the ranks of the source.
struct Target<'a, R> {
    sorted: &'a [R],
    kind: Kind,
    /// Of the source.
    voxels: u64,
}

impl<R: Bits> Target<'_, R> {
    /// The value in the middle of some ranks of the source.
    #[inline(always)]
    fn of_ranks(&self, [start, end]: [u64; 2]) -> R {
        let middle = start + end;
        let size = self.sorted.len() as u64;
        let rank = if size == self.voxels {
            middle / 2
        } else if let Some(product) = middle.checked_mul(size) {
            product / (2 * self.voxels)
        } else {
            (u128::from(middle) * u128::from(size) / u128::from(2 * self.voxels)) as u64
        };
        // Values that do not occur have the ranks [0, 0] or [n, n].
        R::of_key(self.sorted[rank.min(size - 1) as usize], self.kind)
    }
}

/// Finds the values for one bucket, whose first value has the rank `first`.
fn rank<S: Bits, R: Bits, P: Copy>(
    keys: &[S],
    first: u64,
    ties: Ties,
    target: &Target<'_, R>,
    found: &mut [R],
    pack: impl Fn(S, u32) -> P,
    unpack: impl Fn(P) -> (u64, u32),
) {
    let mut pairs: Vec<P> = (0u32..).zip(keys).map(|(at, &key)| pack(key, at)).collect();
    let mut spare = Vec::new();
    radix_sort(&mut pairs, &mut spare, |pair| unpack(pair).0);
    let mut start = 0;
    while start < pairs.len() {
        let key = unpack(pairs[start]).0;
        let length = pairs[start..].iter().take_while(|pair| unpack(**pair).0 == key).count();
        let alike = &mut pairs[start..start + length];
        let ranks = first + start as u64;
        match ties {
            Ties::Random(random) if length > 1 => {
                radix_sort(alike, &mut spare, |pair| random.bits(u64::from(unpack(pair).1)));
                for (rank, &pair) in (ranks..).zip(alike.iter()) {
                    found[unpack(pair).1 as usize] = target.of_ranks([rank, rank + 1]);
                }
            }
            _ => {
                let value = target.of_ranks([ranks, ranks + length as u64]);
                for &pair in alike.iter() {
                    found[unpack(pair).1 as usize] = value;
                }
            }
        }
        start += length;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::threads::with_threads;

    /// By sorting, one value after the other.
    fn twin(source: &[f32], reference: &[f32]) -> Vec<f32> {
        let sort = |values: &[f32]| {
            let mut sorted = values.to_vec();
            sorted.sort_by(f32::total_cmp);
            sorted
        };
        let (sorted, reference) = (sort(source), sort(reference));
        let middle =
            |v: f32| sorted.partition_point(|s| *s < v) + sorted.partition_point(|s| *s <= v);
        source
            .iter()
            .map(|&v| reference[middle(v) * reference.len() / (2 * source.len())])
            .collect()
    }

    fn matched(source: &[f32], reference: &[f32], ties: Ties) -> Vec<f32> {
        let bits = |values: &[f32]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        let mut out = vec![0u32; source.len()];
        match_histogram(
            (&bits(source), Kind::Float),
            (&bits(reference), Kind::Float),
            ties,
            &mut out,
            &Monitor::silent(),
        )
        .unwrap();
        out.into_iter().map(f32::from_bits).collect()
    }

    proptest! {
        #[test]
        fn agrees_with_sorting(
            source in proptest::collection::vec(-9..9i32, 1..200),
            reference in proptest::collection::vec(-900..900i32, 1..200),
        ) {
            let source: Vec<f32> = source.iter().map(|&v| v as f32 / 8.0).collect();
            let reference: Vec<f32> = reference.iter().map(|&v| v as f32 / 8.0).collect();
            let expected = twin(&source, &reference);
            prop_assert_eq!(&matched(&source, &reference, Ties::Alike), &expected);
            let bytes: Vec<u8> = source.iter().map(|v| (v * 8.0) as i8 as u8).collect();
            let wide: Vec<u64> = source.iter().map(|v| f64::from(*v).to_bits()).collect();
            let bits: Vec<u32> = reference.iter().map(|v| v.to_bits()).collect();
            let silent = Monitor::silent();
            let mut out = vec![0u32; source.len()];
            let reference = (bits.as_slice(), Kind::Float);
            let source = (bytes.as_slice(), Kind::Signed);
            match_histogram(source, reference, Ties::Alike, &mut out, &silent).unwrap();
            let same = |out: &[u32]| {
                out.iter().zip(&expected).all(|(a, b)| f32::from_bits(*a).total_cmp(b).is_eq())
            };
            prop_assert!(same(&out));
            let source = (wide.as_slice(), Kind::Float);
            match_histogram(source, reference, Ties::Alike, &mut out, &silent).unwrap();
            prop_assert!(same(&out));
        }

        #[test]
        fn random_ties_reproduce_the_distribution(
            source in proptest::collection::vec(-3..3i32, 1..200),
            seed: u64,
        ) {
            let reference: Vec<f32> = (0..source.len()).map(|i| (i * i % 17) as f32).collect();
            let source: Vec<f32> = source.iter().map(|&v| v as f32).collect();
            let ties = Ties::Random(Key::new(seed));
            let found = matched(&source, &reference, ties);
            let sort = |values: &[f32]| {
                let mut sorted = values.to_vec();
                sorted.sort_by(f32::total_cmp);
                sorted
            };
            prop_assert_eq!(sort(&found), sort(&reference));
            for (a, x) in source.iter().zip(&found) {
                for (b, y) in source.iter().zip(&found) {
                    prop_assert!(a >= b || x <= y);
                }
            }
        }
    }

    #[test]
    fn many_values_and_any_number_of_threads() {
        let noise = |seed, n| (0..n).map(|i| Key::new(seed).unit(i)).collect::<Vec<_>>();
        let (source, reference) = (noise(1, 300_000), noise(2, 123_457));
        let expected = twin(&source, &reference);
        assert!(matched(&source, &reference, Ties::Alike) == expected);
        let ties = Ties::Random(Key::new(3));
        let source: Vec<f32> = source.iter().map(|v| (v * 20.0).floor()).collect();
        let [one, three] =
            [1, 3].map(|n| with_threads(n, || matched(&source, &reference, ties)).unwrap());
        assert!(one == three);
    }

    #[test]
    fn bad_input_is_named() {
        let silent = Monitor::silent();
        let measure = |source: &[u8], reference: &[u8], out: &mut [u8]| {
            let kind = Kind::Unsigned;
            match_histogram((source, kind), (reference, kind), Ties::Alike, out, &silent)
        };
        assert!(measure(&[], &[1], &mut []).is_err());
        assert!(measure(&[1], &[], &mut [0]).is_err());
        assert!(measure(&[1], &[1], &mut []).is_err());
    }
}
