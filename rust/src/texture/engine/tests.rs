#![allow(clippy::float_cmp)] // equal bits are what is asked for

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use super::*;
use crate::error::Error;
use crate::texture::parameters::{Backend, Emphasis};
use crate::texture::responses::FilterBank;
use crate::texture::symmetry::Symmetry;
use crate::threads::with_threads;
use crate::volume::{Boundary, position, voxels};

/// Smooth noise: something with a structure a few voxels large.
fn exemplar(channels: usize) -> Field {
    let shape = [18, 17, 16];
    let n = channels * voxels(shape);
    let noise = (0..n as u64).map(|i| 255.0 * Key::new(7).unit(i)).collect();
    let smooth =
        pyramid::gaussian(&Field::new(shape, channels, noise).unwrap(), 1.2, Boundary::Open);
    let stretched = smooth.into_values().iter().map(|v| (v - 127.5) * 5.0 + 127.5).collect();
    Field::new(shape, channels, stretched).unwrap()
}

fn plan(iterations: usize, backend: Backend) -> LevelPlan {
    let stages = vec![Stage { window: 6, step: 3 }, Stage { window: 4, step: 2 }];
    LevelPlan {
        stages,
        iterations,
        filters: None,
        detail: false,
        response_steps: [0; 2],
        backend,
        temperature: 0.02,
        mixing: Mixing::MEAN,
        mode_steps: 0,
    }
}

/// As many iterations of coherent search at each of so many levels.
fn plans(levels: usize, iterations: usize) -> Vec<LevelPlan> {
    vec![plan(iterations, Backend::Coherent); levels]
}

/// The exemplar as it is, and nothing else.
fn alone(field: Field) -> [Example; 1] {
    [Example::volume(field, Symmetry::None.orientations(None))]
}

fn parameters() -> Parameters {
    Parameters {
        levels: plans(2, 3),
        tolerance: 0.0,
        patience: 3,
        start: Start::Blocks(6),
        starts: 1,
        components: 16,
        variance: 0.95,
        emphasis: Emphasis::None,
        match_histogram: true,
        index_weight: IndexWeight::Off,
        run_penalty: 0.3,
        run_reach: 6,
        exponent: 0.8,
        adaptive: true,
        gradient: 0.1,
        boundary: Boundary::Open,
    }
}

const SHAPE: Shape = [22, 13, 19];

fn run(p: &Parameters, constraints: Constraints) -> Synthesis {
    synthesize(&alone(exemplar(1)), SHAPE, p, constraints, Key::new(3), &Monitor::silent()).unwrap()
}

#[test]
fn the_result_is_the_same_on_any_number_of_threads() {
    for boundary in [Boundary::Open, Boundary::Periodic] {
        for backend in [Backend::Coherent, Backend::KdTree(5)] {
            let p = Parameters { levels: vec![plan(3, backend); 2], boundary, ..parameters() };
            let first = run(&p, Constraints::default());
            for threads in [1, 2, 3, 8] {
                let again = with_threads(threads, || run(&p, Constraints::default())).unwrap();
                assert!(first.field == again.field && first.maps == again.maps, "{threads}");
                assert_eq!(first.energy, again.energy);
            }
        }
    }
}

#[test]
fn every_backend_and_option_gives_values_of_the_exemplars_range() {
    let source = exemplar(2);
    let (low, high) = source
        .clone()
        .into_values()
        .iter()
        .fold((f32::MAX, f32::MIN), |(a, b), &v| (a.min(v), b.max(v)));
    for backend in [Backend::BruteForce, Backend::KdTree(4), Backend::Coherent] {
        for index_weight in [IndexWeight::Off, IndexWeight::Literal, IndexWeight::Normalised] {
            for symmetry in [Symmetry::None, Symmetry::Flips] {
                let p = Parameters { levels: vec![plan(1, backend)], index_weight, ..parameters() };
                let made = synthesize(
                    &[Example::volume(source.clone(), symmetry.orientations(None))],
                    SHAPE,
                    &p,
                    Constraints::default(),
                    Key::new(0),
                    &Monitor::silent(),
                )
                .unwrap();
                assert_eq!((made.field.shape(), made.field.channels()), (SHAPE, 2));
                assert!(made.maps[0].matches.iter().all(|m| m.is_some()));
                let values = made.field.into_values();
                assert!(values.iter().all(|v| (low - 1e-3..=high + 1e-3).contains(v)));
            }
        }
    }
}

#[test]
fn the_energy_falls_within_a_level() {
    let made = run(
        &Parameters { levels: plans(2, 8), run_penalty: 0.0, ..parameters() },
        Constraints::default(),
    );
    for level in 0..2 {
        let at: Vec<f64> =
            made.energy.iter().filter(|e| e.level == level).map(|e| e.energy).collect();
        assert!(at[at.len() - 1] < 0.8 * at[0], "{at:?}");
    }
    assert!(made.energy.iter().all(|e| (e.energy - e.data - e.gradient).abs() < 1e-9));
}

#[test]
fn the_adaptive_factor_follows_the_energy() {
    let made = run(&Parameters { levels: plans(2, 8), ..parameters() }, Constraints::default());
    for pair in made.energy.windows(2).filter(|p| p[1].iteration > 0) {
        let ratio = pair[1].factor / pair[0].factor;
        let expected = match pair[1].energy / pair[0].energy {
            r if r < 1.0 - SAME => 1.05,
            r if r > 1.0 + SAME => 0.7,
            _ => 1.0,
        };
        assert!((ratio - expected).abs() < 1e-4, "{pair:?}");
    }
    let fixed = run(&Parameters { adaptive: false, ..parameters() }, Constraints::default());
    assert!(fixed.energy.iter().all(|e| e.factor == 1.0));
}

#[test]
fn a_periodic_result_has_no_larger_steps_across_the_border_than_inside() {
    let p = Parameters { boundary: Boundary::Periodic, levels: plans(2, 6), ..parameters() };
    let field = run(&p, Constraints::default()).field;
    let [nz, ny, nx] = SHAPE;
    let step = |z: usize| -> f32 {
        let next = (z + 1) % nz;
        let values = field.channel(0);
        (0..ny * nx).map(|i| (values[z * ny * nx + i] - values[next * ny * nx + i]).abs()).sum()
    };
    let inside: Vec<f32> = (0..nz - 1).map(step).collect();
    let largest = inside.iter().copied().fold(0.0, f32::max);
    assert!(step(nz - 1) <= 1.3 * largest, "{} {inside:?}", step(nz - 1));
}

#[test]
fn known_voxels_are_kept_and_their_surroundings_adapt() {
    let source = exemplar(1);
    let known: Vec<bool> = (0..voxels(SHAPE)).map(|i| position(SHAPE, i)[0] < 8).collect();
    let mut values = Field::zeros(SHAPE, 1);
    for (i, v) in values.channel_mut(0).iter_mut().enumerate() {
        let [z, y, x] = position(SHAPE, i);
        *v = source.channel(0)[crate::volume::index(source.shape(), [z.min(17), y, x.min(15)])];
    }
    let constraints =
        Constraints { known: Some((values.clone(), known.clone())), ..Constraints::default() };
    let made = run(&Parameters { levels: plans(2, 6), ..parameters() }, constraints);
    for (i, on) in known.iter().enumerate() {
        assert!(!on || made.field.channel(0)[i] == values.channel(0)[i]);
    }
    // The step from the last known plane to the first free one is an ordinary step.
    let plane = SHAPE[1] * SHAPE[2];
    let step = |z: usize| -> f32 {
        let v = made.field.channel(0);
        (0..plane).map(|i| (v[z * plane + i] - v[(z + 1) * plane + i]).abs()).sum()
    };
    let typical: f32 = (0..SHAPE[0] - 1).map(step).sum::<f32>() / (SHAPE[0] - 1) as f32;
    assert!(step(7) < 2.0 * typical, "{} {typical}", step(7));
}

#[test]
fn windows_that_miss_the_domain_are_not_searched() {
    let domain: Vec<bool> = (0..voxels(SHAPE)).map(|i| position(SHAPE, i)[2] < 4).collect();
    let made = run(&parameters(), Constraints { domain: Some(domain), ..Constraints::default() });
    let lattice = &made.maps[0].lattice;
    for (origin, m) in
        crate::texture::match_map::product(&lattice.origins).zip(&made.maps[0].matches)
    {
        assert_eq!(m.is_some(), origin[2] < 4);
    }
}

#[test]
fn the_caller_can_cancel_and_hears_of_the_progress() {
    let cancel = AtomicBool::new(false);
    let heard = Mutex::new(Vec::new());
    let report = |p: crate::monitor::Progress| {
        heard.lock().unwrap().push(p.fraction);
        if p.fraction > 0.3 {
            cancel.store(true, Ordering::Relaxed);
        }
    };
    let monitor = Monitor::new(&cancel, &report);
    let made = synthesize(
        &alone(exemplar(1)),
        SHAPE,
        &parameters(),
        Constraints::default(),
        Key::new(0),
        &monitor,
    );
    assert_eq!(made.unwrap_err(), Error::Cancelled);
    let heard = heard.into_inner().unwrap();
    assert!(heard.windows(2).all(|w| w[0] <= w[1]) && heard[heard.len() - 1] < 0.8, "{heard:?}");
}

#[test]
fn what_does_not_fit_is_refused() {
    let source = alone(exemplar(1));
    let refuse = |p: Parameters, shape: Shape, constraints: Constraints| {
        synthesize(&source, shape, &p, constraints, Key::new(0), &Monitor::silent()).unwrap_err()
    };
    let none = Constraints::default;
    refuse(Parameters { levels: plans(3, 1), ..parameters() }, SHAPE, none());
    refuse(Parameters { levels: Vec::new(), ..parameters() }, SHAPE, none());
    for stages in [Vec::new(), vec![Stage { window: 4, step: 5 }]] {
        let levels = vec![LevelPlan { stages, ..plan(1, Backend::Coherent) }];
        refuse(Parameters { levels, ..parameters() }, SHAPE, none());
    }
    refuse(parameters(), [11, 13, 19], none());
    refuse(parameters(), [0, 13, 19], none());
    refuse(parameters(), [1 << 20, 13, 19], none());
    let short = Constraints { domain: Some(vec![true; 3]), ..Constraints::default() };
    refuse(parameters(), SHAPE, short);
    refuse(Parameters { starts: 0, ..parameters() }, SHAPE, none());
    // These start from blocks, whatever the shape.
    let given = Constraints { start: Some(Field::zeros(SHAPE, 1)), ..Constraints::default() };
    refuse(parameters(), SHAPE, given);
}

#[test]
fn of_a_given_start_the_order_counts() {
    let image = Field::new([1, 16, 16], 1, exemplar(1).channel(0)[..256].to_vec()).unwrap();
    let examples: Vec<Example> =
        (0..3).map(|axis| Example::image(image.clone(), axis, false, 1.0)).collect();
    let p = Parameters {
        levels: vec![LevelPlan {
            filters: Some(FilterBank::default()),
            ..plan(0, Backend::Coherent)
        }],
        start: Start::RandomField,
        boundary: Boundary::Periodic,
        ..parameters()
    };
    let shape = [8, 8, 8];
    let made = |values: Vec<f32>, shape: Shape| {
        let start = Some(Field::new(shape, 1, values)?);
        let given = Constraints { start, ..Constraints::default() };
        synthesize(&examples, [8, 8, 8], &p, given, Key::new(0), &Monitor::silent())
    };
    let rising: Vec<f32> = (0..512u16).map(f32::from).collect();
    let field = made(rising.clone(), shape).unwrap().field;
    assert!(field.channel(0).is_sorted());
    let mut wanted = image.channel(0).to_vec();
    wanted.sort_by(f32::total_cmp);
    assert!((field.channel(0)[0], field.channel(0)[511]) == (wanted[0], wanted[255]));
    let scaled = rising.iter().map(|v| 4.0 * v).collect();
    assert!(made(scaled, shape).unwrap().field == field);
    assert!(made(vec![0.0; 256], [8, 8, 4]).is_err());
}

#[test]
fn an_output_of_the_window_itself_works() {
    let stages = vec![Stage { window: 4, step: 2 }];
    let levels = vec![LevelPlan { stages, ..plan(3, Backend::Coherent) }];
    let p = Parameters { levels, ..parameters() };
    for boundary in [Boundary::Open, Boundary::Periodic] {
        let p = Parameters { boundary, ..p.clone() };
        let made = synthesize(
            &alone(exemplar(1)),
            [4, 4, 4],
            &p,
            Constraints::default(),
            Key::new(0),
            &Monitor::silent(),
        );
        assert_eq!(made.unwrap().field.shape(), [4, 4, 4]);
    }
}

#[test]
fn of_several_starts_the_one_that_is_nearest_to_the_exemplar_goes_on() {
    let levels = |iterations| vec![plan(iterations, Backend::Coherent)];
    let source = exemplar(1);
    let made = |starts, threads| {
        let p = Parameters { levels: levels(2), starts, ..parameters() };
        with_threads(threads, || run(&p, Constraints::default())).unwrap().field
    };
    let [one, six] = [made(1, 2), made(6, 2)];
    assert!(one != six);
    let both = nearest(&source, &[&one, &six], None, &Monitor::silent()).unwrap();
    assert_eq!(both, 1);
    assert!(six == made(6, 1) && six == made(6, 3));
    // The first start is that of a run with one.
    let six = made(6, 2);
    let again = nearest(&source, &[&six, &one, &made(2, 2)], None, &Monitor::silent()).unwrap();
    assert_eq!(again, 0);
}
