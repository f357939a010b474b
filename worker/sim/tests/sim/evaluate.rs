//! Tests that the bits of evaluations do not depend on how they are computed, and that invalid evaluations are refused.

use crate::simulate;
use murmuration_proto::v1;
use murmuration_sim::{
    evaluate::{Evaluator, evaluate},
    features::{FEATURE_STEPS, FeatureMeans},
    rasterise::Rasteriser,
    replay::replay_frames,
    simulate::{Arch, Start, Swarm},
};
use murmuration_swarm::{
    CampaignSpec, Controller, Evaluation, ImageFormat, Preset, Purpose, RandomStream, World,
};
use proptest::prelude::*;
use std::thread;

fn world(horizon: u32) -> World {
    let message = v1::World {
        horizon: Some(horizon),
        ..World::default().into()
    };
    World::try_from(message).unwrap()
}

fn controllers() -> Vec<Controller> {
    let two = [0.8, 0.5, 0.6, -0.5, -0.5, 0.0, -0.2, 0.5, -1.0];
    vec![
        Controller::new(Preset::SingleSensor, &[0.6, 1.0, 0.4, 0.5]).unwrap(),
        Controller::new(Preset::TwoSensor, &two).unwrap(),
    ]
}

/// Evaluations of each controller from two starts, by `evaluate`.
fn all(mut evaluate: impl FnMut(&Controller, &Start) -> Evaluation) -> Vec<Evaluation> {
    let mut outcomes = Vec::new();
    for controller in controllers() {
        outcomes.extend([0, 1].map(|seed| evaluate(&controller, &Start::seeded(seed))));
    }
    outcomes
}

fn assert_same(left: &[Evaluation], right: &[Evaluation]) {
    assert_eq!(left.len(), right.len());
    assert!(left.iter().zip(right).all(|(a, b)| a.same_bits(b)));
}

#[test]
fn the_bits_depend_neither_on_the_evaluator_nor_on_the_cpu_nor_on_the_thread() {
    let (world, format) = (world(400), ImageFormat::default());
    let fresh = all(|controller, start| evaluate(controller, &world, &format, start).unwrap());
    let reused = |arch| {
        let mut evaluator = Evaluator::on(arch, &world, &format).unwrap();
        all(|controller, start| evaluator.evaluate(controller, start).unwrap())
    };
    assert_same(&reused(Arch::Scalar), &fresh);
    thread::scope(|scope| {
        let threads = [(); 4].map(|()| scope.spawn(|| reused(Arch::new())));
        for thread in threads {
            assert_same(&thread.join().unwrap(), &fresh);
        }
    });
    assert!(!fresh[0].same_bits(&fresh[1]), "the start matters");
}

#[test]
fn a_horizon_shorter_than_the_window_shows_every_step() {
    let format = ImageFormat::default();
    let controller = &controllers()[0];
    for horizon in [1, 7, 99, 100, 101, 158, 159] {
        let world = world(horizon);
        let evaluation = evaluate(controller, &world, &format, &Start::seeded(2)).unwrap();
        let mut swarm = Swarm::new(controller, &world, &Start::seeded(2)).unwrap();
        let mut rasteriser = Rasteriser::new(&world, &format).unwrap();
        let mut features = FeatureMeans::new(&world);
        for step in 1..=horizon {
            swarm.step();
            rasteriser.draw(&swarm);
            if step + FEATURE_STEPS > horizon {
                features.observe(&swarm);
            }
        }
        assert_eq!(evaluation.image(), rasteriser.image(), "{horizon}");
        assert_eq!(evaluation.features(), &features.means(), "{horizon}");
    }
}

#[test]
fn a_picture_larger_than_the_world_is_refused() {
    let format = ImageFormat::default();
    let small = v1::World {
        width: Some(45.5),
        ..World::default().into()
    };
    let error = Evaluator::new(&World::try_from(small).unwrap(), &format).unwrap_err();
    assert_eq!(
        error.to_string(),
        "image.resolution = 50: must be a whole number from 1 to 45"
    );
}

#[test]
fn a_channel_for_each_species_of_another_swarm_is_refused() {
    let species = |name| format!("[[species]]\nname = \"{name}\"\ncount = 12\nrobot.sensors = [{{}}]\n");
    let text = format!("{}{}", species("a"), species("b"));
    let (model, world) = CampaignSpec::robots_from_toml(&text).unwrap();
    let message = v1::ImageFormat {
        channels: Some("species".to_owned()),
        ..v1::ImageFormat::default()
    };
    let format = ImageFormat::for_swarm(message, &world, &model).unwrap();
    let mut evaluator = Evaluator::new(&world, &format).unwrap();
    let controller = Controller::new(&model, &[0.5; 8]).unwrap();
    let evaluation = evaluator.evaluate(&controller, &Start::seeded(1)).unwrap();
    assert_eq!(evaluation.image().len(), 5000);
    let tasks: Vec<_> = (0..9)
        .map(|seed| (controllers()[0].clone(), Start::seeded(seed)))
        .collect();
    for error in [
        evaluator.evaluate(&tasks[0].0, &tasks[0].1).unwrap_err(),
        evaluator.evaluate_all(&tasks).unwrap_err(),
    ] {
        assert_eq!(
            error.to_string(),
            "image.channels = 2: must be 1, or as many as the swarm has species: 1"
        );
    }
}

/// A picture small enough for every world of `simulate::worlds`.
fn small_picture() -> ImageFormat {
    let message = v1::ImageFormat {
        resolution: Some(10),
        ..ImageFormat::default().into()
    };
    ImageFormat::for_swarm(message, &World::default(), &Preset::SingleSensor.into()).unwrap()
}

proptest! {
    #![proptest_config(crate::proptest_cases::at_most(64))]

    #[test]
    fn many_at_once_have_the_bits_that_each_has_alone(
        controllers in prop::collection::vec(simulate::controllers(), 1..30),
        world in simulate::worlds(1..=70u32),
        horizon in 1u32..300,
        seed: u64,
    ) {
        let message = v1::World { horizon: Some(horizon), ..world.into() };
        let (world, format) = (World::try_from(message).unwrap(), small_picture());
        let starts = (0..).map(|i| Start::seeded(seed.wrapping_add(i)));
        // Controllers of the same model are adjacent, as in a campaign.
        let (single, two): (Vec<_>, Vec<_>) = controllers
            .into_iter()
            .zip(starts)
            .map(|(controller, start)| (simulate::sized(&controller, &world), start))
            .partition(|(controller, _)| controller.model().preset() == Some(Preset::SingleSensor));
        let tasks = [single, two].concat();
        let mut scalar = Evaluator::on(Arch::Scalar, &world, &format).unwrap();
        let alone: Vec<_> =
            tasks.iter().map(|(controller, start)| scalar.evaluate(controller, start).unwrap()).collect();
        for arch in simulate::arches() {
            let mut evaluator = Evaluator::on(arch, &world, &format).unwrap();
            let together = evaluator.evaluate_all(&tasks).unwrap();
            prop_assert_eq!(together.len(), alone.len());
            for (i, (one, other)) in together.iter().zip(&alone).enumerate() {
                prop_assert!(one.same_bits(other), "{:?} task {}: {:?} {:?}", arch, i, one, other);
            }
        }
    }
}

#[test]
fn the_papers_swarms_have_the_same_bits_at_once_and_alone() {
    let (world, format) = (World::default(), ImageFormat::default());
    for controller in controllers() {
        let tasks: Vec<_> = (0..8)
            .map(|seed| (controller.clone(), Start::seeded(seed)))
            .collect();
        for arch in simulate::arches() {
            let mut evaluator = Evaluator::on(arch, &world, &format).unwrap();
            let together = evaluator.evaluate_all(&tasks).unwrap();
            for ((controller, start), one) in tasks.iter().zip(together) {
                assert!(
                    one.same_bits(&evaluator.evaluate(controller, start).unwrap()),
                    "{arch:?}"
                );
            }
        }
    }
}

/// FNV-1a hash of all bits of 16 evaluations. The hash is the same on every machine, until the simulator's version changes.
const BITS: u64 = 0xc3a4_ccb5_3942_e185;

#[test]
fn the_papers_swarms_have_the_bits_that_were_recorded() {
    let (world, format) = (World::default(), ImageFormat::default());
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    for controller in controllers() {
        let tasks: Vec<_> = (0..8)
            .map(|seed| (controller.clone(), Start::seeded(seed)))
            .collect();
        for evaluation in Evaluator::new(&world, &format)
            .unwrap()
            .evaluate_all(&tasks)
            .unwrap()
        {
            let features = evaluation
                .features()
                .iter()
                .flat_map(|feature| feature.to_le_bytes());
            for byte in features.chain(evaluation.image().iter().copied()) {
                hash = (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
            }
        }
    }
    assert_eq!(hash, BITS, "{hash:#018x}");
}

#[test]
fn what_is_wrong_with_one_of_many_is_an_error() {
    let mut tasks = vec![(controllers()[0].clone(), Start::seeded(1)); 8];
    tasks[5].1 = Start::at(vec![[1.0; 3]; 3]).unwrap();
    let mut evaluator = Evaluator::new(&world(2), &ImageFormat::default()).unwrap();
    assert_eq!(evaluator.evaluate_all(&tasks).unwrap_err().field, "initial");
    assert!(evaluator.evaluate_all(&[]).unwrap().is_empty());
}

proptest! {
    #![proptest_config(crate::proptest_cases::at_most(48))]

    /// A single evaluation uses entirely different code, which reads sensors by the definition.
    #[test]
    fn described_swarms_together_have_the_bits_of_each_alone(
        model in simulate::described::alone(),
        agents in 1..=40_u32,
        boundary in simulate::described::boundaries(),
        side in 60.0..400.0_f64,
        seed: u64,
    ) {
        let message = v1::World {
            width: Some(side),
            height: Some(side),
            padding: Some(1.0),
            agents: Some(agents),
            radius: Some(model.largest_radius()),
            boundary: Some(boundary.name().to_owned()),
            horizon: Some(300),
            ..World::default().into()
        };
        let world = World::try_from(message).unwrap();
        let format = v1::ImageFormat { window: Some(290), ..v1::ImageFormat::default() };
        let format = ImageFormat::for_swarm(format, &world, &model).unwrap();
        let mut stream = RandomStream::derive(seed, Purpose::Propose, 0);
        let tasks: Vec<_> = (0..11).map(|start| {
            let genes: Vec<f64> = (0..model.genes()).map(|_| stream.random_range(-1.0..1.0)).collect();
            (Controller::new(&model, &genes).unwrap(), Start::seeded(seed ^ start))
        }).collect();
        for arch in simulate::arches() {
            let mut evaluator = Evaluator::on(arch, &world, &format).unwrap();
            let together = evaluator.evaluate_all(&tasks).unwrap();
            let alone: Vec<_> = tasks
                .iter()
                .map(|(controller, start)| evaluator.evaluate(controller, start).unwrap())
                .collect();
            assert_same(&together, &alone);
        }
    }
}

#[test]
fn the_verdict_is_the_judges_of_the_replay_and_changes_nothing_else() {
    let format = ImageFormat::default();
    let seeds = 0..11;
    for (world, controller) in [(400, 0), (1200, 0), (1200, 1), (150, 0), (3, 0)]
        .map(|(horizon, controller)| (world(horizon), controllers().swap_remove(controller)))
    {
        let tasks: Vec<_> = seeds
            .clone()
            .map(|seed| (controller.clone(), Start::seeded(seed)))
            .collect();
        let frames = murmuration_judge::frames(&world);
        for arch in simulate::arches() {
            let evaluator = || Evaluator::on(arch, &world, &format).unwrap();
            let plain = evaluator().evaluate_all(&tasks).unwrap();
            let judged = evaluator().judging(true).evaluate_all(&tasks).unwrap();
            let alone = evaluator()
                .judging(true)
                .evaluate(&tasks[0].0, &tasks[0].1)
                .unwrap();
            assert!(alone.same_bits(&judged[0]));
            for ((plain, judged), (controller, start)) in plain.iter().zip(&judged).zip(&tasks) {
                assert_eq!(plain.verdict(), None);
                assert!(judged.clone().judged(None).same_bits(plain));
                let replay = replay_frames(controller, &world, start, &frames).unwrap();
                assert_eq!(judged.verdict(), Some(murmuration_judge::judge(&replay, &world)));
            }
        }
    }
}
