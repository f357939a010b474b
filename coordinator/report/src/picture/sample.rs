//! Invented swarms for tests, and a decoder with which tests check pictures.

use murmuration_proto::v1;
use murmuration_swarm::{Pose, Purpose, RandomStream, Replay, World};
use rand::RngExt as _;

/// A world from the lines of a campaign file's `[world]` table.
pub fn world(lines: &str) -> World {
    let message: v1::World = toml::from_str(lines).unwrap();
    World::try_from(message).unwrap()
}

/// Agents that circle around the middle of the world, with random distances, phases and speeds.
pub fn ring(world: &World, steps: u32, stride: u32) -> Replay {
    let mut stream = RandomStream::derive(7, Purpose::Start, 0);
    let (cx, cy) = (world.width() / 2.0, world.height() / 2.0);
    let reach = cx.min(cy) - world.margin();
    let agents: Vec<[f64; 3]> = (0..world.agents())
        .map(|_| {
            [
                stream.random_range(0.3..1.0) * reach,
                stream.random_range(0.0..6.3),
                stream.random_range(0.5..1.0),
            ]
        })
        .collect();
    let shown: Vec<u32> = (0..steps).step_by(stride as usize).chain([steps]).collect();
    let pose = |&[radius, phase, speed]: &[f64; 3], step: u32| -> Pose {
        let angle = phase + speed * f64::from(step) / radius;
        [
            (cx + radius * libm::cos(angle)) as f32,
            (cy + radius * libm::sin(angle)) as f32,
            (angle + std::f64::consts::FRAC_PI_2) as f32,
        ]
    };
    let poses = shown
        .iter()
        .flat_map(|&step| agents.iter().map(move |agent| pose(agent, step)))
        .collect();
    Replay::new(shown, agents.len(), poses).unwrap()
}

/// Width, height and bytes of the pixels of a PNG.
pub(crate) fn decode_png(file: &[u8]) -> (u32, u32, Vec<u8>) {
    let mut reader = png::Decoder::new(std::io::Cursor::new(file)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    pixels.truncate(info.buffer_size());
    (info.width, info.height, pixels)
}
