//! Numbers that scripts draw: columns of little-endian binary in base64, which are small and quick to read.

use super::{Colouring, thinned};
use base64::{Engine as _, engine::general_purpose::STANDARD};
use murmuration_swarm::{Boundary, Frames, Obstacle, Replay, World};
use serde::Serialize;

/// Maximum number of frames of a motion.
const MOST_FRAMES: usize = Frames::WATCHED as usize;
const POSE_BYTES: usize = 5;

/// The facts about a world that drawing a swarm needs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WorldView {
    width: f64,
    height: f64,
    padding: f64,
    radius: f64,
    walls: bool,
    torus: bool,
    obstacles: Vec<ObstacleView>,
}

/// An obstacle, with the position of its centre. A disc has a radius; a box has a width and a height.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct ObstacleView {
    x: f64,
    y: f64,
    radius: Option<f64>,
    width: Option<f64>,
    height: Option<f64>,
}

impl From<&World> for WorldView {
    fn from(world: &World) -> Self {
        Self {
            width: world.width(),
            height: world.height(),
            padding: world.padding(),
            radius: world.radius(),
            walls: world.boundary() == Boundary::Walls,
            torus: world.boundary() == Boundary::Torus,
            obstacles: world.obstacles().iter().map(ObstacleView::from).collect(),
        }
    }
}

impl From<&Obstacle> for ObstacleView {
    fn from(obstacle: &Obstacle) -> Self {
        let [x, y] = obstacle.centre();
        let (radius, size) = match *obstacle {
            Obstacle::Disc { radius, .. } => (Some(radius), None),
            Obstacle::Box { size, .. } => (None, Some(size)),
        };
        Self {
            x,
            y,
            radius,
            width: size.map(|[width, _]| width),
            height: size.map(|[_, height]| height),
        }
    }
}

/// The motion of a swarm.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MotionView {
    agents: usize,
    /// Index of each agent's species, as a column of bytes; `None` if there is only one species.
    species: Option<String>,
    radii: Option<Vec<f64>>,
    /// The step of each frame.
    steps: Vec<u32>,
    /// Columns of the positions x and y, with a value for each frame and agent: 0 to 65535 from one side of the world to the
    /// other.
    x: String,
    y: String,
    /// Column of the headings, with a value for each frame and agent: 0 to 255 over a full turn.
    heading: String,
}

/// The motion of a replay. Frames are left out, so that the motion has at most `most_bytes` before base64.
pub fn motion(replay: &Replay, world: &World, colouring: Colouring<'_>, most_bytes: usize) -> MotionView {
    let agents = replay.agents();
    let most = (most_bytes / (POSE_BYTES * agents)).min(MOST_FRAMES);
    let frames: Vec<_> = replay.frames().collect();
    let shown = thinned(frames.len(), most);
    let poses = || shown.iter().flat_map(|&frame| frames[frame]);
    let turn = |heading: f32| {
        let turns = f64::from(heading) / std::f64::consts::TAU;
        ((turns - turns.floor()) * 256.0).round() as u32 as u8
    };
    let (species, radii) = match colouring {
        Colouring::Agents => (None, None),
        Colouring::Species { of_agents, radii } => {
            let places = column(of_agents.iter().map(|&place| [place as u8]));
            (Some(places), Some(radii.to_vec()))
        }
    };
    MotionView {
        agents,
        species,
        radii,
        steps: shown.iter().map(|&frame| replay.steps()[frame]).collect(),
        x: column(poses().map(|pose| sixteen_bits(f64::from(pose[0]) / world.width()).to_le_bytes())),
        y: column(poses().map(|pose| sixteen_bits(f64::from(pose[1]) / world.height()).to_le_bytes())),
        heading: column(poses().map(|pose| [turn(pose[2])])),
    }
}

/// A column of finite `values`, scaled so that the smallest is 0 and the largest 65535; if all values are equal, they are in the
/// middle.
pub fn spread(values: impl Iterator<Item = f64> + Clone) -> String {
    let low = values.clone().fold(f64::INFINITY, f64::min);
    let span = span(values.clone());
    let place = move |value: f64| if span > 0.0 { (value - low) / span } else { 0.5 };
    column(values.map(|value| sixteen_bits(place(value)).to_le_bytes()))
}

/// Difference between the largest and the smallest of finite `values`; 0 if there are no values.
pub fn span(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let low = values.clone().fold(f64::INFINITY, f64::min);
    let high = values.fold(f64::NEG_INFINITY, f64::max);
    (high - low).max(0.0)
}

/// Encodes numbers, each given as its bytes, as base64.
pub fn column<const N: usize>(values: impl Iterator<Item = [u8; N]>) -> String {
    STANDARD.encode(values.collect::<Vec<_>>().as_flattened())
}

fn sixteen_bits(part: f64) -> u16 {
    (part * 65535.0).round() as u16
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::sample::{ring, world};

    const MEGABYTES: usize = 1 << 20;

    fn bytes(column: &str) -> Vec<u8> {
        STANDARD.decode(column).unwrap()
    }

    #[test]
    fn a_run_reads_back_to_within_its_resolution() {
        let world = world("width = 800.0");
        let replay = ring(&world, 1200, 3);
        let run = motion(&replay, &world, Colouring::Agents, MEGABYTES);
        assert_eq!((run.steps.len(), run.steps[399]), (400, 1200));
        let (xs, headings) = (bytes(&run.x), bytes(&run.heading));
        let last = replay.frames().last().unwrap();
        for (agent, pose) in last.iter().enumerate() {
            let at = 399 * 24 + agent;
            let x = f64::from(u16::from_le_bytes([xs[2 * at], xs[2 * at + 1]])) / 65535.0 * 800.0;
            assert!((x - f64::from(pose[0])).abs() < 0.01);
            let turned = f64::from(headings[at]) / 256.0 * std::f64::consts::TAU - f64::from(pose[2]);
            assert!(
                libm::cos(turned) > 0.9998,
                "heading {} read as {}",
                pose[2],
                headings[at]
            );
        }
    }

    #[test]
    fn huge_swarms_lose_frames_not_the_start_or_the_end() {
        let crowd = world("agents = 10000\nwidth = 5000.0\nheight = 5000.0");
        let run = motion(&ring(&crowd, 400, 10), &crowd, Colouring::Agents, MEGABYTES);
        assert_eq!((run.steps.first(), run.steps.last()), (Some(&0), Some(&400)));
        assert!(bytes(&run.x).len() < MEGABYTES);
    }
}
