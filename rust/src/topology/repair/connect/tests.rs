use ndarray::s;
use proptest::prelude::*;

use super::*;
use crate::rng::Key;
use crate::threads::with_threads;
use crate::topology::euler::euler_number;
use crate::topology::labelling::component_sizes;

const OPEN: Options = Options {
    connectivity: Connectivity::Corners,
    boundary: Boundary::Open,
    smallest: 2,
    width: 1.0,
};

fn connected(
    phase: &Array3<bool>,
    score: &Array3<f32>,
    free: Option<&Array3<bool>>,
    options: &Options,
) -> (Array3<bool>, Outcome) {
    let mut out = Array3::from_elem(phase.dim(), true);
    let free = free.map(|free| free.view());
    let silent = Monitor::silent();
    let found = connect(phase.view(), score.view(), free, options, out.view_mut(), &silent);
    (out, found.unwrap())
}

fn components(phase: &Array3<bool>, options: &Options) -> usize {
    let Options { connectivity, boundary, .. } = *options;
    component_sizes(phase.view(), connectivity, boundary, &Monitor::silent()).unwrap().len()
}

fn size(phase: &Array3<bool>) -> i64 {
    phase.iter().filter(|&&in_phase| in_phase).count() as i64
}

/// Two blocks of 4³, and their score.
fn blocks() -> (Array3<bool>, Array3<f32>) {
    let mut phase = Array3::from_elem((8, 8, 16), false);
    phase.slice_mut(s![2..6, 2..6, 1..5]).fill(true);
    phase.slice_mut(s![2..6, 2..6, 11..15]).fill(true);
    let score = phase.mapv(|in_phase| if in_phase { 1.0 } else { -1.0 });
    (phase, score)
}

#[test]
fn blocks_get_a_straight_bridge() {
    let (phase, score) = blocks();
    let (out, outcome) = connected(&phase, &score, None, &OPEN);
    assert_eq!(outcome, Outcome { joined: 1, ..Outcome::default() });
    assert_eq!((size(&out), components(&out, &OPEN)), (128, 1));
    let bridge = out.slice(s![.., .., 5..11]);
    assert_eq!(bridge.iter().filter(|&&in_phase| in_phase).count(), 6);
    let (z, y) = out
        .indexed_iter()
        .find(|((.., x), v)| *x == 7 && **v)
        .map(|((z, y, _), _)| (z, y))
        .unwrap();
    assert!(bridge.slice(s![z, y, ..]).iter().all(|&in_phase| in_phase));

    let (thick, _) = connected(&phase, &score, None, &Options { width: 3.0, ..OPEN });
    let areas: Vec<_> = (5..11).map(|x| size(&thick.slice(s![.., .., x..=x]).to_owned())).collect();
    assert_eq!(areas, [9; 6]);
    assert_eq!((size(&thick), components(&thick, &OPEN)), (128, 1));
}

#[test]
fn the_bridge_takes_the_valley_with_the_lowest_pass() {
    let (phase, mut score) = blocks();
    // A ridge between the blocks but for one hole, far from the straight way.
    score.slice_mut(s![.., .., 7]).fill(-100.0);
    score[[0, 7, 7]] = -1.0;
    let (out, _) = connected(&phase, &score, None, &OPEN);
    assert!(out[[0, 7, 7]]);
    assert_eq!(size(&out.slice(s![.., .., 7..8]).to_owned()), 1);
}

#[test]
fn small_islands_are_erased_and_the_count_is_restored() {
    let (mut phase, mut score) = blocks();
    phase.slice_mut(s![.., .., 9..]).fill(false);
    phase[[7, 7, 15]] = true;
    score[[4, 6, 2]] = 0.5;
    let (out, outcome) = connected(&phase, &score, None, &OPEN);
    assert_eq!(outcome, Outcome { erased: 1, ..Outcome::default() });
    assert!(!out[[7, 7, 15]] && out[[4, 6, 2]]);
    phase[[7, 7, 15]] = false;
    phase[[4, 6, 2]] = true;
    assert_eq!(out, phase);
    // A fixed voxel cannot be erased, so it is joined.
    phase[[7, 7, 15]] = true;
    let mut free = Array3::from_elem(phase.dim(), true);
    free[[7, 7, 15]] = false;
    let (out, outcome) = connected(&phase, &score, Some(&free), &OPEN);
    assert_eq!(outcome, Outcome { joined: 1, ..Outcome::default() });
    assert!(out[[7, 7, 15]] && components(&out, &OPEN) == 1);
}

#[test]
fn walls_keep_an_island_apart() {
    let (phase, score) = blocks();
    let mut free = Array3::from_elem(phase.dim(), true);
    free.slice_mut(s![.., .., 8]).fill(false);
    let (out, outcome) = connected(&phase, &score, Some(&free), &OPEN);
    assert_eq!(outcome, Outcome { apart: 1, ..Outcome::default() });
    assert_eq!(out, phase);
    // The way round the border leads past the wall.
    let periodic = Options { boundary: Boundary::Periodic, ..OPEN };
    let (out, outcome) = connected(&phase, &score, Some(&free), &periodic);
    assert_eq!(outcome, Outcome { joined: 1, ..Outcome::default() });
    assert_eq!(size(&out.slice(s![.., .., ..1]).to_owned()), 1);
    assert_eq!(size(&out.slice(s![.., .., 5..11]).to_owned()), 0);
}

#[test]
fn what_cannot_be_restored_is_reported() {
    let mut phase = Array3::from_elem((1, 1, 8), false);
    (phase[[0, 0, 1]], phase[[0, 0, 6]]) = (true, true);
    let score = Array3::zeros(phase.dim());
    let (out, outcome) = connected(&phase, &score, None, &Options { smallest: 0, ..OPEN });
    // The bridge of four stays when both its ends are gone.
    assert_eq!(outcome, Outcome { joined: 1, missing: -2, ..Outcome::default() });
    assert_eq!(size(&out), 4);
}

#[test]
fn one_piece_and_none_are_unchanged() {
    let (phase, score) = blocks();
    let one = Array3::from_shape_fn(phase.dim(), |(.., x)| x < 8 && phase[[2, 2, x]]);
    for phase in [one, Array3::from_elem(phase.dim(), true), Array3::from_elem(phase.dim(), false)]
    {
        for connectivity in [Connectivity::Corners, Connectivity::Faces] {
            let options = Options { connectivity, smallest: 1000, width: 3.0, ..OPEN };
            assert_eq!(
                connected(&phase, &score, None, &options),
                (phase.clone(), Outcome::default())
            );
        }
    }
    for shape in [(0, 3, 4), (3, 0, 4), (3, 4, 0), (1, 1, 1)] {
        let phase = Array3::from_elem(shape, true);
        let score = Array3::zeros(shape);
        assert_eq!(connected(&phase, &score, None, &OPEN), (phase, Outcome::default()));
    }
}

#[test]
fn bad_input_is_named() {
    let (phase, score) = blocks();
    let named = |score: &Array3<f32>, options: Options| {
        let mut out = phase.clone();
        let silent = Monitor::silent();
        match connect(phase.view(), score.view(), None, &options, out.view_mut(), &silent) {
            Err(Error::Parameter { parameter, .. }) => parameter,
            _ => "none",
        }
    };
    assert_eq!(named(&Array3::zeros((8, 8, 15)), OPEN), "score.shape");
    assert_eq!(named(&Array3::from_elem(phase.dim(), f32::NAN), OPEN), "score");
    assert_eq!(
        named(&score, Options { connectivity: Connectivity::Edges, ..OPEN }),
        "connectivity"
    );
    for width in [0.9, 33.0, f64::NAN] {
        assert_eq!(named(&score, Options { width, ..OPEN }), "width");
    }
}

prop_compose! {
    fn volumes()(
        shape in (1..7usize, 1..9usize, 1..12usize),
        fraction in 0.02..0.98f32,
        fixed in prop::sample::select(vec![0.0f32, 0.1, 0.6]),
        levels in prop::sample::select(vec![2.0f32, 1e6]),
        seed: u64,
    ) -> (Array3<bool>, Array3<f32>, Array3<bool>) {
        let key = Key::new(seed);
        let mut index = 0;
        let score = Array3::from_shape_simple_fn(shape, || {
            index += 1;
            key.unit(index)
        });
        let free = score.mapv(|value| (value * 1e3).fract() >= fixed);
        (score.mapv(|value| value < fraction), score.mapv(|value| (-levels * value).round()), free)
    }
}

proptest! {
    #[test]
    fn the_result_is_one_piece_of_the_same_size(
        (phase, score, free) in volumes(),
        corners: bool,
        periodic: bool,
        smallest in 0..5u64,
        width in prop::sample::select(vec![1.0, 2.0, 3.5]),
    ) {
        let options = Options {
            connectivity: if corners { Connectivity::Corners } else { Connectivity::Faces },
            boundary: if periodic { Boundary::Periodic } else { Boundary::Open },
            smallest,
            width,
        };
        let (out, outcome) = connected(&phase, &score, Some(&free), &options);
        let Outcome { erased, joined, apart, missing } = outcome;
        prop_assert_eq!(size(&out), size(&phase) - missing);
        for ((&before, &after), &free) in phase.iter().zip(&out).zip(&free) {
            prop_assert!(free || before == after);
        }
        let before = components(&phase, &options);
        prop_assert_eq!(erased + joined + apart, before.saturating_sub(1));
        prop_assert_eq!(components(&out, &options), apart + before.min(1));
        // Only what no free voxels lead to is apart.
        let reach = Array3::from_shape_fn(phase.dim(), |at| out[at] || free[at]);
        let mut regions = Array3::zeros(phase.dim());
        let Options { connectivity, boundary, .. } = options;
        let silent = Monitor::silent();
        label(reach.view(), connectivity, boundary, regions.view_mut(), &silent).unwrap();
        let used: std::collections::BTreeSet<u32> =
            out.iter().zip(&regions).filter(|(v, _)| **v).map(|(_, &region)| region).collect();
        prop_assert_eq!(used.len(), components(&out, &options));

        let fortran = phase.t().as_standard_layout().into_owned().reversed_axes();
        for threads in [1, 3] {
            let again = with_threads(threads, || connected(&fortran, &score, Some(&free), &options));
            prop_assert_eq!(&again.unwrap(), &(out.clone(), outcome));
        }
    }

    /// Whatever is swapped keeps the topology, also in volumes whose copies lie side by side.
    #[test]
    fn swapped_voxels_keep_the_euler_number(
        (phase, score, free) in volumes(),
        corners: bool,
        periodic: bool,
        wanted in 0..400usize,
    ) {
        let connectivity = if corners { Connectivity::Corners } else { Connectivity::Faces };
        let boundary = if periodic { Boundary::Periodic } else { Boundary::Open };
        let silent = Monitor::silent();
        let mut scene =
            Scene::new(phase.view(), Some(free.view()), connectivity, boundary).scored(score.view());
        let missing = recount::restore(&mut scene, wanted, &silent).unwrap();
        let mut at = 0..;
        let out = phase.mapv(|_| scene.phase(at.next().unwrap()));
        prop_assert_eq!(size(&out), wanted as i64 - missing);
        let numbers = |phase: &Array3<bool>| {
            let found = component_sizes(phase.view(), connectivity, boundary, &silent).unwrap();
            (found.len(), euler_number(phase.view(), connectivity, boundary, &silent).unwrap())
        };
        prop_assert_eq!(numbers(&out), numbers(&phase));
    }
}
