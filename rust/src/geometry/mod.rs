//! Distances.

pub mod distance;

pub use distance::{capped_distance, signed_distance};
