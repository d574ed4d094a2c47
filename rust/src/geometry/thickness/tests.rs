use ndarray::{Array3, s};
use proptest::prelude::*;

use super::cells::Placed;
use super::diameters::Balls;
use super::ridge::Ball;
use super::sections::{Discs, LANES, Roots, Sections};
use super::steps::STEPS;
use super::*;
use crate::geometry::distance::distance_transform;
use crate::rng::Key;
use crate::threads::with_threads;
use crate::volume::index;

fn thickness(phase: ArrayView3<'_, bool>, size: [f64; 3], boundary: Boundary) -> Array3<f32> {
    let mut out = Array3::zeros(phase.dim());
    let monitor = Monitor::silent();
    local_thickness(phase, size, boundary, out.view_mut(), &monitor).unwrap();
    out
}

/// Every ball against every voxel. Distances between voxels are taken from `distance_transform`.
fn twin(phase: &Array3<bool>, diameters: &Array3<f32>, boundary: Boundary) -> Array3<f32> {
    let mut distance = Array3::zeros(phase.dim());
    let monitor = Monitor::silent();
    distance_transform(phase.view(), [1.0; 3], boundary, None, distance.view_mut(), &monitor)
        .unwrap();
    let shape = [phase.dim().0, phase.dim().1, phase.dim().2];
    let along = |a: usize, b: usize, n: usize| match boundary {
        Boundary::Open => a.abs_diff(b),
        Boundary::Periodic => a.abs_diff(b).min(n - a.abs_diff(b)),
    };
    Array3::from_shape_fn(phase.dim(), |at| {
        let mut largest = 0.0f32;
        for (centre, &radius) in distance.indexed_iter() {
            let square = along(at.0, centre.0, shape[0]).pow(2)
                + along(at.1, centre.1, shape[1]).pow(2)
                + along(at.2, centre.2, shape[2]).pow(2);
            if phase[at] && (square as f32) < (radius * radius).round() {
                largest = largest.max(diameters[centre]);
            }
        }
        largest
    })
}

/// How thick the ball of each voxel is, where voxels are cubes.
fn diameters(phase: &Array3<bool>, space: &Space) -> Array3<f32> {
    let (mut room, mut more) = (vec![0.0; phase.len()], Vec::new());
    let monitor = Monitor::silent();
    let balls = Balls::<u16>::new(phase.view(), space, &mut room, &mut more, &monitor);
    let balls = balls.unwrap().unwrap();
    balls.rank.mapv(|rank| space.diameter(f32::from(rank)))
}

fn volumes() -> impl Strategy<Value = Array3<bool>> {
    (1..7usize, 1..9usize, 1..24usize, 0.5..1.0f64).prop_flat_map(|(z, y, x, fraction)| {
        proptest::collection::vec(proptest::bool::weighted(fraction), z * y * x)
            .prop_map(move |voxels| Array3::from_shape_vec((z, y, x), voxels).unwrap())
    })
}

proptest! {
    #[test]
    fn agrees_with_every_ball_against_every_voxel(phase in volumes(), periodic: bool) {
        let boundary = if periodic { Boundary::Periodic } else { Boundary::Open };
        let found = thickness(phase.view(), [1.0; 3], boundary);
        if phase.iter().all(|&inside| inside) {
            prop_assert!(found.iter().all(|t| t.is_infinite()));
            return Ok(());
        }
        let space = Space::new([1.0; 3], boundary);
        let diameters = diameters(&phase, &space);
        prop_assert_eq!(&found, &twin(&phase, &diameters, boundary));
        let again = with_threads(3, || thickness(phase.view(), [1.0; 3], boundary)).unwrap();
        prop_assert_eq!(&found, &again);
        // The way of large radii and of other voxels than cubes.
        let mut again = Array3::zeros(phase.dim());
        fill::<f32>(&space, phase.view(), again.view_mut(), &Monitor::silent()).unwrap();
        prop_assert_eq!(&found, &again);
    }
}

#[test]
fn where_bands_lanes_and_tiles_meet() {
    // Longer than a band along y, than lanes and a tile along x, or than a slab along z.
    for (shape, boundary) in [
        ((3, 35, 70), Boundary::Open),
        ((3, 35, 70), Boundary::Periodic),
        ((35, 18, 4), Boundary::Open),
        ((35, 18, 4), Boundary::Periodic),
    ] {
        let noise = Key::new(1);
        let phase = Array3::from_shape_fn(shape, |(z, y, x)| {
            noise.unit(index(shape.into(), [z, y, x]) as u64) < 0.985
        });
        let diameters = diameters(&phase, &Space::new([1.0; 3], boundary));
        let found = thickness(phase.view(), [1.0; 3], boundary);
        assert_eq!(found, twin(&phase, &diameters, boundary));
    }
}

proptest! {
    #[test]
    fn discs_are_what_roots_find(
        own in 1..961i32,
        other in 0..961i32,
        step in 0..STEPS,
        off in [-1.0..1.0f64, -1.0..1.0f64, -1.0..1.0f64],
        voxel in [0..64i32, 0..64i32, 0..64i32],
        waiting: [u64; LANES],
    ) {
        // The ball has a voxel in the rows that are looked at.
        let radius = f64::from(own - 1).sqrt();
        let length = off.iter().map(|a| a * a).sum::<f64>().sqrt().max(1.0);
        let at = [0, 1, 2].map(|i| voxel[i] + (off[i] / length * radius) as i32);
        let [reach, neighbour] = [own, other].map(|square| (4 * square) as u16);
        let placed = Placed { at, ball: Ball { reach, neighbour, ..Ball::default() } };
        let space = Space::new([1.0; 3], Boundary::Open);
        let along = space.steps.all[step].along;
        let discs = Discs::of_cubes((4 * own.max(other)) as f32);
        prop_assert!(discs.hold(&placed.ball));
        let (z, y) = (voxel[0] as usize, voxel[1] as usize);
        let hits = discs.sections(&placed, along).hits([z, y], &waiting);
        let roots = Roots::new(&placed, along, &space, u64::MAX);
        prop_assert_eq!(hits, roots.hits([z, y], &waiting));
    }
}

#[test]
fn balls_that_the_table_of_discs_is_too_small_for() {
    // One voxel outside, in a corner: the ball in the opposite one holds all others.
    let phase = Array3::from_shape_fn((42, 42, 42), |(z, y, x)| z * z + y * y + x * x >= 1);
    let found = thickness(phase.view(), [1.0; 3], Boundary::Open);
    let diameters = diameters(&phase, &Space::new([1.0; 3], Boundary::Open));
    let largest = diameters.iter().copied().fold(0.0, f32::max);
    assert!(largest > 100.0);
    assert!(found.iter().skip(1).all(|&t| t >= largest), "{largest}");
}

#[test]
fn a_slab_is_as_thick_as_it_is() {
    for t in 1..12 {
        for boundary in [Boundary::Open, Boundary::Periodic] {
            let mut phase = Array3::from_elem((20, 20, 20), false);
            phase.slice_mut(s![4..4 + t, .., ..]).fill(true);
            let found = thickness(phase.view(), [1.5, 1.0, 0.7], boundary);
            let expected = 1.5 * t as f32;
            for (inside, value) in phase.iter().zip(&found) {
                let wanted = if *inside { expected } else { 0.0 };
                assert!((value - wanted).abs() < 1e-5, "{t}: {value}");
            }
        }
    }
}

#[test]
fn radii_that_do_not_fit_into_sixteen_bits() {
    let mut phase = Array3::from_elem((300, 3, 2), true);
    phase.slice_mut(s![0, .., ..]).fill(false);
    let found = thickness(phase.view(), [1.0; 3], Boundary::Open);
    // The ball in the last plane holds all others.
    assert!(found.slice(s![1.., .., ..]).iter().all(|&t| (t - 597.0).abs() < 1e-3), "{found}");
    assert!(found.slice(s![0, .., ..]).iter().all(|&t| t == 0.0));
}

#[test]
fn empty_and_full_volumes() {
    let none = Array3::from_elem((0, 3, 3), true);
    assert!(thickness(none.view(), [1.0; 3], Boundary::Open).is_empty());
    let full = Array3::from_elem((3, 4, 5), true);
    assert!(thickness(full.view(), [1.0; 3], Boundary::Open).iter().all(|t| t.is_infinite()));
    let empty = full.mapv(|_| false);
    assert!(thickness(empty.view(), [1.0; 3], Boundary::Open).iter().all(|&t| t == 0.0));
}
