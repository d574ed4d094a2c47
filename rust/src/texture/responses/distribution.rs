//! Distributions of responses, and the monotone map from one to another.

/// Most bins of a distribution: a hundredth of a standard deviation or less, for responses whose range
/// is 20 of them or less.
const MOST: usize = 2048;

/// Fewest bins.
const FEWEST: usize = 256;

/// Values for each bin, between the two: of a volume of 32³, a step takes a third less time than with
/// [`MOST`] bins.
const VALUES: usize = 16;

/// Bins for so many values.
pub(super) fn bins_for(values: usize) -> usize {
    (values / VALUES).next_power_of_two().clamp(FEWEST, MOST)
}

/// Smallest and largest of some values; infinities the wrong way round where there are none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Range {
    pub low: f32,
    pub high: f32,
}

impl Range {
    pub const EMPTY: Self = Self { low: f32::INFINITY, high: f32::NEG_INFINITY };

    pub fn join(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// Of values.
    pub fn of(values: &[f32]) -> Self {
        values.iter().fold(Self::EMPTY, |range, &v| range.join(Self { low: v, high: v }))
    }

    /// Bins a unit of value; 0 where all values are one.
    fn scale(self, bins: usize) -> f32 {
        let scale = bins as f32 / (self.high - self.low);
        if scale.is_finite() { scale } else { 0.0 }
    }
}

/// Counts values in the bins of a range.
pub(super) fn count(values: &[f32], range: Range, counts: &mut [u32]) {
    let (low, scale) = (range.low, range.scale(counts.len()));
    let last = counts.len() - 1;
    for &v in values {
        // A negative number becomes 0.
        let bin = ((v - low) * scale) as u32 as usize;
        counts[bin.min(last)] += 1;
    }
}

/// A histogram, even within its bins.
#[derive(Debug, Clone)]
pub(super) struct Distribution {
    range: Range,
    /// Values below each edge of the bins.
    below: Vec<u64>,
}

impl Distribution {
    pub fn new(range: Range, counts: &[u32]) -> Self {
        let mut total = 0;
        let sums = counts.iter().map(|&n| {
            total += u64::from(n);
            total
        });
        let below = std::iter::once(0).chain(sums).collect();
        Self { range, below }
    }

    /// Of values.
    pub fn of(values: &[f32]) -> Self {
        let range = Range::of(values);
        let mut counts = vec![0; bins_for(values.len())];
        count(values, range, &mut counts);
        Self::new(range, &counts)
    }

    /// Standard deviation, of values in the middle of their bins.
    pub fn deviation(&self) -> f64 {
        let n = self.total().max(1) as f64;
        let (mut sum, mut square) = (0.0, 0.0);
        for (bin, below) in self.below.windows(2).enumerate() {
            let (share, value) = ((below[1] - below[0]) as f64 / n, bin as f64 + 0.5);
            sum += share * value;
            square += share * value * value;
        }
        (square - sum * sum).max(0.0).sqrt() * self.width()
    }

    /// The end of the bin up to which this share of the values lies.
    pub fn quantile(&self, share: f64) -> f64 {
        let rank = (share * self.total() as f64) as u64;
        self.value(self.below.partition_point(|&n| n <= rank).min(self.bins()) as f64)
    }

    fn total(&self) -> u64 {
        self.below[self.bins()]
    }

    fn bins(&self) -> usize {
        self.below.len() - 1
    }

    fn width(&self) -> f64 {
        (f64::from(self.range.high) - f64::from(self.range.low)) / self.bins() as f64
    }

    /// Value at a place in bins.
    fn value(&self, place: f64) -> f64 {
        f64::from(self.range.low) + place * self.width()
    }
}

/// What to add to a value of one distribution to make it the value of the same rank of another.
///
/// Linear within each bin: a start and a slope for each.
#[derive(Debug, Clone)]
pub(super) struct Correction {
    low: f32,
    scale: f32,
    table: Vec<[f32; 2]>,
}

impl Correction {
    pub fn new(from: &Distribution, to: &Distribution) -> Self {
        let ratio = to.total() as f64 / from.total().max(1) as f64;
        let mut table = vec![[0.0; 2]; from.bins()];
        let last = to.bins() - 1;
        // The bin of the target in which the rank lies.
        let mut bin = 0;
        let rank_in = |bin: usize, rank: f64| {
            let (low, high) = (to.below[bin] as f64, to.below[bin + 1] as f64);
            bin as f64 + if high > low { ((rank - low) / (high - low)).min(1.0) } else { 1.0 }
        };
        for (i, (entry, below)) in table.iter_mut().zip(from.below.windows(2)).enumerate() {
            if below[0] == below[1] {
                continue;
            }
            let ranks = [below[0], below[1]].map(|n| n as f64 * ratio);
            // A rank on a step of several values is the last of them as a bin's start, …
            while bin < last && to.below[bin + 1] as f64 <= ranks[0] {
                bin += 1;
            }
            let start = to.value(rank_in(bin, ranks[0]));
            // … and the first of them as its end.
            while bin < last && (to.below[bin + 1] as f64) < ranks[1] {
                bin += 1;
            }
            let end = to.value(rank_in(bin, ranks[1]));
            *entry = [start - from.value(i as f64), end - start - from.width()].map(|v| v as f32);
        }
        let scale = from.range.scale(from.bins());
        if scale == 0.0 {
            // One value, in the first bin: it becomes the median.
            let middle = to.below.partition_point(|&n| 2 * n < to.total()).clamp(1, to.bins()) - 1;
            let median = to.value(rank_in(middle, to.total() as f64 / 2.0));
            table[0] = [(median - f64::from(from.range.low)) as f32, 0.0];
        }
        Self { low: from.range.low, scale, table }
    }

    /// Replaces values by what is to be added to them.
    pub fn apply(&self, values: &mut [f32]) {
        let last = self.table.len() - 1;
        for v in values {
            let place = (*v - self.low) * self.scale;
            let bin = (place as u32 as usize).min(last);
            let [start, slope] = self.table[bin];
            *v = start + (place - bin as f32) * slope;
        }
    }
}
