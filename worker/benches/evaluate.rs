//! quick
use murmuration_proto::*;
use murmuration_worker::simulate::*;
use std::time::Instant;
fn main() {
    let world = World::default();
    for (name, model, genes) in [
        ("milling", CapabilityModel::SingleSensor, vec![0.6, 1.0, 0.4, 0.5]),
        (
            "rand1_00",
            CapabilityModel::SingleSensor,
            vec![0.1, 0.1, 0.4, -0.8],
        ),
        (
            "aggregation",
            CapabilityModel::SingleSensor,
            vec![-0.7, -1.0, 1.0, -1.0],
        ),
        (
            "nested",
            CapabilityModel::TwoSensor,
            vec![0.8, 0.5, 0.6, -0.5, -0.5, 0.0, -0.2, 0.5, -1.0471975511965976],
        ),
    ] {
        let c = Controller::new(model, &genes).unwrap();
        let mut archs = vec![("scalar", pulp::Arch::Scalar)];
        if let Some(s) = pulp::x86::V3::try_new() {
            archs.push(("v3", pulp::Arch::V3(s)));
        }
        if let Some(s) = pulp::x86::V4::try_new() {
            archs.push(("v4", pulp::Arch::V4(s)));
        }
        for (a, arch) in archs {
            let mut best = f64::MAX;
            let mut sum = 0u64;
            for rep in 0..10 {
                let t = Instant::now();
                for seed in 0..20 {
                    let mut s = Swarm::on(arch, &c, &world, &Start::seeded(seed)).unwrap();
                    s.advance(1200);
                    if rep == 0 {
                        for a in s.agents() {
                            sum = sum.rotate_left(5) ^ a.position[0].to_bits();
                        }
                    }
                }
                best = best.min(t.elapsed().as_secs_f64() / 20.0);
            }
            println!("{name:12} {a:7} {:8.0}/s  {sum:x}", 1.0 / best);
        }
    }
}
