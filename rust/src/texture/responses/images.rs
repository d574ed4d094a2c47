//! Responses of the images.

use super::distribution::Distribution;
use super::filters::Filter;
use crate::error::Result;
use crate::monitor::Monitor;
use crate::texture::field::Field;

/// Distribution of the responses of an image to a filter along each direction, at all positions inside
/// the image; those of its symmetric copies too if they count. The filter is turned rather than the
/// image, which need not be square.
pub(super) fn responses(
    image: &Field,
    symmetric: bool,
    filter: &Filter,
    monitor: &Monitor<'_>,
) -> Result<Vec<Distribution>> {
    let [_, ny, nx] = image.shape();
    let variants = if symmetric { filter.symmetric() } else { vec![filter.taps.clone()] };
    let of_direction = |direction: &[f32]| {
        monitor.check()?;
        let mixed = mixed(image, direction);
        let mut responses = Vec::new();
        for taps in &variants {
            append_responses(&mixed, [ny, nx], taps, filter.edge, &mut responses);
        }
        Ok(Distribution::of(&responses))
    };
    filter.directions.chunks_exact(image.channels()).map(of_direction).collect()
}

/// An image along a direction in channel space.
pub(super) fn mixed(image: &Field, direction: &[f32]) -> Vec<f32> {
    let mut out = vec![0.0; image.channel(0).len()];
    for (c, &q) in direction.iter().enumerate() {
        out.iter_mut().zip(image.channel(c)).for_each(|(sum, v)| *sum += q * v);
    }
    out
}

/// Appends the responses at all positions inside an image.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
pub(super) fn append_responses(
    image: &[f32],
    [ny, nx]: [usize; 2],
    taps: &[f32],
    edge: usize,
    responses: &mut Vec<f32>,
) {
    let width = nx + 1 - edge;
    for y in 0..=ny - edge {
        let start = responses.len();
        responses.resize(start + width, 0.0);
        let out = &mut responses[start..];
        for (i, tap) in taps.iter().enumerate() {
            let from = &image[(y + i / edge) * nx + i % edge..][..width];
            for (sum, v) in out.iter_mut().zip(from) {
                *sum += tap * v;
            }
        }
    }
}
