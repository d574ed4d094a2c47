//! Rows with and without the solid.

use crate::bits::{WORD, take_run};

/// Writes values to the places whose bits are set, and zeros to the others.
#[inline(always)]
pub(super) fn spread(words: &[u64], values: &[f32], places: &mut [f32]) {
    let mut values = values;
    for (bits, places) in words.iter().zip(places.chunks_mut(WORD)) {
        places.fill(0.0);
        let mut bits = *bits;
        while bits != 0 {
            let (start, length) = take_run(&mut bits);
            let (run, rest) = values.split_at(length);
            places[start..start + length].copy_from_slice(run);
            values = rest;
        }
    }
}

/// Calls `take(value, place)` for the values and the places whose bits are set, one after the other.
#[inline(always)]
pub(super) fn collect<T>(
    words: &[u64],
    places: &[f32],
    values: &mut [T],
    take: impl Fn(&mut T, f32),
) {
    let mut values = values;
    for (bits, places) in words.iter().zip(places.chunks(WORD)) {
        let mut bits = *bits;
        while bits != 0 {
            let (start, length) = take_run(&mut bits);
            let (run, rest) = std::mem::take(&mut values).split_at_mut(length);
            let places = &places[start..start + length];
            for i in 0..length {
                take(&mut run[i], places[i]);
            }
            values = rest;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_go_to_the_places_of_their_bits_and_back() {
        let words = [0x8000_0000_0000_00f1, u64::MAX, 0, 0b101];
        let places = 3 * WORD + 4;
        let bit = |i: usize| words[i / WORD] >> (i % WORD) & 1 == 1;
        let count = (0..places).filter(|&i| bit(i)).count();
        let values: Vec<f32> = (1..=count).map(|i| i as f32).collect();
        let mut row = vec![7.0; places];
        spread(&words, &values, &mut row);
        let mut next = 0;
        for (i, &found) in row.iter().enumerate() {
            next += usize::from(bit(i));
            assert_eq!(found as usize, if bit(i) { next } else { 0 });
        }
        let mut back = vec![1.0; count];
        collect(&words, &row, &mut back, |value, place| *value += place);
        let expected: Vec<f32> = values.iter().map(|value| value + 1.0).collect();
        assert_eq!(back, expected);
    }
}
