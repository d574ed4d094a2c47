//! Two-point correlation.

mod common;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use poresynth_core::correlation::two_point::{Lags, two_point};
use poresynth_core::monitor::Monitor;
use poresynth_core::volume::Boundary;

fn correlation(c: &mut Criterion) {
    let mut group = c.benchmark_group("two-point correlation, r ≤ 50");
    group.sample_size(10);
    for edge in [128, 256] {
        let solid = common::gray(edge, 1).mapv(|v| v > 127.5);
        group.throughput(Throughput::Elements(solid.len() as u64));
        for (name, boundary) in [("open", Boundary::Open), ("periodic", Boundary::Periodic)] {
            group.bench_function(format!("{edge}³, {name}"), |b| {
                b.iter(|| {
                    two_point(solid.view(), None, &Lags::cubic(50, boundary), &Monitor::silent())
                });
            });
        }
    }
    group.finish();
}

criterion_group!(benches, correlation);
criterion_main!(benches);
