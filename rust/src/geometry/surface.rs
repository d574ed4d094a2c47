//! Area of the surface between a phase and the rest.

use ndarray::ArrayView3;

use super::changes::{Changes, phase_changes};
use super::configurations::configurations;
use super::marching_cubes;
use super::packed::Step;
use super::secants::{Secant, secants};
use crate::error::{Error, Result};
use crate::monitor::Monitor;
use crate::volume::Boundary;

/// How the surface is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// From the changes of phase along 13 directions, by Crofton's formula.
    Crofton,
    /// The triangles of marching cubes.
    MarchingCubes,
    /// The faces of the voxels.
    Faces,
}

impl std::str::FromStr for Method {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        match name {
            "crofton" => Ok(Self::Crofton),
            "marching_cubes" => Ok(Self::MarchingCubes),
            "faces" => Ok(Self::Faces),
            _ => {
                let allowed = "must be 'crofton', 'marching_cubes' or 'faces'";
                Err(Error::parameter("method", name, allowed))
            }
        }
    }
}

/// The surface of a phase.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    /// Area of the surface that was seen between voxels.
    pub area: f64,
    /// Area per volume in which it was looked for; NaN if no two voxels are neighbours.
    pub specific: f64,
}

const AXES: [Step; 3] = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];

/// Area of the surface of the true voxels. The border of an open volume is no surface.
///
/// # Errors
/// If the volume is empty.
pub fn surface_area(
    solid: ArrayView3<'_, bool>,
    voxel_size: [f64; 3],
    method: Method,
    boundary: Boundary,
    monitor: &Monitor<'_>,
) -> Result<Surface> {
    let voxel: f64 = voxel_size.iter().product();
    match method {
        Method::Crofton => Ok(crofton(&secants(solid, 1, voxel_size, boundary, monitor)?, voxel)),
        Method::MarchingCubes => {
            let counts = configurations(solid, boundary, monitor)?;
            let areas = marching_cubes::areas(voxel_size);
            let area: f64 = counts.iter().zip(areas).map(|(&n, area)| n as f64 * area).sum();
            let cubes: u64 = counts.iter().sum();
            let specific = if cubes > 0 { area / (cubes as f64 * voxel) } else { f64::NAN };
            Ok(Surface { area, specific })
        }
        Method::Faces => {
            let found = phase_changes(solid, &AXES, boundary, monitor)?;
            let sum = |of: fn(&Changes) -> f64| -> f64 {
                found.iter().zip(voxel_size).map(|(changes, edge)| of(changes) / edge).sum()
            };
            let area = voxel * sum(|found| found.changes as f64);
            let specific = if found.iter().all(|found| found.pairs == 0) {
                f64::NAN
            } else {
                sum(|found| found.changes as f64 / found.pairs.max(1) as f64)
            };
            Ok(Surface { area, specific })
        }
    }
}

/// Crofton's formula: the area per volume is twice the mean, over all directions, of the changes of
/// phase per length of a line.
fn crofton(secants: &[Secant], voxel: f64) -> Surface {
    let sum = |of: &dyn Fn(&Secant) -> f64| -> f64 {
        2.0 * secants.iter().map(|secant| secant.weight * of(secant)).sum::<f64>()
    };
    let area = voxel * sum(&|secant| secant.changes as f64 / secant.length);
    let specific = if secants.is_empty() { f64::NAN } else { sum(&Secant::density) };
    Surface { area, specific }
}

#[cfg(test)]
mod tests {
    use ndarray::Array3;

    use super::*;

    const METHODS: [Method; 3] = [Method::Crofton, Method::MarchingCubes, Method::Faces];

    fn measured(solid: &Array3<bool>, size: [f64; 3], method: Method, open: bool) -> Surface {
        let boundary = if open { Boundary::Open } else { Boundary::Periodic };
        surface_area(solid.view(), size, method, boundary, &Monitor::silent()).unwrap()
    }

    #[test]
    fn nothing_and_everything_have_no_surface() {
        for value in [false, true] {
            let solid = Array3::from_elem((3, 4, 70), value);
            for (method, open) in METHODS.into_iter().flat_map(|m| [(m, true), (m, false)]) {
                let found = measured(&solid, [1.0; 3], method, open);
                assert_eq!(found, Surface { area: 0.0, specific: 0.0 });
            }
        }
    }

    #[test]
    fn one_voxel_says_nothing() {
        let solid = Array3::from_elem((1, 1, 1), true);
        for method in METHODS {
            let found = measured(&solid, [1.0; 3], method, true);
            assert!(found.area == 0.0 && found.specific.is_nan());
            let periodic = measured(&solid, [1.0; 3], method, false);
            assert_eq!(periodic, Surface { area: 0.0, specific: 0.0 });
        }
    }

    #[test]
    fn faces_of_a_box() {
        let solid = Array3::from_shape_fn((5, 6, 7), |(z, y, x)| {
            (1..3).contains(&z) && (1..5).contains(&y) && (1..6).contains(&x)
        });
        let found = measured(&solid, [1.0, 0.5, 2.0], Method::Faces, true);
        let [a, b, c] = [2.0 * 1.0, 4.0 * 0.5, 5.0 * 2.0];
        assert!((found.area - 2.0 * (a * b + b * c + c * a)).abs() < 1e-9);
    }

    #[test]
    fn a_ball_of_stretched_voxels() {
        let (radius, size) = (10.0, [1.0, 0.6, 1.4]);
        let solid = Array3::from_shape_fn((24, 40, 18), |(z, y, x)| {
            let at = [z as f64 - 11.6, y as f64 - 19.3, x as f64 - 8.4];
            (0..3).map(|a| (at[a] * size[a]).powi(2)).sum::<f64>() < radius * radius
        });
        let found = measured(&solid, size, Method::Crofton, true);
        let exact = 4.0 * std::f64::consts::PI * radius * radius;
        assert!((found.area / exact - 1.0).abs() < 0.015, "{}", found.area / exact);
    }
}
