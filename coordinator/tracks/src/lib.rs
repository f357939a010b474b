//! Tracks: the positions of a swarm's robots in the frames of a film.
//!
//! [`Tracks`] is a parsed file. [`Tracks::ending`] makes the motion of a swarm from its tracks: a pose of each robot at each of
//! the last steps. The function interpolates gaps between frames, and takes an unknown heading from the direction of motion. This
//! crate reads text but no files, and computes neither features nor pictures.

mod error;
mod file;
mod filmed;
mod motion;
mod moves;
mod robot_name;
mod understood;

pub use error::{Jump, TracksError, WrongHeadings};
pub use file::{COLUMNS, Reading, Tracks, TracksFile, to_csv};
pub use filmed::{Axes, Filmed, Origin, YAxis};
pub use motion::MAX_POSES;
pub use robot_name::RobotName;
pub use understood::Understood;

/// Maximum number of consecutive frames in which a robot can be missing.
pub const MAX_GAP_FRAMES: u32 = 25;

/// The position of a robot at a moment.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Sighting {
    /// Coordinates x and y, in the units of the file.
    at: [f64; 2],
    /// The heading in radians; `None` if the file has no heading for this sighting.
    heading: Option<f64>,
}
