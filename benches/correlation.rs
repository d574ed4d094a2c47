//! Correlation functions of two phases and of clusters, runs along the axes, local porosity.

mod common;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use ndarray::Array3;
use poresynth_core::correlation::cluster::two_point_cluster;
use poresynth_core::correlation::local_porosity::local_porosity;
use poresynth_core::correlation::runs::run_lengths;
use poresynth_core::correlation::two_point::{Lags, two_point, two_point_map};
use poresynth_core::monitor::Monitor;
use poresynth_core::rng::Key;
use poresynth_core::topology::labelling::{Connectivity, label};
use poresynth_core::volume::Boundary;

const EDGE: usize = 256;

fn pairs(c: &mut Criterion) {
    let blobs = common::gray(EDGE, 1).mapv(|v| v > 127.5);
    let void = blobs.mapv(|v| !v);
    let silent = Monitor::silent();
    let mut group = c.benchmark_group(format!("correlations of {EDGE}³, r ≤ 50"));
    group.sample_size(10);
    group.throughput(Throughput::Elements(blobs.len() as u64));
    for (name, boundary) in [("open", Boundary::Open), ("periodic", Boundary::Periodic)] {
        let lags = Lags::cubic(50, boundary);
        group.bench_function(format!("two phases, {name}"), |b| {
            b.iter(|| two_point(blobs.view(), Some(void.view()), &lags, &silent));
        });
        group.bench_function(format!("map, {name}"), |b| {
            b.iter(|| two_point_map(blobs.view(), None, &lags, &silent));
        });
    }
    let mut index = 0;
    let noise = Array3::from_shape_simple_fn(blobs.dim(), || {
        index += 1;
        Key::new(1).unit(index) < 0.09
    });
    for (name, solid) in [("blobs", &blobs), ("noise of 9 %", &noise)] {
        let mut labels = Array3::zeros(solid.dim());
        let corners = Connectivity::Corners;
        let sizes = label(solid.view(), corners, Boundary::Open, labels.view_mut(), &silent);
        let clusters = sizes.expect("the shapes are equal").len();
        let lags = Lags::cubic(50, Boundary::Open);
        group.bench_function(format!("clusters of {name}"), |b| {
            b.iter(|| two_point_cluster(labels.view(), clusters, &lags, &silent));
        });
    }
    group.finish();
}

fn runs_and_windows(c: &mut Criterion) {
    let blobs = common::gray(EDGE, 1).mapv(|v| v > 127.5);
    let silent = Monitor::silent();
    let mut group = c.benchmark_group(format!("runs and windows of {EDGE}³"));
    group.throughput(Throughput::Elements(blobs.len() as u64));
    group.bench_function("runs along three axes", |b| {
        b.iter(|| run_lengths(blobs.view(), Boundary::Open, &silent));
    });
    for edge in [10, 40] {
        group.bench_function(format!("porosity of windows of {edge}³"), |b| {
            b.iter(|| local_porosity(blobs.view(), [edge; 3], 100, Boundary::Open, &silent));
        });
    }
    group.finish();
}

criterion_group!(benches, pairs, runs_and_windows);
criterion_main!(benches);
