//! The motion of a swarm as an animated GIF.

use super::{
    PictureError,
    indexed::{Palette, UNCHANGED},
    sketch::{Colouring, Sketch},
};
use gif::{DisposalMethod, Encoder, Frame, Repeat};
use murmuration_model::colours::{PAPER, over};
use murmuration_swarm::{Pose, Replay, World};

/// Options of an animation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Animation {
    /// Longer side of the picture in pixels, 16 to 4096.
    pub size: u32,
    /// Pictures per second, 1 to 50. GIF has delays in hundredths of a second, so that 30 becomes 33.
    pub fps: u32,
    /// Maximum number of pictures. A longer replay is thinned out evenly and keeps its last frame.
    pub frames: u32,
    /// Number of steps that the trail behind each agent shows; 0 for no trail.
    pub trail: u32,
}

impl Default for Animation {
    /// Twelve seconds at 480 pixels: for the paper's swarms, a file of one to two megabytes.
    fn default() -> Self {
        Self {
            size: 480,
            fps: 25,
            frames: 300,
            trail: 60,
        }
    }
}

/// Maximum number of poses in one animation (pictures times agents). It bounds the time and the file for huge swarms.
const MOST_POSES: usize = 400_000;
/// Maximum number of agents of a swarm with trails. In larger swarms, trails would only cover each other.
const MOST_TRAILS: usize = 1000;
/// Number of shades of a trail.
const AGES: usize = 4;
/// Time for which the last picture is shown before the animation repeats, in hundredths of a second.
const HOLD: u16 = 150;

/// The whole run as a GIF that loops: agents coloured by `colouring`, with short trails, on a light background.
///
/// Works for one agent to 10,000 agents; the animation of a large swarm has fewer than `animation.frames` pictures.
///
/// # Errors
/// [`PictureError::Size`] if the picture would be too small or too large.
pub fn animation_gif(
    replay: &Replay,
    world: &World,
    colouring: Colouring<'_>,
    animation: &Animation,
) -> Result<Vec<u8>, PictureError> {
    let mut sketch = Sketch::new(world, animation.size, colouring)?;
    let mut palette = Palette::new();
    let (width, height) = (sketch.width() as u16, sketch.height() as u16);
    let mut encoder = Encoder::new(Vec::new(), width, height, &palette.bytes())?;
    encoder.set_repeat(Repeat::Infinite)?;
    let poses: Vec<&[Pose]> = replay.frames().collect();
    let shown = thinned(poses.len(), most_frames(animation, replay.agents()));
    let delay = (100 / animation.fps.clamp(1, 50)) as u16;
    let mut before: Vec<u8> = Vec::new();
    for &frame in &shown {
        draw(&mut sketch, world, replay, &poses, frame, animation);
        let now = palette.index(&sketch);
        let mut picture = changes(&before, &now, width);
        picture.delay = if Some(&frame) == shown.last() { HOLD } else { delay };
        encoder.write_frame(&picture)?;
        before = now;
    }
    Ok(encoder.into_inner()?)
}

/// The pictures of an animation, one after the other, for a video encoder.
#[derive(Debug)]
pub struct Film<I> {
    /// Number of pixels of each row.
    pub width: u32,
    /// Number of rows of each picture.
    pub height: u32,
    /// The pictures, each with the red, green and blue of each pixel, row by row.
    pub pictures: I,
}

/// The pictures that [`animation_gif`] shows, in full colour.
///
/// # Errors
/// [`PictureError::Size`] if the picture would be too small or too large.
pub fn animation_film<'a>(
    replay: &'a Replay,
    world: &'a World,
    colouring: Colouring<'a>,
    animation: &'a Animation,
) -> Result<Film<impl Iterator<Item = Vec<u8>> + 'a>, PictureError> {
    let mut sketch = Sketch::new(world, animation.size, colouring)?;
    let poses: Vec<&[Pose]> = replay.frames().collect();
    let shown = thinned(poses.len(), most_frames(animation, replay.agents()));
    Ok(Film {
        width: sketch.width(),
        height: sketch.height(),
        pictures: shown.into_iter().map(move |frame| {
            draw(&mut sketch, world, replay, &poses, frame, animation);
            let pixels = sketch.pixels();
            pixels
                .flat_map(|(colour, part)| over(colour, part, PAPER))
                .collect()
        }),
    })
}

/// Draws the frame `frame` of a replay, with trails; `poses` has the poses of all frames of the replay.
fn draw(
    sketch: &mut Sketch<'_>,
    world: &World,
    replay: &Replay,
    poses: &[&[Pose]],
    frame: usize,
    animation: &Animation,
) {
    sketch.clear();
    sketch.walls(world);
    let trail = if replay.agents() <= MOST_TRAILS {
        animation.trail
    } else {
        0
    };
    draw_trails(sketch, &poses[trail_start(replay.steps(), frame, trail)..=frame]);
    sketch.bodies(poses[frame]);
}

fn most_frames(animation: &Animation, agents: usize) -> usize {
    (animation.frames as usize).min(MOST_POSES / agents.max(1)).max(2)
}

/// At most `most` of the places from 0 to `count`, evenly spread; the first and the last place are among them.
pub(crate) fn thinned(count: usize, most: usize) -> Vec<usize> {
    if count <= most.max(2) {
        return (0..count).collect();
    }
    let last = most.max(2) - 1;
    (0..=last).map(|i| i * (count - 1) / last).collect()
}

fn trail_start(steps: &[u32], frame: usize, trail: u32) -> usize {
    steps
        .partition_point(|&step| step < steps[frame].saturating_sub(trail))
        .min(frame)
}

fn draw_trails(sketch: &mut Sketch, frames: &[&[Pose]]) {
    let segments = frames.len().saturating_sub(1);
    for age in 0..AGES.min(segments) {
        let ages = AGES.min(segments);
        let (first, last) = (age * segments / ages, (age + 1) * segments / ages);
        // The opacity is a multiple of a tenth, because the palette has these shades.
        let part = 255 * (age + 1 + AGES - ages) / 10;
        sketch.paths(&frames[first..=last], part as u8, 1.5);
    }
}

/// The smallest rectangle whose pixels turn the picture `before` into `now`. Unchanged pixels in the rectangle have the index
/// [`UNCHANGED`], which compresses well.
fn changes(before: &[u8], now: &[u8], width: u16) -> Frame<'static> {
    let columns = usize::from(width);
    let changed = |i: usize| before.get(i) != Some(&now[i]);
    let rows = now.len() / columns;
    let in_row = |y: usize| (0..columns).any(|x| changed(y * columns + x));
    let top = (0..rows).find(|&y| in_row(y)).unwrap_or(0);
    let bottom = (top..rows).rfind(|&y| in_row(y)).unwrap_or(top);
    let in_column = |x: usize| (top..=bottom).any(|y| changed(y * columns + x));
    let left = (0..columns).find(|&x| in_column(x)).unwrap_or(0);
    let right = (left..columns).rfind(|&x| in_column(x)).unwrap_or(left);
    let place = |i: usize| if changed(i) { now[i] } else { UNCHANGED };
    let buffer: Vec<u8> = (top..=bottom)
        .flat_map(|y| (left..=right).map(move |x| y * columns + x))
        .map(place)
        .collect();
    Frame {
        left: left as u16,
        top: top as u16,
        width: (right - left + 1) as u16,
        height: (bottom - top + 1) as u16,
        transparent: Some(UNCHANGED),
        dispose: DisposalMethod::Keep,
        buffer: buffer.into(),
        ..Frame::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::sample::{ring, world};
    use murmuration_model::colours::AGENTS;

    /// A frame: its delay, and the whole picture as indices into the palette.
    type Shown = (u16, Vec<u8>);

    /// Plays a GIF, and returns its size, its frames and its palette.
    fn play(file: &[u8]) -> ((u16, u16), Vec<Shown>, Vec<u8>) {
        let mut decoder = gif::DecodeOptions::new().read_info(file).unwrap();
        let palette = decoder.global_palette().unwrap().to_vec();
        let size = (decoder.width(), decoder.height());
        let mut screen = vec![UNCHANGED; usize::from(size.0) * usize::from(size.1)];
        let mut frames = Vec::new();
        while let Some(frame) = decoder.read_next_frame().unwrap() {
            for (i, &place) in frame.buffer.iter().enumerate() {
                let (x, y) = (i % usize::from(frame.width), i / usize::from(frame.width));
                if place != UNCHANGED {
                    screen
                        [(y + usize::from(frame.top)) * usize::from(size.0) + x + usize::from(frame.left)] =
                        place;
                }
            }
            frames.push((frame.delay, screen.clone()));
        }
        (size, frames, palette)
    }

    #[test]
    fn the_agent_is_where_the_replay_says_in_every_frame() {
        let world = world("agents = 1");
        let xs: Vec<f32> = (0..20).map(|i| 50.0 + 20.0 * i as f32).collect();
        let replay = Replay::new(
            (0..20).collect(),
            1,
            xs.iter().map(|&x| [x, 100.0, 0.0]).collect(),
        )
        .unwrap();
        let (size, frames, palette) = play(
            &animation_gif(
                &replay,
                &world,
                Colouring::Agents,
                &Animation {
                    size: 500,
                    ..Animation::default()
                },
            )
            .unwrap(),
        );
        assert_eq!((size, frames.len()), ((500, 500), 20));
        for ((delay, screen), (i, &x)) in frames.iter().zip(xs.iter().enumerate()) {
            let at = |x: f32, y: usize| &palette[3 * usize::from(screen[y * 500 + x as usize])..][..3];
            assert_eq!(at(x, 100), AGENTS[0], "frame {i}");
            assert_eq!(at(x + 30.0, 100), PAPER, "frame {i}: ahead of the agent");
            assert_eq!(*delay, if i == 19 { HOLD } else { 4 });
        }
    }

    #[test]
    fn a_long_replay_is_thinned_and_an_unmoving_one_kept() {
        let wide = world("width = 1000.0\nheight = 250.0");
        let (size, frames, _) = play(
            &animation_gif(
                &ring(&wide, 900, 1),
                &wide,
                Colouring::Agents,
                &Animation::default(),
            )
            .unwrap(),
        );
        assert_eq!((size, frames.len()), ((480, 120), 300));
        let still = Replay::new(vec![0, 1, 2], 1, vec![[100.0, 100.0, 0.0]; 3]).unwrap();
        let (_, frames, _) =
            play(&animation_gif(&still, &world(""), Colouring::Agents, &Animation::default()).unwrap());
        assert_eq!(frames.len(), 3);
    }

    #[test]
    fn one_agent_and_ten_thousand_stay_small() {
        let crowd = world("agents = 10000\nwidth = 5000.0\nheight = 5000.0");
        for (world, most) in [
            (world("agents = 1"), 300_000),
            (world(""), 2_500_000),
            (crowd, 6_000_000),
        ] {
            let small = Animation {
                frames: if world.agents() > 24 { 10 } else { 300 },
                ..Animation::default()
            };
            let bytes = animation_gif(
                &ring(&world, 1200, 40.min(world.agents())),
                &world,
                Colouring::Agents,
                &small,
            )
            .unwrap()
            .len();
            assert!(bytes < most, "{} agents: {bytes} bytes", world.agents());
        }
    }

    #[test]
    fn a_film_has_the_pictures_of_the_animation_in_all_colours() {
        let world = world("agents = 1");
        let poses = (0..20).map(|i| [50.0 + 20.0 * i as f32, 100.0, 0.0]).collect();
        let replay = Replay::new((0..20).collect(), 1, poses).unwrap();
        let animation = Animation {
            size: 500,
            ..Animation::default()
        };
        let film = animation_film(&replay, &world, Colouring::Agents, &animation).unwrap();
        assert_eq!((film.width, film.height), (500, 500));
        let pictures: Vec<Vec<u8>> = film.pictures.collect();
        assert_eq!(pictures.len(), 20);
        for (i, picture) in pictures.iter().enumerate() {
            let at = |x: usize| &picture[3 * (100 * 500 + x)..][..3];
            assert_eq!(at(50 + 20 * i), AGENTS[0], "picture {i}");
            assert_eq!(at(80 + 20 * i), PAPER, "picture {i}: ahead of the agent");
        }
    }

    #[test]
    fn thinning_keeps_both_ends() {
        assert_eq!(thinned(5, 10), [0, 1, 2, 3, 4]);
        assert_eq!(thinned(9, 3), [0, 4, 8]);
        assert_eq!(thinned(9, 0), [0, 8]);
        assert_eq!(thinned(1, 5), [0]);
    }
}
