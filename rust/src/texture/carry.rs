//! The exemplar's own values, brought to the output through the match map.

use rayon::prelude::*;

use super::blend::{Mixing, Part, Source, blend};
use super::field::Field;
use super::lattice::Lattice;
use super::match_map::MatchMap;
use crate::error::Result;
use crate::monitor::Monitor;
use crate::rng::Key;
use crate::volume::{Boundary, voxels};

/// One site in this many leads a cell of its own.
const SITES_PER_CELL: usize = 16;

/// Half the edge, in voxels, of the cube that a leading site may fill.
const REACH: usize = 6;

/// Price, in squared voxels of distance, of a squared level of disagreement between the output's field
/// and the exemplar's.
const DISAGREEMENT: f32 = 0.02;

/// Price, in squared voxels, of a value from a site that leads no cell.
const FALLBACK: f32 = 30.0;

/// Share of the mean over all windows in the result. Copies alone come out 8–11 % too sharp, for their
/// cells have borders, the mean alone 8–10 % too smooth; in between bone and cement both have the
/// gradient of their exemplar within 2 %.
const SOFTNESS: f32 = 0.4;

/// Planes a task fills: a site may fill 12, and is looked at again by each task that it meets.
const SLAB: usize = 16;

/// For each voxel the values of `values` at a place of the exemplar that fits there.
///
/// Values are mostly copied, not averaged, so that sharpness and noise stay the exemplar's. A copied
/// noise texture must not change its source at every lattice cell, or the cells show: a random few of
/// the sites lead irregular cells of five voxels or so, which they fill as far as their place in the
/// exemplar agrees with the output's field; elsewhere the nearest window that agrees steps in.
/// Memory: 4 bytes a voxel, and 8 a channel.
///
/// # Errors
/// If the caller cancels.
pub fn carry(
    source: &Source<'_>,
    output: &Field,
    values: &Field,
    map: &MatchMap,
    key: Key,
    monitor: &Monitor<'_>,
) -> Result<Field> {
    let shape = map.lattice.shape;
    let plane = shape[1] * shape[2];
    let mut places = vec![0u32; voxels(shape)];
    places.par_chunks_mut(SLAB * plane).enumerate().try_for_each(|(i, places)| {
        monitor.check()?;
        Cells { source, output, map, key, first: i * SLAB }.fill(places);
        Ok(())
    })?;
    let mut out = Field::zeros(shape, values.channels());
    for c in 0..values.channels() {
        let from = values.channel(c);
        out.channel_mut(c).par_iter_mut().zip(&places).for_each(|(v, &p)| *v = from[p as usize]);
    }
    let carried = Source { field: values, emphasis: None, laplacian: None, views: source.views };
    let weights = vec![1.0; map.matches.len()];
    let mut mean = out.clone();
    let parts = [Part { source: &carried, map, weights: &weights }];
    blend(&parts, Mixing::MEAN, &mut mean, monitor)?;
    for c in 0..values.channels() {
        let smooth = mean.channel(c);
        out.channel_mut(c).par_iter_mut().zip(smooth).for_each(|(v, m)| *v += SOFTNESS * (m - *v));
    }
    Ok(out)
}

/// The search for places in some planes of the output.
struct Cells<'a> {
    source: &'a Source<'a>,
    output: &'a Field,
    map: &'a MatchMap,
    key: Key,
    first: usize,
}

impl Cells<'_> {
    fn fill(&self, places: &mut [u32]) {
        let [sz, sy, sx] = self.map.lattice.sites();
        let mut scores = vec![f32::INFINITY; places.len()];
        let voxels = places.len();
        for z in (0..sz).filter(|&z| self.may_meet(z, voxels)) {
            for site in z * sy * sx..(z + 1) * sy * sx {
                if self.map.matches[site].is_some() {
                    let leads = self.key.below(site as u64, SITES_PER_CELL) == 0;
                    let at = [z, site / sx % sy, site % sx];
                    self.offer(site, at, leads, &mut scores, places);
                }
            }
        }
    }

    /// Whether sites of a layer may offer something to so many voxels.
    fn may_meet(&self, layer: usize, voxels: usize) -> bool {
        let Lattice { shape: [nz, ny, nx], window, origins, .. } = &self.map.lattice;
        let planes = self.first..self.first + voxels / (ny * nx);
        let (first, count) = (origins[0][layer] + nz - REACH.min(*nz), window[0] + 2 * REACH);
        (first..first + count).any(|z| planes.contains(&(z % nz)))
    }

    /// Offers the voxels round a site the exemplar's values round its match.
    fn offer(
        &self,
        site: usize,
        at: [usize; 3],
        leads: bool,
        scores: &mut [f32],
        places: &mut [u32],
    ) {
        let lattice = &self.map.lattice;
        let [_, ny, nx] = lattice.shape;
        let planes = places.len() / (ny * nx);
        let m = self.map.matches[site];
        let view = &self.source.views[usize::from(m.orientation)];
        let price = if leads { 0.0 } else { FALLBACK };
        // Along each axis: output coordinate, exemplar coordinate, squared distance from the centre.
        let axes: [Vec<(usize, usize, f32)>; 3] = std::array::from_fn(|a| {
            let (n, window) = (lattice.shape[a] as i32, lattice.window[a] as i32);
            let (centre, reach) = (window / 2, REACH as i32);
            let range = if leads { centre - reach..centre + reach } else { 0..window };
            range
                .filter_map(|d| {
                    let to = lattice.origins[a][at[a]] as i32 + d;
                    let from = i32::from(m.origin[a]) + d;
                    let inside = lattice.boundary == Boundary::Periodic || (0..n).contains(&to);
                    let off = d as f32 - (window as f32 - 1.0) / 2.0;
                    (inside && (0..view.shape[a] as i32).contains(&from))
                        .then(|| (to.rem_euclid(n) as usize, from as usize, off * off))
                })
                .collect()
        });
        for &(z, fz, dz) in &axes[0] {
            if !(self.first..self.first + planes).contains(&z) {
                continue;
            }
            for &(y, fy, dy) in &axes[1] {
                let row = ((z - self.first) * ny + y) * nx;
                let full = (z * ny + y) * nx;
                for &(x, fx, dx) in &axes[2] {
                    let mut score = price + dz + dy + dx;
                    if score >= scores[row + x] {
                        continue;
                    }
                    let place = view.index([fz, fy, fx]);
                    for c in 0..self.output.channels() {
                        let off =
                            self.output.channel(c)[full + x] - self.source.field.channel(c)[place];
                        score += DISAGREEMENT * off * off;
                    }
                    if score < scores[row + x] {
                        scores[row + x] = score;
                        places[row + x] = place as u32;
                    }
                }
            }
        }
    }
}
