//! Scale between a film and its world: time and length.

use murmuration_swarm::{Invalid, World};

/// The place of 0, 0 in the tracks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// The corner of the arena with the least x and y.
    Corner,
    /// The middle of the arena.
    Centre,
}

/// The direction in which y grows. Headings grow from x to y.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum YAxis {
    Down,
    Up,
}

/// The axes of the tracks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Axes {
    pub origin: Origin,
    pub y: YAxis,
}

/// The scale of a film.
#[derive(Debug, Clone, PartialEq)]
pub struct Filmed<'a> {
    pub(crate) world: &'a World,
    /// World units per unit of the tracks.
    scale: f64,
    /// Width and height of the arena, in units of the tracks.
    arena: [f64; 2],
    /// The arena's corner with the least x and y, as a position in the world, in world units.
    corner: [f64; 2],
    axes: Axes,
    /// Number of frames per step.
    pub(crate) frames_a_step: f64,
}

impl<'a> Filmed<'a> {
    /// A film of `world` with tracks in world units and one frame per step.
    pub const fn new(world: &'a World) -> Self {
        Self {
            world,
            scale: 1.0,
            arena: [world.width(), world.height()],
            corner: [0.0; 2],
            axes: Axes {
                origin: Origin::Corner,
                y: YAxis::Down,
            },
            frames_a_step: 1.0,
        }
    }

    /// This scale, but for tracks with these axes.
    #[must_use]
    pub const fn with_axes(self, axes: Axes) -> Self {
        Self { axes, ..self }
    }

    /// This scale, but with `time` from one frame to the next, in units of the world's time.
    ///
    /// # Errors
    /// If the time is not over 0 and finite.
    pub fn with_frame_time(self, time: f64) -> Result<Self, Invalid> {
        let frames_a_step = self.world.dt() / time;
        match time > 0.0 && frames_a_step > 0.0 && frames_a_step.is_finite() {
            true => Ok(Self {
                frames_a_step,
                ..self
            }),
            false => Err(Invalid::new("frame-time", time, "a finite number over 0")),
        }
    }

    /// This scale, but for tracks of an arena of this width and height, in the units of the tracks. The arena is scaled by one
    /// factor to fit the world, and centred in the world.
    ///
    /// # Errors
    /// If a side is not over 0 and finite.
    pub fn with_arena(self, arena: [f64; 2]) -> Result<Self, Invalid> {
        let world = [self.world.width(), self.world.height()];
        let scale = (world[0] / arena[0]).min(world[1] / arena[1]);
        let is_side = |side: f64| side > 0.0 && side.is_finite();
        if !arena.into_iter().all(is_side) || !is_side(scale) {
            let value = format!("{}x{}", arena[0], arena[1]);
            return Err(Invalid::new("arena", value, "two finite numbers over 0"));
        }
        let corner = [0, 1].map(|axis| (world[axis] - scale * arena[axis]) / 2.0);
        Ok(Self {
            scale,
            arena,
            corner,
            ..self
        })
    }

    pub const fn axes(&self) -> Axes {
        self.axes
    }

    /// World units per unit of the tracks.
    pub const fn scale(&self) -> f64 {
        self.scale
    }

    /// Converts a position from the tracks to the world.
    pub(crate) fn place(&self, at: [f64; 2]) -> [f64; 2] {
        let [least, _] = self.walls();
        let from_corner = match self.axes.y {
            YAxis::Down => [at[0] - least[0], at[1] - least[1]],
            YAxis::Up => [at[0] - least[0], self.arena[1] - (at[1] - least[1])],
        };
        // With a scale of 1 and axes as in the world, the position stays the same to the bit.
        [0, 1].map(|axis| self.corner[axis] + self.scale * from_corner[axis])
    }

    /// Converts a heading from the tracks to the world, radians.
    pub(crate) fn turn(&self, heading: f64) -> f64 {
        match self.axes.y {
            YAxis::Down => heading,
            YAxis::Up => -heading,
        }
    }

    /// The corners of the arena with the least and with the greatest x and y, in units of the tracks.
    pub(crate) fn walls(&self) -> [[f64; 2]; 2] {
        match self.axes.origin {
            Origin::Corner => [[0.0; 2], self.arena],
            Origin::Centre => [
                self.arena.map(|side| -side / 2.0),
                self.arena.map(|side| side / 2.0),
            ],
        }
    }

    /// Distance in world units up to which a motion can be jitter of the camera: a fifth of the largest radius of a robot.
    pub(crate) fn still(&self) -> f64 {
        self.world.radius() / 5.0
    }
}
