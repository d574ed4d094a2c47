//! Creeping flow through the pore: Stokes' equations on a staggered grid.
//!
//! Pressure is at the centres of voxels, velocity at the faces between them (marker and cell), so
//! that mass is kept exactly and no flow passes an edge or a corner. The flow is driven by a unit
//! force along axis 0; viscosity is 1, so that the mean velocity is the permeability. What is
//! solved is [A G; Gᵀ 0] [u; p] = [1; 0], for the pressure ([`schur`], [`preconditioner`]), with the
//! velocities that each pressure drives inside ([`viscous`]). [`places`] says which velocities there are,
//! [`lines`] how they lie in memory; [`grid`] and [`diagonals`] are A, [`coupling`] is G.

mod coupling;
mod diagonals;
mod grid;
mod lines;
mod places;
mod preconditioner;
mod runs;
mod schur;
mod viscous;

use self::grid::Grid;
use self::preconditioner::Preconditioner;
use self::viscous::Viscous;
use super::Settings;
use super::diffusion::mismatch;
use super::pore::PoreSpace;
use crate::error::Result;
use crate::large_pages::give_back;
use crate::monitor::Monitor;
use crate::volume::voxels;

/// How a viscous fluid flows through a pore space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flow {
    /// Permeability in the square of the unit of the spacing; infinite where there is no wall.
    pub permeability: f64,
    /// Difference between the largest and the smallest flow through a plane, by the mean flow.
    pub flux_mismatch: f64,
    /// Norm of the preconditioned residual of the pressure by that of no pressure.
    pub residual: f64,
    /// Iterations done.
    pub iterations: usize,
}

/// Solves for the flow along axis 0.
///
/// Peak memory: 9 bytes a percolating voxel, 86 for each node of 4³ of them, and 6 a voxel of the volume.
pub fn flow(space: &PoreSpace, settings: &Settings, monitor: &Monitor<'_>) -> Result<Flow> {
    let still = Flow { permeability: 0.0, flux_mismatch: 0.0, residual: 0.0, iterations: 0 };
    if space.is_empty() {
        return Ok(still);
    }
    if space.pore == voxels(space.shape) {
        return Ok(Flow { permeability: f64::INFINITY, ..still });
    }
    // Single precision likes steps near 1.
    let edge = settings.spacing.iter().product::<f64>().cbrt();
    let grid = Grid::new(space, settings.spacing.map(|h| h / edge), monitor)?;
    give_back();
    let mut viscous = Viscous::new(&grid);
    let mut preconditioner = Preconditioner::new(&grid, &mut viscous, monitor)?;
    give_back();
    let solved = schur::solve(&grid, &mut preconditioner, &mut viscous, settings, monitor)?;
    let [_, n1, n2] = space.shape;
    let mean = solved.fluxes.iter().sum::<f64>() / solved.fluxes.len() as f64;
    Ok(Flow {
        permeability: edge * edge * mean / (n1 * n2) as f64,
        flux_mismatch: mismatch(&solved.fluxes),
        residual: solved.residual,
        iterations: solved.iterations,
    })
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use ndarray::{Array3, s};

    use super::*;
    use crate::error::Error;
    use crate::rng::Key;
    use crate::volume::{Boundary, Shape};

    /// Pore spaces with even and odd edges and edges of 1, whose rows fill their words or do not.
    pub(super) fn spaces() -> impl Iterator<Item = PoreSpace> {
        let shapes =
            [[1, 1, 1], [2, 2, 2], [3, 4, 5], [4, 3, 64], [5, 5, 2], [4, 6, 66], [3, 1, 131]];
        let each = move |shape: Shape| {
            [Boundary::Open, Boundary::Periodic].into_iter().map(move |boundary| {
                let mut i = 0;
                let solid = Array3::from_shape_simple_fn(shape, || {
                    i += 1;
                    Key::new(2).unit(i) < 0.2
                });
                PoreSpace::new(solid.view(), boundary, &Monitor::silent()).unwrap()
            })
        };
        shapes.into_iter().flat_map(each).filter(|space| !space.is_empty())
    }

    const SETTINGS: Settings = Settings { spacing: [1.0; 3], tolerance: 1e-5, iterations: 1000 };

    fn plates(width: usize) -> Array3<bool> {
        let mut solid = Array3::from_elem((5, width + 1, 4), false);
        solid.slice_mut(s![.., 0, ..]).fill(true);
        solid
    }

    fn solve(solid: &Array3<bool>, boundary: Boundary) -> Flow {
        let silent = Monitor::silent();
        let space = PoreSpace::new(solid.view(), boundary, &silent).unwrap();
        flow(&space, &SETTINGS, &silent).unwrap()
    }

    #[test]
    fn between_plates() {
        for width in 1..7 {
            // An open side is a mirror: the other plate is twice as far.
            for (boundary, gap) in [(Boundary::Periodic, width), (Boundary::Open, 2 * width)] {
                let found = solve(&plates(width), boundary).permeability;
                let exact = (gap * gap * width) as f64 / 12.0 / (width + 1) as f64;
                assert!((found / exact - 1.0).abs() < 1e-5, "{width} {boundary:?}");
            }
        }
    }

    #[test]
    fn without_a_wall_and_without_a_way() {
        for boundary in [Boundary::Open, Boundary::Periodic] {
            let free = solve(&Array3::from_elem((3, 3, 3), false), boundary);
            assert!(free.permeability.is_infinite());
            assert!(solve(&Array3::from_elem((3, 3, 3), true), boundary).permeability == 0.0);
        }
    }

    #[test]
    fn stops_when_asked_to() {
        let silent = Monitor::silent();
        let space = PoreSpace::new(plates(3).view(), Boundary::Open, &silent).unwrap();
        let cancel = AtomicBool::new(true);
        let monitor = Monitor::new(&cancel, &|_| ());
        assert_eq!(flow(&space, &SETTINGS, &monitor), Err(Error::Cancelled));
    }
}
