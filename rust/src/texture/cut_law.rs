//! What a cut makes of the covariance of a Gaussian field: the arcsine law, for any share.

use std::f64::consts::{PI, TAU};

/// Steps of the angle whose sine is the correlation: covariances are then exact to 10⁻⁶.
const STEPS: usize = 2048;

/// Halvings of the range in which the squared level of the cut is sought.
const HALVINGS: usize = 60;

/// The largest squared level: shares beyond are less than 10⁻¹⁴.
const HIGHEST: f64 = 60.0;

/// Covariance of the two phases that a standard normal field is cut into, by the field's correlation.
///
/// With t the level of the cut, the covariance grows by exp(−t²/(1 + sin θ))/2π per angle θ, of which
/// the correlation is the sine.
pub(super) struct CutLaw {
    /// Covariances at even steps of the angle, from −π/2 to π/2.
    covariances: Vec<f64>,
}

impl CutLaw {
    /// Of a cut with this share on one side, inside (0, 1).
    pub fn new(share: f64) -> Self {
        let variance = share * (1.0 - share);
        // The share decides the level, for a field is correlated with itself by 1.
        let (mut low, mut high) = (0.0, HIGHEST);
        for _ in 0..HALVINGS {
            let middle = f64::midpoint(low, high);
            let found: f64 = (STEPS / 2..STEPS).map(|i| growth(middle, i)).sum();
            if found > variance { low = middle } else { high = middle }
        }
        let mut covariances = vec![0.0; STEPS + 1];
        for i in 0..STEPS {
            covariances[i + 1] = covariances[i] + growth(low, i);
        }
        let none = covariances[STEPS / 2];
        for c in &mut covariances {
            *c -= none;
        }
        Self { covariances }
    }

    /// The correlation at which the phases have this covariance; the nearest if there is none.
    pub fn correlation(&self, covariance: f64) -> f64 {
        let above = self.covariances.partition_point(|c| *c < covariance).clamp(1, STEPS);
        let [low, high] = [above - 1, above].map(|i| self.covariances[i]);
        let beyond =
            if high > low { ((covariance - low) / (high - low)).clamp(0.0, 1.0) } else { 0.0 };
        angle(above as f64 - 1.0 + beyond).sin()
    }
}

fn angle(step: f64) -> f64 {
    PI * (step / STEPS as f64 - 0.5)
}

/// What a step of the angle adds to the covariance.
fn growth(squared_level: f64, step: usize) -> f64 {
    let middle = angle(step as f64 + 0.5).sin();
    (-squared_level / (1.0 + middle)).exp() / TAU * PI / STEPS as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_and_half_is_the_arcsine_law() {
        let law = CutLaw::new(0.5);
        for correlation in [-0.9f64, -0.3, 0.0, 0.2, 0.7, 0.99] {
            let covariance = correlation.asin() / TAU;
            assert!((law.correlation(covariance) - correlation).abs() < 1e-6);
        }
    }

    #[test]
    fn a_field_is_correlated_with_itself_and_not_with_another() {
        for share in [0.02, 0.18, 0.5, 0.9] {
            let law = CutLaw::new(share);
            assert!((law.correlation(share * (1.0 - share)) - 1.0).abs() < 1e-3);
            assert!(law.correlation(0.0).abs() < 1e-9);
            assert!(law.correlation(1.0) <= 1.0 && law.correlation(-1.0) >= -1.0);
        }
    }

    #[test]
    fn a_gaussian_field_that_is_cut_has_the_covariance() {
        use crate::rng::Key;
        let (correlation, level, count) = (0.6f64, 0.9f64, 400_000);
        let key = Key::new(1);
        let (mut one, mut both) = (0, 0);
        for i in 0..count {
            let [a, b] = [0, 1].map(|k| f64::from(key.with(k).normal(i)));
            let second = correlation * a + (1.0 - correlation * correlation).sqrt() * b;
            one += usize::from(a > level);
            both += usize::from(a > level && second > level);
        }
        let [share, both] = [one, both].map(|n| n as f64 / count as f64);
        let found = CutLaw::new(share).correlation(both - share * share);
        assert!((found - correlation).abs() < 0.01, "{found}");
    }
}
