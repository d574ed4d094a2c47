//! What is connected to what.

mod bit_rows;
pub mod cells;
mod contacts;
pub mod euler;
mod forest;
pub mod labelling;
pub mod parts;
pub mod repair;
mod runs;
mod seams;
mod simple_point;
pub mod skeleton_graph;
pub mod statistics;
pub mod thinning;
