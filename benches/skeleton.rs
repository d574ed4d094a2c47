//! Thinning of blobs and of noise, and the graph of a skeleton.

mod common;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use ndarray::Array3;
use poresynth_core::monitor::Monitor;
use poresynth_core::rng::Key;
use poresynth_core::topology::skeleton_graph::graph;
use poresynth_core::topology::thinning::{Kind, Method, thin};

fn skeleton(c: &mut Criterion) {
    let edge = 128;
    let blobs = common::gray(edge, 1).mapv(|v| v > 127.5);
    let mut index = 0;
    let noise = Array3::from_shape_simple_fn(blobs.dim(), || {
        index += 1;
        Key::new(1).unit(index) < 0.5
    });
    let silent = Monitor::silent();
    for (name, volume) in [("blobs", &blobs), ("noise", &noise)] {
        let mut group = c.benchmark_group(format!("skeleton, {name} of {edge}³"));
        group.throughput(Throughput::Elements(volume.len() as u64)).sample_size(10);
        let thinned = |kind, method| {
            let mut skeleton = Array3::from_elem(volume.dim(), false);
            thin(volume.view(), kind, method, skeleton.view_mut(), &silent).map(|()| skeleton)
        };
        for (name, kind, method) in [
            ("curve, strict", Kind::Curve, Method::Strict),
            ("curve, lee", Kind::Curve, Method::Lee),
            ("surface, strict", Kind::Surface, Method::Strict),
        ] {
            group.bench_function(name, |b| b.iter(|| thinned(kind, method)));
        }
        let skeleton = thinned(Kind::Curve, Method::Strict).expect("the same shape");
        group.bench_function("graph", |b| b.iter(|| graph(skeleton.view(), [1.0; 3], &silent)));
        group.finish();
    }
}

criterion_group!(benches, skeleton);
criterion_main!(benches);
