//! How the values of images go together over distances.

use super::cut_law::CutLaw;
use super::responses::Target;
use crate::error::Result;
use crate::fourier::{Transform, fast_length};
use crate::monitor::Monitor;
use crate::volume::voxels;

/// Where a field parts two phases: distances and indicators have it between them.
pub(super) const MIDDLE: f32 = 127.5;

/// Whether values lie on both sides of the middle.
pub(super) fn has_both(values: &[f32]) -> bool {
    let above = values.iter().filter(|v| **v > MIDDLE).count();
    0 < above && above < values.len()
}

/// Covariance of one channel of an image with itself, or the correlation of a Gaussian field that has
/// the covariance of the image's cut.
pub(super) struct Covariance {
    pub(super) axis: usize,
    pub(super) weight: f64,
    /// Lags beyond this have none.
    reach: usize,
    /// By lag along rows and columns, from −`reach` to `reach`; empty for a symmetric image.
    map: Vec<f32>,
    /// By length, mean over the directions.
    radial: Vec<f32>,
}

impl Covariance {
    /// Of an image of one or, for its cut, of both phases.
    pub(super) fn new(
        target: &Target<'_>,
        channel: usize,
        cut: bool,
        monitor: &Monitor<'_>,
    ) -> Result<Self> {
        let [_, ny, nx] = target.image.shape();
        let values = target.image.channel(channel);
        let mean = |value: &dyn Fn(f32) -> f64| {
            values.iter().map(|&v| value(v)).sum::<f64>() / values.len() as f64
        };
        let share = mean(&|v| if v > MIDDLE { 1.0 } else { 0.0 });
        let law = cut.then(|| CutLaw::new(share));
        let translated = |covariance: f64| {
            law.as_ref().map_or(covariance, |law| law.correlation(covariance)) as f32
        };
        // A cut is compared by its two-point correlation, which is of pairs that are not centred.
        let (centre, beside) =
            if cut { (0.0, share * share) } else { (mean(&|v| f64::from(v)), 0.0) };
        let reach = 3 * ny.min(nx) / 4;
        let padded = [1, fast_length(ny + reach), fast_length(nx + reach)];
        let mut centred = vec![0.0; voxels(padded)];
        for (to, from) in centred.chunks_exact_mut(padded[2]).zip(values.chunks_exact(nx)) {
            for (to, &from) in to.iter_mut().zip(from) {
                let value = if cut { f32::from(from > MIDDLE) } else { from };
                *to = (f64::from(value) - centre) as f32;
            }
        }
        Transform::new(padded).autocorrelate(&mut centred, monitor)?;
        let edge = 2 * reach + 1;
        let mut map = vec![0.0; edge * edge];
        let mut rings = vec![(0.0, 0.0); reach + 2];
        for (i, out) in map.iter_mut().enumerate() {
            let [dy, dx] = [i / edge, i % edge].map(|k| k as isize - reach as isize);
            let wrap = |d: isize, n: usize| d.rem_euclid(n as isize) as usize;
            let products = centred[wrap(dy, padded[1]) * padded[2] + wrap(dx, padded[2])];
            let pairs = (ny - dy.unsigned_abs()) * (nx - dx.unsigned_abs());
            let covariance = f64::from(products) / pairs as f64 - beside;
            *out = translated(covariance);
            let r = ((dy * dy + dx * dx) as f64).sqrt();
            let ring = r as usize;
            if ring <= reach {
                // Shared between the two nearest rings.
                let beyond = r - ring as f64;
                for (ring, share) in [(ring, 1.0 - beyond), (ring + 1, beyond)] {
                    rings[ring].0 += share * covariance;
                    rings[ring].1 += share;
                }
            }
        }
        let radial = rings.iter().map(|(sum, n)| translated(sum / f64::max(*n, 1e-9))).collect();
        if target.symmetric {
            map.clear();
        }
        let weight = f64::from(target.weight);
        Ok(Self { axis: target.axis, weight, reach, map, radial })
    }

    /// At a lag turned into the plane; 0 from three quarters of the image's edge on.
    pub(super) fn at(&self, lag: [f64; 3], length: f64) -> f64 {
        let reach = self.reach as f64;
        if length >= reach && length > 0.0 {
            return 0.0;
        }
        let [down, along] = [[1, 2], [0, 2], [0, 1]][self.axis].map(|a| lag[a]);
        let in_plane = down.hypot(along);
        let value = if self.map.is_empty() || in_plane < 1e-9 {
            let ring = length as usize;
            let beyond = length - ring as f64;
            let [low, high] = [ring, ring + 1].map(|r| f64::from(self.radial[r]));
            low + beyond * (high - low)
        } else {
            let turned = [down, along].map(|d| d * length / in_plane + reach);
            self.interpolated(turned)
        };
        value * taper(length / reach)
    }

    fn interpolated(&self, [y, x]: [f64; 2]) -> f64 {
        let edge = 2 * self.reach + 1;
        let (row, column) = ((y as usize).min(edge - 2), (x as usize).min(edge - 2));
        let (ty, tx) = (y - row as f64, x - column as f64);
        let line = |row: usize| {
            let [a, b] = [0, 1].map(|i| f64::from(self.map[row * edge + column + i]));
            a + tx * (b - a)
        };
        let (a, b) = (line(row), line(row + 1));
        a + ty * (b - a)
    }
}

/// 1 up to two thirds of the reach, which is half the image's edge, then a cosine down to 0.
fn taper(share: f64) -> f64 {
    let beyond = (3.0 * share - 2.0).clamp(0.0, 1.0);
    f64::midpoint(1.0, (std::f64::consts::PI * beyond).cos())
}
