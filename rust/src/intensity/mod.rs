//! Gray levels: histogram matching and exact cuts.
