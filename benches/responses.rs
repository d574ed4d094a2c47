//! Response matching of a volume to an image, and what it is made of.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use poresynth_core::fourier::Transform;
use poresynth_core::monitor::Monitor;
use poresynth_core::rng::Key;
use poresynth_core::texture::random_field::random_field;
use poresynth_core::texture::responses::{FilterBank, ResponseMatching, Target, pooled_quantiles};
use poresynth_core::texture::{Field, pyramid};
use poresynth_core::volume::{Boundary, Shape, voxels};

const SHAPE: Shape = [128; 3];

/// Smooth noise with two phases.
fn image() -> Field {
    let shape = [1, 128, 128];
    let noise = (0..voxels(shape) as u64).map(|i| 255.0 * Key::new(1).unit(i)).collect();
    let noise = Field::new(shape, 1, noise).expect("one value a pixel");
    let smooth = pyramid::gaussian(&noise, 2.5, Boundary::Periodic).into_values();
    let clipped = smooth.into_iter().map(|v| ((v - 127.5) * 12.0 + 127.5).clamp(0.0, 255.0));
    Field::new(shape, 1, clipped.collect()).expect("one value a pixel")
}

fn responses(c: &mut Criterion) {
    let image = image();
    let targets =
        [0, 1, 2].map(|axis| Target { axis, image: &image, symmetric: true, weight: 1.0 });
    let quantiles = pooled_quantiles(&targets);
    let silent = Monitor::silent();
    let start = || random_field(&targets, 1, SHAPE, &quantiles, Key::new(2), &silent);
    let mut volume = start().expect("the images fit");
    let mut group = c.benchmark_group("volume 128³ from images of 128²");
    group.sample_size(10);
    group.throughput(Throughput::Elements(voxels(SHAPE) as u64));
    group.bench_function("random field", |b| b.iter(start));
    let transform = Transform::new(SHAPE);
    group.bench_function("Fourier transform, there and back", |b| {
        let mut out = volume.channel(0).to_vec();
        b.iter(|| {
            let spectrum = transform.forward(volume.channel(0), &silent)?;
            transform.inverse(spectrum, &mut out, &silent)
        });
    });
    let mut step = 0;
    for (name, deep) in [
        ("step, 16 filters of 3 × 3", false),
        ("step, 16 filters of 3 × 3, and responses to responses", true),
    ] {
        let bank = FilterBank { deep, ..FilterBank::default() };
        let matching = ResponseMatching::new(&targets, (1, SHAPE), bank).expect("the images fit");
        group.bench_function(name, |b| {
            b.iter(|| {
                step += 1;
                matching.step(&mut volume, &quantiles, Key::new(step), &silent)
            });
        });
    }
    group.finish();
}

criterion_group!(benches, responses);
criterion_main!(benches);
