//! Binary sensors that look along a ray or into a cone.

use super::SpeciesName;
use crate::{Invalid, counted, invalid};
use std::{
    f64::consts::{PI, TAU},
    fmt,
    str::FromStr,
};

/// A binary sensor: it is on while anything that it can see is in its cone.
///
/// A sensor sees a robot if the robot's centre is within the range, and its body meets an edge of the cone or its centre lies in
/// the cone. A sensor sees a disc like a robot, except that the disc's nearest point must be within the range. A sensor sees a
/// box if the cone, cut at the range, meets the box. Obstacles hide nothing.
#[derive(Debug, Clone, PartialEq)]
pub struct Sensor {
    angle: SensorAngle,
    half_angle: f64,
    range: Option<f64>,
    robots: SeenRobots,
    wall_range: Option<f64>,
    obstacles: bool,
}

/// A sensor's description, not yet checked. [`Sensor::try_from`] checks the description.
///
/// The default is the paper's sensor, which looks straight ahead along a ray without limit and sees all robots.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorDescription {
    /// The direction of the cone's middle.
    pub angle: SensorAngle,
    /// Half of the cone's opening angle, radians, 0 (a ray) to pi.
    pub half_angle: f64,
    /// Largest distance at which the sensor sees a robot's centre, or the nearest point of an obstacle, world units, over 0;
    /// `None`: no limit.
    pub range: Option<f64>,
    /// Kinds of things that the sensor sees, each once; not both all robots and a species.
    pub sees: Vec<Seen>,
    /// Largest distance at which the sensor sees walls, world units; `None`: `range`.
    pub wall_range: Option<f64>,
}

/// The angle from a robot's heading to the middle of a sensor's cone, radians; positive angles turn in the direction of growing
/// headings.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorAngle(Angle);

#[derive(Debug, Clone, PartialEq)]
enum Angle {
    Fixed(f64),
    Within([f64; 2]),
    Among(Vec<f64>),
}

/// A kind of thing that a sensor can see.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Seen {
    /// Robots of every species.
    Robots,
    /// Robots of one species.
    Species(SpeciesName),
    Walls,
    Obstacles,
}

/// The robots that a sensor sees.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum SeenRobots {
    None,
    /// Robots of every species.
    All,
    /// Robots of one species.
    Species(SpeciesName),
}

impl Sensor {
    /// Largest range, world units.
    pub(crate) const MAX_RANGE: f64 = 1e6;

    /// The angle from the robot's heading to the middle of the cone.
    #[must_use]
    pub const fn angle(&self) -> &SensorAngle {
        &self.angle
    }

    /// Half of the cone's opening angle, radians, 0 (a ray) to pi.
    #[must_use]
    pub const fn half_angle(&self) -> f64 {
        self.half_angle
    }

    /// Largest distance at which the sensor sees a robot's centre, or the nearest point of an obstacle, world units; `None`: no
    /// limit.
    #[must_use]
    pub const fn range(&self) -> Option<f64> {
        self.range
    }

    #[must_use]
    pub const fn robots(&self) -> &SeenRobots {
        &self.robots
    }

    /// Largest distance at which the sensor sees walls, world units; `None` if it sees no walls.
    #[must_use]
    pub const fn wall_range(&self) -> Option<f64> {
        self.wall_range
    }

    #[must_use]
    pub const fn sees_obstacles(&self) -> bool {
        self.obstacles
    }

    /// Whether the sensor is of the paper's kind: a ray without limit that sees all robots and nothing else.
    #[must_use]
    pub fn is_plain_ray(&self) -> bool {
        let alone = self.wall_range.is_none() && !self.obstacles;
        self.half_angle == 0.0 && self.range.is_none() && self.robots == SeenRobots::All && alone
    }
}

impl Default for SensorDescription {
    fn default() -> Self {
        Self {
            angle: SensorAngle(Angle::Fixed(0.0)),
            half_angle: 0.0,
            range: None,
            sees: vec![Seen::Robots],
            wall_range: None,
        }
    }
}

impl TryFrom<SensorDescription> for Sensor {
    type Error = Invalid;

    /// The error names the invalid field: a half angle over pi, a range that is not over 0, walls without a range, or a kind of
    /// thing that is named twice.
    fn try_from(described: SensorDescription) -> Result<Self, Invalid> {
        let range = |field, range: Option<f64>| {
            let check = |range| invalid::positive(field, range, Self::MAX_RANGE);
            range.map(check).transpose()
        };
        let half_angle = invalid::angle("half_angle", described.half_angle, 0.0..=PI)?;
        let robot_range = range("range", described.range)?;
        let own_wall_range = range("wall_range", described.wall_range)?;
        let wall_range = match (described.sees.contains(&Seen::Walls), own_wall_range) {
            (false, None) => None,
            (false, Some(given)) => {
                let allowed = "absent from a sensor that does not see walls";
                return Err(Invalid::new("wall_range", given, allowed));
            }
            (true, own) => Some(own.or(robot_range).ok_or_else(|| {
                let allowed =
                    "given, or wall_range, for a sensor that sees walls: without a limit it would always see a wall";
                Invalid::missing("range", allowed)
            })?),
        };
        Ok(Self {
            angle: described.angle,
            // Negative zero becomes zero, so that equal sensors have equal bits.
            half_angle: half_angle + 0.0,
            range: robot_range,
            robots: seen_robots(&described.sees)?,
            wall_range,
            obstacles: described.sees.contains(&Seen::Obstacles),
        })
    }
}

fn seen_robots(sees: &[Seen]) -> Result<SeenRobots, Invalid> {
    let names = || sees.iter().map(Seen::to_string).collect::<Vec<_>>().join(", ");
    if sees.is_empty() {
        let allowed = "robots, a species, walls or obstacles";
        return Err(Invalid::missing("sees", allowed));
    }
    if let Some(twice) = (1..sees.len()).find(|&i| sees[..i].contains(&sees[i])) {
        let allowed = format!("without a second \"{}\"", sees[twice]);
        return Err(Invalid::new("sees", names(), allowed));
    }
    let mut robots = sees.iter().filter_map(|seen| match seen {
        Seen::Robots => Some(SeenRobots::All),
        Seen::Species(name) => Some(SeenRobots::Species(name.clone())),
        Seen::Walls | Seen::Obstacles => None,
    });
    match (robots.next(), robots.next()) {
        (None, _) => Ok(SeenRobots::None),
        (Some(robots), None) => Ok(robots),
        (Some(_), Some(_)) => Err(Invalid::new(
            "sees",
            names(),
            "all robots or one species, not both",
        )),
    }
}

impl SensorAngle {
    /// Maximum number of angles in a list.
    pub const MAX_CHOICES: usize = 1000;
    /// Tolerance in radians: a controller's angle counts as an angle of the list if they differ by at most this.
    const NEAR: f64 = 1e-9;

    /// An angle that never changes, -2 pi to 2 pi.
    ///
    /// # Errors
    /// If the angle is out of range.
    pub fn fixed(angle: f64) -> Result<Self, Invalid> {
        Ok(Self(Angle::Fixed(checked("angle", angle)?)))
    }

    /// An angle that is a gene: any angle `within` a lowest and a highest angle, or an angle `among` a list. All angles are from
    /// -2 pi to 2 pi.
    ///
    /// # Errors
    /// If range and list are both present or both absent; if the lowest angle is not below the highest; if the list has more than
    /// [`SensorAngle::MAX_CHOICES`] angles; if an angle is out of range.
    pub fn free(within: Option<[f64; 2]>, among: &[f64]) -> Result<Self, Invalid> {
        let one_of_both = "free with exactly one of angle_range and angles";
        match (within, among) {
            (Some([low, high]), []) => {
                let bounds = [checked("angle_range", low)?, checked("angle_range", high)?];
                if low < high {
                    return Ok(Self(Angle::Within(bounds)));
                }
                let value = format!("[{low}, {high}]");
                Err(Invalid::new("angle_range", value, "a lower and a higher angle"))
            }
            (None, [_, ..]) if among.len() > Self::MAX_CHOICES => {
                let value = counted(among.len() as u64, "value");
                let allowed = format!("at most {} values", Self::MAX_CHOICES);
                Err(Invalid::new("angles", value, allowed))
            }
            (None, [_, ..]) => {
                let among = among.iter().enumerate();
                let among = among.map(|(i, &angle)| checked(&format!("angles[{i}]"), angle));
                Ok(Self(Angle::Among(among.collect::<Result<_, _>>()?)))
            }
            (None, []) | (Some(_), [_, ..]) => Err(Invalid::new("angle", "free", one_of_both)),
        }
    }

    /// Whether the angle is a gene.
    #[must_use]
    pub const fn is_free(&self) -> bool {
        !matches!(self.0, Angle::Fixed(_))
    }

    /// The angle, if it is fixed.
    #[must_use]
    pub const fn value(&self) -> Option<f64> {
        match self.0 {
            Angle::Fixed(angle) => Some(angle),
            Angle::Within(_) | Angle::Among(_) => None,
        }
    }

    /// Lowest and highest angle, if the angle is free within a range.
    #[must_use]
    pub const fn range(&self) -> Option<[f64; 2]> {
        match self.0 {
            Angle::Within(bounds) => Some(bounds),
            Angle::Fixed(_) | Angle::Among(_) => None,
        }
    }

    /// The angles to choose from, if the angle is free among a list; otherwise empty.
    #[must_use]
    pub fn choices(&self) -> &[f64] {
        match &self.0 {
            Angle::Among(angles) => angles,
            Angle::Fixed(_) | Angle::Within(_) => &[],
        }
    }

    /// The sensor's angle if `angle` is its gene. A fixed angle ignores the gene.
    ///
    /// # Errors
    /// The error names `field` if the angle is not allowed.
    pub(super) fn chosen(&self, field: &str, angle: f64) -> Result<f64, Invalid> {
        match &self.0 {
            Angle::Fixed(fixed) => Ok(*fixed),
            Angle::Within([low, high]) => Ok(invalid::real(field, angle, *low..=*high)? + 0.0),
            Angle::Among(angles) => {
                let near = |choice: &&f64| (**choice - angle).abs() <= Self::NEAR;
                let nearest = angles.iter().find(near).copied();
                nearest.ok_or_else(|| Invalid::new(field, angle, format!("one of {angles:?}")))
            }
        }
    }
}

/// Negative zero becomes zero, so that equal angles have equal bits.
fn checked(field: &str, angle: f64) -> Result<f64, Invalid> {
    Ok(invalid::angle(field, angle, -TAU..=TAU)? + 0.0)
}

impl FromStr for Seen {
    type Err = Invalid;

    /// Reads `robots`, `walls`, `obstacles`, or the name of a species.
    fn from_str(name: &str) -> Result<Self, Invalid> {
        match name {
            "robots" => Ok(Self::Robots),
            "walls" => Ok(Self::Walls),
            "obstacles" => Ok(Self::Obstacles),
            species => Ok(Self::Species(SpeciesName::parse("sees", species)?)),
        }
    }
}

impl fmt::Display for Seen {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Robots => "robots",
            Self::Species(name) => name.as_str(),
            Self::Walls => "walls",
            Self::Obstacles => "obstacles",
        })
    }
}
