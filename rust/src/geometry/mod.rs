//! Distances, thicknesses, surfaces and directions.

pub mod changes;
pub mod configurations;
pub mod directions;
pub mod distance;
pub mod marching_cubes;
mod packed;
pub mod secants;
pub mod surface;
pub mod thickness;

pub use distance::{distance_transform, signed_distance};
pub use packed::Step;
pub use thickness::local_thickness;
