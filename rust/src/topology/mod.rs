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
mod bit_rows;
pub mod labelling;
mod simple_point;
pub mod skeleton_graph;
pub mod thinning;
