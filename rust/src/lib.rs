//! Kernels of poresynth: synthesis of porous volumes by example, and their measurement.
//!
//! Ground floor: [`error`], [`rng`], [`volume`], [`fourier`], [`monitor`], [`threads`]. Above it one module an
//! area. Only `bindings` (feature `python`) knows Python. All memory comes by way of `large_pages`.

mod bits;
pub mod correlation;
pub mod error;
pub mod fourier;
pub mod geometry;
pub mod intensity;
mod large_pages;
pub mod monitor;
pub mod points;
pub mod rng;
pub mod texture;
pub mod threads;
pub mod topology;
pub mod transport;
pub mod volume;

#[cfg(feature = "python")]
mod bindings;

#[global_allocator]
static ALLOCATOR: large_pages::LargePages = large_pages::LargePages;
