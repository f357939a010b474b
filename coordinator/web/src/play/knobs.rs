//! The genes of a controller as people set them: names, limits and defaults.

use murmuration_swarm::{CapabilityModel, DriveKind, Invalid, Preset, Robot, SensorAngle};
use std::{fmt, iter};

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Knob {
    /// The gene's name among all genes of the model.
    pub(super) name: String,
    pub(super) values: Values,
    /// The gene's default value.
    pub(super) usual: f64,
}

/// The allowed values of a gene.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Values {
    /// Any number between these two bounds, lowest first.
    Within([f64; 2]),
    /// One of these angles, in radians.
    Angles(Vec<f64>),
    /// The place of a ratio in this list; a ratio has the number of robots of each species.
    Ratios(Vec<Vec<u32>>),
}

/// The initial controllers of the paper's presets: the paper's cyclic pursuit, and the paper's nested cycle with its angle -pi/3
/// rounded.
const PURSUIT: [f64; 4] = [-0.7, 0.3, 1.0, 1.0];
const NESTED_CYCLE: [f64; 9] = [0.8, 0.5, 0.6, -0.5, -0.5, 0.0, -0.2, 0.5, -1.05];

/// The genes of a model's controllers, in order.
pub(super) fn knobs(model: &CapabilityModel) -> Vec<Knob> {
    let own = model
        .species()
        .iter()
        .flat_map(|species| of_robot(species.robot()));
    let ratios = model.ratios();
    let ratio = (ratios.len() > 1).then(|| (Values::Ratios(ratios.to_vec()), 0.0));
    let mut knobs: Vec<_> = iter::zip(model.gene_names(), own.chain(ratio))
        .map(|(name, (values, usual))| Knob { name, values, usual })
        .collect();
    let known: &[f64] = match model.preset() {
        Some(Preset::SingleSensor) => &PURSUIT,
        Some(Preset::TwoSensor) => &NESTED_CYCLE,
        _ => &[],
    };
    for (knob, &usual) in iter::zip(&mut knobs, known) {
        knob.usual = usual;
    }
    knobs
}

/// The allowed values and defaults of one robot's genes. By default, the robot turns until a sensor is on.
fn of_robot(robot: &Robot) -> impl Iterator<Item = (Values, f64)> + use<'_> {
    let limits = robot.drive().limits();
    let shares = |state| match (robot.drive().kind(), state) {
        (DriveKind::Differential { .. }, 0) => [-0.7, 0.3],
        (DriveKind::Differential { .. }, _) => [1.0, 1.0],
        (DriveKind::Unicycle, 0) => [0.5, 0.3],
        (DriveKind::Unicycle, _) => [1.0, -0.1],
    };
    let speed = |(limit, share): (f64, f64)| (Values::Within([-limit, limit]), limit * share);
    let speeds = (0..robot.states()).flat_map(move |state| iter::zip(limits, shares(state)).map(speed));
    speeds.chain(robot.free_angles().map(|(_, angle)| of_angle(angle)))
}

fn of_angle(angle: &SensorAngle) -> (Values, f64) {
    match angle.range() {
        Some([low, high]) => {
            let third = low + (high - low) / 3.0;
            // The default is rounded to few digits, so that addresses stay short.
            let usual = ((third * 1e4).round() / 1e4).clamp(low, high);
            (Values::Within([low, high]), usual)
        }
        None => {
            let choices = angle.choices();
            let first = choices.first().copied().unwrap_or_default();
            (Values::Angles(choices.to_vec()), first)
        }
    }
}

impl Knob {
    /// Reads the value that a person entered.
    ///
    /// # Errors
    /// If the text is not an allowed value of the gene; the error names the allowed values.
    pub(super) fn read(&self, text: &str) -> Result<f64, Invalid> {
        let refused = || Invalid::new(self.name.clone(), format!("{text:?}"), self.values.to_string());
        let value: f64 = text.trim().parse().map_err(|_| refused())?;
        let allowed = match &self.values {
            Values::Within([low, high]) => (*low..=*high).contains(&value),
            Values::Angles(angles) => angles.contains(&value),
            Values::Ratios(ratios) => (0..ratios.len()).any(|place| place as f64 == value),
        };
        allowed.then_some(value).ok_or_else(refused)
    }
}

impl fmt::Display for Values {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Within([low, high]) => write!(f, "a number from {low} to {high}"),
            Self::Angles(angles) => write!(f, "one of {angles:?}"),
            Self::Ratios(ratios) => write!(f, "a whole number from 0 to {}", ratios.len() - 1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_swarm::{CampaignSpec, Controller};

    const SPECIES: &str = r#"
        ratios = [[12, 12], [6, 18]]
        [[species]]
        name = "a"
        robot.sensors = [{}, { angle = "free", angles = [0.5, 1.0] }]
        [[species]]
        name = "b"
        robot = { sensors = [{}], drive = "unicycle", max_speed = 20.0, max_turn = 2.0 }
    "#;

    fn described() -> CapabilityModel {
        CampaignSpec::robots_from_toml(SPECIES).unwrap().0
    }

    #[test]
    fn every_model_begins_with_a_controller_that_it_allows() {
        let presets = Preset::ALL.map(CapabilityModel::from);
        for model in presets.into_iter().chain([described()]) {
            let knobs = knobs(&model);
            let genes: Vec<_> = knobs.iter().map(|knob| knob.usual).collect();
            assert_eq!(knobs.len(), model.genes());
            Controller::new(&model, &genes).unwrap();
            for knob in &knobs {
                assert_eq!(knob.read(&knob.usual.to_string()), Ok(knob.usual));
            }
        }
    }

    #[test]
    fn limits_are_those_of_the_drive_and_of_the_angles() {
        let knobs = knobs(&described());
        let knob = |name: &str| knobs.iter().find(|knob| knob.name == name).unwrap();
        assert_eq!(knob("a.left_01").values, Values::Within([-1.0, 1.0]));
        assert_eq!(knob("a.angle_2").values, Values::Angles(vec![0.5, 1.0]));
        assert_eq!(knob("b.speed_0").values, Values::Within([-20.0, 20.0]));
        assert_eq!(knob("b.turn_1").values, Values::Within([-2.0, 2.0]));
        assert_eq!(
            knob("ratio").values,
            Values::Ratios(vec![vec![12, 12], vec![6, 18]])
        );
    }

    #[test]
    fn a_value_that_is_not_allowed_is_told_what_is() {
        let knobs = knobs(&described());
        let message = |name: &str, text: &str| {
            let knob = knobs.iter().find(|knob| knob.name == name).unwrap();
            knob.read(text).unwrap_err().to_string()
        };
        assert_eq!(
            message("a.left_00", "1.1"),
            "a.left_00 = \"1.1\": must be a number from -1 to 1"
        );
        assert_eq!(
            message("a.left_00", "NaN"),
            "a.left_00 = \"NaN\": must be a number from -1 to 1"
        );
        assert_eq!(
            message("a.angle_2", "0.7"),
            "a.angle_2 = \"0.7\": must be one of [0.5, 1.0]"
        );
        assert_eq!(
            message("ratio", "2"),
            "ratio = \"2\": must be a whole number from 0 to 1"
        );
        assert_eq!(
            message("ratio", "0.5"),
            "ratio = \"0.5\": must be a whole number from 0 to 1"
        );
    }
}
