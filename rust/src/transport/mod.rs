//! Transport through the pore space: diffusion and creeping flow.
//!
//! [`pore::PoreSpace`] numbers the voxels that carry a flow from face to face and says which touch;
//! [`links`] is how well they conduct. [`diffusion`] and [`stokes`] solve for what flows there, helped
//! by a multigrid cycle, [`finest`], [`cubes`] and [`multigrid`]. The flow goes along axis 0 of the views:
//! callers permute the axes. No solution is kept, only what is asked of it, nothing that follows from the
//! bits of the pore space, and what only helps in [`compact`] numbers: memory is what limits the volumes
//! that can be solved.

mod chebyshev;
mod compact;
mod cubes;
pub mod diffusion;
mod even;
mod finest;
mod links;
mod multigrid;
pub mod pore;
pub mod stokes;
mod vectors;

/// How to measure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Edges of a voxel along the axes of the view.
    pub spacing: [f64; 3],
    /// Relative residual to reach.
    pub tolerance: f64,
    /// Iterations after which to give up.
    pub iterations: usize,
}
