//! The diagonal of the viscous operator, which only walls and borders make another than that of the
//! open pore.

use rayon::prelude::*;

use super::lines::{HALF, every_other};
use super::places::Places;
use crate::bits::{WORD, ones};
use crate::error::Result;
use crate::monitor::Monitor;
use crate::transport::vectors::{CHUNK, in_order};

/// Rows that one thread handles at a time.
const ROWS: usize = 256;

/// Diagonals for the velocities along an axis.
pub(super) struct Diagonals {
    axis: usize,
    /// That of a velocity with velocities all around.
    inside: f32,
    /// The number of the first exposed velocity of each line, of the even places of a row and the odd ones.
    firsts: Vec<u32>,
    /// Which of the values each of these has.
    codes: Vec<u16>,
    /// The values that there are; not rounded, for between wide walls a rounding is felt.
    values: Vec<f32>,
}

impl Diagonals {
    /// Memory: 2 bytes a velocity beside a wall.
    pub fn new(
        places: &Places<'_>,
        axis: usize,
        weights: [f32; 3],
        monitor: &Monitor<'_>,
    ) -> Result<Self> {
        let inside: f32 = weights.iter().flat_map(|&w| [w, w]).sum();
        let of_rows = |part: usize| {
            monitor.check()?;
            let (mut values, mut ends) = (Vec::new(), Vec::new());
            for row in part * ROWS..((part + 1) * ROWS).min(places.rows()) {
                let exposed = places.exposed(row, axis);
                for odd in 0..2 {
                    for word in 0..places.words(row).len() {
                        for bit in ones(every_other(exposed.word(word) >> odd).into()) {
                            let x = WORD * word + 2 * bit as usize + odd;
                            values.push(places.viscous_diagonal([row, x], axis, weights));
                        }
                    }
                    ends.push(values.len() as u32);
                }
            }
            Ok((values, ends))
        };
        let (mut firsts, mut each) = (vec![0], Vec::new());
        in_order(places.rows().div_ceil(ROWS), of_rows, |(own, ends)| {
            let before = each.len() as u32;
            firsts.extend(ends.into_iter().map(|end| before + end));
            each.extend(own);
        })?;
        firsts.shrink_to_fit();
        let parts = each.par_chunks(CHUNK).flat_map_iter(|part| distinct(part.to_vec()));
        let values = distinct(parts.collect());
        let codes = each.par_iter().map(|&value| code(&values, value)).collect();
        Ok(Self { axis, inside, firsts, codes, values })
    }

    /// Writes those of a line, 0 where there is no velocity.
    #[inline(always)]
    pub fn write(&self, places: &Places<'_>, row: usize, odd: bool, out: &mut [f32]) {
        let exposed = places.exposed(row, self.axis);
        let mut code = self.firsts[2 * row + usize::from(odd)] as usize;
        for (word, out) in out.chunks_mut(HALF).enumerate() {
            let own = every_other(exposed.owners.word(word) >> u32::from(odd));
            let others = every_other(exposed.word(word) >> u32::from(odd));
            if own == u32::MAX && others == 0 {
                out.fill(self.inside);
                continue;
            }
            for (i, out) in out.iter_mut().enumerate() {
                *out = if own & (1 << i as u32) == 0 { 0.0 } else { self.inside };
            }
            for bit in ones(others.into()) {
                out[bit as usize] = self.values[usize::from(self.codes[code])];
                code += 1;
            }
        }
    }
}

/// The different ones of some values, in order.
fn distinct(mut values: Vec<f32>) -> Vec<f32> {
    values.par_sort_unstable_by(f32::total_cmp);
    values.dedup();
    // More than 16 bits can tell have never been seen; they would lie so close that one nearby will do.
    let apart = values.len().div_ceil(usize::from(u16::MAX) + 1).max(1);
    values.into_iter().step_by(apart).collect()
}

/// Which of some values, in order, one of them is, or which is the next below.
fn code(values: &[f32], value: f32) -> u16 {
    (values.partition_point(|&known| known <= value) - 1) as u16
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::stokes::lines::Lines;
    use crate::transport::stokes::tests::spaces;

    #[test]
    fn lines_have_the_diagonals_of_their_velocities() {
        for space in spaces() {
            let lines = Lines::new(&space);
            let weights = [4.0, 1.0, 0.25];
            for axis in 0..3 {
                let diagonals =
                    Diagonals::new(&lines.places, axis, weights, &Monitor::silent()).unwrap();
                for (row, odd) in (0..lines.places.rows()).flat_map(|row| [(row, 0), (row, 1)]) {
                    let mut found = vec![f32::NAN; lines.length];
                    diagonals.write(&lines.places, row, odd == 1, &mut found);
                    let owners = lines.places.owners(row, axis);
                    for (i, found) in found.into_iter().enumerate() {
                        let x = 2 * i + odd;
                        let owner =
                            x < space.shape[2] && owners.word(x / WORD) >> (x % WORD) & 1 == 1;
                        let expected = || lines.places.viscous_diagonal([row, x], axis, weights);
                        let expected = if owner { expected() } else { 0.0 };
                        assert_eq!(found.to_bits(), expected.to_bits());
                        if x < space.shape[2] {
                            let node = lines.places.has_node([row, x]);
                            assert_eq!(owner, node && lines.places.has_velocity([row, x], axis));
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn too_many_values_leave_near_ones() {
        let known = distinct((0..200_000).map(|i| 1.0 + i as f32 * 1e-5).collect());
        assert!(known.len() <= 1 << 16);
        for value in [1.0, 1.234_56, 2.0, 2.999_99] {
            let nearest = known[usize::from(code(&known, value))];
            assert!((nearest - value).abs() < 4e-5);
        }
    }
}
