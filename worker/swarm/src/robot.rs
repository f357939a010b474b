//! Robots as data: what a robot senses, how it drives, and which numbers control it.
//!
//! A robot has k binary sensors and so 2^k sensor states. A robot's controller is a table with one pair of speeds for each state,
//! and the free angles of the sensors.

mod boundary;
mod capability_model;
mod controller;
mod drive;
mod messages;
mod preset;
mod sensor;
mod species;
#[cfg(test)]
mod tests;

pub use boundary::Boundary;
pub use capability_model::CapabilityModel;
pub use controller::{Controller, RobotController};
pub use drive::{Drive, DriveKind};
pub(crate) use messages::{Defaults, Written};
pub use preset::Preset;
pub use sensor::{Seen, SeenRobots, Sensor, SensorAngle, SensorDescription};
pub use species::{Species, SpeciesName};

use crate::{Invalid, counted, invalid};

/// A robot: its sensors, its body and its drive.
#[derive(Debug, Clone, PartialEq)]
pub struct Robot {
    sensors: Vec<Sensor>,
    radius: f64,
    drive: Drive,
}

impl Robot {
    /// Largest number of sensors.
    pub const MAX_SENSORS: usize = 6;
    /// Smallest radius of a body, world units. This limit keeps turning rates, which are divided by the radius, far below the
    /// largest number.
    pub const MIN_RADIUS: f64 = 0.001;
    /// Largest radius of a body, world units.
    pub const MAX_RADIUS: f64 = 1000.0;

    /// A robot with these `sensors`, S1 first, and a body of `radius` world units.
    ///
    /// # Errors
    /// If there are not 1 to 6 sensors, or the radius is not from [`Robot::MIN_RADIUS`] to [`Robot::MAX_RADIUS`].
    pub fn new(sensors: Vec<Sensor>, radius: f64, drive: Drive) -> Result<Self, Invalid> {
        if !(1..=Self::MAX_SENSORS).contains(&sensors.len()) {
            let allowed = format!("1 to {} sensors", Self::MAX_SENSORS);
            return Err(Invalid::new(
                "sensors",
                counted(sensors.len() as u64, "sensor"),
                allowed,
            ));
        }
        Ok(Self {
            sensors,
            radius: invalid::real("radius", radius, Self::MIN_RADIUS..=Self::MAX_RADIUS)?,
            drive,
        })
    }

    /// The robot's 1 to 6 sensors, S1 first.
    #[must_use]
    pub fn sensors(&self) -> &[Sensor] {
        &self.sensors
    }

    /// Radius of the robot's body, world units, 0.001 to 1,000.
    #[must_use]
    pub const fn radius(&self) -> f64 {
        self.radius
    }

    /// How a pair of speeds moves the robot.
    #[must_use]
    pub const fn drive(&self) -> &Drive {
        &self.drive
    }

    /// Number of the robot's sensor states: 2 to 64.
    #[must_use]
    pub fn states(&self) -> usize {
        1 << self.sensors.len()
    }

    /// Number of a controller's genes that are speeds: two for each sensor state, 4 to 128.
    #[must_use]
    pub fn speeds(&self) -> usize {
        2 * self.states()
    }

    /// The angles that are genes, each with the place of its sensor in [`Robot::sensors`], in order.
    pub fn free_angles(&self) -> impl Iterator<Item = (usize, &SensorAngle)> {
        let sensors = self.sensors.iter().map(Sensor::angle).enumerate();
        sensors.filter(|(_, angle)| angle.is_free())
    }

    /// Number of genes of the robot's controllers: 4 to 134.
    #[must_use]
    pub fn genes(&self) -> usize {
        self.speeds() + self.free_angles().count()
    }

    /// Names of the genes of the robot's controllers, in order.
    ///
    /// `left_01` is the left wheel's speed while S1 sees nothing and S2 sees something; a unicycle has `speed_01` and
    /// `turn_01` instead of `left_01` and `right_01`. `angle_2` is the angle of S2.
    #[must_use]
    pub fn gene_names(&self) -> Vec<String> {
        let [first, second] = self.drive.pair_names();
        let digits = self.sensors.len();
        let speeds = (0..self.states())
            .flat_map(|state| [first, second].map(|name| format!("{name}_{state:0digits$b}")));
        let angles = self
            .free_angles()
            .map(|(sensor, _)| format!("angle_{}", sensor + 1));
        speeds.chain(angles).collect()
    }
}
