//! Connected components of blobs and of noise.

mod common;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use ndarray::Array3;
use poresynth_core::monitor::Monitor;
use poresynth_core::rng::Key;
use poresynth_core::topology::labelling::{Connectivity, component_sizes, label};
use poresynth_core::topology::statistics::component_statistics;
use poresynth_core::volume::Boundary;

fn labelling(c: &mut Criterion) {
    let edge = 256;
    let blobs = common::gray(edge, 1).mapv(|v| v > 127.5);
    let mut index = 0;
    let noise = Array3::from_shape_simple_fn(blobs.dim(), || {
        index += 1;
        Key::new(1).unit(index) < 0.3
    });
    let mut labels = Array3::zeros(blobs.dim());
    for (name, volume) in [("blobs", &blobs), ("noise", &noise)] {
        let mut group = c.benchmark_group(format!("labelling, {name} of {edge}³"));
        group.throughput(Throughput::Elements(volume.len() as u64));
        for (name, connectivity) in
            [("6", Connectivity::Faces), ("18", Connectivity::Edges), ("26", Connectivity::Corners)]
        {
            let silent = Monitor::silent();
            group.bench_function(format!("sizes, {name}"), |b| {
                b.iter(|| component_sizes(volume.view(), connectivity, Boundary::Open, &silent));
            });
        }
        group.bench_function("labels, 26", |b| {
            b.iter(|| {
                let (view, silent) = (labels.view_mut(), Monitor::silent());
                label(volume.view(), Connectivity::Corners, Boundary::Open, view, &silent)
            });
        });
        for (name, boundary) in [("open", Boundary::Open), ("periodic", Boundary::Periodic)] {
            let (corners, silent) = (Connectivity::Corners, Monitor::silent());
            group.bench_function(format!("statistics, 26, {name}"), |b| {
                b.iter(|| component_statistics(volume.view(), corners, boundary, None, &silent));
            });
        }
        group.finish();
    }
}

criterion_group!(benches, labelling);
criterion_main!(benches);
