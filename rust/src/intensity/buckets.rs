//! Values dealt to buckets of neighbouring values, so that what follows works inside the cache.
//!
//! A bucket keeps its values in the order of the voxels: what is computed for them comes back by
//! reading every bucket from its start while the voxels are passed in order.

use rayon::prelude::*;

use super::order::{Bits, Kind};
use super::radix::radix_sort;
use crate::error::Result;
use crate::monitor::Monitor;

/// Values of a bucket, if they are even enough: with their indices, 256 KB.
const BUCKET: usize = 1 << 15;
/// More buckets than this are more streams of memory than a processor keeps open.
const MOST_BUCKETS: usize = 2048;
/// Voxels between two looks at the monitor, and a bucket's worth of work for a thread at least.
const CHUNK: usize = 1 << 20;

/// Which bucket each value belongs to.
pub(super) struct Buckets<T> {
    kind: Kind,
    high: HighBits,
    /// Bucket of the highest bits of a key.
    of_bits: Vec<u16>,
    /// Where each bucket begins; one more entry than buckets.
    pub starts: Vec<usize>,
    /// Values of each chunk of voxels in each bucket.
    counts: Vec<Vec<usize>>,
    values: std::marker::PhantomData<T>,
}

/// The 16 highest bits in which the keys of some values differ.
#[derive(Clone, Copy)]
struct HighBits {
    lowest: u64,
    shift: u32,
}

impl HighBits {
    fn new<T: Bits>(values: &[T], kind: Kind, monitor: &Monitor<'_>) -> Result<Self> {
        let (lowest, highest) = values
            .par_chunks(CHUNK)
            .map(|chunk| {
                monitor.check()?;
                Ok(chunk.iter().fold((u64::MAX, 0), |(low, high), value| {
                    let key = value.key(kind).wide();
                    (low.min(key), high.max(key))
                }))
            })
            .try_reduce(|| (u64::MAX, 0), |a, b| Ok((a.0.min(b.0), a.1.max(b.1))))?;
        let width = u64::BITS - highest.saturating_sub(lowest).leading_zeros();
        Ok(Self { lowest, shift: width.saturating_sub(16) })
    }

    #[inline(always)]
    fn of<T: Bits>(self, key: T) -> usize {
        ((key.wide() - self.lowest) >> self.shift) as usize
    }
}

/// How often each value occurs, by key, of values of at most 16 bits.
pub fn level_counts<T: Bits>(values: &[T], kind: Kind, monitor: &Monitor<'_>) -> Result<Vec<u64>> {
    /// Neighbours are often alike; in tables of their own they need not wait for each other.
    const TABLES: usize = 4;
    let levels = 1usize << T::WIDTH.min(16);
    values
        .par_chunks(CHUNK)
        .map(|chunk| {
            monitor.check()?;
            let mut tables = vec![0u32; TABLES * levels];
            let (fours, rest) = chunk.as_chunks::<TABLES>();
            for four in fours {
                for (table, value) in four.iter().enumerate() {
                    tables[table * levels + value.key(kind).wide() as usize % levels] += 1;
                }
            }
            for value in rest {
                tables[value.key(kind).wide() as usize % levels] += 1;
            }
            let sum = |level| tables[level..].iter().step_by(levels).map(|&n| u64::from(n)).sum();
            Ok((0..levels).map(sum).collect())
        })
        .try_reduce(
            || vec![0; levels],
            |mut a: Vec<u64>, b| {
                a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
                Ok(a)
            },
        )
}

impl<T: Bits> Buckets<T> {
    pub fn new(values: &[T], kind: Kind, monitor: &Monitor<'_>) -> Result<Self> {
        let bits = HighBits::new(values, kind, monitor)?;
        let high = values
            .par_chunks(CHUNK)
            .map(|chunk| {
                monitor.check()?;
                let mut counts = vec![0u32; 1 << 16];
                for value in chunk {
                    counts[bits.of(value.key(kind))] += 1;
                }
                Ok(counts)
            })
            .collect::<Result<Vec<_>>>()?;
        let wanted = BUCKET.max(values.len() / MOST_BUCKETS);
        let mut of_bits = vec![0u16; 1 << 16];
        let (mut bucket, mut size) = (0u16, 0);
        for (value, of) in of_bits.iter_mut().enumerate() {
            let count: usize = high.iter().map(|counts| counts[value] as usize).sum();
            if size > 0 && size + count > wanted {
                (bucket, size) = (bucket + 1, 0);
            }
            size += count;
            *of = bucket;
        }
        let buckets = usize::from(bucket) + 1;
        let mut starts = vec![0; buckets + 1];
        let counts: Vec<_> = high
            .iter()
            .map(|high| {
                let mut counts = vec![0; buckets];
                for (&count, &of) in high.iter().zip(&of_bits) {
                    counts[usize::from(of)] += count as usize;
                    starts[usize::from(of) + 1] += count as usize;
                }
                counts
            })
            .collect();
        for bucket in 0..buckets {
            starts[bucket + 1] += starts[bucket];
        }
        Ok(Self { kind, high: bits, of_bits, starts, counts, values: std::marker::PhantomData })
    }

    #[inline(always)]
    fn of(&self, key: T) -> usize {
        usize::from(self.of_bits[self.high.of(key)])
    }

    /// Deals the keys of the values out, bucket after bucket.
    pub fn deal(&self, values: &[T], monitor: &Monitor<'_>) -> Result<Vec<T>> {
        let mut keys = vec![T::default(); values.len()];
        // The share of each chunk in each bucket.
        let mut shares: Vec<Vec<_>> = self.counts.iter().map(|_| Vec::new()).collect();
        let mut rest = keys.as_mut_slice();
        for bucket in 0..self.starts.len() - 1 {
            for (shares, counts) in shares.iter_mut().zip(&self.counts) {
                let (share, after) = rest.split_at_mut(counts[bucket]);
                shares.push(share.iter_mut());
                rest = after;
            }
        }
        values.par_chunks(CHUNK).zip(shares).try_for_each(|(chunk, mut shares)| {
            monitor.check()?;
            for value in chunk {
                let key = value.key(self.kind);
                if let Some(to) = shares[self.of(key)].next() {
                    *to = key;
                }
            }
            Ok(())
        })?;
        Ok(keys)
    }

    /// Gives each voxel what was found for it, bucket after bucket.
    pub fn collect<R: Bits>(
        &self,
        values: &[T],
        found: &[R],
        out: &mut [R],
        monitor: &Monitor<'_>,
    ) -> Result<()> {
        let mut shares: Vec<Vec<_>> = self.counts.iter().map(|_| Vec::new()).collect();
        let mut rest = found;
        for bucket in 0..self.starts.len() - 1 {
            for (shares, counts) in shares.iter_mut().zip(&self.counts) {
                let (share, after) = rest.split_at(counts[bucket]);
                shares.push(share.iter());
                rest = after;
            }
        }
        let chunks = values.par_chunks(CHUNK).zip(out.par_chunks_mut(CHUNK));
        chunks.zip(shares).try_for_each(|((chunk, out), mut shares)| {
            monitor.check()?;
            for (value, out) in chunk.iter().zip(out) {
                if let Some(&found) = shares[self.of(value.key(self.kind))].next() {
                    *out = found;
                }
            }
            Ok(())
        })
    }

    /// The buckets of something that is stored bucket after bucket.
    pub fn parts<'a, R>(&self, mut all: &'a mut [R]) -> Vec<&'a mut [R]> {
        let mut parts = Vec::with_capacity(self.starts.len() - 1);
        for pair in self.starts.windows(2) {
            let (part, rest) = all.split_at_mut(pair[1] - pair[0]);
            parts.push(part);
            all = rest;
        }
        parts
    }
}

/// The keys of the values, in order.
pub(super) fn sorted_keys<T: Bits>(
    values: &[T],
    kind: Kind,
    monitor: &Monitor<'_>,
) -> Result<Vec<T>> {
    if T::WIDTH <= 16 {
        let counts = level_counts(values, kind, monitor)?;
        let mut keys = Vec::with_capacity(values.len());
        for (key, count) in counts.into_iter().enumerate() {
            keys.resize(keys.len() + count as usize, T::narrow(key as u64));
        }
        return Ok(keys);
    }
    let buckets = Buckets::new(values, kind, monitor)?;
    let mut keys = buckets.deal(values, monitor)?;
    buckets.parts(&mut keys).into_par_iter().try_for_each_init(Vec::new, |spare, keys| {
        monitor.check()?;
        radix_sort(keys, spare, T::wide);
        Ok(())
    })?;
    Ok(keys)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Key;

    #[test]
    fn keys_are_sorted() {
        let silent = Monitor::silent();
        for n in [0, 1, 1000, 2_500_000] {
            let values: Vec<u32> = (0..n).map(|i| (Key::new(1).unit(i) - 0.5).to_bits()).collect();
            let found = sorted_keys(&values, Kind::Float, &silent).unwrap();
            let mut expected: Vec<_> = values.iter().map(|v| v.key(Kind::Float)).collect();
            expected.sort_unstable();
            assert!(found == expected, "{n}");
            let bytes: Vec<u8> = values.iter().map(|&v| v as u8).collect();
            let found = sorted_keys(&bytes, Kind::Signed, &silent).unwrap();
            let mut expected: Vec<_> = bytes.iter().map(|v| v.key(Kind::Signed)).collect();
            expected.sort_unstable();
            assert!(found == expected, "{n}");
        }
    }
}
