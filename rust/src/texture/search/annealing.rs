//! Random choice among candidates, less and less of it.

/// Values of the Gumbel law that are told apart: enough that the best of ten candidates is chosen
/// about as often as by the law itself, few enough that ten of them need one random number.
const LEVELS: usize = 64;

/// Bits that pick one of the levels.
const BITS: usize = LEVELS.ilog2() as usize;

/// What the costs of candidates are lowered by, at random.
///
/// The least of costs lowered by independent Gumbel numbers times T belongs to a candidate with a
/// chance in proportion to exp(−cost / T): simulated annealing (Kirkpatrick et al. 1983), in one pass.
pub struct Heat([f32; LEVELS]);

impl Heat {
    /// At a temperature in squared descriptor units.
    pub fn new(temperature: f32) -> Self {
        Self(std::array::from_fn(|i| {
            let share = (i as f32 + 0.5) / LEVELS as f32;
            -temperature * (-share.ln()).ln()
        }))
    }

    /// What the cost of a candidate, one of ten, is lowered by; `bits` are those of its site.
    #[inline(always)]
    pub(super) fn discount(&self, bits: u64, candidate: usize) -> f32 {
        self.0[(bits >> (BITS * candidate)) as usize % LEVELS]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Key;

    #[test]
    fn candidates_are_chosen_as_their_costs_say() {
        let (temperature, costs) = (5.0, [0.0, 2.0, 9.0f32]);
        let heat = Heat::new(temperature);
        let mut chosen = [0.0f32; 3];
        for site in 0..100_000 {
            let bits = Key::new(4).bits(site);
            let lowered = |c: usize| costs[c] - heat.discount(bits, 3 * c);
            let best = (1..3).fold(0, |best, c| if lowered(c) < lowered(best) { c } else { best });
            chosen[best] += 1e-5;
        }
        let weights = costs.map(|cost| (-cost / temperature).exp());
        let sum: f32 = weights.iter().sum();
        for (share, weight) in chosen.iter().zip(weights) {
            assert!((share - weight / sum).abs() < 0.02, "{chosen:?}");
        }
    }

    #[test]
    fn nothing_is_lowered_at_the_temperature_zero() {
        let heat = Heat::new(0.0);
        assert!((0..10).all(|c| heat.discount(0x0123_4567_89AB_CDEF, c) == 0.0));
    }
}
