//! Novelty: blocks against every place and mirror image of an exemplar of 100³.

mod common;

use criterion::{Criterion, criterion_group, criterion_main};
use poresynth_core::correlation::block_match::novelty;
use poresynth_core::monitor::Monitor;

fn matching(c: &mut Criterion) {
    let (exemplar, volume) = (common::gray(100, 1), common::gray(100, 2));
    let mut group = c.benchmark_group("novelty, 24 probes, exemplar of 100³");
    group.sample_size(10);
    for edge in [12, 20, 32] {
        group.bench_function(format!("blocks of {edge}³"), |b| {
            b.iter(|| novelty(exemplar.view(), volume.view(), edge, 24, 0, &Monitor::silent()));
        });
    }
    group.finish();
}

criterion_group!(benches, matching);
criterion_main!(benches);
