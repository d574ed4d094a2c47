//! Gray levels: histogram matching and exact cuts.

pub mod cut;
pub mod histogram;

pub use cut::{cut_phases, cut_solid};
pub use histogram::{Quantiles, ranks_by_phase};
