//! Obstacles in an arena.

use crate::{Invalid, World, invalid};
use murmuration_proto::v1;

/// A body in the arena that never moves. An obstacle pushes robots out, and sensors can see an obstacle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Obstacle {
    Disc {
        /// x and y of the obstacle's centre, world units.
        centre: [f64; 2],
        /// Radius of the disc, world units, over 0.
        radius: f64,
    },
    /// A box whose sides are parallel to those of the world.
    Box {
        /// x and y of the obstacle's centre, world units.
        centre: [f64; 2],
        /// Width and height of the box, world units, each over 0.
        size: [f64; 2],
    },
}

/// Number of places along each side at which `leave_room` looks for room. An arena with only finer gaps counts as full.
const TRIED: u32 = 256;

impl Obstacle {
    /// Maximum number of obstacles in a world.
    pub const MAX_COUNT: usize = 100;

    /// x and y of the obstacle's centre, world units.
    #[must_use]
    pub const fn centre(&self) -> [f64; 2] {
        match *self {
            Self::Disc { centre, .. } | Self::Box { centre, .. } => centre,
        }
    }

    /// Distances from the obstacle's centre to its right and lower ends, world units.
    #[must_use]
    pub fn half_size(&self) -> [f64; 2] {
        match *self {
            Self::Disc { radius, .. } => [radius; 2],
            Self::Box { size, .. } => size.map(|side| side / 2.0),
        }
    }

    /// Distance of a point from the obstacle, world units; 0 for a point inside.
    #[must_use]
    pub fn distance(&self, [x, y]: [f64; 2]) -> f64 {
        let centre = self.centre();
        let off = [x - centre[0], y - centre[1]];
        match *self {
            Self::Disc { radius, .. } => (length(off) - radius).max(0.0),
            Self::Box { size, .. } => {
                let beyond = [0, 1].map(|axis| (off[axis].abs() - size[axis] / 2.0).max(0.0));
                length(beyond)
            }
        }
    }

    /// The obstacle of a message, in a world of this width and height.
    fn in_world(message: v1::Obstacle, sides: [f64; 2]) -> Result<Self, Invalid> {
        let far = 2.0 * World::MAX_SIDE;
        let place = |field, given: Option<f64>| {
            let given = given.ok_or_else(|| Invalid::missing(field, "given"))?;
            invalid::real(field, given, -far..=far)
        };
        let centre = [place("x", message.x)?, place("y", message.y)?];
        let size = |field, value| invalid::positive(field, value, far);
        let obstacle = match (message.radius, message.width, message.height) {
            (Some(radius), None, None) => Self::Disc {
                centre,
                radius: size("radius", radius)?,
            },
            (None, Some(width), Some(height)) => Self::Box {
                centre,
                size: [size("width", width)?, size("height", height)?],
            },
            (Some(radius), ..) => {
                let allowed = "absent if a width or height is given: an obstacle is a disc or a box";
                return Err(Invalid::new("radius", radius, allowed));
            }
            (None, None, None) => {
                let allowed = "given for a disc, or width and height for a box";
                return Err(Invalid::missing("radius", allowed));
            }
            (None, width, _) => {
                let absent = if width.is_none() { "width" } else { "height" };
                return Err(Invalid::missing(absent, "given for a box"));
            }
        };
        obstacle.check_place(sides)?;
        Ok(obstacle)
    }

    /// Checks that the obstacle lies in the world at least in part, and does not fill the world.
    fn check_place(&self, [width, height]: [f64; 2]) -> Result<(), Invalid> {
        let [x, y] = self.centre();
        let refused = |allowed: &str| {
            let field = if (0.0..=width).contains(&x) { "y" } else { "x" };
            let value = if field == "x" { x } else { y };
            Err(Invalid::new(field, value, allowed))
        };
        if self.distance([x.clamp(0.0, width), y.clamp(0.0, height)]) > 0.0 {
            return refused("such that at least a part of the obstacle is in the world");
        }
        let corners = [[0.0, 0.0], [width, 0.0], [0.0, height], [width, height]];
        // Obstacles are convex: an obstacle that contains all corners contains everything between them.
        if corners.into_iter().all(|corner| self.distance(corner) == 0.0) {
            let field = if matches!(self, Self::Disc { .. }) {
                "radius"
            } else {
                "width"
            };
            let value = 2.0 * self.half_size()[0] / if field == "radius" { 2.0 } else { 1.0 };
            return Err(Invalid::new(
                field,
                value,
                "small enough to leave room in the world",
            ));
        }
        Ok(())
    }
}

/// The obstacles of a message, in a world of these sides.
pub(super) fn obstacles(messages: Vec<v1::Obstacle>, sides: [f64; 2]) -> Result<Vec<Obstacle>, Invalid> {
    if messages.len() > Obstacle::MAX_COUNT {
        let allowed = format!("at most {}", Obstacle::MAX_COUNT);
        return Err(Invalid::new("obstacles", messages.len(), allowed));
    }
    let read = |(i, message)| {
        Obstacle::in_world(message, sides).map_err(|error| error.within(&format!("obstacles[{i}]")))
    };
    messages.into_iter().enumerate().map(read).collect()
}

/// Whether a body of this radius fits somewhere between the obstacles, with its centre at least `margin` from the edges of the
/// world. The function tries a grid of [`TRIED`] by [`TRIED`] places.
pub(super) fn leave_room(obstacles: &[Obstacle], sides: [f64; 2], radius: f64, margin: f64) -> bool {
    let place = |axis: usize, k: u32| {
        let share = (f64::from(k) + 0.5) / f64::from(TRIED);
        margin + share * (sides[axis] - 2.0 * margin)
    };
    let mut places = (0..TRIED).flat_map(|i| (0..TRIED).map(move |j| [place(0, i), place(1, j)]));
    obstacles.is_empty() || places.any(|at| obstacles.iter().all(|obstacle| obstacle.distance(at) >= radius))
}

fn length([x, y]: [f64; 2]) -> f64 {
    (x * x + y * y).sqrt()
}

impl From<&Obstacle> for v1::Obstacle {
    fn from(obstacle: &Obstacle) -> Self {
        let [x, y] = obstacle.centre();
        let (radius, width, height) = match *obstacle {
            Obstacle::Disc { radius, .. } => (Some(radius), None, None),
            Obstacle::Box { size, .. } => (None, Some(size[0]), Some(size[1])),
        };
        Self {
            x: Some(x),
            y: Some(y),
            radius,
            width,
            height,
        }
    }
}
