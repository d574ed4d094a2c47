//! What is connected to what.

mod bits;
pub mod euler;
mod forest;
pub mod labelling;
pub mod parts;
mod runs;
mod seams;
pub mod statistics;
