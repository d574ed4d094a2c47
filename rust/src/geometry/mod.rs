//! Distances.

pub mod distance;

pub use distance::{distance_transform, signed_distance};
