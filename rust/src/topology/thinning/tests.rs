//! The kernel against a twin that looks at every voxel in every pass, and against known shapes.

use ndarray::Array3;
use proptest::prelude::*;

use super::super::simple_point::{is_connected, is_simple};
use super::*;
use crate::threads::with_threads;

fn neighbours_of(solid: &Array3<bool>, [z, y, x]: [usize; 3]) -> Word {
    let mut word = 0;
    for bit in 0..27 {
        // A coordinate below 0 wraps to one that no array has.
        let at = [z + bit / 9, y + bit / 3 % 3, x + bit % 3].map(|i| i.wrapping_sub(1));
        word |= Word::from(solid.get(at) == Some(&true)) << bit;
    }
    word & !(1 << 13)
}

fn twin(solid: &Array3<bool>, kind: Kind, method: Method) -> Array3<bool> {
    let mut solid = solid.clone();
    let flat: Vec<usize> =
        (0..3).filter(|&a| solid.shape()[a] == 1 && (method == Method::Strict || a == 0)).collect();
    loop {
        let mut changed = false;
        for side in SIDES.iter().filter(|side| !flat.contains(&side.axis)) {
            let facing = 13 + [9, 3, 1][side.axis] * if side.up { 1 } else { -1 };
            let mut candidates: Vec<[usize; 3]> = solid
                .indexed_iter()
                .filter(|(_, solid)| **solid)
                .map(|((z, y, x), _)| [z, y, x])
                .filter(|&at| {
                    let around = neighbours_of(&solid, at);
                    let end = match kind {
                        Kind::Curve => around.is_power_of_two(),
                        Kind::Surface => is_surface_end(around),
                    };
                    around >> facing & 1 == 0 && !end && is_simple(around)
                })
                .collect();
            if method == Method::Strict {
                // Spare planes and rows shift the parity along z and y.
                candidates.sort_by_key(|[z, y, x]| [(z + 1) % 2, (y + 1) % 2, x % 2]);
            }
            for at in candidates {
                let around = neighbours_of(&solid, at);
                let goes = match method {
                    Method::Strict => is_simple(around),
                    Method::Lee => is_connected(around),
                };
                if goes {
                    solid[at] = false;
                    changed = true;
                }
            }
        }
        if !changed {
            return solid;
        }
    }
}

fn thinned(solid: ArrayView3<'_, bool>, kind: Kind, method: Method) -> Array3<bool> {
    let mut skeleton = Array3::from_elem(solid.dim(), false);
    thin(solid, kind, method, skeleton.view_mut(), &Monitor::silent()).unwrap();
    skeleton
}

fn solids() -> impl Strategy<Value = Array3<bool>> {
    (1..9usize, 1..9usize, 1..70usize, 0.2..1.0f64).prop_flat_map(|(z, y, x, fraction)| {
        proptest::collection::vec(proptest::bool::weighted(fraction), z * y * x)
            .prop_map(move |voxels| Array3::from_shape_vec((z, y, x), voxels).unwrap())
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn agrees_with_the_twin(
        solid in solids(),
        kind in prop::sample::select(vec![Kind::Curve, Kind::Surface]),
        method in prop::sample::select(vec![Method::Strict, Method::Lee]),
    ) {
        let expected = twin(&solid, kind, method);
        let fortran = solid.t().as_standard_layout().into_owned().reversed_axes();
        prop_assert_eq!(&thinned(solid.view(), kind, method), &expected);
        prop_assert_eq!(&thinned(fortran.view(), kind, method), &expected);
    }
}

/// Rounded blocks of many sizes: enough candidates that threads share them.
fn grains() -> Array3<bool> {
    Array3::from_shape_fn((40, 70, 90), |(z, y, x)| {
        let wave = |i: usize, length: f64| (i as f64 / length).sin();
        wave(z, 3.0) * wave(y, 4.0) + wave(y, 2.5) * wave(x, 3.5) + wave(x, 5.0) > -0.4
    })
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let solid = grains();
    for method in [Method::Strict, Method::Lee] {
        let expected = twin(&solid, Kind::Curve, method);
        for threads in [1, 2, 3, 8] {
            let found = with_threads(threads, || thinned(solid.view(), Kind::Curve, method));
            assert_eq!(found.unwrap(), expected);
        }
    }
}

#[test]
fn bars_of_even_thickness_stay_and_go() {
    for (edge, length) in [(2, 30), (4, 30), (8, 30)] {
        for axis in 0..3 {
            let mut shape = [edge; 3];
            shape[axis] = length;
            let solid = Array3::from_elem(shape, true);
            let count = |method| {
                let skeleton = thinned(solid.view(), Kind::Curve, method);
                skeleton.iter().filter(|voxel| **voxel).count()
            };
            assert!(count(Method::Strict) >= length - edge - 3);
            assert_eq!(count(Method::Lee), 0);
        }
    }
}

#[test]
fn nothing_and_everything() {
    for shape in [(0, 3, 3), (3, 0, 3), (3, 3, 0), (1, 1, 1), (2, 3, 31), (2, 3, 32), (2, 3, 33)] {
        let mut solid = Array3::from_elem(shape, false);
        assert_eq!(thinned(solid.view(), Kind::Curve, Method::Strict), solid);
        solid.fill(true);
        let skeleton = thinned(solid.view(), Kind::Curve, Method::Strict);
        assert_eq!(skeleton.iter().any(|voxel| *voxel), !solid.is_empty());
    }
}

#[test]
fn a_stop_is_obeyed_and_bad_input_named() {
    let solid = grains();
    let stop = AtomicBool::new(true);
    let mut skeleton = Array3::from_elem(solid.dim(), false);
    for method in [Method::Strict, Method::Lee] {
        let monitor = Monitor::new(&stop, &|_| ());
        let result = thin(solid.view(), Kind::Curve, method, skeleton.view_mut(), &monitor);
        assert_eq!(result, Err(Error::Cancelled));
    }
    assert!("line".parse::<Kind>().is_err() && "old".parse::<Method>().is_err());
    let mut small = Array3::from_elem((1, 2, 3), false);
    let silent = Monitor::silent();
    let result = thin(solid.view(), Kind::Curve, Method::Strict, small.view_mut(), &silent);
    assert!(matches!(result, Err(Error::Parameter { parameter: "skeleton.shape", .. })));
}
