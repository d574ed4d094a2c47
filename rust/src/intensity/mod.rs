//! Gray levels: histogram matching, exact cuts and statistics.

mod buckets;
pub mod cut;
pub mod histogram;
pub mod matching;
pub mod order;
mod radix;
pub mod statistics;

pub use buckets::level_counts;
pub use cut::{cut_phases, cut_solid};
pub use histogram::Quantiles;
