//! Synthesis by texture optimisation.
