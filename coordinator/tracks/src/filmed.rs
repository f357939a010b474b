//! Scale between a film and its world: time and length.

use murmuration_swarm::{Invalid, World};

/// The scale of a film.
#[derive(Debug, Clone, PartialEq)]
pub struct Filmed<'a> {
    pub(crate) world: &'a World,
    /// World units per unit of the tracks.
    scale: f64,
    /// Origin of the tracks, as a position in the world, in world units.
    origin: [f64; 2],
    /// Number of frames per step.
    pub(crate) frames_a_step: f64,
}

impl<'a> Filmed<'a> {
    /// A film of `world` with tracks in world units and one frame per step.
    pub const fn new(world: &'a World) -> Self {
        Self {
            world,
            scale: 1.0,
            origin: [0.0; 2],
            frames_a_step: 1.0,
        }
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

    /// This scale, but for tracks of an arena of this width and height, in the units of the tracks. A corner of the arena is at
    /// the origin of the tracks. The arena is scaled by one factor to fit the world, and centred in the world.
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
        let origin = [0, 1].map(|axis| (world[axis] - scale * arena[axis]) / 2.0);
        Ok(Self {
            scale,
            origin,
            ..self
        })
    }

    /// World units per unit of the tracks.
    pub const fn scale(&self) -> f64 {
        self.scale
    }

    /// Converts a position from the tracks to the world.
    pub(crate) fn place(&self, at: [f64; 2]) -> [f64; 2] {
        // With a scale of 1 and an origin at 0, the position stays the same to the bit.
        [0, 1].map(|axis| self.origin[axis] + self.scale * at[axis])
    }

    /// Distance in world units up to which a motion can be jitter of the camera: a fifth of the largest radius of a robot.
    pub(crate) fn still(&self) -> f64 {
        self.world.radius() / 5.0
    }
}
