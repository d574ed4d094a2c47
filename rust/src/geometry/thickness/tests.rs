use ndarray::{Array3, s};
use proptest::prelude::*;

use super::cells::Placed;
use super::ridge::Ball;
use super::sections::{LANES, Roots, Section};
use super::*;
use crate::geometry::distance::distance_transform;
use crate::threads::with_threads;

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
        let monitor = Monitor::silent();
        let balls = Balls::<u16>::new(phase.view(), &space, &monitor).unwrap().unwrap();
        let diameters = balls.rank.mapv(|rank| space.diameter(f32::from(rank)));
        prop_assert_eq!(&found, &twin(&phase, &diameters, boundary));
        let again = with_threads(3, || thickness(phase.view(), [1.0; 3], boundary)).unwrap();
        prop_assert_eq!(&found, &again);
        // The way of large radii and of other voxels than cubes.
        let wide = Balls::<f32>::new(phase.view(), &space, &monitor).unwrap().unwrap();
        let mut again = Array3::zeros(phase.dim());
        fill(wide, &space, phase.view(), again.view_mut(), &monitor).unwrap();
        prop_assert_eq!(&found, &again);
    }
}

/// A square less than which voxels are, in half voxels, as balls have it.
fn reach(square: i32) -> f32 {
    (4 * square - 2) as f32
}

proptest! {
    #[test]
    fn discs_are_what_roots_find(
        own in 1..961i32,
        other in 0..961i32,
        step in [-1..2i8, -1..2i8, -1..2i8],
        off in [-1.0..1.0f64, -1.0..1.0f64, -1.0..1.0f64],
        voxel in [0..64i32, 0..64i32, 0..64i32],
        waiting: [u64; LANES],
    ) {
        // The ball has a voxel in the rows that are looked at.
        let radius = f64::from(own - 1).sqrt();
        let length = off.iter().map(|a| a * a).sum::<f64>().sqrt().max(1.0);
        let at = [0, 1, 2].map(|i| voxel[i] + (off[i] / length * radius) as i32);
        let neighbour = if other == 0 { 0.0 } else { reach(other) };
        let ball = Ball { step, reach: reach(own), neighbour, ..Ball::default() };
        let placed = Placed { at, ball };
        let discs = Discs::of_cubes(reach(own.max(other) + 1));
        prop_assert!(discs.hold(&ball));
        let (z, y) = (voxel[0] as usize, voxel[1] as usize);
        let (mut hits, mut expected) = ([0; LANES], [0; LANES]);
        let found = discs.section(&placed, z).find_hits(y, &waiting, &mut hits);
        let roots = Roots::new(&placed, z, [2.0; 3], u64::MAX);
        prop_assert_eq!(found, roots.find_hits(y, &waiting, &mut expected));
        prop_assert_eq!(hits, expected);
    }
}

#[test]
fn balls_that_the_table_of_discs_is_too_small_for() {
    // One voxel outside, in a corner: the ball in the opposite one holds all others.
    let phase = Array3::from_shape_fn((42, 42, 42), |(z, y, x)| z * z + y * y + x * x >= 1);
    let found = thickness(phase.view(), [1.0; 3], Boundary::Open);
    let space = Space::new([1.0; 3], Boundary::Open);
    let balls = Balls::<u16>::new(phase.view(), &space, &Monitor::silent()).unwrap().unwrap();
    let diameters = balls.rank.mapv(|rank| space.diameter(f32::from(rank)));
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
