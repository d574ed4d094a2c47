//! Statistics of where a phase lies: two-point correlation, and how far blocks are copied.

pub mod block_match;
mod fft;
pub mod two_point;
