//! Euler number of blobs.

mod common;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use poresynth_core::monitor::Monitor;
use poresynth_core::topology::euler::euler_number;
use poresynth_core::topology::labelling::Connectivity;
use poresynth_core::volume::Boundary;

fn euler(c: &mut Criterion) {
    let edge = 256;
    let blobs = common::gray(edge, 1).mapv(|v| v > 127.5);
    let fortran = blobs.t().as_standard_layout().into_owned().reversed_axes();
    let mut group = c.benchmark_group(format!("Euler number of {edge}³"));
    group.throughput(Throughput::Elements(blobs.len() as u64));
    for (order, volume) in [("C order", &blobs), ("Fortran order", &fortran)] {
        for (name, connectivity) in [("6", Connectivity::Faces), ("26", Connectivity::Corners)] {
            for (border, boundary) in [("open", Boundary::Open), ("periodic", Boundary::Periodic)] {
                group.bench_function(format!("{name}, {border}, {order}"), |b| {
                    let silent = Monitor::silent();
                    b.iter(|| euler_number(volume.view(), connectivity, boundary, &silent));
                });
            }
        }
    }
    group.finish();
}

criterion_group!(benches, euler);
criterion_main!(benches);
