use ndarray::{Array3, s};
use proptest::prelude::*;

use super::*;
use crate::rng::Key;
use crate::topology::labelling::component_sizes;

/// A wall of 5 voxels with a square post on it that ends in the open, and the post's skeleton.
fn post() -> (Array3<bool>, Vec<[u32; 3]>) {
    let mut phase = Array3::from_elem((21, 21, 30), false);
    phase.slice_mut(s![.., .., 2..7]).fill(true);
    phase.slice_mut(s![9..12, 9..12, 7..22]).fill(true);
    let spine = (5..21).rev().map(|x| [10, 10, x]).collect();
    (phase, spine)
}

fn removed(
    phase: &Array3<bool>,
    skeleton: &Skeleton<'_>,
    manner: Manner,
) -> (Array3<bool>, Vec<u64>) {
    let mut out = phase.clone();
    let lost = remove(out.view_mut(), skeleton, None, manner, &Monitor::silent()).unwrap();
    (out, lost)
}

#[test]
fn a_post_goes_and_the_wall_stays() {
    let (phase, mut places) = post();
    let mut branches = vec![0; places.len()];
    let mut radii = vec![2.0_f32; places.len()];
    for z in 3..18 {
        for y in 3..18 {
            places.push([z, y, 4]);
            branches.push(STAYS);
            radii.push(3.0);
        }
    }
    let skeleton = Skeleton { places: &places, radii: &radii, branches: &branches };
    let (out, lost) = removed(&phase, &skeleton, Manner::Prune);
    let mut wall = phase.clone();
    wall.slice_mut(s![.., .., 8..]).fill(false);
    // The balls of the wall reach one voxel into the post.
    assert!(lost[0] >= 14 * 9 && lost[0] <= 15 * 9);
    assert_eq!(out.slice(s![.., .., ..7]), phase.slice(s![.., .., ..7]));
    assert!(out.slice(s![.., .., 8..]).iter().all(|&in_phase| !in_phase));
    let fixed = Array3::from_elem(phase.dim(), false);
    let mut kept = phase.clone();
    let silent = Monitor::silent();
    let none = remove(kept.view_mut(), &skeleton, Some(fixed.view()), Manner::Prune, &silent);
    assert_eq!((none.unwrap(), kept), (vec![0], phase));
}

#[test]
fn a_beam_is_cut_and_nothing_hangs() {
    let mut phase = Array3::from_elem((9, 9, 30), false);
    phase.slice_mut(s![.., .., ..5]).fill(true);
    phase.slice_mut(s![.., .., 25..]).fill(true);
    phase.slice_mut(s![3..6, 3..6, 5..25]).fill(true);
    let places: Vec<[u32; 3]> = (6..24).map(|x| [4, 4, x]).chain([[4, 4, 2], [4, 4, 27]]).collect();
    let branches: Vec<i64> = (0..20).map(|i| if i < 18 { 0 } else { STAYS }).collect();
    let radii: Vec<f32> = (0..20).map(|i| if i < 18 { 2.0 } else { 3.0 }).collect();
    let skeleton = Skeleton { places: &places, radii: &radii, branches: &branches };
    let (out, lost) = removed(&phase, &skeleton, Manner::Cut);
    assert!(lost[0] >= 16 * 9);
    assert!(out.slice(s![.., .., 8..22]).iter().all(|&in_phase| !in_phase));
    let sizes = |phase: &Array3<bool>| {
        component_sizes(phase.view(), Connectivity::Corners, Boundary::Open, &Monitor::silent())
            .unwrap()
    };
    assert_eq!(sizes(&out).len(), 2);
    // As long as the topology must stay, a beam between two walls stays one.
    let (out, _) = removed(&phase, &skeleton, Manner::Prune);
    assert_eq!(sizes(&out).len(), 1);
}

#[test]
fn nothing_is_nothing() {
    let none = Skeleton { places: &[], radii: &[], branches: &[] };
    for shape in [(0, 3, 4), (1, 1, 1), (3, 4, 5)] {
        let phase = Array3::from_elem(shape, true);
        assert_eq!(removed(&phase, &none, Manner::Cut), (phase, vec![]));
    }
}

#[test]
fn bad_input_is_named() {
    let named = |places: &[[u32; 3]], radii: &[f32], branches: &[i64]| {
        let mut phase = Array3::from_elem((4, 4, 4), true);
        let skeleton = Skeleton { places, radii, branches };
        match remove(phase.view_mut(), &skeleton, None, Manner::Prune, &Monitor::silent()) {
            Err(Error::Parameter { parameter, .. }) => parameter,
            _ => "none",
        }
    };
    assert_eq!(named(&[[0, 0, 4]], &[1.0], &[0]), "places");
    assert_eq!(named(&[[0, 0, 0]], &[f32::NAN], &[0]), "radii");
    assert_eq!(named(&[[0, 0, 0]], &[f32::INFINITY], &[0]), "radii");
    assert_eq!(named(&[[0, 0, 0]], &[1.0], &[-2]), "branches");
    assert_eq!(named(&[[0, 0, 0]], &[1.0], &[1]), "branches");
    assert_eq!(named(&[[0, 0, 0]], &[], &[0]), "radii, branches");
    assert_eq!(named(&[[0, 0, 0]], &[1.0], &[0]), "none");
}

proptest! {
    /// Whatever is called a branch, pruning parts nothing and makes nothing vanish.
    #[test]
    fn pruning_keeps_what_hangs_together(
        shape in (1..9usize, 1..9usize, 1..14usize),
        fraction in 0.1..0.95f32,
        seed: u64,
    ) {
        let key = Key::new(seed);
        let mut index = 0;
        let phase = Array3::from_shape_simple_fn(shape, || {
            index += 1;
            key.unit(index) < fraction
        });
        let places: Vec<[u32; 3]> = phase
            .indexed_iter()
            .filter(|&(at, _)| (at.0 + at.1 + at.2) % 3 == 0)
            .map(|((z, y, x), _)| [z as u32, y as u32, x as u32])
            .collect();
        let n = places.len() as u64;
        let branches: Vec<i64> = (0..n).map(|i| key.below(i + 999, 4) as i64 - 1)
            .map(|branch| branch.min(n as i64 - 1)).collect();
        let radii: Vec<f32> = (0..n).map(|i| 3.0 * key.unit(i + 9999)).collect();
        let skeleton = Skeleton { places: &places, radii: &radii, branches: &branches };
        let (out, lost) = removed(&phase, &skeleton, Manner::Prune);
        let size = |phase: &Array3<bool>| phase.iter().filter(|&&in_phase| in_phase).count();
        prop_assert_eq!(size(&phase) - size(&out), lost.iter().sum::<u64>() as usize);
        prop_assert!(phase.iter().zip(&out).all(|(&before, &after)| before || !after));
        let parts = |phase: &Array3<bool>| {
            let (corners, open) = (Connectivity::Corners, Boundary::Open);
            component_sizes(phase.view(), corners, open, &Monitor::silent()).unwrap().len()
        };
        prop_assert_eq!(parts(&out), parts(&phase));
        let fortran = phase.t().as_standard_layout().into_owned().reversed_axes();
        prop_assert_eq!(removed(&fortran, &skeleton, Manner::Prune), (out, lost));
    }
}
