//! Tests mirror images. A swarm that starts as the mirror image of another swarm, with wheels exchanged, moves as the mirror
//! image of the other swarm.
//!
//! The mirror lies on the diagonal of a square world: it exchanges x and y, which rounds nothing. (In an upright mirror the image
//! of x is `width - x`, which rounds.)

use super::*;
use rand::RngExt as _;

/// The unit vector of a heading, as the swarm computes it.
fn direction(theta: f64) -> [f64; 2] {
    [libm::cos(theta), libm::sin(theta)]
}

/// The mirror image of a heading; `None` if no angle has exactly this cosine and sine.
fn mirrored_heading(theta: f64) -> Option<f64> {
    let [cos, sin] = direction(theta);
    let near = PI / 2.0 - theta;
    let candidates = (-8..=8_i64).map(|ulps| f64::from_bits(near.to_bits().wrapping_add_signed(ulps)));
    candidates
        .into_iter()
        .find(|&angle| direction(angle) == [sin, cos])
}

/// Random poses, and their mirror images.
fn starts(world: &World, stream: &mut RandomStream) -> [Start; 2] {
    let pose = |_| loop {
        let [x, y] = [0, 1].map(|_| stream.random_range(0.0..world.width()));
        let theta = stream.random_range(0.0..TAU);
        if let Some(mirrored) = mirrored_heading(theta) {
            return ([x, y, theta], [y, x, mirrored]);
        }
    };
    let (poses, mirrored) = (0..world.agents()).map(pose).unzip();
    [poses, mirrored].map(|poses| Start::at(poses).unwrap())
}

/// Positions and headings of all agents, as bits.
fn poses(swarm: &Swarm) -> Vec<[u64; 4]> {
    let pose = |agent: Agent| {
        let ([x, y], [hx, hy]) = (agent.position, agent.heading);
        // Makes -0 and 0 equal.
        [x, y, hx, hy].map(|number| (number + 0.0).to_bits())
    };
    swarm.agents().map(pose).collect()
}

#[test]
fn a_mirrored_controller_moves_as_the_mirror_image_to_the_bit() {
    let world = World::default();
    let mut stream = RandomStream::derive(1, Purpose::Start, 0);
    let mut speed = || f64::from(stream.random_range(-10..=10)) / 10.0;
    let controllers: Vec<[f64; 4]> = (0..60).map(|_| [(); 4].map(|()| speed())).collect();
    let mut stream = RandomStream::derive(2, Purpose::Start, 0);
    for [a, b, c, d] in controllers {
        let [start, mirrored_start] = starts(&world, &mut stream);
        let mut swarm = Swarm::new(&single([a, b, c, d]), &world, &start).unwrap();
        let mut mirrored = Swarm::new(&single([b, a, d, c]), &world, &mirrored_start).unwrap();
        for swarm in [&mut swarm, &mut mirrored] {
            swarm.advance(world.horizon());
        }
        let image: Vec<_> = poses(&mirrored)
            .into_iter()
            .map(|[x, y, hx, hy]| [y, x, hy, hx])
            .collect();
        assert_eq!(poses(&swarm), image, "{:?}", [a, b, c, d]);
    }
}
