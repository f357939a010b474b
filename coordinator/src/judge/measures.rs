//! Everything that is measured of a motion before it is judged.

use super::{arrangement::Arrangement, body::Body, motion::Motion, walls::Walls, window::Window};
use murmuration_proto::{Replay, World};

/// Measures of the last 160 steps of a swarm. All are 0 or more; lengths are in the units of [`Scale`].
#[derive(Debug, Clone, PartialEq)]
pub struct Measures {
    /// Where the agents are.
    pub arrangement: Arrangement,
    /// How they move.
    pub motion: Motion,
    /// The swarm as one body.
    pub body: Body,
    /// What it does at the walls.
    pub walls: Walls,
}

/// The lengths that others are measured by, world units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    /// Radius of a body.
    pub radius: f64,
    /// Radius of a disc in which the bodies would just fit if they could be cut up: body radius times the root of their number.
    pub packed: f64,
    /// Distance between neighbours if the agents stood on a square grid over all of the arena.
    pub spacing: f64,
}

impl Scale {
    /// The lengths of a world.
    #[must_use]
    pub fn of(world: &World) -> Self {
        let agents = f64::from(world.agents());
        let sides = [world.width(), world.height()].map(|side| side - 2.0 * world.margin());
        Self {
            radius: world.radius(),
            packed: world.radius() * agents.sqrt(),
            // Where the walls leave no room to move there is still that of a body.
            spacing: (sides.map(|side| side.max(world.radius())).iter().product::<f64>() / agents).sqrt(),
        }
    }
}

impl Measures {
    /// Measures the end of a replay; the cost grows with the square of the number of agents.
    #[must_use]
    pub fn of(replay: &Replay, world: &World) -> Self {
        let scale = Scale::of(world);
        let window = Window::of(replay);
        let (motion, shared) = Motion::of(&window, &scale);
        Self {
            arrangement: Arrangement::of(&window, &scale),
            body: Body::of(&window, &shared),
            walls: Walls::of(&window, world, &scale),
            motion,
        }
    }
}

/// The value that `part` (0 to 1) of at least one value are under.
pub(super) fn quantile(values: impl Iterator<Item = f64>, part: f64) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    let place = (part * sorted.len().saturating_sub(1) as f64).round() as usize;
    sorted.get(place).copied().unwrap_or(0.0)
}

/// Share of the true ones; 0 of none.
pub(super) fn share(values: impl Iterator<Item = bool>) -> f64 {
    let (mut held, mut all) = (0.0, 0.0);
    for value in values {
        held += if value { 1.0 } else { 0.0 };
        all += 1.0;
    }
    ratio(held, all)
}

/// `part / whole`; 0 of nothing.
pub(super) fn ratio(part: f64, whole: f64) -> f64 {
    if whole > 0.0 { part / whole } else { 0.0 }
}
