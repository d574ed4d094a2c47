//! Factors on the voxels of the exemplars that even out how often they are used.

use super::field::Field;
use super::match_map::MatchMap;
use super::neighbourhoods::Neighbourhoods;
use super::parameters::Emphasis;
use crate::volume::{position, voxels};

/// Bins of a histogram of values, as in Kopf et al. 2007.
const BINS: usize = 16;

/// The factor of each voxel of an exemplar: 1 where it is used as often as it should be, 1 / n where
/// it is used n times as often. None if nothing is evened out.
pub fn emphasis(
    kind: Emphasis,
    set: &Neighbourhoods<'_>,
    map: &MatchMap,
    output: &Field,
) -> Option<Vec<f32>> {
    match kind {
        Emphasis::None => None,
        Emphasis::Histogram => Some(of_values(set.field(), output)),
        Emphasis::Position => Some(of_places(set, map)),
    }
}

/// 1 / (1 + Σ_c max(0, H_output / H_exemplar − 1)), over the bins that a voxel's channels fall into.
fn of_values(exemplar: &Field, output: &Field) -> Vec<f32> {
    let mut excess = vec![0.0f32; voxels(exemplar.shape())];
    for c in 0..exemplar.channels() {
        let own = exemplar.channel(c);
        let (low, high) =
            own.iter().fold((f32::MAX, f32::MIN), |(low, high), &v| (low.min(v), high.max(v)));
        let scale = if high > low { BINS as f32 / (high - low) } else { 0.0 };
        let bin = |v: f32| (((v - low) * scale).max(0.0) as usize).min(BINS - 1);
        let shares = |values: &[f32]| {
            let mut counts = [0u32; BINS];
            for &v in values {
                counts[bin(v)] += 1;
            }
            counts.map(|n| n as f32 / values.len() as f32)
        };
        let (wanted, present) = (shares(own), shares(output.channel(c)));
        for (sum, &v) in excess.iter_mut().zip(own) {
            *sum += (present[bin(v)] / wanted[bin(v)] - 1.0).max(0.0);
        }
    }
    excess.iter().map(|e| 1.0 / (1.0 + e)).collect()
}

/// 1 / (1 + max(0, uses / mean uses − 1)), with the uses of a voxel by the windows of the output.
fn of_places(set: &Neighbourhoods<'_>, map: &MatchMap) -> Vec<f32> {
    let mut uses = vec![0u32; voxels(set.field().shape())];
    let window = set.window();
    let mut total = 0u64;
    let mut origins = vec![0u32; set.len()];
    for m in map.matches.iter().filter(|m| m.is_some()) {
        origins[set.index(*m)] += 1;
    }
    for (at, &count) in origins.iter().enumerate().filter(|(_, n)| **n > 0) {
        let m = set.match_at(at);
        let origin = m.origin.map(usize::from);
        for i in 0..voxels(window) {
            let [z, y, x] = position(window, i);
            uses[set.view(m).index([origin[0] + z, origin[1] + y, origin[2] + x])] += count;
            total += u64::from(count);
        }
    }
    let mean = (total as f32 / uses.len() as f32).max(f32::MIN_POSITIVE);
    uses.iter().map(|&n| 1.0 / (1.0 + (n as f32 / mean - 1.0).max(0.0))).collect()
}
