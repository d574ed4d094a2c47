//! Sorting by digits, for values that fit into the cache.

/// Most bits of a digit: its counts fill half of the innermost cache.
const DIGIT: u32 = 11;
/// Fewer values than this sort faster by comparison.
const FEW: usize = 256;

/// Sorts by an integer; values of the same integer keep their order. `spare` is memory to work in.
pub(super) fn radix_sort<T: Copy>(values: &mut [T], spare: &mut Vec<T>, key: impl Fn(T) -> u64) {
    if values.len() < FEW {
        values.sort_by_key(|&value| key(value));
        return;
    }
    // Only the bits in which the values differ.
    let (all, any) = values.iter().fold((u64::MAX, 0), |(all, any), &value| {
        let key = key(value);
        (all & key, any | key)
    });
    let different = all ^ any;
    if different == 0 {
        return;
    }
    let low = different.trailing_zeros();
    let width = u64::BITS - different.leading_zeros() - low;
    let passes = width.div_ceil(DIGIT);
    let digit = width.div_ceil(passes);
    spare.clear();
    spare.extend_from_slice(values);
    let (mut from, mut to) = (values, spare.as_mut_slice());
    for pass in 0..passes {
        let shift = low + pass * digit;
        let of = |value: T| (key(value) >> shift) as usize & ((1 << digit) - 1);
        let mut next = [0u32; 1 << DIGIT];
        for &value in from.iter() {
            next[of(value)] += 1;
        }
        let mut before = 0;
        for count in &mut next {
            before += std::mem::replace(count, before);
        }
        for &value in from.iter() {
            let at = &mut next[of(value)];
            to[*at as usize] = value;
            *at += 1;
        }
        (from, to) = (to, from);
    }
    if passes % 2 == 1 {
        to.copy_from_slice(from);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Key;

    #[test]
    fn sorts_as_a_stable_sort_does() {
        for n in [0, 1, 255, 256, 5000] {
            for bits in [0, 1, 5, 11, 12, 23, 64] {
                let number = |i| if bits == 0 { 7 } else { Key::new(bits).bits(i) >> (64 - bits) };
                let mut found: Vec<(u64, u64)> = (0..n).map(|i| (number(i), i)).collect();
                let mut expected = found.clone();
                expected.sort_by_key(|pair| pair.0);
                radix_sort(&mut found, &mut Vec::new(), |pair| pair.0);
                assert!(found == expected, "{n} values of {bits} bits");
            }
        }
    }
}
