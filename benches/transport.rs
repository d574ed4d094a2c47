//! Diffusion and creeping flow through blobs.

mod common;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use poresynth_core::monitor::Monitor;
use poresynth_core::transport::Settings;
use poresynth_core::transport::diffusion::diffuse;
use poresynth_core::transport::pore::PoreSpace;
use poresynth_core::transport::stokes::flow;
use poresynth_core::volume::Boundary;

fn transport(c: &mut Criterion) {
    let edge = 96;
    let solid = common::gray(edge, 1).mapv(|v| v > 127.5);
    let silent = Monitor::silent();
    let mut group = c.benchmark_group(format!("transport, blobs of {edge}³"));
    group.sample_size(10);
    group.throughput(Throughput::Elements(solid.len() as u64));
    let space = |boundary| PoreSpace::new(solid.view(), boundary, &silent);
    for (name, boundary) in [("open", Boundary::Open), ("periodic", Boundary::Periodic)] {
        group.bench_function(format!("pore space, {name}"), |b| b.iter(|| space(boundary)));
        let space = space(boundary).expect("a small volume");
        let settings = |tolerance| Settings { spacing: [1.0; 3], tolerance, iterations: 1000 };
        group.bench_function(format!("diffusion, {name}"), |b| {
            b.iter(|| diffuse(&space, &settings(1e-4), &silent));
        });
        group.bench_function(format!("flow, {name}"), |b| {
            b.iter(|| flow(&space, &settings(1e-3), &silent));
        });
    }
    group.finish();
}

criterion_group!(benches, transport);
criterion_main!(benches);
