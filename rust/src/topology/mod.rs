//! What is connected to what.

mod bit_rows;
pub mod labelling;
mod simple_point;
pub mod skeleton_graph;
pub mod thinning;
