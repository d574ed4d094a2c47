//! Distances and local thickness of blobs, and distances in an almost empty volume.

mod common;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use ndarray::Array3;
use poresynth_core::geometry::{distance_transform, local_thickness};
use poresynth_core::monitor::Monitor;
use poresynth_core::volume::Boundary;

fn distance(c: &mut Criterion) {
    let edge = 256;
    let blobs = common::gray(edge, 1).mapv(|v| v > 127.5);
    let mut single = Array3::from_elem(blobs.dim(), true);
    single[[0, 0, 0]] = false;
    let mut out = Array3::zeros(blobs.dim());
    let silent = Monitor::silent();
    let mut group = c.benchmark_group(format!("distance, {edge}³"));
    group.throughput(Throughput::Elements(blobs.len() as u64)).sample_size(10);
    for (name, volume) in [("blobs", &blobs), ("a single voxel outside", &single)] {
        for (kind, size) in [("cubes", [1.0; 3]), ("boxes", [1.5, 1.1, 1.0])] {
            group.bench_function(format!("{name}, {kind}"), |b| {
                b.iter(|| {
                    let view = out.view_mut();
                    distance_transform(volume.view(), size, Boundary::Open, None, view, &silent)
                });
            });
        }
    }
    group.bench_function("local thickness of blobs", |b| {
        b.iter(|| {
            let view = out.view_mut();
            local_thickness(blobs.view(), [1.0; 3], Boundary::Open, view, &silent)
        });
    });
    group.finish();
}

criterion_group!(benches, distance);
criterion_main!(benches);
