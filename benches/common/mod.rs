//! Volumes to measure.

use ndarray::Array3;
use poresynth_core::rng::Key;
use poresynth_core::texture::{Field, pyramid};
use poresynth_core::volume::{Boundary, voxels};

/// Smooth noise with features of about 10 voxels, mean 127.5.
pub fn gray(edge: usize, seed: u64) -> Array3<f32> {
    let shape = [edge; 3];
    let noise = (0..voxels(shape) as u64).map(|i| 255.0 * Key::new(seed).unit(i)).collect();
    let noise = Field::new(shape, 1, noise).expect("one value a voxel");
    let smooth = pyramid::gaussian(&noise, 3.0, Boundary::Periodic).into_values();
    Array3::from_shape_vec((edge, edge, edge), smooth).expect("one value a voxel")
}
