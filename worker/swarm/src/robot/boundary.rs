//! Edges of an arena.

use crate::{Invalid, text};
use std::{fmt, str::FromStr};

/// Effect of the edges of a world on a robot.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum Boundary {
    /// A wall at the world's padding from each edge. Robots' bodies stay between the walls, unless other robots push them.
    #[default]
    Walls,
    /// No effect: robots can leave the world, and no sensor sees a wall.
    Open,
    /// No edges: robots that leave on one side come in on the other. Distances, collisions and sensors use the nearest image of a
    /// robot. A ray without limit sees only the nearest image of a robot. No sensor sees a wall.
    Torus,
}

impl Boundary {
    pub const ALL: [Self; 3] = [Self::Walls, Self::Open, Self::Torus];

    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Walls => "walls",
            Self::Open => "open",
            Self::Torus => "torus",
        }
    }
}

impl FromStr for Boundary {
    type Err = Invalid;

    fn from_str(name: &str) -> Result<Self, Invalid> {
        let found = Self::ALL.into_iter().find(|boundary| boundary.name() == name);
        found.ok_or_else(|| {
            let names = Self::ALL.map(|boundary| text::quoted(boundary.name()).to_string());
            Invalid::new("boundary", text::quoted(name), names.join(" or "))
        })
    }
}

impl fmt::Display for Boundary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
