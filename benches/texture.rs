//! Kernels of the volume-texture engine, and one whole small synthesis.

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use ndarray::Array3;
use poresynth_core::geometry::signed_distance;
use poresynth_core::intensity::{Quantiles, cut_solid};
use poresynth_core::monitor::Monitor;
use poresynth_core::rng::Key;
use poresynth_core::texture::blend::{Mixing, Part, Source, blend};
use poresynth_core::texture::match_map::random_blocks;
use poresynth_core::texture::neighbourhoods::Neighbourhoods;
use poresynth_core::texture::parameters::{
    Backend, Emphasis, Example, IndexWeight, LevelPlan, Start,
};
use poresynth_core::texture::search::{BruteForce, Coherent, KdTree, Scene, Search};
use poresynth_core::texture::symmetry::Symmetry;
use poresynth_core::texture::{
    Constraints, Field, MatchMap, Parameters, Stage, poisson, pyramid, synthesize,
};
use poresynth_core::volume::{Boundary, Shape, voxels};

const EXEMPLAR: Shape = [60, 60, 60];
const OUTPUT: Shape = [96, 96, 96];

/// Smooth noise with two phases, as a clipped field.
fn exemplar() -> Field {
    let noise = (0..voxels(EXEMPLAR) as u64).map(|i| 255.0 * Key::new(1).unit(i)).collect();
    let noise = Field::new(EXEMPLAR, 1, noise).expect("one value a voxel");
    let smooth = pyramid::gaussian(&noise, 2.5, Boundary::Periodic);
    let clipped =
        smooth.into_values().into_iter().map(|v| ((v - 127.5) * 12.0 + 127.5).clamp(0.0, 255.0));
    Field::new(EXEMPLAR, 1, clipped.collect()).expect("one value a voxel")
}

fn neighbourhoods(field: &Field, window: usize) -> Neighbourhoods<'_> {
    let all = Symmetry::None.orientations(None);
    Neighbourhoods::new(field, [window; 3], &all, (32, 0.95), Key::new(0), &Monitor::silent())
        .expect("the window fits")
}

fn searches(c: &mut Criterion) {
    let field = exemplar();
    let set = neighbourhoods(&field, 8);
    let (_, map) = random_blocks(&field, OUTPUT, 8, Boundary::Open, Key::new(2));
    let mut group = c.benchmark_group("search, window 8");
    let run = |backend: &dyn Search, sites: usize| -> MatchMap {
        let mut out = map.clone();
        let queries: Vec<i16> = map.matches[..sites]
            .iter()
            .flat_map(|m| set.descriptor(set.index(m.moved([3, 0, 1], set.limit(0)))).to_vec())
            .collect();
        let scene = Scene::new(&set, &map, &map.lattice, None, None, Key::new(3));
        backend.search(&scene, 0, &queries, &vec![true; sites], &mut out.matches[..sites]);
        out
    };
    let tree = KdTree::new(&set, 10).expect("there are windows");
    for (name, backend, sites) in [
        ("brute force", &BruteForce as &dyn Search, 20),
        ("kd-tree", &tree, 200),
        ("coherent", &Coherent, map.matches.len()),
    ] {
        group.throughput(Throughput::Elements(sites as u64));
        group.bench_function(name, |b| b.iter(|| run(backend, sites)));
    }
    group.finish();
}

fn blending(c: &mut Criterion) {
    let field = exemplar();
    let laplacian = Field::new(EXEMPLAR, 1, poisson::laplacian(field.channel(0), EXEMPLAR))
        .expect("one value a voxel");
    let set = neighbourhoods(&field, 4);
    let (start, _) = random_blocks(&field, OUTPUT, 4, Boundary::Open, Key::new(2));
    let lattice = poresynth_core::texture::lattice::Lattice::new(
        OUTPUT,
        [4; 3],
        [2; 3],
        [0; 3],
        Boundary::Open,
    );
    let n = voxels(lattice.sites());
    let matches = (0..n as u64).map(|i| set.match_at(Key::new(4).below(i, set.len()))).collect();
    let map = MatchMap { lattice, matches };
    let weights = vec![1.0; n];
    let mut group = c.benchmark_group("optimisation, window 4");
    group.throughput(Throughput::Elements(voxels(OUTPUT) as u64));
    for (name, laplacian) in [("blend", None), ("blend with Laplacian", Some(&laplacian))] {
        let source = Source { field: &field, emphasis: None, laplacian, views: set.views() };
        let parts = [Part { source: &source, map: &map, weights: &weights }];
        group.bench_function(name, |b| {
            b.iter(|| blend(&parts, Mixing::MEAN, &mut start.clone(), &Monitor::silent()));
        });
    }
    let zeros = vec![0.0; voxels(OUTPUT)];
    let ones = vec![1.0; voxels(OUTPUT)];
    group.bench_function("screened Poisson, μ = 0.1", |b| {
        b.iter_batched(
            || start.channel(0).to_vec(),
            |mut s| poisson::solve(&mut s, &ones, &zeros, 0.1, OUTPUT, Boundary::Open),
            BatchSize::LargeInput,
        );
    });
    group.finish();
}

fn preparation(c: &mut Criterion) {
    let field = exemplar();
    let mut group = c.benchmark_group("exemplar 60³");
    group.throughput(Throughput::Elements(voxels(EXEMPLAR) as u64));
    for window in [4, 8, 10] {
        group.bench_function(format!("neighbourhoods, window {window}"), |b| {
            b.iter(|| neighbourhoods(&field, window));
        });
    }
    let phase = Array3::from_shape_fn((60, 60, 60), |(z, y, x)| {
        field.channel(0)[(z * 60 + y) * 60 + x] > 127.5
    });
    group.bench_function("signed distance, clip 6", |b| {
        b.iter(|| signed_distance(phase.view(), None, 6, Boundary::Open));
    });
    group.finish();
}

fn intensities(c: &mut Criterion) {
    let field = exemplar();
    let (output, _) = random_blocks(&field, OUTPUT, 8, Boundary::Open, Key::new(2));
    let values = output.channel(0);
    let n = voxels(OUTPUT);
    let quantiles = Quantiles::new(field.channel(0));
    let mut group = c.benchmark_group("intensities");
    group.throughput(Throughput::Elements(n as u64));
    group.bench_function("histogram matching", |b| {
        b.iter_batched(
            || values.to_vec(),
            |mut v| quantiles.match_values(&mut v, None),
            BatchSize::LargeInput,
        );
    });
    group.bench_function("exact cut", |b| b.iter(|| cut_solid(values, n / 2, None, Key::new(0))));
    group.finish();
}

fn whole(c: &mut Criterion) {
    let field = exemplar();
    let plan = LevelPlan {
        stages: vec![Stage { window: 8, step: 4 }, Stage { window: 4, step: 2 }],
        iterations: 6,
        filters: None,
        detail: false,
        response_steps: [0; 2],
        backend: Backend::Coherent,
        temperature: 0.0,
        mixing: Mixing::MEAN,
        mode_steps: 0,
    };
    let examples = [Example::volume(field, Symmetry::None.orientations(None))];
    let parameters = Parameters {
        levels: vec![plan; 2],
        tolerance: 0.005,
        patience: 3,
        start: Start::Blocks(8),
        starts: 1,
        components: 32,
        variance: 0.95,
        emphasis: Emphasis::None,
        match_histogram: true,
        index_weight: IndexWeight::Off,
        run_penalty: 0.3,
        run_reach: 12,
        exponent: 0.8,
        adaptive: false,
        gradient: 0.0,
        boundary: Boundary::Open,
    };
    let mut group = c.benchmark_group("synthesis");
    group.sample_size(10);
    group.bench_function("96³ from 60³, two levels", |b| {
        b.iter(|| {
            let none = Constraints::default();
            synthesize(&examples, OUTPUT, &parameters, none, Key::new(0), &Monitor::silent())
        });
    });
    group.finish();
}

criterion_group!(benches, searches, blending, preparation, intensities, whole);
criterion_main!(benches);
