//! Drives: how a pair of a controller's numbers moves a robot.

use crate::{Invalid, invalid};

/// How a robot moves, with the limits of its controllers' numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drive {
    kind: DriveKind,
    limits: [f64; 2],
}

/// How a pair of numbers (a, b) moves a robot in one step of duration dt, along the heading before the step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DriveKind {
    /// Two wheels: a is the speed of the left wheel, b the speed of the right wheel. The robot moves ahead by `(wheel_radius / 2)
    /// (a + b) dt` and turns by `(a - b) / (2 radius) dt` radians, where `radius` is the body's.
    ///
    /// The turn does not depend on the radius of the wheels, as in the paper's simulator.
    Differential {
        /// Radius of a wheel, world units, over 0.
        wheel_radius: f64,
    },
    /// A speed a and a turning rate b: the robot moves ahead by `a dt` and turns by `b dt` radians.
    Unicycle,
}

impl Drive {
    /// Largest radius of a wheel, and largest limit of a speed or turning rate.
    pub const MAX: f64 = 1000.0;

    /// Two wheels of `wheel_radius` world units; the magnitude of a wheel's speed is at most `max_speed` (the paper's robots: 1).
    ///
    /// # Errors
    /// If a number is not over 0 and at most [`Drive::MAX`].
    pub fn differential(wheel_radius: f64, max_speed: f64) -> Result<Self, Invalid> {
        let wheel_radius = invalid::positive("wheel_radius", wheel_radius, Self::MAX)?;
        Ok(Self {
            kind: DriveKind::Differential { wheel_radius },
            limits: [invalid::positive("max_speed", max_speed, Self::MAX)?; 2],
        })
    }

    /// A robot driven by a speed of magnitude at most `max_speed`, world units per unit of time, and a turning rate of
    /// magnitude at most `max_turn`, radians per unit of time.
    ///
    /// # Errors
    /// If a number is not over 0 and at most [`Drive::MAX`].
    pub fn unicycle(max_speed: f64, max_turn: f64) -> Result<Self, Invalid> {
        Ok(Self {
            kind: DriveKind::Unicycle,
            limits: [
                invalid::positive("max_speed", max_speed, Self::MAX)?,
                invalid::positive("max_turn", max_turn, Self::MAX)?,
            ],
        })
    }

    /// Meaning of a pair of numbers.
    #[must_use]
    pub const fn kind(&self) -> DriveKind {
        self.kind
    }

    /// Largest magnitudes of the two numbers of a pair: the speeds of left and right wheel, or speed and turning rate.
    #[must_use]
    pub const fn limits(&self) -> [f64; 2] {
        self.limits
    }

    /// Largest distance that a robot drives in a unit of time, world units.
    #[must_use]
    pub fn top_speed(&self) -> f64 {
        match self.kind {
            DriveKind::Differential { wheel_radius } => wheel_radius * self.limits[0],
            DriveKind::Unicycle => self.limits[0],
        }
    }

    /// Names of the two numbers of a pair: left and right, or speed and turn.
    #[must_use]
    pub const fn pair_names(&self) -> [&'static str; 2] {
        match self.kind {
            DriveKind::Differential { .. } => ["left", "right"],
            DriveKind::Unicycle => ["speed", "turn"],
        }
    }
}
