//! Robots and capability models as messages.

use super::{
    CapabilityModel, Drive, DriveKind, Preset, Robot, Seen, SeenRobots, Sensor, SensorAngle,
    SensorDescription, Species, SpeciesName,
};
use crate::{Invalid, invalid, of_toml_line, text};
use murmuration_proto::v1;
use serde::{Deserialize, Serialize};

const DIFFERENTIAL: &str = "differential";
const UNICYCLE: &str = "unicycle";

/// A world's defaults for robots.
pub(crate) struct Defaults {
    pub(crate) radius: f64,
    pub(crate) wheel_radius: f64,
    pub(crate) agents: u32,
}

impl TryFrom<v1::Sensor> for Sensor {
    type Error = Invalid;

    fn try_from(message: v1::Sensor) -> Result<Self, Invalid> {
        let described = SensorDescription::default();
        let sees = message.sees.iter().map(|name| name.parse());
        let sees: Vec<Seen> = sees.collect::<Result<_, _>>()?;
        Self::try_from(SensorDescription {
            angle: angle(message.angle, &message.angle_range, &message.angles)?,
            half_angle: message.half_angle.unwrap_or(described.half_angle),
            range: message.range,
            sees: if sees.is_empty() { described.sees } else { sees },
            wall_range: message.wall_range,
        })
    }
}

/// The angle of a sensor, from the fields of a message.
fn angle(angle: Option<v1::SensorAngle>, range: &[f64], among: &[f64]) -> Result<SensorAngle, Invalid> {
    let is_free = angle.is_some_and(|angle| angle.fixed.is_none());
    for (field, given) in [("angle_range", range), ("angles", among)] {
        if !is_free && !given.is_empty() {
            let allowed = "absent, or angle = \"free\"";
            return Err(Invalid::new(field, format!("{given:?}"), allowed));
        }
    }
    if !is_free {
        return SensorAngle::fixed(angle.and_then(|angle| angle.fixed).unwrap_or_default());
    }
    let range = match range {
        [] => None,
        &[low, high] => Some([low, high]),
        _ => {
            let allowed = "a list of two angles, the lowest and the highest";
            return Err(Invalid::new("angle_range", format!("{range:?}"), allowed));
        }
    };
    SensorAngle::free(range, among)
}

impl From<&Sensor> for v1::Sensor {
    fn from(sensor: &Sensor) -> Self {
        let robots = match sensor.robots() {
            SeenRobots::None => None,
            SeenRobots::All => Some(Seen::Robots),
            SeenRobots::Species(name) => Some(Seen::Species(name.clone())),
        };
        let walls = sensor.wall_range().map(|_| Seen::Walls);
        let obstacles = sensor.sees_obstacles().then_some(Seen::Obstacles);
        Self {
            angle: Some(v1::SensorAngle {
                fixed: sensor.angle().value(),
            }),
            angle_range: sensor.angle().range().map_or_else(Vec::new, Vec::from),
            angles: sensor.angle().choices().to_vec(),
            half_angle: Some(sensor.half_angle()),
            range: sensor.range(),
            wall_range: sensor.wall_range(),
            sees: [robots, walls, obstacles]
                .into_iter()
                .flatten()
                .map(|seen| seen.to_string())
                .collect(),
        }
    }
}

impl Robot {
    /// The robot of a message; `default` fills absent fields.
    ///
    /// # Errors
    /// The error names the field that is not allowed.
    pub(crate) fn of_message(message: v1::Robot, default: &Defaults) -> Result<Self, Invalid> {
        let mut sensors = Vec::with_capacity(message.sensors.len());
        for (i, sensor) in message.sensors.iter().enumerate().take(Self::MAX_SENSORS + 1) {
            let sensor = Sensor::try_from(sensor.clone());
            sensors.push(sensor.map_err(|error| error.within(&format!("sensors[{i}]")))?);
        }
        let radius = message.radius.unwrap_or(default.radius);
        Self::new(sensors, radius, drive(&message, default)?)
    }
}

fn drive(message: &v1::Robot, default: &Defaults) -> Result<Drive, Invalid> {
    let absent = |field: &str, given: Option<f64>, kind: &str| match given {
        None => Ok(()),
        Some(given) => Err(Invalid::new(
            field,
            given,
            format!("absent: the drive is \"{kind}\""),
        )),
    };
    match message.drive.as_deref() {
        None | Some(DIFFERENTIAL) => {
            absent("max_turn", message.max_turn, DIFFERENTIAL)?;
            let wheel_radius = message.wheel_radius.unwrap_or(default.wheel_radius);
            Drive::differential(wheel_radius, message.max_speed.unwrap_or(1.0))
        }
        Some(UNICYCLE) => {
            absent("wheel_radius", message.wheel_radius, UNICYCLE)?;
            let needed = |field: &str, given: Option<f64>| {
                given.ok_or_else(|| Invalid::missing(field, "given for a unicycle"))
            };
            Drive::unicycle(
                needed("max_speed", message.max_speed)?,
                needed("max_turn", message.max_turn)?,
            )
        }
        Some(other) => Err(Invalid::new(
            "drive",
            text::quoted(other),
            format!("\"{DIFFERENTIAL}\" or \"{UNICYCLE}\""),
        )),
    }
}

impl From<&Robot> for v1::Robot {
    fn from(robot: &Robot) -> Self {
        let [max_speed, second] = robot.drive().limits();
        let (drive, wheel_radius, max_turn) = match robot.drive().kind() {
            DriveKind::Differential { wheel_radius } => (DIFFERENTIAL, Some(wheel_radius), None),
            DriveKind::Unicycle => (UNICYCLE, None, Some(second)),
        };
        Self {
            sensors: robot.sensors().iter().map(Into::into).collect(),
            radius: Some(robot.radius()),
            drive: Some(drive.to_owned()),
            wheel_radius,
            max_speed: Some(max_speed),
            max_turn,
        }
    }
}

/// The robot of a preset or of a description; exactly one of them must be given.
fn robot(preset: Option<&str>, described: Option<v1::Robot>, default: &Defaults) -> Result<Robot, Invalid> {
    match (preset, described) {
        (Some(name), None) => name
            .parse::<Preset>()?
            .sized(default.radius, default.wheel_radius),
        (None, Some(described)) => {
            Robot::of_message(described, default).map_err(|error| error.within("robot"))
        }
        (None, None) => {
            let presets = Preset::ALL.map(|preset| format!("\"{preset}\"")).join(" or ");
            let allowed = format!("{presets}, unless a robot is described");
            Err(Invalid::missing("model", allowed))
        }
        (Some(name), Some(_)) => {
            let allowed = "absent: `robot` describes the robots";
            Err(Invalid::new("model", text::quoted(name), allowed))
        }
    }
}

impl CapabilityModel {
    /// The capability model that these messages describe. `default` fills absent fields; shares are shares of `default.agents`.
    ///
    /// # Errors
    /// The error names the field that is not allowed.
    pub(crate) fn of_messages(
        species: Vec<v1::Species>,
        ratios: Vec<v1::Ratio>,
        default: &Defaults,
    ) -> Result<Self, Invalid> {
        let shares: Vec<_> = species.iter().map(|species| species.share).collect();
        let mut counts = Vec::new();
        let mut described = Vec::with_capacity(species.len());
        for (i, message) in species.into_iter().enumerate().take(Self::MAX_SPECIES + 1) {
            let within = |error: Invalid| error.within(&format!("species[{i}]"));
            counts.extend(count(&message, !ratios.is_empty(), default.agents).map_err(within)?);
            let name = SpeciesName::parse("name", &message.name).map_err(within)?;
            let robot = robot(message.model.as_deref(), message.robot, default).map_err(within)?;
            described.push(Species::new(name, robot));
        }
        check_shares(&shares)?;
        let ratios = match ratios.is_empty() {
            true => vec![counts],
            false => ratios.into_iter().map(|ratio| ratio.counts).collect(),
        };
        Self::new(described, ratios)
    }
}

/// The number of robots of a species; `None` if there are ratios.
fn count(species: &v1::Species, has_ratios: bool, agents: u32) -> Result<Option<u32>, Invalid> {
    match (species.count, species.share) {
        (None, None) if has_ratios => Ok(None),
        (Some(count), None) if !has_ratios => {
            invalid::whole("count", count, 1..=CapabilityModel::MAX_ROBOTS).map(Some)
        }
        (None, Some(share)) if !has_ratios => counted_share(share, agents).map(Some),
        (None, None) => Err(Invalid::missing(
            "count",
            "given, or share, unless there are ratios",
        )),
        (Some(count), _) => Err(Invalid::new(
            "count",
            count,
            "absent if a share or ratios are given",
        )),
        (None, Some(share)) => Err(Invalid::new("share", share, "absent if ratios are given")),
    }
}

/// Checks that no species has a share, or that all species have shares that sum to 1.
fn check_shares(shares: &[Option<f64>]) -> Result<(), Invalid> {
    let given: f64 = shares.iter().flatten().sum();
    let all = shares.iter().all(Option::is_some);
    match shares.iter().position(Option::is_some) {
        Some(i) if !all || (given - 1.0).abs() > 1e-6 => {
            let value = shares[i].unwrap_or_default();
            let allowed =
                format!("such that all species have a share, and all shares come to 1, not {given}");
            Err(Invalid::new(format!("species[{i}].share"), value, allowed))
        }
        _ => Ok(()),
    }
}

fn counted_share(share: f64, agents: u32) -> Result<u32, Invalid> {
    let count = share * f64::from(agents);
    let whole = count.round();
    if share > 0.0 && share <= 1.0 && (count - whole).abs() < 1e-6 {
        return Ok(whole as u32);
    }
    let allowed = format!("over 0 and at most 1, and a whole number of the {agents} agents");
    Err(Invalid::new("share", share, allowed))
}

impl TryFrom<v1::CapabilityModel> for CapabilityModel {
    type Error = Invalid;

    /// Reads a model whose species are described in full. A preset has the paper's body and wheels.
    fn try_from(message: v1::CapabilityModel) -> Result<Self, Invalid> {
        let within = |error: Invalid| error.within("model");
        // Only presets need defaults: described robots have every field.
        let default = Defaults {
            radius: Preset::PAPER_RADIUS,
            wheel_radius: Preset::PAPER_WHEEL_RADIUS,
            agents: 1,
        };
        if !message.ratios.is_empty() {
            return Self::of_messages(message.species, message.ratios, &default).map_err(within);
        }
        match <[v1::Species; 1]>::try_from(message.species) {
            Ok([alone]) => {
                let robot = robot(alone.model.as_deref(), alone.robot, &default);
                robot.and_then(Self::of_one).map_err(within)
            }
            Err(species) => {
                let value = format!("{} species", species.len());
                Err(within(Invalid::new("species", value, "one species, or ratios")))
            }
        }
    }
}

/// Robots of a campaign file: exactly one of `model`, `robot` and `species`.
#[derive(Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct Written {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) model: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) robot: Option<v1::Robot>,
    #[serde(
        with = "murmuration_proto::toml_forms::ratios",
        skip_serializing_if = "Vec::is_empty"
    )]
    pub(crate) ratios: Vec<v1::Ratio>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) species: Vec<v1::Species>,
}

impl Written {
    /// Reads a model; `default` fills absent fields.
    ///
    /// # Errors
    /// The error names the field that is not allowed.
    pub(crate) fn read(self, default: &Defaults) -> Result<CapabilityModel, Invalid> {
        if self.species.is_empty() {
            if !self.ratios.is_empty() {
                let allowed = "absent without species";
                return Err(Invalid::new("ratios", "given", allowed));
            }
            let robot = robot(self.model.as_deref(), self.robot, default)?;
            return CapabilityModel::of_one(robot).map_err(|error| error.within("robot"));
        }
        for (field, given) in [("model", self.model.is_some()), ("robot", self.robot.is_some())] {
            if given {
                let allowed = "absent: each species describes its robots";
                return Err(Invalid::new(field, "given", allowed));
            }
        }
        CapabilityModel::of_messages(self.species, self.ratios, default)
    }
}

impl From<&CapabilityModel> for Written {
    fn from(model: &CapabilityModel) -> Self {
        let mut written = Self::default();
        match (model.preset(), model.ratios(), model.species()) {
            (Some(preset), ..) => written.model = Some(preset.name().to_owned()),
            (None, [], [alone, ..]) => written.robot = Some(alone.robot().into()),
            (None, ratios, species) => {
                written.species = species.iter().map(Into::into).collect();
                written.ratios = ratios
                    .iter()
                    .cloned()
                    .map(|counts| v1::Ratio { counts })
                    .collect();
            }
        }
        written
    }
}

impl CapabilityModel {
    /// The model as an inline table of TOML, with the fields of a campaign file: `{ model = "turbopi" }`.
    /// [`World::robots_of_line`](crate::World::robots_of_line) reads the line.
    #[must_use]
    pub fn to_line(&self) -> String {
        toml::Value::try_from(Written::from(self)).map_or_else(|_| String::new(), |value| value.to_string())
    }

    /// Reads a line of [`CapabilityModel::to_line`]; `default` fills absent fields.
    pub(crate) fn of_line(field: &str, line: &str, default: &Defaults) -> Result<Self, Invalid> {
        let written: Written = of_toml_line(field, line, "{ model = \"turbopi\" }")?;
        written.read(default).map_err(|error| error.within(field))
    }
}

impl From<&CapabilityModel> for v1::CapabilityModel {
    fn from(model: &CapabilityModel) -> Self {
        Self {
            species: model.species().iter().map(Into::into).collect(),
            ratios: model
                .ratios()
                .iter()
                .cloned()
                .map(|counts| v1::Ratio { counts })
                .collect(),
        }
    }
}

impl From<&Species> for v1::Species {
    fn from(species: &Species) -> Self {
        Self {
            name: species.name().as_str().to_owned(),
            robot: Some(species.robot().into()),
            ..Self::default()
        }
    }
}
