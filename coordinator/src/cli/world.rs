//! `world`: a world that the authors' RobotSwarmSimulator saved, as a campaign file.

use super::{
    CliError,
    files::{read_words, write},
};
use murmuration_link::{InputKind, errln, print};
use murmuration_proto::{CampaignSpec, text};
use serde::Deserialize;
use std::{collections::BTreeMap, path::PathBuf};
use toml::{Table, Value};

/// Steps of a world that does not say when it stops: the paper's.
const HORIZON: u32 = 1200;

/// Arguments of `world`.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
The file is a world as RobotSwarmSimulator saves it (RectangularWorldConfig), of one species or of several. The campaign file has \
its robots, walls, and start poses; what it cannot have is named. The controllers that the world was saved with are in a comment.

Examples:
  murmuration world cyclone.json --out cyclone.toml
  murmuration world cyclone.json")]
pub(super) struct WorldCommand {
    /// World of RobotSwarmSimulator, JSON
    file: PathBuf,
    /// Write the campaign file to this file [default: print it]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

impl WorldCommand {
    pub(super) fn execute(&self) -> Result<(), CliError> {
        let text = read_words(&self.file, InputKind::Case)?;
        let named = |error: String| CliError::Input(format!("{}: {error}", self.file.display()));
        let world: SavedWorld = serde_json::from_str(&text)
            .map_err(|error| named(format!("it is no world of RobotSwarmSimulator: {error}")))?;
        let converted = world.convert().map_err(named)?;
        // What is written can be run.
        CampaignSpec::from_toml(&converted.text).map_err(|error| named(error.to_string()))?;
        for left_out in &converted.left_out {
            errln!("left out: {left_out}");
        }
        match &self.out {
            Some(path) => write(path, converted.text),
            None => Ok(print(converted.text)?),
        }
    }
}

/// Fields that do not move a robot: how things look, what is measured, and where random numbers come from.
const HARMLESS: &[&str] = &[
    "type",
    "seed",
    "behavior",
    "metadata",
    "show_walls",
    "background_color",
    "show",
    "body_color",
    "body_filled",
    "trace_length",
    "trace_color",
    "history_length",
    "store_history",
    // Of an agent's configuration: `agent_init` says where agents begin.
    "x",
    "y",
    "angle",
    "heading",
];

/// Fields that nothing is made of, by name.
type Rest = BTreeMap<String, serde_json::Value>;

/// The names of those fields that may have moved a robot: neither harmless, nor nothing.
fn unknown(rest: &Rest) -> impl Iterator<Item = &str> {
    let is_nothing = |value: &serde_json::Value| match value {
        serde_json::Value::Null => true,
        serde_json::Value::Bool(value) => !value,
        serde_json::Value::Number(value) => value.as_f64() == Some(0.0),
        serde_json::Value::String(value) => value.is_empty(),
        serde_json::Value::Array(values) => values.is_empty(),
        serde_json::Value::Object(fields) => fields.is_empty(),
    };
    let is_every_step = |name: &str, value: &serde_json::Value| {
        name == "time_step_between_sensing" && value.as_f64() == Some(1.0)
    };
    rest.iter()
        .filter(move |(name, value)| {
            !HARMLESS.contains(&name.as_str()) && !is_nothing(value) && !is_every_step(name, value)
        })
        .map(|(name, _)| name.as_str())
}

/// A world as the reference code saves it.
#[derive(Debug, Deserialize)]
struct SavedWorld {
    w: f64,
    h: f64,
    population_size: u32,
    padding: f64,
    agent_config: SavedAgents,
    collide_walls: bool,
    stop_at: Option<u32>,
    #[serde(default)]
    objects: Vec<serde_json::Value>,
    #[serde(default)]
    goals: Vec<serde_json::Value>,
    agent_init: Option<Vec<[f64; 3]>>,
    #[serde(flatten)]
    rest: Rest,
}

#[derive(Debug, Deserialize)]
#[serde(tag = "type")]
enum SavedAgents {
    #[serde(rename = "HeterogeneousSwarmConfig")]
    Several {
        sub_population_configs: Vec<SavedAgent>,
        counts: Vec<u32>,
        #[serde(flatten)]
        rest: Rest,
    },
    #[serde(untagged)]
    One(SavedAgent),
}

#[derive(Debug, Deserialize)]
struct SavedAgent {
    #[serde(rename = "type")]
    kind: SavedDrive,
    dt: f64,
    agent_radius: f64,
    wheel_radius: Option<f64>,
    controller: Vec<f64>,
    sensors: SavedSensors,
    #[serde(default)]
    idiosyncrasies: bool,
    #[serde(flatten)]
    rest: Rest,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
enum SavedDrive {
    #[serde(rename = "DiffDriveAgentConfig")]
    Differential,
    #[serde(rename = "UnicycleAgentConfig", alias = "MazeAgentConfig")]
    Unicycle,
}

#[derive(Debug, Deserialize)]
struct SavedSensors {
    sensors: Vec<SavedSensor>,
    #[serde(flatten)]
    rest: Rest,
}

#[derive(Debug, Deserialize)]
#[serde(tag = "type")]
enum SavedSensor {
    #[serde(rename = "BinaryLOSSensor")]
    Ray {
        angle: f64,
        #[serde(flatten)]
        rest: Rest,
    },
    #[serde(rename = "BinaryFOVSensor")]
    Cone {
        /// Half of the cone's angle, radians.
        theta: f64,
        /// The angle of its middle, radians.
        bias: f64,
        agent_sensing_range: f64,
        #[serde(default)]
        fp: f64,
        #[serde(default, rename = "fn")]
        missed: f64,
        #[serde(default)]
        use_goal_state: bool,
        #[serde(flatten)]
        rest: Rest,
    },
}

/// A campaign file, and what of the world is not in it.
#[derive(Debug)]
struct Converted {
    text: String,
    left_out: Vec<String>,
}

impl SavedWorld {
    fn convert(&self) -> Result<Converted, String> {
        let one;
        let (agents, counts): (&[SavedAgent], Vec<u32>) = match &self.agent_config {
            SavedAgents::Several {
                sub_population_configs,
                counts,
                ..
            } if counts.len() == sub_population_configs.len() && !counts.is_empty() => {
                (sub_population_configs, counts.clone())
            }
            SavedAgents::Several { .. } => return Err("counts: not as many as there are species".to_owned()),
            SavedAgents::One(agent) => {
                one = std::slice::from_ref(agent);
                (one, vec![self.population_size])
            }
        };
        let robots: u32 = counts.iter().fold(0, |sum, count| sum.saturating_add(*count));
        let dt = agents[0].dt;
        if agents.iter().any(|agent| agent.dt != dt) {
            return Err("dt: its species differ, and a world here has one".to_owned());
        }
        let mut left_out = Vec::new();
        let mut file = Table::new();
        file.insert("method".to_owned(), "hand-crafted".into());
        let mut genes = Vec::new();
        let mut species = Vec::new();
        for (agent, (count, name)) in agents.iter().zip(counts.iter().zip('a'..='z')) {
            let (robot, controller) = agent.robot(&mut left_out)?;
            genes.extend(controller);
            let mut one = Table::new();
            one.insert("name".to_owned(), name.to_string().into());
            one.insert("count".to_owned(), i64::from(*count).into());
            one.insert("robot".to_owned(), robot.into());
            species.push(one);
        }
        match <[Table; 1]>::try_from(species) {
            Ok([mut alone]) => {
                let robot = alone.remove("robot");
                file.extend(robot.map(|robot| ("robot".to_owned(), robot)));
            }
            Err(species) => {
                let species = species.into_iter().map(Value::from).collect();
                file.insert("species".to_owned(), Value::Array(species));
            }
        }
        file.insert("world".to_owned(), self.world(dt, robots, &mut left_out).into());
        self.leave_out(robots, agents, &mut left_out);
        let genes: Vec<String> = genes.iter().map(f64::to_string).collect();
        let text = format!(
            "# A world of RobotSwarmSimulator. The controllers that it was saved with, for --spec of `murmuration simulate`:\n\
             # --controller {}\n{}",
            genes.join(","),
            toml::to_string(&file).map_err(|error| error.to_string())?
        );
        left_out.sort_unstable();
        left_out.dedup();
        Ok(Converted { text, left_out })
    }

    fn world(&self, dt: f64, robots: u32, left_out: &mut Vec<String>) -> Table {
        let mut world = Table::new();
        for (name, number) in [
            ("width", self.w),
            ("height", self.h),
            ("padding", self.padding),
            ("dt", dt),
        ] {
            world.insert(name.to_owned(), number.into());
        }
        world.insert("agents".to_owned(), i64::from(robots).into());
        world.insert(
            "horizon".to_owned(),
            i64::from(self.stop_at.unwrap_or(HORIZON)).into(),
        );
        if !self.collide_walls {
            world.insert("boundary".to_owned(), "open".into());
        }
        match &self.agent_init {
            Some(poses) if poses.len() == robots as usize => {
                let pose = |pose: &[f64; 3]| Value::Array(pose.iter().map(|&number| number.into()).collect());
                let mut start = Table::new();
                start.insert("shape".to_owned(), "poses".into());
                start.insert("poses".to_owned(), Value::Array(poses.iter().map(pose).collect()));
                world.insert("start".to_owned(), start.into());
                left_out.push(
                    "the noise that RobotSwarmSimulator adds to stored poses (20 world units, pi/8)"
                        .to_owned(),
                );
            }
            Some(_) => {
                left_out.push(
                    "stored poses, which are not as many as there are robots: starts are uniform".to_owned(),
                );
            }
            None => {}
        }
        world
    }

    fn leave_out(&self, robots: u32, agents: &[SavedAgent], left_out: &mut Vec<String>) {
        let noise = |sensor: &SavedSensor| matches!(sensor, SavedSensor::Cone { fp, missed, .. } if fp + missed > 0.0);
        let sees_goals = |sensor: &SavedSensor| {
            matches!(
                sensor,
                SavedSensor::Cone {
                    use_goal_state: true,
                    ..
                }
            )
        };
        let sensors = || agents.iter().flat_map(|agent| &agent.sensors.sensors);
        for (is_left_out, what) in [
            (!self.objects.is_empty(), "objects"),
            (
                !self.goals.is_empty() && sensors().any(sees_goals),
                "goals, and what sensors see of them",
            ),
            (
                !self.goals.is_empty() && !sensors().any(sees_goals),
                "goals, which no sensor sees",
            ),
            (
                sensors().any(noise),
                "false readings of sensors (`missed` and `false_detection` of [world.noise])",
            ),
            (
                agents.iter().any(|agent| agent.idiosyncrasies),
                "idiosyncrasies of robots (`gain` of [world.noise] is like them)",
            ),
            (
                robots != self.population_size,
                "population_size, which is not the sum of counts",
            ),
        ] {
            left_out.extend(is_left_out.then(|| what.to_owned()));
        }
        self.leave_out_unknown(agents, left_out);
    }

    /// Names the fields that this program does not know.
    fn leave_out_unknown(&self, agents: &[SavedAgent], left_out: &mut Vec<String>) {
        let mut leave_out = |rest: &Rest, whose: &str| {
            let named = unknown(rest).map(|name| format!("{} of {whose}", text::marked(name)));
            left_out.extend(named);
        };
        leave_out(&self.rest, "the world");
        if let SavedAgents::Several { rest, .. } = &self.agent_config {
            leave_out(rest, "the agents");
        }
        for agent in agents {
            leave_out(&agent.rest, "an agent");
            leave_out(&agent.sensors.rest, "an agent's sensors");
            for sensor in &agent.sensors.sensors {
                let (SavedSensor::Ray { rest, .. } | SavedSensor::Cone { rest, .. }) = sensor;
                leave_out(rest, "a sensor");
            }
        }
    }
}

impl SavedAgent {
    /// The robot as a table of a campaign file, and its controller: a pair for each state of its sensors.
    fn robot(&self, left_out: &mut Vec<String>) -> Result<(Table, &[f64]), String> {
        let sensors = &self.sensors.sensors;
        let genes = match u32::try_from(sensors.len())
            .ok()
            .and_then(|count| 2_usize.checked_pow(count))
        {
            Some(states) if (1..=6).contains(&sensors.len()) => 2 * states,
            _ => {
                return Err(format!(
                    "sensors: {} of them, and 1 to 6 are possible",
                    sensors.len()
                ));
            }
        };
        let controller = self.controller.get(..genes).ok_or_else(|| {
            format!(
                "controller: {} numbers, and {genes} are needed",
                self.controller.len()
            )
        })?;
        if self.controller.len() > genes {
            left_out.push("the pairs of a controller for goals".to_owned());
        }
        let mut robot = Table::new();
        let sensors = sensors.iter().map(|sensor| Value::from(sensor.table())).collect();
        robot.insert("sensors".to_owned(), Value::Array(sensors));
        robot.insert("radius".to_owned(), self.agent_radius.into());
        let largest = |first: usize| {
            let speeds = controller.iter().skip(first).step_by(2);
            speeds.fold(0.0, |most: f64, speed| most.max(speed.abs()))
        };
        match self.kind {
            SavedDrive::Differential => {
                robot.extend(
                    self.wheel_radius
                        .map(|radius| ("wheel_radius".to_owned(), radius.into())),
                );
                robot.insert("max_speed".to_owned(), largest(0).max(largest(1)).max(1.0).into());
            }
            SavedDrive::Unicycle => {
                robot.insert("drive".to_owned(), "unicycle".into());
                for (name, most) in [("max_speed", largest(0)), ("max_turn", largest(1))] {
                    let most = if most > 0.0 { most } else { 1.0 };
                    robot.insert(name.to_owned(), most.into());
                }
            }
        }
        Ok((robot, controller))
    }
}

impl SavedSensor {
    fn table(&self) -> Table {
        let numbers = match self {
            Self::Ray { angle, .. } => vec![("angle", *angle)],
            Self::Cone {
                theta,
                bias,
                agent_sensing_range,
                ..
            } => vec![
                ("angle", *bias),
                ("half_angle", *theta),
                ("range", *agent_sensing_range),
            ],
        };
        numbers
            .into_iter()
            .map(|(name, number)| (name.to_owned(), number.into()))
            .collect()
    }
}

#[cfg(test)]
mod tests;
