//! Distances and thickness.

pub mod distance;
pub mod thickness;

pub use distance::{distance_transform, signed_distance};
pub use thickness::local_thickness;
