//! Why tracks cannot be used.

use crate::{MAX_GAP_FRAMES, RobotName};
use murmuration_model::csv_file::CsvError;
use murmuration_swarm::{Invalid, counted, in_full};
use std::path::PathBuf;

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
    #[error("{}, line {line}: the heading {heading} is beyond a whole turn of 2 pi radians", path.display())]
    Headings { path: PathBuf, line: u64, heading: f64 },
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
