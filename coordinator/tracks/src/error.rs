//! Why tracks cannot be used.

use crate::{MAX_GAP_FRAMES, RobotName};
use murmuration_model::csv_file::CsvError;
use murmuration_swarm::{Invalid, counted, in_full};
use std::{fmt, path::PathBuf};

/// Why tracks cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TracksError {
    #[error(transparent)]
    File(#[from] CsvError),
    #[error("{}: no robot is seen in it", .0.display())]
    Empty(PathBuf),
    #[error("{}: the frames last less than one step, and a motion has one at least", .0.display())]
    Short(PathBuf),
    #[error(
        "{}: robot {robot} is missing from {}; only gaps of up to {} are interpolated", path.display(), missing(*frames),
        counted(u64::from(MAX_GAP_FRAMES), "frame")
    )]
    Gap {
        path: PathBuf,
        robot: RobotName,
        /// First and last missing frame.
        frames: [u32; 2],
    },
    #[error("{}: robot {robot} is seen in only {} of {}{}", path.display(), frames.len(), counted(*of, "frame"), listed(frames))]
    Ghost {
        path: PathBuf,
        robot: RobotName,
        /// The frames in which the robot is seen.
        frames: Vec<u32>,
        /// Number of frames in which some robot is seen.
        of: u64,
    },
    #[error("{}: robot {robot} {what}", path.display())]
    Species {
        path: PathBuf,
        robot: RobotName,
        what: String,
    },
    #[error("{}: the headings {}", path.display(), headings_in_words(*wrong))]
    Headings { path: PathBuf, wrong: WrongHeadings },
    #[error(
        "{}: the robots move by {} a step on average, and robots of the campaign by at most {}", path.display(), short(*pace),
        short(*top)
    )]
    Fast {
        path: PathBuf,
        /// Mean speed of the robots, world units a step.
        pace: f64,
        /// The campaign's top speed, world units a step.
        top: f64,
    },
    #[error(
        "{}: {jump}, as in {} of {} moves: robots that are not seen have empty cells, and a robot keeps its name", path.display(),
        of[0], of[1]
    )]
    Jumps {
        path: PathBuf,
        /// The first jump.
        jump: Box<Jump>,
        /// Number of jumps, and of all moves.
        of: [u64; 2],
    },
    #[error(
        "{}: {} of the positions are inside the walls ({}); the positions span {}", path.display(), percent(*inside),
        in_words(walls), in_words(span)
    )]
    Outside {
        path: PathBuf,
        /// Share of the positions, 0 to 1.
        inside: f64,
        /// The least and the greatest x and y between the walls, in units of the tracks.
        walls: [[f64; 2]; 2],
        /// The least and the greatest x and y of the positions, in units of the tracks.
        span: [[f64; 2]; 2],
    },
    #[error(
        "{}: the positions span {}, which is {} of the arena ({}): the robots would not have room there", path.display(),
        in_words(span), percent(*share), in_words(walls)
    )]
    Small {
        path: PathBuf,
        /// Length of the positions' longer side, as a share of the arena's, 0 to 1.
        share: f64,
        /// The least and the greatest x and y between the walls, in units of the tracks.
        walls: [[f64; 2]; 2],
        /// The least and the greatest x and y of the positions, in units of the tracks.
        span: [[f64; 2]; 2],
    },
    #[error(transparent)]
    Invalid(#[from] Invalid),
}

/// A move of a robot that no robot of the campaign can make.
#[derive(Debug, Clone, PartialEq)]
pub struct Jump {
    pub robot: RobotName,
    /// The frames before and after it.
    pub frames: [u32; 2],
    /// Its length, world units.
    pub length: f64,
}

/// An error in the headings of tracks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WrongHeadings {
    /// They are in degrees, and were read as radians.
    Degrees,
    /// They are in radians, and were read as degrees.
    Radians,
    /// They grow from y to x.
    Mirrored,
    /// They point across the direction of motion.
    Across,
}

impl fmt::Display for Jump {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (robot, [before, after], length) = (&self.robot, self.frames, short(self.length));
        write!(
            f,
            "robot {robot} moves by {length} in the world from frame {before} to {after}, farther than it can"
        )
    }
}

const fn headings_in_words(wrong: WrongHeadings) -> &'static str {
    match wrong {
        WrongHeadings::Degrees => {
            "are no radians: they do not fit the robots' motion, or change by more than a turn in a frame"
        }
        WrongHeadings::Radians => "are no degrees: read as radians, they fit the robots' motion",
        WrongHeadings::Mirrored => {
            "turn the other way: they fit the robots' motion with the opposite sign, and must grow from x to y"
        }
        WrongHeadings::Across => {
            "point across the robots' motion: without the column, a robot looks where it moves"
        }
    }
}

fn missing([first, last]: [u32; 2]) -> String {
    match first == last {
        true => format!("frame {first}"),
        false => format!("frames {first} to {last}"),
    }
}

/// The frames in words, the first of them if there are many.
fn listed(frames: &[u32]) -> String {
    let first: Vec<String> = frames.iter().take(8).map(u32::to_string).collect();
    let more = if frames.len() > first.len() { ", ..." } else { "" };
    match first.as_slice() {
        [] => String::new(),
        some => format!(" ({}{more})", some.join(", ")),
    }
}

fn percent(share: f64) -> String {
    format!("{:.0} %", 100.0 * share)
}

fn in_words([[left, right], [top, bottom]]: &[[f64; 2]; 2]) -> String {
    let [left, right, top, bottom] = [left, right, top, bottom].map(|side| short(*side));
    format!("x {left} to {right}, y {top} to {bottom}")
}

/// A number with four significant digits.
fn short(value: f64) -> String {
    let digits = 3 - value.abs().max(1e-9).log10().floor() as i32;
    let unit = 10_f64.powi(digits);
    in_full((value * unit).round() / unit)
}
