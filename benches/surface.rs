//! Surface area and lines along the directions of the lattice, of blobs.

mod common;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use poresynth_core::geometry::secants::secants;
use poresynth_core::geometry::surface::{Method, surface_area};
use poresynth_core::monitor::Monitor;
use poresynth_core::volume::Boundary;

fn surface(c: &mut Criterion) {
    let edge = 256;
    let blobs = common::gray(edge, 1).mapv(|v| v > 127.5);
    let silent = Monitor::silent();
    let mut group = c.benchmark_group(format!("surface of blobs, {edge}³"));
    group.throughput(Throughput::Elements(blobs.len() as u64));
    for (name, method) in [
        ("Crofton", Method::Crofton),
        ("marching cubes", Method::MarchingCubes),
        ("faces", Method::Faces),
    ] {
        group.bench_function(name, |b| {
            b.iter(|| surface_area(blobs.view(), [1.0; 3], method, Boundary::Open, &silent));
        });
    }
    for (directions, reach) in [(13, 1), (49, 2), (145, 3)] {
        group.bench_function(format!("{directions} directions"), |b| {
            b.iter(|| secants(blobs.view(), reach, [1.0; 3], Boundary::Open, &silent));
        });
    }
    group.finish();
}

criterion_group!(benches, surface);
criterion_main!(benches);
