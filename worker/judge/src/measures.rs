//! The measures of a motion.

use super::{
    arrangement::Arrangement, body::Body, motion::Motion, scale::Scale, walls::Walls, window::Window,
};
use murmuration_proto::{Replay, World};

/// Measures of the last 160 steps of a swarm. All are 0 or more; lengths are in the units of [`Scale`].
#[derive(Debug, Clone, PartialEq)]
pub struct Measures {
    /// The arrangement of the agents.
    pub arrangement: Arrangement,
    /// Their motion.
    pub motion: Motion,
    /// The swarm as one body.
    pub body: Body,
    /// Its motion at the walls.
    pub walls: Walls,
}

impl Measures {
    /// Measures the end of a replay; the cost grows with the square of the number of agents.
    #[must_use]
    pub fn of(replay: &Replay, world: &World) -> Self {
        let scale = Scale::of(world);
        let window = Window::of(replay, world);
        let (motion, shared) = Motion::of(&window, &scale);
        Self {
            arrangement: Arrangement::of(&window, &scale),
            body: Body::of(&window, &shared),
            walls: Walls::of(&window, world, &scale),
            motion,
        }
    }
}
