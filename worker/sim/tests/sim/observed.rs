//! Tests of evaluations of recorded motions.

use murmuration_sim::{
    evaluate::{evaluate, observe},
    replay::poses,
    simulate::Start,
};
use murmuration_swarm::{CampaignSpec, Controller, ImageFormat, Preset, World};

const SPECIES: &str = r#"
    [[species]]
    name = "a"
    count = 5
    robot.radius = 4
    robot.sensors = [{ half_angle = 0.3, range = 100 }, { angle = 1.0, sees = ["b"] }, { angle = -1.0, range = 40, sees = ["walls"] }]
    [[species]]
    name = "b"
    count = 7
    robot.sensors = [{}]
"#;

/// A swarm of described robots, with speeds that differ by sensor state.
fn swarm(robots: &str) -> (Controller, World) {
    let (model, world) = CampaignSpec::robots_from_toml(robots).unwrap();
    let genes: Vec<f64> = (0..model.genes())
        .map(|gene| 0.9 - 0.23 * (gene % 8) as f64)
        .collect();
    (Controller::new(model, &genes).unwrap(), world)
}

#[test]
fn a_simulated_swarm_that_is_observed_has_its_own_features_and_picture() {
    let format = ImageFormat::default();
    for robots in ["model = \"single-sensor\"", "model = \"two-sensor\"", SPECIES] {
        let (controller, world) = swarm(robots);
        for seed in 0..3 {
            let start = Start::seeded(seed);
            let simulated = evaluate(&controller, &world, &format, &start).unwrap();
            let frames = poses(&controller, &world, &start).unwrap();
            let observed = observe(&controller, &world, &format, &frames).unwrap();
            assert!(observed.same_bits(&simulated), "{robots}, seed {seed}");
            // The last frames alone contain everything that is observed.
            let end = observe(&controller, &world, &format, &frames[frames.len() - 160..]).unwrap();
            assert!(end.same_bits(&simulated), "{robots}, seed {seed}");
        }
    }
}

#[test]
fn a_swarm_that_crosses_the_edge_of_a_torus_does_not_jump() {
    let (controller, world) = swarm("model = \"single-sensor\"\n[world]\nboundary = \"torus\"\n");
    let format = ImageFormat::default();
    for seed in 0..3 {
        let start = Start::seeded(seed);
        let simulated = evaluate(&controller, &world, &format, &start).unwrap();
        let frames = poses(&controller, &world, &start).unwrap();
        let observed = observe(&controller, &world, &format, &frames).unwrap();
        assert_eq!(observed.image(), simulated.image());
        for (observed, simulated) in observed.features().iter().zip(simulated.features()) {
            assert!((observed - simulated).abs() < 1e-9, "{observed} {simulated}");
        }
    }
}

#[test]
fn what_is_no_motion_of_this_swarm_is_refused() {
    let controller = Controller::new(Preset::SingleSensor, &[0.0; 4]).unwrap();
    let check = |frames: &[Vec<[f64; 3]>], field: &str| {
        let error = observe(&controller, &World::default(), &ImageFormat::default(), frames);
        assert_eq!(error.unwrap_err().field, field);
    };
    let pose = [250.0, 250.0, 0.0];
    check(&[], "frames");
    check(&[vec![pose; 24]], "frames");
    check(&[vec![pose; 24], vec![pose; 23]], "frames");
    check(&[vec![pose; 24], vec![[1e9, 0.0, 0.0]; 24]], "x");
    check(&[vec![pose; 24], vec![[0.0, f64::NAN, 0.0]; 24]], "y");
    check(&[vec![pose; 24], vec![[0.0, 0.0, f64::INFINITY]; 24]], "heading");
}
