//! Robots that have a name: the paper's two robots, and two real robots.

use super::{Drive, DriveKind, Robot, Sensor, SensorAngle, SensorDescription};
use crate::Invalid;
use std::{f64::consts::PI, fmt, str::FromStr};

/// A robot with a name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Preset {
    /// The paper's robot with one sensor, a ray straight ahead.
    SingleSensor,
    /// The paper's robot with a second ray, whose angle is a gene.
    TwoSensor,
    /// The Flockbot of George Mason University, as the authors' simulator describes it (`flockbots-icra-milling/flockbot.yaml` of
    /// RobotSwarmSimulator): a camera 0.4 radians wide that sees robots 3.6 m away. Lengths are in centimetres, times in seconds;
    /// a step in that file is 0.13 s.
    Flockbots,
    /// Hiwonder's TurboPi, as the authors' simulator describes it (`turbopi-milling/turbopi.yaml` of RobotSwarmSimulator): a
    /// camera 0.9 radians wide that sees robots 1 m away. Lengths are in centimetres, times in seconds; a step in that file is
    /// 0.025 s. The preset leaves out the noise and delay of that file.
    TurboPi,
}

impl Preset {
    pub const ALL: [Self; 4] = [
        Self::SingleSensor,
        Self::TwoSensor,
        Self::Flockbots,
        Self::TurboPi,
    ];

    /// Radius of the paper's robots, world units.
    pub(crate) const PAPER_RADIUS: f64 = 5.0;
    /// Radius of the wheels of the paper's robots, world units.
    pub(crate) const PAPER_WHEEL_RADIUS: f64 = 2.0;
    /// The paper's two robots.
    pub const PAPER: [Self; 2] = [Self::SingleSensor, Self::TwoSensor];

    /// Name of the preset in files and on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::SingleSensor => "single-sensor",
            Self::TwoSensor => "two-sensor",
            Self::Flockbots => "flockbots",
            Self::TurboPi => "turbopi",
        }
    }

    /// The robot of the preset. The paper's presets have the body and wheels of the paper's world.
    #[must_use]
    #[expect(clippy::expect_used, reason = "a preset is a valid robot: a test makes each")]
    pub fn robot(self) -> Robot {
        self.sized(Self::PAPER_RADIUS, Self::PAPER_WHEEL_RADIUS)
            .expect("a preset is a valid robot")
    }
}

impl Preset {
    /// The preset that equals a robot. The paper's presets match robots with bodies and wheels of any radius.
    pub(super) fn of(robot: &Robot) -> Option<Self> {
        let is = |preset: &Self| match (preset, robot.drive().kind()) {
            (Self::SingleSensor | Self::TwoSensor, DriveKind::Differential { wheel_radius }) => {
                preset.sized(robot.radius(), wheel_radius).as_ref() == Ok(robot)
            }
            (Self::SingleSensor | Self::TwoSensor, DriveKind::Unicycle) => false,
            (Self::Flockbots | Self::TurboPi, _) => preset.robot() == *robot,
        };
        Self::ALL.into_iter().find(is)
    }

    /// The robot of the preset. The paper's presets get a body and wheels of these radii (world units); other presets ignore
    /// them.
    ///
    /// # Errors
    /// If [`Robot::new`] or [`Drive::differential`] does not allow a radius.
    pub fn sized(self, radius: f64, wheel_radius: f64) -> Result<Robot, Invalid> {
        match self {
            Self::SingleSensor => paper(radius, wheel_radius, false),
            Self::TwoSensor => paper(radius, wheel_radius, true),
            Self::Flockbots => camera(0.2, 360.0, 7.5),
            Self::TurboPi => camera(0.45, 100.0, 10.0),
        }
    }
}

fn paper(radius: f64, wheel_radius: f64, second: bool) -> Result<Robot, Invalid> {
    let ray = |angle| {
        Sensor::try_from(SensorDescription {
            angle,
            ..SensorDescription::default()
        })
    };
    let mut sensors = vec![ray(SensorAngle::fixed(0.0)?)?];
    if second {
        sensors.push(ray(SensorAngle::free(Some([-PI, PI]), &[])?)?);
    }
    Robot::new(sensors, radius, Drive::differential(wheel_radius, 1.0)?)
}

/// A unicycle with a camera that looks ahead. Both real robots move by at most 0.2 m, and turn by at most 2 radians, a second.
fn camera(half_angle: f64, range: f64, radius: f64) -> Result<Robot, Invalid> {
    let eye = Sensor::try_from(SensorDescription {
        half_angle,
        range: Some(range),
        ..SensorDescription::default()
    })?;
    Robot::new(vec![eye], radius, Drive::unicycle(20.0, 2.0)?)
}

impl FromStr for Preset {
    type Err = Invalid;

    fn from_str(name: &str) -> Result<Self, Invalid> {
        let found = Self::ALL.into_iter().find(|preset| preset.name() == name);
        found.ok_or_else(|| {
            let names = Self::ALL.map(|preset| format!("\"{preset}\"")).join(" or ");
            Invalid::new("model", format!("\"{name}\""), names)
        })
    }
}

impl fmt::Display for Preset {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
