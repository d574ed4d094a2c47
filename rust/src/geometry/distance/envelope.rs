//! `min over k of f(i + k) + (k·w)²` along one line by the lower envelope of parabolas (Felzenszwalb
//! and Huttenlocher 2012): its cost does not grow with the distance.

use crate::volume::Boundary;

/// The parabolas that reach the envelope, from left to right.
#[derive(Default)]
pub(super) struct Envelope {
    /// Position and height of each one's tip.
    tips: Vec<(f64, f64)>,
    /// Where each takes over from the one before.
    starts: Vec<f64>,
}

impl Envelope {
    /// Replaces a line of squared distances by its minima, at the voxels or half-way to the next.
    pub(super) fn lower(
        &mut self,
        line: &mut [f32],
        size: f64,
        half: bool,
        limit: f32,
        boundary: Boundary,
    ) {
        let n = line.len();
        // A nearest voxel is at most half a period away.
        let around = if boundary == Boundary::Periodic { n / 2 + 1 } else { 0 };
        let scale = size * size;
        self.tips.clear();
        self.starts.clear();
        for place in 0..n + 2 * around {
            let square = line[(place + n * around - around) % n];
            if square < f32::INFINITY {
                self.push(place as f64 - around as f64, f64::from(square) / scale);
            }
        }
        let Some(last) = self.tips.len().checked_sub(1) else {
            line.fill(limit);
            return;
        };
        let mut tip = 0;
        let (first, offset) = (line[0], if half { 0.5 } else { 0.0 });
        for i in 0..n {
            let at = i as f64 + offset;
            while tip < last && self.starts[tip + 1] < at {
                tip += 1;
            }
            let (place, height) = self.tips[tip];
            let mut square = ((at - place).powi(2) + height) * scale;
            if half {
                // Half-way to the next voxel is level with both.
                let next = match boundary {
                    Boundary::Open => line.get(i + 1).copied(),
                    Boundary::Periodic => line.get(i + 1).copied().or(Some(first)),
                };
                square = square.min(f64::from(line[i].min(next.unwrap_or(f32::INFINITY))));
            }
            line[i] = square.min(f64::from(limit)) as f32;
        }
    }

    fn push(&mut self, place: f64, height: f64) {
        let start = loop {
            let Some(&(before, lower)) = self.tips.last() else { break f64::NEG_INFINITY };
            let start = 0.5 * ((height - lower) / (place - before) + place + before);
            // The first parabola starts at minus infinity, so that it is never taken away.
            if self.starts.last().is_some_and(|&s| start <= s) {
                self.tips.pop();
                self.starts.pop();
            } else {
                break start;
            }
        };
        self.tips.push((place, height));
        self.starts.push(start);
    }
}
