//! Tracks: where the robots of a swarm were in the frames of a film.
//!
//! [`Tracks`] is a file of them as it was read. [`Tracks::ending`] makes the motion of a swarm of it: a pose of each robot at each of
//! the last steps. What is missing between two frames is interpolated; headings that nobody measured are directions of motion.
//! Limits: text in and out, no files; knows nothing of features or pictures.

mod file;
mod filmed;
mod motion;

pub use file::{Tracks, TracksError, to_csv};
pub use filmed::Filmed;
pub use motion::{MAX_GAP_FRAMES, MAX_POSES};

/// Where a robot was at a moment.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Sighting {
    /// x and y, in the units of the file.
    at: [f64; 2],
    /// Radians; `None` if the file does not say.
    heading: Option<f64>,
}
