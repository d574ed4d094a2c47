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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::monitor::Monitor;
    use crate::rng::Key;
    use crate::texture::lattice::Lattice;
    use crate::texture::match_map::Match;
    use crate::texture::symmetry::Symmetry;
    use crate::volume::Boundary;

    /// Half of the voxels dark, half bright.
    fn exemplar() -> Field {
        let data = (0..64).map(|i| if i < 32 { 0.0 } else { 255.0 }).collect();
        Field::new([4, 4, 4], 1, data).unwrap()
    }

    #[test]
    fn values_in_excess_weigh_less() {
        let own = exemplar();
        assert_eq!(of_values(&own, &own), vec![1.0; 64]);
        let bright = Field::new([2, 2, 2], 1, vec![255.0; 8]).unwrap();
        let factors = of_values(&own, &bright);
        // Bright values are twice as common as they should be, dark ones less.
        assert_eq!(factors[..32], [1.0; 32]);
        assert_eq!(factors[32..], [0.5; 32]);
        let constant = Field::new([1, 1, 2], 1, vec![7.0; 2]).unwrap();
        assert_eq!(of_values(&constant, &constant), [1.0; 2]);
    }

    #[test]
    fn voxels_that_are_used_too_often_weigh_less() {
        let own = exemplar();
        let one = Symmetry::None.orientations(None);
        let (key, silent) = (Key::new(0), Monitor::silent());
        let set = Neighbourhoods::new(&own, [2; 3], &one, (8, 1.0), key, &silent).unwrap();
        let lattice = Lattice::new([4; 3], [2; 3], [2; 3], [0; 3], Boundary::Open);
        let corner = Match { orientation: 0, origin: [0; 3] };
        let mut matches = vec![corner; 8];
        let map = MatchMap { lattice: lattice.clone(), matches: matches.clone() };
        let factors = of_places(&set, &map);
        // 64 uses of 64 voxels are one each; the eight of the corner have all.
        for (i, factor) in factors.iter().enumerate() {
            let used = position([4; 3], i).iter().all(|&n| n < 2);
            let wanted: f32 = if used { 1.0 / 8.0 } else { 1.0 };
            assert_eq!(factor.to_bits(), wanted.to_bits());
        }
        // Sites without a match do not count.
        matches[0] = Match::NONE;
        let fewer = of_places(&set, &MatchMap { lattice, matches });
        assert_eq!(fewer, factors);
    }
}
