//! What is connected to what.

mod bits;
mod contacts;
pub mod euler;
mod forest;
pub mod labelling;
pub mod parts;
mod runs;
mod seams;
pub mod statistics;
