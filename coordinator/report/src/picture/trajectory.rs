//! The paths of a swarm in colour.

use super::{
    PictureError, encoded,
    sketch::{Colouring, Sketch},
};
use murmuration_model::colours;
use murmuration_swarm::{Boundary, Pose, Replay, World};

/// The background of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Paper {
    Light,
    /// A transparent background, which shows the colour of the page.
    Clear,
}

/// Number of shades of a path.
const AGES: u32 = 20;

/// The paths of the last `window` steps as a PNG whose longer side is `size` pixels (16 to 4096).
///
/// `colouring` determines the agents' colours. Older parts of a path are fainter. The bodies are at their last positions, each
/// with a tick in the direction of its heading, and the walls are a thin line. x goes right and y down, as on a screen.
///
/// # Errors
/// [`PictureError::Size`] if the picture would be too small or too large.
pub fn trajectory_png(
    replay: &Replay,
    world: &World,
    colouring: Colouring<'_>,
    window: u32,
    size: u32,
    paper: Paper,
) -> Result<Vec<u8>, PictureError> {
    let mut sketch = Sketch::new(world, size, colouring)?;
    sketch.walls(world);
    let frames: Vec<&[Pose]> = replay.frames().collect();
    let width = (size as f32 / 290.0).max(1.0);
    for (first, last, part) in ages(replay.steps(), window) {
        sketch.paths(&frames[first..=last], part, width);
    }
    if let Some(poses) = frames.last() {
        sketch.bodies(poses);
    }
    encode(&sketch, paper)
}

/// Series of frames of similar age, oldest first. Each series has its first frame, its last frame, and an opacity out of 255.
pub(super) fn ages(steps: &[u32], window: u32) -> Vec<(usize, usize, u8)> {
    let end = steps.last().copied().unwrap_or(0);
    let start = end.saturating_sub(window.max(1));
    let begins = steps
        .partition_point(|&step| step < start)
        .min(steps.len().saturating_sub(2));
    let mut runs: Vec<(usize, usize, u32)> = Vec::new();
    for (frame, pair) in steps.windows(2).enumerate().skip(begins) {
        let done = u64::from(pair[0].saturating_sub(start));
        let age = (done * u64::from(AGES) / u64::from((end - start).max(1))) as u32;
        match runs.last_mut() {
            Some(run) if run.2 == age => run.1 = frame + 1,
            _ => runs.push((frame, frame + 1, age)),
        }
    }
    let opacity = |age: u32| 36 + 200 * (age + 1) * (age + 1) / (AGES * AGES);
    runs.into_iter()
        .map(|(first, last, age)| (first, last, opacity(age) as u8))
        .collect()
}

/// Whether an agent left a torus on one side and came in on the other.
pub(super) fn is_jump(world: &World, from: Pose, to: Pose) -> bool {
    let sides = [world.width(), world.height()].map(|side| side as f32 / 2.0);
    world.boundary() == Boundary::Torus && (0..2).any(|axis| (to[axis] - from[axis]).abs() > sides[axis])
}

fn encode(sketch: &Sketch, paper: Paper) -> Result<Vec<u8>, PictureError> {
    let mut bytes = Vec::new();
    for (colour, part) in sketch.pixels() {
        match paper {
            Paper::Light => bytes.extend(colours::over(colour, part, colours::PAPER)),
            Paper::Clear => bytes.extend([colour[0], colour[1], colour[2], part]),
        }
    }
    let colours = match paper {
        Paper::Light => png::ColorType::Rgb,
        Paper::Clear => png::ColorType::Rgba,
    };
    encoded(
        &bytes,
        [sketch.width() as usize, sketch.height() as usize],
        colours,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::sample::{decode_png, ring, world};

    #[test]
    fn the_picture_keeps_the_worlds_shape() {
        let world = world("width = 600.0\nheight = 200.0");
        let png = trajectory_png(
            &ring(&world, 400, 5),
            &world,
            Colouring::Agents,
            160,
            300,
            Paper::Light,
        )
        .unwrap();
        let (width, height, pixels) = decode_png(&png);
        assert_eq!((width, height), (300, 100));
        assert_eq!(pixels.len(), 3 * 300 * 100);
    }

    #[test]
    fn bodies_stand_where_the_replay_ends() {
        let world = world("agents = 1");
        let poses = vec![[100.0, 300.0, 0.0], [200.0, 300.0, 0.0]];
        let replay = Replay::new(vec![0, 50], 1, poses).unwrap();
        let (_, _, pixels) =
            decode_png(&trajectory_png(&replay, &world, Colouring::Agents, 160, 500, Paper::Light).unwrap());
        let at = |x: usize, y: usize| [0, 1, 2].map(|i| pixels[3 * (y * 500 + x) + i]);
        assert_eq!(at(200, 300), colours::AGENTS[0], "the body");
        assert_eq!(at(208, 300), colours::AGENTS[0], "its tick, to the right");
        assert_eq!(at(192, 310), colours::PAPER, "nothing beside it");
        let path = at(150, 300);
        assert!(
            path != colours::PAPER && path != colours::AGENTS[0],
            "a fainter path: {path:?}"
        );
    }

    #[test]
    fn robots_of_one_species_have_one_colour() {
        let world = world("agents = 3");
        let places = [[100.0, 100.0], [200.0, 300.0], [400.0, 200.0]];
        let poses = places.map(|[x, y]| [x, y, 0.0]);
        let replay = Replay::new(vec![0, 50], 3, [poses, poses].concat()).unwrap();
        let colours_of = |colouring| {
            let png = trajectory_png(&replay, &world, colouring, 160, 500, Paper::Light).unwrap();
            let (_, _, pixels) = decode_png(&png);
            places.map(|[x, y]| [0, 1, 2].map(|i| pixels[3 * (y as usize * 500 + x as usize) + i]))
        };
        let [first, second, third] = [0, 1, 2].map(|place| colours::AGENTS[place]);
        assert_eq!(colours_of(Colouring::Agents), [first, second, third]);
        assert_eq!(
            colours_of(Colouring::Species {
                of_agents: &[0, 1, 1],
                radii: &[5.0, 5.0]
            }),
            [first, second, second]
        );
    }

    #[test]
    fn a_clear_picture_is_transparent_where_nothing_is() {
        let world = world("");
        let png = trajectory_png(
            &ring(&world, 400, 5),
            &world,
            Colouring::Agents,
            160,
            100,
            Paper::Clear,
        )
        .unwrap();
        let (_, _, pixels) = decode_png(&png);
        assert_eq!(pixels[3], 0);
        assert!(pixels.chunks(4).any(|pixel| pixel[3] == 255));
    }

    #[test]
    fn ages_cover_the_window_without_gaps() {
        let steps: Vec<u32> = (0..=1200).step_by(7).chain([1200]).collect();
        let runs = ages(&steps, 160);
        assert!(steps[runs[0].0] >= 1040 && steps[runs[0].0] < 1047);
        assert_eq!(runs.last().unwrap().1, steps.len() - 1);
        assert!(
            runs.windows(2)
                .all(|pair| pair[0].1 == pair[1].0 && pair[0].2 < pair[1].2)
        );
        assert_eq!(ages(&[0], 160), []);
        assert_eq!(ages(&[0, 1000], 160).len(), 1, "one long stride is still shown");
    }

    #[test]
    fn a_start_alone_and_a_huge_swarm_are_pictures_too() {
        let crowd = world("agents = 10000\nwidth = 5000.0\nheight = 5000.0");
        for (world, steps) in [(world("agents = 1"), 0), (crowd, 10)] {
            let png = trajectory_png(
                &ring(&world, steps, 5),
                &world,
                Colouring::Agents,
                160,
                200,
                Paper::Light,
            )
            .unwrap();
            assert_eq!(decode_png(&png).0, 200);
        }
    }

    #[test]
    fn an_impossible_size_is_refused() {
        for size in [0, 15, 4097] {
            let error = trajectory_png(
                &ring(&world(""), 1, 1),
                &world(""),
                Colouring::Agents,
                160,
                size,
                Paper::Light,
            )
            .unwrap_err();
            assert!(matches!(error, PictureError::Size(n) if n == u64::from(size)));
        }
    }
}
