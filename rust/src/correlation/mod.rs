//! Statistics of where a phase lies: two-point correlations, runs along the axes, local porosity,
//! and how far blocks are copied.

pub mod block_match;
pub mod cluster;
mod lags;
pub mod local_porosity;
pub mod runs;
pub mod two_point;
