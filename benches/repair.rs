//! Phases made one piece, freed of branches, given a number of voxels; cells of a network.

mod common;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use ndarray::Array3;
use poresynth_core::monitor::Monitor;
use poresynth_core::topology::cells::perimeters;
use poresynth_core::topology::labelling::Connectivity;
use poresynth_core::topology::repair::branches::{Manner, STAYS, Skeleton, remove};
use poresynth_core::topology::repair::connect::{Options, connect};
use poresynth_core::topology::repair::recount;
use poresynth_core::topology::skeleton_graph::{Kind, graph};
use poresynth_core::topology::thinning::{Kind as Thin, Method, thin};
use poresynth_core::volume::Boundary;

fn repair(c: &mut Criterion) {
    let edge = 160;
    let score = common::gray(edge, 1);
    let silent = Monitor::silent();
    let mut group = c.benchmark_group(format!("repair, blobs of {edge}³"));
    group.sample_size(10).throughput(Throughput::Elements(score.len() as u64));

    // Sparse, so that there are many islands.
    let sparse = score.mapv(|v| v > 175.0);
    let options = Options {
        connectivity: Connectivity::Corners,
        boundary: Boundary::Open,
        smallest: 10,
        width: 3.0,
    };
    let mut out = sparse.clone();
    group.bench_function("connect", |b| {
        b.iter(|| connect(sparse.view(), score.view(), None, &options, out.view_mut(), &silent));
    });

    let solid = score.mapv(|v| v > 127.5);
    let size = solid.iter().filter(|&&in_phase| in_phase).count();
    let topology = (Connectivity::Corners, Boundary::Open);
    group.bench_function("recount, 1 % less", |b| {
        b.iter_batched_ref(
            || solid.clone(),
            |phase| {
                recount(phase.view_mut(), score.view(), None, topology, size * 99 / 100, &silent)
            },
            criterion::BatchSize::LargeInput,
        );
    });

    let mut skeleton = Array3::from_elem(solid.dim(), false);
    let (kind, method) = (Thin::Curve, Method::Strict);
    thin(solid.view(), kind, method, skeleton.view_mut(), &silent).expect("a skeleton");
    let network = graph(skeleton.view(), [1.0; 3], &silent).expect("a graph");
    let ends: Vec<[u32; 2]> = network.branches.iter().map(|branch| branch.nodes).collect();
    let lengths: Vec<f64> = network.branches.iter().map(|branch| branch.length).collect();
    let junctions: Vec<u32> = (0..network.nodes.len() as u32)
        .filter(|&node| network.nodes[node as usize].kind == Kind::Junction)
        .collect();
    group.bench_function(format!("perimeters of {} cells", junctions.len()), |b| {
        b.iter(|| perimeters(network.nodes.len(), &ends, &lengths, &junctions, &silent));
    });

    let mut branches = Vec::new();
    let mut number = 0;
    for (i, branch) in network.branches.iter().enumerate() {
        let next = network.branches.get(i + 1).map_or(network.voxels.len(), |next| next.start);
        let loose = network.nodes[branch.nodes[0] as usize].kind == Kind::End;
        branches
            .extend(std::iter::repeat_n(if loose { number } else { STAYS }, next - branch.start));
        number += i64::from(loose);
    }
    let radii = vec![4.0; network.voxels.len()];
    let skeleton = Skeleton { places: &network.voxels, radii: &radii, branches: &branches };
    group.bench_function(format!("remove {number} branches"), |b| {
        b.iter_batched_ref(
            || solid.clone(),
            |phase| remove(phase.view_mut(), &skeleton, None, Manner::Prune, &silent),
            criterion::BatchSize::LargeInput,
        );
    });
    group.finish();
}

criterion_group!(benches, repair);
criterion_main!(benches);
