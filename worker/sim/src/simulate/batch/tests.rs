//! Invariants of a batch between steps.

use super::Batch;
use crate::{lanes::lanes, simulate::Start};
use murmuration_proto::v1;
use murmuration_swarm::{Controller, Preset, World};
use pulp::Scalar;

/// The margin of a glance grows with the largest coordinate so far. An agent beyond this coordinate would be seen with too small
/// a margin.
#[test]
fn nobody_is_farther_than_the_margins_of_a_glance_allow_for() {
    let agents = 40;
    let world = World::try_from(v1::World {
        agents: Some(agents),
        boundary: Some("open".to_owned()),
        ..World::default().into()
    });
    let world = world.unwrap();
    let controller = Controller::new(Preset::SingleSensor, &[0.0; 4]).unwrap();
    // The agents are so close together that ten passes separate only a few agents. All agents are in the corner where pushes lead
    // to larger coordinates.
    let poses = (0..agents).map(|i| [499.0 + 0.01 * f64::from(i), 499.0 - 0.02 * f64::from(i % 7), 0.0]);
    let tasks = [(controller, Start::at(poses.collect()).unwrap())];
    let simd = Scalar::new();
    let mut batch = Batch::<Scalar, 1, false>::new(simd, &world, &tasks).unwrap();
    let mut still_crowded = 0;
    for step in 0..30 {
        batch.advance(simd, 1);
        still_crowded += batch.bodies.iter().filter(|body| body.0.crowded).count();
        let far = lanes::<Scalar>(&batch.far)[0];
        for agent in batch.agents(simd) {
            let [x, y] = agent.position.map(|axis| lanes::<Scalar>(&axis)[0]);
            assert!(
                x.abs().max(y.abs()) <= far,
                "step {step}: ({x}, {y}) is beyond {far}"
            );
        }
    }
    assert!(still_crowded > 0, "nobody was crowded, so nothing was shown");
}
