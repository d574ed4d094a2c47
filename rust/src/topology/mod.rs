//! What is connected to what.

pub mod labelling;
