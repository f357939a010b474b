//! Whether robots can have moved and turned as tracks say.

use crate::{
    Filmed, MAX_GAP_FRAMES, Sighting, Tracks, TracksError,
    error::{Jump, WrongHeadings},
    file::Robot,
};
use std::f64::consts::TAU;

/// How many times as fast as its top speed a swarm may seem to be on average.
const TOLERANCE: f64 = 1.1;
/// A move is a jump if it is longer than this many times what a robot can drive in the meantime, and its diameter.
const JUMP: f64 = 3.0;
/// Share of a film's moves that may be jumps.
const MOST_JUMPS: f64 = 0.01;
/// Number of moves with a heading from which on headings are compared with the moves.
const ENOUGH: usize = 30;
/// Frames over which a move that exceeds the camera's jitter is looked for.
const MOST_FRAMES: u32 = 5;
/// Least agreement of headings with moves, 0 to 1, and the least difference to that of other headings, from which on a reading of
/// the headings is the right one.
const AGREES: f64 = 0.5;
const BETTER: f64 = 0.3;

impl Tracks {
    /// Checks the motion at the end of the film against what robots can do that drive at most `top_speed` world units in a unit of
    /// time. `poses` is the motion of [`Tracks::ending`]. Returns the jumps, which are few.
    ///
    /// # Errors
    /// [`TracksError::Fast`], [`TracksError::Jumps`] and [`TracksError::Headings`].
    pub fn check_moves(
        &self,
        poses: &[Vec<[f64; 3]>],
        filmed: &Filmed<'_>,
        top_speed: f64,
    ) -> Result<Vec<Jump>, TracksError> {
        let top = top_speed * filmed.world.dt();
        let frames = (poses.len().saturating_sub(1) as f64 * filmed.frames_a_step).ceil() as u32;
        let first = self.frames()[1].saturating_sub(frames);
        let (jumps, moves) = self.jumps(first, filmed, top);
        let path = || self.path.clone();
        if jumps.len() as f64 > MOST_JUMPS * moves as f64
            && let Some(jump) = jumps.first()
        {
            return Err(TracksError::Jumps {
                path: path(),
                jump: Box::new(jump.clone()),
                of: [jumps.len() as u64, moves],
            });
        }
        let pace = pace(poses, filmed, top);
        if pace > TOLERANCE * top {
            return Err(TracksError::Fast {
                path: path(),
                pace,
                top,
            });
        }
        match self.wrong_headings(first, filmed) {
            Some(wrong) => Err(TracksError::Headings { path: path(), wrong }),
            None => Ok(jumps),
        }
    }

    /// The jumps from a frame on, and the number of all moves.
    fn jumps(&self, first: u32, filmed: &Filmed<'_>, top: f64) -> (Vec<Jump>, u64) {
        let (mut jumps, mut moves) = (Vec::new(), 0);
        for robot in &self.robots {
            for ([before, after], [from, to]) in successive(robot, first) {
                moves += 1;
                let length = distance(filmed, from, to);
                let steps = f64::from(after - before) / filmed.frames_a_step;
                if length > JUMP * top * steps + 2.0 * filmed.world.radius() {
                    jumps.push(Jump {
                        robot: robot.name.clone(),
                        frames: [before, after],
                        length,
                    });
                }
            }
        }
        (jumps, moves)
    }

    fn wrong_headings(&self, first: u32, filmed: &Filmed<'_>) -> Option<WrongHeadings> {
        let moves: Vec<[f64; 2]> = self
            .robots
            .iter()
            .flat_map(|robot| headed_moves(robot, first, filmed))
            .collect();
        let fits = |reading: fn(f64) -> f64| {
            let angles = moves.iter().map(|[heading, way]| 2.0 * (reading(*heading) - way));
            let (x, y) = angles.fold((0.0, 0.0), |(x, y), angle| (x + angle.cos(), y + angle.sin()));
            let count = moves.len().max(1) as f64;
            // A robot moves along its heading, forwards or backwards, so an angle counts modulo half a turn.
            (x.hypot(y) / count, x / x.hypot(y).max(f64::MIN_POSITIVE))
        };
        let (as_read, along) = fits(|heading| heading);
        let other = match self.in_degrees {
            true => fits(f64::to_degrees),
            false => fits(f64::to_radians),
        };
        let is_better = |other: f64| moves.len() >= ENOUGH && other > AGREES && other > as_read + BETTER;
        let wrong_unit = match self.in_degrees {
            true => WrongHeadings::Radians,
            false => WrongHeadings::Degrees,
        };
        if is_better(other.0) {
            return Some(wrong_unit);
        }
        if is_better(fits(|heading| -heading).0) {
            return Some(WrongHeadings::Mirrored);
        }
        let agrees = moves.len() >= ENOUGH && as_read > AGREES;
        match agrees {
            true => (as_read > AGREES + BETTER && along < -0.5).then_some(WrongHeadings::Across),
            false => (!self.in_degrees && self.leaps_in_heading(first)).then_some(WrongHeadings::Degrees),
        }
    }

    /// Whether a heading changes by more than a turn from one frame to the next. Headings in radians may go on over a turn, as those
    /// of `murmuration simulate` do.
    fn leaps_in_heading(&self, first: u32) -> bool {
        let leaps = |robot: &Robot| {
            successive(robot, first).any(|(_, [from, to])| {
                let headings = from.heading.zip(to.heading);
                headings.is_some_and(|(from, to)| (to - from).abs() > 1.0001 * TAU)
            })
        };
        self.robots.iter().any(leaps)
    }
}

/// The sightings of a robot from a frame on, each with the next one and their frames.
fn successive(robot: &Robot, first: u32) -> impl Iterator<Item = ([u32; 2], [Sighting; 2])> + '_ {
    let sightings = || robot.sightings.range(first.saturating_sub(MAX_GAP_FRAMES)..);
    sightings()
        .zip(sightings().skip(1))
        .map(|((&before, &from), (&after, &to))| ([before, after], [from, to]))
}

/// The heading at the middle of each move that exceeds the camera's jitter, and the direction of the move; radians in the world.
fn headed_moves(robot: &Robot, first: u32, filmed: &Filmed<'_>) -> Vec<[f64; 2]> {
    let sightings = robot.sightings.range(first.saturating_sub(MAX_GAP_FRAMES)..);
    let mut moves = Vec::new();
    for (&frame, middle) in sightings {
        let around = (1..=MOST_FRAMES).find_map(|frames| {
            let before = robot.sightings.get(&frame.checked_sub(frames)?)?;
            let after = robot.sightings.get(&frame.checked_add(frames)?)?;
            let [x, y] = filmed.world.way(filmed.place(before.at), filmed.place(after.at));
            (x.hypot(y) > filmed.still()).then(|| y.atan2(x))
        });
        if let Some((heading, way)) = middle.heading.zip(around) {
            moves.push([filmed.turn(heading), way]);
        }
    }
    moves
}

fn distance(filmed: &Filmed<'_>, from: Sighting, to: Sighting) -> f64 {
    let [x, y] = filmed.world.way(filmed.place(from.at), filmed.place(to.at));
    x.hypot(y)
}

/// The mean speed of a swarm in world units a step, over so many steps that robots can drive much farther than the camera's jitter.
fn pace(poses: &[Vec<[f64; 3]>], filmed: &Filmed<'_>, top: f64) -> f64 {
    let steps = (4.0 * filmed.still() / top).ceil().clamp(1.0, 25.0) as usize;
    let moves = poses.iter().zip(poses.iter().skip(steps));
    let lengths = moves.flat_map(|(before, after)| {
        before.iter().zip(after).map(|([x, y, _], [to_x, to_y, _])| {
            let [x, y] = filmed.world.way([*x, *y], [*to_x, *to_y]);
            x.hypot(y)
        })
    });
    let (sum, count) = lengths.fold((0.0, 0_u64), |(sum, count), length| (sum + length, count + 1));
    sum / (count.max(1) * steps as u64) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Reading, TracksFile};
    use murmuration_model::csv_file::ColumnNames;
    use murmuration_swarm::World;
    use std::{f64::consts::FRAC_PI_2, path::Path};

    /// The tracks of four robots on circles with a speed of 1.5 a step in 200 frames. `row` may change a robot's x, y and heading.
    fn circles(row: impl Fn(u32, u32, [f64; 3]) -> [f64; 3]) -> String {
        let mut text = "frame,robot,x,y,heading\n".to_owned();
        for frame in 0..200 {
            for robot in 0..4 {
                let radius = 30.0 + 10.0 * f64::from(robot);
                let turn = 1.5 / radius * f64::from(frame) + f64::from(robot);
                let pose = [
                    250.0 + radius * turn.cos(),
                    250.0 + radius * turn.sin(),
                    turn + FRAC_PI_2,
                ];
                let [x, y, heading] = row(frame, robot, pose);
                text += &format!("{frame},{robot},{x},{y},{heading}\n");
            }
        }
        text
    }

    fn checked(text: &str, degrees: bool, frame_time: f64) -> Result<Vec<Jump>, TracksError> {
        let file = TracksFile::open(Path::new("t.csv"), text.as_bytes(), ColumnNames::default())?;
        let tracks = Tracks::read(
            file,
            Reading {
                degrees,
                ..Reading::default()
            },
        )?;
        let world = World::default();
        let filmed = Filmed::new(&world).with_frame_time(frame_time)?;
        let poses = tracks.ending(160, &filmed)?;
        tracks.check_moves(&poses, &filmed, 2.0)
    }

    fn wrong(text: &str, degrees: bool) -> Option<WrongHeadings> {
        match checked(text, degrees, 1.0) {
            Ok(_) => None,
            Err(TracksError::Headings { wrong, .. }) => Some(wrong),
            Err(error) => panic!("{error}"),
        }
    }

    #[test]
    fn a_swarm_that_is_too_fast_has_frames_of_another_time() {
        let text = circles(|_, _, pose| pose);
        assert_eq!(checked(&text, false, 1.0), Ok(Vec::new()));
        assert_eq!(checked(&text, false, 2.0), Ok(Vec::new()));
        let fast = checked(&text, false, 0.5).unwrap_err();
        assert_eq!(
            fast.to_string(),
            "t.csv: the robots move by 2.997 a step on average, and robots of the campaign by at most 2"
        );
    }

    #[test]
    fn the_last_frames_that_a_number_can_have_are_checked_too() {
        let rows: String = (0..30)
            .map(|step| format!("{},0,{},100,0\n", u32::MAX - 29 + step, 100 + step))
            .collect();
        assert_eq!(
            checked(&format!("frame,robot,x,y,heading\n{rows}"), false, 1.0),
            Ok(Vec::new())
        );
    }

    #[test]
    fn one_jump_is_told_and_many_are_refused() {
        let exchanged = circles(|frame, robot, [x, y, heading]| match (frame, robot) {
            (120, 3) => [500.0 - x, 500.0 - y, heading],
            _ => [x, y, heading],
        });
        let jumps = checked(&exchanged, false, 1.0).unwrap();
        let frames: Vec<_> = jumps.iter().map(|jump| jump.frames).collect();
        assert_eq!(frames, [[119, 120], [120, 121]]);
        assert!((jumps[0].length - 120.0).abs() < 2.0);
        let zeros = circles(|frame, robot, pose| match (frame + robot) % 20 {
            0 => [0.0, 0.0, pose[2]],
            _ => pose,
        });
        let refused = checked(&zeros, false, 1.0).unwrap_err().to_string();
        assert!(
            refused.contains("moves by 3") && refused.contains("of 740 moves"),
            "{refused}"
        );
    }

    #[test]
    fn headings_are_compared_with_the_motion() {
        let turned = |by: fn(f64) -> f64| circles(|_, _, [x, y, heading]| [x, y, by(heading)]);
        assert_eq!(wrong(&turned(|heading| heading), false), None);
        // Backwards, in whole turns more, and in degrees.
        assert_eq!(wrong(&turned(|heading| heading + TAU / 2.0), false), None);
        assert_eq!(wrong(&turned(|heading| heading + 5.0 * TAU), false), None);
        assert_eq!(wrong(&turned(f64::to_degrees), true), None);
        assert_eq!(
            wrong(&turned(f64::to_degrees), false),
            Some(WrongHeadings::Degrees)
        );
        assert_eq!(
            wrong(&turned(|heading| heading), true),
            Some(WrongHeadings::Radians)
        );
        assert_eq!(
            wrong(&turned(|heading| -heading), false),
            Some(WrongHeadings::Mirrored)
        );
        assert_eq!(
            wrong(&turned(|heading| heading + FRAC_PI_2), false),
            Some(WrongHeadings::Across)
        );
    }

    #[test]
    fn headings_of_robots_that_stand_still_may_go_on_over_a_turn() {
        let turning = |rate: f64| {
            circles(|frame, robot, _| {
                [
                    100.0 + 50.0 * f64::from(robot),
                    100.0,
                    9.0 + rate * f64::from(frame),
                ]
            })
        };
        assert_eq!(wrong(&turning(0.5), false), None);
        assert_eq!(wrong(&turning(7.0), false), Some(WrongHeadings::Degrees));
        assert_eq!(wrong(&turning(7.0), true), None);
    }
}
