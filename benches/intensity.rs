//! Histogram matching and moments of gray values.

mod common;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use poresynth_core::intensity::matching::{Ties, match_histogram};
use poresynth_core::intensity::order::Kind;
use poresynth_core::intensity::statistics::moments;
use poresynth_core::monitor::Monitor;
use poresynth_core::rng::Key;

fn intensity(c: &mut Criterion) {
    let edge = 256;
    let [source, reference] =
        [1, 2].map(|seed| common::gray(edge, seed).into_raw_vec_and_offset().0);
    let silent = Monitor::silent();
    let mut group = c.benchmark_group(format!("gray values of {edge}³"));
    group.sample_size(10);
    group.throughput(Throughput::Elements(source.len() as u64));
    group.bench_function("moments, f32", |b| b.iter(|| moments(&source, &silent)));
    let bits = |values: &[f32]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    let (floats, wanted) = (bits(&source), bits(&reference));
    let mut out = vec![0; source.len()];
    group.bench_function("matching, f32", |b| {
        b.iter(|| {
            let (source, reference) = ((&floats[..], Kind::Float), (&wanted[..], Kind::Float));
            match_histogram(source, reference, Ties::Alike, &mut out, &silent)
        });
    });
    let bytes = |values: &[f32]| values.iter().map(|&v| v as u8).collect::<Vec<_>>();
    let (levels, wanted) = (bytes(&source), bytes(&reference));
    let mut out = vec![0; source.len()];
    for (name, ties) in [("alike", Ties::Alike), ("random", Ties::Random(Key::new(1)))] {
        group.bench_function(format!("matching, u8, ties {name}"), |b| {
            b.iter(|| {
                let source = (&levels[..], Kind::Unsigned);
                let reference = (&wanted[..], Kind::Unsigned);
                match_histogram(source, reference, ties, &mut out, &silent)
            });
        });
    }
    group.finish();
}

criterion_group!(benches, intensity);
criterion_main!(benches);
