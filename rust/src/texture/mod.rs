//! Synthesis by texture optimisation (Zhang et al. 2017, after Kwatra et al. 2005).
//!
//! [`synthesize`] runs a coarse-to-fine schedule of expectation-maximisation passes. A pass is pure:
//! it maps the previous volume and match map to the next ones, and no site sees what another site
//! found in the same pass. Together with random numbers keyed by position this makes the result the
//! same for any number of threads.

pub mod blend;
pub mod carry;
pub mod copying;
mod cosines;
mod covariance;
mod cut_law;
mod detail;
mod emphasis;
pub mod engine;
pub mod field;
pub mod lattice;
mod levels;
pub mod match_map;
mod matching;
pub mod neighbourhoods;
pub mod parameters;
pub mod pca;
pub mod poisson;
pub mod pyramid;
pub mod random_field;
pub mod responses;
pub mod search;
mod starts;
pub mod symmetry;
pub mod windows;

pub use engine::synthesize;
pub use field::Field;
pub use match_map::{Match, MatchMap};
pub use parameters::{Constraints, EnergyRecord, Parameters, Stage, Synthesis};
