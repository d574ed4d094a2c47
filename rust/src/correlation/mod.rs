//! Statistics of where a phase lies: two-point correlation, and how far blocks are copied.
