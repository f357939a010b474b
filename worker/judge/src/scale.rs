//! The units of length of measures.

use murmuration_proto::World;

/// The units of length, in world units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    /// Radius of a body.
    pub radius: f64,
    /// Radius of a disc with the total area of the bodies: body radius times the square root of their number.
    pub packed: f64,
    /// Distance between neighbours if the agents stood on a square grid over the whole arena.
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
            // If the walls leave no room to move, there is still the room of a body.
            spacing: (sides.map(|side| side.max(world.radius())).iter().product::<f64>() / agents).sqrt(),
        }
    }
}
