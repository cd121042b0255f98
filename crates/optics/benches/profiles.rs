//! What radial profiles cost: `cargo bench -p moonmilk-optics`. A prepared `tabulated` is meant to evaluate within 20 ns, to sample within 30 ns and to be made within 1 ms.

use std::hint::black_box;

use criterion::Criterion;
use moonmilk_optics::halfspace::{Anisotropic, Illumination};
use moonmilk_optics::{AlbedoTable, OpticalProperties, profile};

fn profiles(c: &mut Criterion) {
    let media = [(0.99, 0.0, 1.33), (0.9, 0.8, 1.5)]
        .map(|(alpha, g, eta)| OpticalProperties::from_albedo(1.0, alpha, g, eta).expect("valid"));
    let model = profile::find("tabulated").expect("registered");
    let prepared = model.prepare(&media[0]).expect("within the table");
    // Radii and variates in no order, more than a cache line predicts.
    let golden: Vec<f64> = (0..1024).map(|i| (f64::from(i) * 0.618_033_988_75 + 0.5).fract()).collect();
    let radii: Vec<f64> = golden.iter().map(|&u| prepared.sample(u)).collect();
    let mut i = 0;
    let mut next = move || {
        i = (i + 1) % 1024;
        i
    };
    c.bench_function("tabulated, prepared: eval", |b| b.iter(|| prepared.eval(black_box(radii[next()]))));
    c.bench_function("tabulated, prepared: sample", |b| b.iter(|| prepared.sample(black_box(golden[next()]))));
    for (medium, name) in media.iter().zip(["g 0", "g .8"]) {
        c.bench_function(&format!("tabulated: prepare, {name}"), |b| b.iter(|| model.prepare(black_box(medium))));
        let built = model.build(medium).expect("within the table");
        c.bench_function(&format!("tabulated: eval, not prepared, {name}"), |b| {
            b.iter(|| built.eval(black_box(radii[next()])))
        });
    }
}

fn albedos(c: &mut Criterion) {
    for g in [0.3, 0.8, 0.95] {
        let operator = Anisotropic::new(g, 1.33, Illumination::Normal).expect("valid");
        c.bench_function(&format!("exact albedo, g {g}"), |b| b.iter(|| operator.albedo(black_box(0.9))));
    }
    c.bench_function("inverse albedo: table, g .8", |b| b.iter(|| AlbedoTable::new(black_box(1.33), 0.8)));
}

fn main() {
    let mut c = Criterion::default().sample_size(40).configure_from_args();
    profiles(&mut c);
    albedos(&mut c);
    c.final_summary();
}
