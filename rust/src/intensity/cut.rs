//! Cuts that reproduce a wanted phase fraction to the voxel.

use rayon::prelude::*;

use super::histogram::ordered_bits;
use crate::rng::Key;

/// Marks the `wanted` voxels with the largest values among those that `free` selects (all without
/// it); ties fall by a position-keyed random number. `wanted` above the number of free voxels marks
/// them all. Memory: 1 byte a voxel.
pub fn cut_solid(values: &[f32], wanted: usize, free: Option<&[bool]>, key: Key) -> Vec<bool> {
    let is_free = |i: usize| free.is_none_or(|f| f[i]);
    // The threshold is found in two histograms: the upper 16 bits of the values, then the lower.
    let count = |select: &(dyn Fn(u32) -> Option<usize> + Sync)| {
        values
            .par_chunks(1 << 18)
            .enumerate()
            .map(|(c, chunk)| {
                let mut counts = vec![0usize; 1 << 16];
                for (i, &v) in chunk.iter().enumerate() {
                    if is_free((c << 18) + i)
                        && let Some(bin) = select(ordered_bits(v))
                    {
                        counts[bin] += 1;
                    }
                }
                counts
            })
            .reduce(
                || vec![0; 1 << 16],
                |mut a, b| {
                    a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
                    a
                },
            )
    };
    let upper = count(&|b| Some((b >> 16) as usize));
    let Some((high, left)) = bin_of_rank(&upper, wanted) else {
        return (0..values.len()).map(is_free).collect();
    };
    let lower = count(&|b| (b >> 16 == high).then_some((b & 0xFFFF) as usize));
    let Some((low, left)) = bin_of_rank(&lower, left) else {
        return (0..values.len()).map(is_free).collect();
    };
    let threshold = high << 16 | low;
    let mut solid: Vec<bool> = values
        .par_iter()
        .enumerate()
        .map(|(i, &v)| is_free(i) && ordered_bits(v) > threshold)
        .collect();
    let mut ties: Vec<(u64, usize)> = (0..values.len())
        .into_par_iter()
        .filter(|&i| is_free(i) && ordered_bits(values[i]) == threshold)
        .map(|i| (key.bits(i as u64), i))
        .collect();
    ties.par_sort_unstable();
    for &(_, i) in &ties[..left.min(ties.len())] {
        solid[i] = true;
    }
    solid
}

/// The bin, counted from the top, in which the `wanted`-th value lies, and how many of that bin are
/// wanted. None if there are not so many values.
fn bin_of_rank(counts: &[usize], wanted: usize) -> Option<(u32, usize)> {
    let mut left = wanted;
    for (bin, &n) in counts.iter().enumerate().rev() {
        if left < n {
            return Some((bin as u32, left));
        }
        left -= n;
    }
    None
}

/// Gives each voxel the phase whose score is largest, with exactly `wanted[k]` voxels of phase `k`.
///
/// `scores` holds one volume a phase, one after the other; `wanted` must sum to the number of free
/// voxels. A bias a phase brings the counts near, then the least decided voxels change sides.
/// Voxels that are not free get phase 0. Memory: 1 byte a voxel, and 16 for each voxel that changes.
pub fn cut_phases(scores: &[f32], wanted: &[usize], free: Option<&[bool]>, key: Key) -> Vec<u8> {
    let n = scores.len() / wanted.len().max(1);
    let is_free = |i: usize| free.is_none_or(|f| f[i]);
    let mut bias = vec![0.0f32; wanted.len()];
    let best = |i: usize, bias: &[f32]| {
        let mut top = (f32::NEG_INFINITY, 0u8);
        for (k, &b) in bias.iter().enumerate() {
            let score = scores[k * n + i] + b;
            if score > top.0 {
                top = (score, k as u8);
            }
        }
        top.1
    };
    let mut phases = vec![0u8; n];
    let mut counts = vec![0usize; wanted.len()];
    let mut step = 32.0f32;
    for _ in 0..40 {
        phases.par_iter_mut().enumerate().for_each(|(i, p)| *p = best(i, &bias));
        counts.fill(0);
        phases
            .iter()
            .enumerate()
            .filter(|(i, _)| is_free(*i))
            .for_each(|(_, &p)| counts[usize::from(p)] += 1);
        if counts == wanted {
            break;
        }
        for ((b, &c), &w) in bias.iter_mut().zip(&counts).zip(wanted) {
            *b += step * (w as f32 - c as f32).signum() * f32::from(u8::from(w != c));
        }
        step *= 0.8;
    }
    // Exact: voxels of phases in surplus move to phases in need, the cheapest first.
    for to in 0..wanted.len() {
        if counts[to] >= wanted[to] {
            continue;
        }
        let mut moves: Vec<(u32, u64, usize)> = (0..n)
            .into_par_iter()
            .filter(|&i| {
                is_free(i) && counts[usize::from(phases[i])] > wanted[usize::from(phases[i])]
            })
            .map(|i| {
                let from = usize::from(phases[i]);
                let loss = scores[from * n + i] + bias[from] - scores[to * n + i] - bias[to];
                (ordered_bits(loss), key.bits(i as u64), i)
            })
            .collect();
        moves.par_sort_unstable();
        for (_, _, i) in moves {
            let from = usize::from(phases[i]);
            if counts[to] == wanted[to] {
                break;
            }
            if counts[from] > wanted[from] {
                counts[from] -= 1;
                counts[to] += 1;
                phases[i] = to as u8;
            }
        }
    }
    phases.par_iter_mut().enumerate().for_each(|(i, p)| *p = if is_free(i) { *p } else { 0 });
    phases
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(seed: u64, n: usize) -> Vec<f32> {
        (0..n as u64).map(|i| Key::new(seed).unit(i) - 0.5).collect()
    }

    #[test]
    fn the_largest_values_are_solid() {
        let values = noise(1, 5000);
        let mut sorted = values.clone();
        sorted.sort_by(f32::total_cmp);
        for wanted in [0, 1, 2500, 4999, 5000, 6000] {
            let solid = cut_solid(&values, wanted, None, Key::new(0));
            assert_eq!(solid.iter().filter(|&&s| s).count(), wanted.min(5000));
            if (1..5000).contains(&wanted) {
                let threshold = sorted[5000 - wanted];
                assert!(values.iter().zip(&solid).all(|(&v, &s)| s == (v >= threshold)));
            }
        }
    }

    #[test]
    fn ties_are_broken_reproducibly_and_only_free_voxels_are_cut() {
        let values = vec![1.0; 999];
        let free: Vec<bool> = (0..999).map(|i| i % 3 == 0).collect();
        let first = cut_solid(&values, 100, Some(&free), Key::new(4));
        assert_eq!(first.iter().filter(|&&s| s).count(), 100);
        assert!(first.iter().zip(&free).all(|(s, f)| !s || *f));
        assert_eq!(first, cut_solid(&values, 100, Some(&free), Key::new(4)));
        assert_ne!(first, cut_solid(&values, 100, Some(&free), Key::new(5)));
        assert!(cut_solid(&[], 3, None, Key::new(0)).is_empty());
    }

    #[test]
    fn phases_have_exactly_the_wanted_counts() {
        for (scores, wanted) in [
            (noise(2, 3000), vec![100usize, 850, 50]),
            (vec![0.0; 3000], vec![0, 1, 999]),
            (noise(3, 3000), vec![1000, 0, 0]),
        ] {
            let phases = cut_phases(&scores, &wanted, None, Key::new(1));
            let mut counts = vec![0; 3];
            for &p in &phases {
                counts[usize::from(p)] += 1;
            }
            assert_eq!(counts, wanted);
        }
    }

    #[test]
    fn the_clear_winner_keeps_its_voxel() {
        // Two phases with mirrored scores are the two-phase cut.
        let x = noise(5, 2000);
        let scores: Vec<f32> = x.iter().map(|v| -v).chain(x.iter().copied()).collect();
        let phases = cut_phases(&scores, &[700, 1300], None, Key::new(1));
        let solid = cut_solid(&x, 1300, None, Key::new(1));
        assert!(phases.iter().zip(&solid).all(|(&p, &s)| (p == 1) == s));
    }
}
