//! Tracks: the positions of a swarm's robots in the frames of a film.
//!
//! [`Tracks`] is a parsed file. [`Tracks::ending`] makes the motion of a swarm from it: a pose of each robot at each of the last
//! steps. It interpolates gaps between frames; unknown headings become directions of motion. This crate handles text but no files,
//! and knows nothing of features or pictures.

mod file;
mod filmed;
mod motion;

pub use file::{Tracks, TracksError, to_csv};
pub use filmed::Filmed;
pub use motion::{MAX_GAP_FRAMES, MAX_POSES};

/// The position of a robot at a moment.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Sighting {
    /// x and y, in the units of the file.
    at: [f64; 2],
    /// Radians; `None` if the file has none.
    heading: Option<f64>,
}
