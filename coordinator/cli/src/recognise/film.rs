//! The film: its file, and how its tracks are read.

use super::super::CliError;
use murmuration_files::{InputKind, open};
use murmuration_model::csv_file::{ColumnNames, CsvError};
use murmuration_swarm::{Invalid, World, text::quoted};
use murmuration_tracks::{
    Axes, Filmed, Origin, Reading, Tracks, TracksError, TracksFile, WrongHeadings, YAxis,
};
use std::{io::Read, path::PathBuf, str::FromStr};

/// Width and height of an arena in the units of the tracks, both greater than 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Arena(pub(super) [f64; 2]);

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum OriginName {
    Corner,
    Centre,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum YName {
    Down,
    Up,
}

#[derive(Debug, clap::Args)]
pub(super) struct Film {
    /// Tracks of the robots, CSV
    pub(super) tracks: PathBuf,
    /// Names of the columns in the file: frame, robot, x, y, heading and species, as far as they differ
    #[arg(long, value_name = "frame=NAME,...")]
    columns: Option<ColumnNames>,
    /// Time from one frame to the next, in units of the world's time [default: one step]
    #[arg(long, value_name = "TIME", value_parser = over_zero, allow_negative_numbers = true)]
    frame_time: Option<f64>,
    /// Frames per unit of the world's time, instead of --frame-time
    #[arg(
        long,
        value_name = "FRAMES",
        conflicts_with = "frame_time",
        value_parser = over_zero,
        allow_negative_numbers = true
    )]
    fps: Option<f64>,
    /// Width and height of the filmed arena, in units of the tracks; the command scales the arena to the world [default: the tracks
    /// are in world units]
    #[arg(long, value_name = "WIDTHxHEIGHT")]
    arena: Option<Arena>,
    /// Place of 0, 0 in the arena: the corner with the least x and y, or the middle
    #[arg(long, value_enum, default_value = "corner")]
    origin: OriginName,
    /// Direction in which y grows; headings grow from x to y
    #[arg(long, value_enum, default_value = "down")]
    y: YName,
    /// Headings are in degrees, not in radians
    #[arg(long)]
    degrees: bool,
    /// Leave out robots that are seen in fewer frames [default: a robot that is seen in less than half of the frames is an error]
    #[arg(long, value_name = "N")]
    min_frames: Option<u32>,
}

/// Parses a time or a rate, whose reciprocal is a number too.
fn over_zero(text: &str) -> Result<f64, &'static str> {
    let number = text.parse::<f64>().ok();
    number
        .filter(|number| number.is_normal() && *number > 0.0)
        .ok_or("it must be a number over 0")
}

impl Film {
    pub(super) fn open(&self) -> Result<TracksFile<impl Read + use<>>, CliError> {
        let file = open(&self.tracks, InputKind::Tracks);
        let file = file.map_err(|error| CliError::unreadable(&self.tracks, &error))?;
        let columns = self.columns.clone().unwrap_or_default();
        TracksFile::open(&self.tracks, file, columns).map_err(|error| self.refused(error))
    }

    /// Reads the tracks, and keeps those of the last `steps` of `world`.
    pub(super) fn read(
        &self,
        file: TracksFile<impl Read>,
        world: &World,
        steps: u32,
    ) -> Result<Tracks, CliError> {
        let frames = f64::from(steps) * world.dt() / self.frame_time(world);
        let reading = Reading {
            // A number that is too large for u32 saturates, and NaN becomes 0.
            frames: (frames.ceil() as u32).saturating_add(1),
            min_frames: self.min_frames,
            degrees: self.degrees,
        };
        Tracks::read(file, reading).map_err(|error| self.refused(error))
    }

    /// Time from one frame to the next, in units of the world's time.
    pub(super) fn frame_time(&self, world: &World) -> f64 {
        let time = self.frame_time.or_else(|| self.fps.map(f64::recip));
        time.unwrap_or(world.dt())
    }

    /// The scale between the film and its world.
    pub(super) fn scale<'a>(&self, world: &'a World) -> Result<Filmed<'a>, Invalid> {
        let axes = Axes {
            origin: match self.origin {
                OriginName::Corner => Origin::Corner,
                OriginName::Centre => Origin::Centre,
            },
            y: match self.y {
                YName::Down => YAxis::Down,
                YName::Up => YAxis::Up,
            },
        };
        let filmed = Filmed::new(world).with_axes(axes);
        let filmed = filmed.with_frame_time(self.frame_time(world))?;
        match self.arena {
            Some(Arena(sides)) => filmed.with_arena(sides),
            None => Ok(filmed),
        }
    }

    /// An error in the tracks, with the option that can mend it.
    pub(super) fn refused(&self, error: TracksError) -> CliError {
        let option = match &error {
            TracksError::File(CsvError::Column { .. }) => {
                "--columns frame=NAME,robot=NAME,x=NAME,y=NAME gives the names of the columns"
            }
            TracksError::Gap { .. } | TracksError::Ghost { .. } => {
                "--min-frames N leaves out robots that are seen in fewer than N frames; if all robots are missing there, frames must \
                 be numbered 0, 1, 2, and --frame-time TIME gives the time between them"
            }
            TracksError::Headings {
                wrong: WrongHeadings::Degrees,
                ..
            } => "--degrees reads headings in degrees",
            TracksError::Headings {
                wrong: WrongHeadings::Radians,
                ..
            } => "leave out --degrees",
            TracksError::Fast { .. } => {
                "--frame-time TIME or --fps FRAMES gives the time between frames, and --arena WIDTHxHEIGHT the size of the filmed arena"
            }
            TracksError::Outside { .. } => {
                "--arena WIDTHxHEIGHT gives the size of the filmed arena in units of the tracks, and --origin centre says that 0, 0 \
                 is its middle"
            }
            TracksError::Small { .. } => {
                "--arena WIDTHxHEIGHT gives the size of the filmed arena in units of the tracks"
            }
            TracksError::File(_)
            | TracksError::Empty(_)
            | TracksError::Short(_)
            | TracksError::Headings { .. }
            | TracksError::Jumps { .. }
            | TracksError::Species { .. }
            | TracksError::Invalid(_) => return CliError::Input(error.to_string()),
        };
        CliError::Input(format!("{error}: {option}"))
    }
}

impl FromStr for Arena {
    type Err = Invalid;

    fn from_str(text: &str) -> Result<Self, Invalid> {
        let sides = text.split_once('x').and_then(|(width, height)| {
            let side = |text: &str| text.trim().parse::<f64>().ok();
            Some([side(width)?, side(height)?])
        });
        let sides = sides.filter(|sides| sides.iter().all(|side| side.is_finite() && *side > 0.0));
        sides
            .map(Self)
            .ok_or_else(|| Invalid::new("arena", quoted(text), "two numbers over 0 such as 400x300"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_and_a_rate_are_over_zero() {
        assert_eq!(over_zero("0.04"), Ok(0.04));
        assert_eq!(over_zero("25"), Ok(25.0));
        for bad in ["", "0", "-1", "nan", "inf", "1e-320", "25fps"] {
            assert!(over_zero(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn an_arena_is_two_lengths() {
        let sides = |text: &str| text.parse::<Arena>().map(|arena| arena.0);
        assert_eq!(sides("4x2.5"), Ok([4.0, 2.5]));
        for bad in ["", "4", "4x", "4x0", "-4x2", "4xinf", "4x2x1"] {
            assert!(sides(bad).is_err(), "{bad}");
        }
    }
}
