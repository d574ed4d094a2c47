//! Directions of a voxel lattice, and the share of all directions that each stands for.

use std::f64::consts::PI;

use super::packed::Step;

/// A direction, or a point of the unit sphere, along (z, y, x).
type Vector = [f64; 3];

/// The shortest lattice vectors of all directions whose components are at most `reach`, one of each
/// pair of opposites (the one whose first component that is not 0 is positive), in order: 13, 49
/// and 145 for a reach of 1, 2 and 3.
pub fn lattice_directions(reach: usize) -> Vec<Step> {
    let reach = reach as isize;
    let line = -reach..=reach;
    let mut found = Vec::new();
    for z in 0..=reach {
        for y in line.clone() {
            for x in line.clone() {
                let step = [z, y, x];
                let common = step.iter().fold(0, |a, &b| greatest_common_divisor(a, b.abs()));
                if step > [0, 0, 0] && common == 1 {
                    found.push(step);
                }
            }
        }
    }
    found
}

const fn greatest_common_divisor(a: isize, b: isize) -> isize {
    if b == 0 { a } else { greatest_common_divisor(b, a % b) }
}

/// Length of a step.
pub fn length(step: Step, voxel_size: [f64; 3]) -> f64 {
    let square: f64 = (0..3).map(|a| (step[a] as f64 * voxel_size[a]).powi(2)).sum();
    square.sqrt()
}

/// Weights of directions in a mean over all directions: the share of the sphere that is nearer to a
/// direction, or its opposite, than to any other. They add up to 1.
pub fn direction_weights(steps: &[Step], voxel_size: [f64; 3]) -> Vec<f64> {
    let units: Vec<Vector> = steps
        .iter()
        .map(|&step| {
            let length = length(step, voxel_size);
            [0, 1, 2].map(|a| step[a] as f64 * voxel_size[a] / length)
        })
        .collect();
    units
        .iter()
        .enumerate()
        .map(|(own, &unit)| {
            let borders: Vec<Vector> = units
                .iter()
                .enumerate()
                .filter(|&(other, _)| other != own)
                .flat_map(|(_, v)| [1.0, -1.0].map(|sign| sum(unit, *v, sign)))
                .chain([unit])
                .collect();
            octants().map(|octant| solid_angle(&clip(octant, &borders))).sum::<f64>() / (2.0 * PI)
        })
        .collect()
}

/// The eight triangles into which the planes between the axes cut the sphere.
fn octants() -> impl Iterator<Item = Vec<Vector>> {
    (0..8).map(|signs| {
        [0, 1, 2]
            .map(|axis| {
                let mut corner = [0.0; 3];
                corner[axis] = if signs >> axis & 1 == 1 { -1.0 } else { 1.0 };
                corner
            })
            .to_vec()
    })
}

/// The part of a convex spherical polygon on the inner side of all planes through the centre.
fn clip(mut polygon: Vec<Vector>, normals: &[Vector]) -> Vec<Vector> {
    for &normal in normals {
        let heights: Vec<f64> = polygon.iter().map(|&p| dot(p, normal)).collect();
        if heights.iter().all(|&height| height >= 0.0) {
            continue;
        }
        let mut kept = Vec::with_capacity(polygon.len() + 1);
        for (i, (&p, &height)) in polygon.iter().zip(&heights).enumerate() {
            let next = (i + 1) % polygon.len();
            if height >= 0.0 {
                kept.push(p);
            }
            if (height >= 0.0) != (heights[next] >= 0.0) {
                let on = sum(p.map(|c| c * heights[next]), polygon[next], -height);
                let length = dot(on, on).sqrt();
                // The chord's point on the plane may come out on the far side of the centre.
                let side = if heights[next] < height { -length } else { length };
                kept.push(on.map(|c| c / side));
            }
        }
        polygon = kept;
    }
    polygon
}

/// Solid angle of a convex spherical polygon (van Oosterom and Strackee 1983, by triangles).
fn solid_angle(polygon: &[Vector]) -> f64 {
    let Some((&a, rest)) = polygon.split_first() else { return 0.0 };
    rest.windows(2)
        .map(|pair| {
            let (b, c) = (pair[0], pair[1]);
            let across = 1.0 + dot(a, b) + dot(b, c) + dot(c, a);
            2.0 * dot(a, cross(b, c)).abs().atan2(across)
        })
        .sum()
}

fn sum(a: Vector, b: Vector, times: f64) -> Vector {
    [0, 1, 2].map(|i| a[i] + times * b[i])
}

fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: f64, b: f64) {
        assert!((a - b).abs() < 1e-9, "{a} is not {b}");
    }

    #[test]
    fn numbers_of_directions() {
        assert_eq!([1, 2, 3].map(|reach| lattice_directions(reach).len()), [13, 49, 145]);
        assert_eq!(lattice_directions(1)[0], [0, 0, 1]);
    }

    #[test]
    fn weights_of_thirteen_directions_are_those_of_the_literature() {
        // Ohser and Mücklich 2000; per direction and opposite: twice the share of one.
        let steps = lattice_directions(1);
        let weights = direction_weights(&steps, [1.0; 3]);
        for (step, weight) in steps.iter().zip(weights) {
            let order: isize = step.iter().map(|c| c.abs()).sum();
            let share = [0.045_777_891_2, 0.036_980_627_9, 0.035_195_639_9][order as usize - 1];
            close(weight, 2.0 * share);
        }
    }

    #[test]
    fn weights_add_up_whatever_the_voxel() {
        for reach in 1..4 {
            for size in [[1.0; 3], [3.0, 1.0, 0.4], [0.01, 5.0, 1.0]] {
                let weights = direction_weights(&lattice_directions(reach), size);
                close(weights.iter().sum(), 1.0);
                assert!(weights.iter().all(|&w| w > 0.0));
            }
        }
    }

    #[test]
    fn few_directions_share_the_sphere_too() {
        close(direction_weights(&[[0, 0, 1]], [1.0; 3])[0], 1.0);
        let plane = direction_weights(&[[0, 0, 1], [0, 1, 0], [0, 1, 1], [0, 1, -1]], [1.0; 3]);
        assert!(plane.iter().all(|weight| (weight - 0.25).abs() < 1e-9));
        let axes = direction_weights(&[[0, 0, 1], [0, 1, 0], [1, 0, 0]], [1.0, 2.0, 3.0]);
        assert!(axes.iter().all(|weight| (weight - 1.0 / 3.0).abs() < 1e-9));
    }
}
