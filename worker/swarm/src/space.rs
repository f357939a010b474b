//! The controllers that a search can propose.

use crate::{CapabilityModel, Controller, Invalid, Preset, RandomStream, SensorAngle, counted, invalid};
use murmuration_proto::v1;
use std::f64::consts::PI;

/// The controller space U(C): speeds on a grid (or continuous), and sets or ranges of sensor angles (paper, appendix "Informed
/// Heuristic Filtering"). With several species, a controller has the genes of each species in turn, and then a ratio if there are
/// several ratios.
#[derive(Debug, Clone, PartialEq)]
pub struct ControllerSpace {
    model: CapabilityModel,
    /// Number of grid steps from 0 to the largest speed; 0 for a continuous space.
    steps: u32,
    /// Angles to choose from for free angles without a list of their own; if empty, they can have any angle in their range.
    angles: Vec<f64>,
    genes: Vec<GeneSpace>,
    initial: Vec<Controller>,
}

/// How far a gene moves at most to a value near it, as a share of the limit of a speed or of the range of an angle.
const NEAR: f64 = 0.2;

/// Number of steps from one end of a gene's range to its other end, see [`GeneSpace::beside`]: a step of a speed is a tenth of its
/// limit, as on the usual grid.
const STEPS: f64 = 20.0;

/// The values of one gene of a controller space.
#[derive(Debug, Clone, PartialEq)]
pub enum GeneSpace {
    Speed {
        /// Largest magnitude of the speed.
        limit: f64,
        /// Number of grid steps from 0 to `limit`; 0 if any value is allowed.
        steps: u32,
    },
    /// One of these angles, radians.
    Among(Vec<f64>),
    /// Any angle from the lowest to the highest, radians.
    Within([f64; 2]),
    /// The index of a ratio; the field is the number of ratios.
    Ratio(usize),
}

impl ControllerSpace {
    /// Maximum number of controllers that a first generation begins with.
    pub const MAX_INITIAL: usize = 1000;

    /// The paper's ten angles of the second sensor, radians.
    #[must_use]
    pub fn paper_angles() -> Vec<f64> {
        [2.0 * PI / 3.0, PI / 2.0, PI / 3.0, PI / 4.0, PI / 6.0]
            .into_iter()
            .flat_map(|angle| [-angle, angle])
            .collect()
    }

    /// Validates a space for `model`.
    ///
    /// # Errors
    /// The error names the invalid field: a step that does not divide 1 evenly, an angle out of a sensor's range, angles for a
    /// model without free ranges, or an initial controller that the model does not allow.
    pub fn for_model(message: v1::ControllerSpace, model: &CapabilityModel) -> Result<Self, Invalid> {
        let steps = steps(message.step.unwrap_or(0.1))?;
        let angles = match model.preset() {
            Some(Preset::TwoSensor) if message.angles.is_empty() => Self::paper_angles(),
            _ => message.angles,
        };
        check_angles(&angles, model)?;
        Ok(Self {
            initial: initial(&message.initial, model)?,
            genes: genes(model, steps, &angles),
            model: model.clone(),
            steps,
            angles,
        })
    }

    #[must_use]
    pub const fn model(&self) -> &CapabilityModel {
        &self.model
    }

    /// The values of each gene, in their order.
    #[must_use]
    pub fn genes(&self) -> &[GeneSpace] {
        &self.genes
    }

    /// The controllers that the first generation begins with, at most [`ControllerSpace::MAX_INITIAL`]. Initial controllers can
    /// lie between the points of the grid.
    #[must_use]
    pub fn initial(&self) -> &[Controller] {
        &self.initial
    }

    /// A uniform sample of the space.
    pub fn sample(&self, stream: &mut RandomStream) -> Controller {
        let genes: Vec<_> = self.genes.iter().map(|gene| gene.sample(stream)).collect();
        self.controller(&genes)
    }

    /// A controller of the space near `controller`, which is of the space's model and can lie between the points of the grid. One
    /// gene moves, and each other gene moves with probability one half.
    pub fn near(&self, controller: &Controller, stream: &mut RandomStream) -> Controller {
        let certain = stream.below(self.genes.len() as u64) as usize;
        let near = |(place, (gene, &value)): (usize, (&GeneSpace, &f64))| match place == certain
            || stream.chance(0.5)
        {
            true => gene.near(value, stream),
            false => gene.nearest(value),
        };
        let genes = self.genes.iter().zip(controller.genes());
        let genes: Vec<_> = genes.enumerate().map(near).collect();
        self.controller(&genes)
    }

    /// The controller with these genes, all of which are in the space.
    #[expect(clippy::expect_used, reason = "members of the space are valid genes")]
    pub fn controller(&self, genes: &[f64]) -> Controller {
        Controller::new(&self.model, genes).expect("genes taken from the controller space")
    }
}

impl GeneSpace {
    /// The values that a model allows for each gene, in the order of the genes. Speeds are continuous, and so are angles that have
    /// a range.
    #[must_use]
    pub fn of_model(model: &CapabilityModel) -> Vec<Self> {
        genes(model, 0, &[])
    }

    /// The values one step below and one step above `value`, without `value` itself. Speeds, and angles in a range, have
    /// `STEPS` steps in their range; the step beyond an end of the range goes to this end. Of a list of angles, and of ratios,
    /// the neighbours are one step away.
    #[must_use]
    pub fn beside(&self, value: f64) -> Vec<f64> {
        let beside = match self {
            Self::Speed { limit, .. } => steps_within(value, [-limit, *limit]).to_vec(),
            Self::Within(range) => steps_within(value, *range).to_vec(),
            Self::Among(angles) => {
                let below = angles.iter().copied().filter(|angle| *angle < value);
                let above = angles.iter().copied().filter(|angle| *angle > value);
                let nearest = [below.max_by(f64::total_cmp), above.min_by(f64::total_cmp)];
                nearest.into_iter().flatten().collect()
            }
            Self::Ratio(count) => {
                let places = 0.0..*count as f64;
                let neighbours = [value - 1.0, value + 1.0].into_iter();
                neighbours.filter(|place| places.contains(place)).collect()
            }
        };
        beside.into_iter().filter(|other| *other != value).collect()
    }

    /// A uniform sample.
    pub fn sample(&self, stream: &mut RandomStream) -> f64 {
        match self {
            &Self::Speed { limit, steps: 0 } => limit * stream.between(-1.0, 1.0),
            &Self::Within([low, high]) => stream.between(low, high),
            Self::Speed { .. } | Self::Among(_) | Self::Ratio(_) => {
                self.value(stream.below(self.values().unwrap_or(1)))
            }
        }
    }

    /// A uniform sample of the values near `value`: at most [`NEAR`] of the limit or of the range away, or one of the two
    /// neighbouring angles. Ratios have no order, so all of them are near.
    fn near(&self, value: f64, stream: &mut RandomStream) -> f64 {
        match self {
            Self::Speed { limit, .. } => self.nearest_speed(value / limit + stream.between(-NEAR, NEAR)),
            &Self::Within([low, high]) => {
                let moved = value + (high - low) * stream.between(-NEAR, NEAR);
                moved.clamp(low, high)
            }
            Self::Among(angles) => {
                let mut sorted = angles.clone();
                sorted.sort_by(f64::total_cmp);
                let own = self.nearest(value);
                let place = sorted.iter().position(|angle| *angle == own).unwrap_or(0);
                let neighbours = [place.checked_sub(1), Some(place + 1)];
                let neighbours: Vec<f64> = neighbours
                    .into_iter()
                    .flatten()
                    .filter_map(|at| sorted.get(at).copied())
                    .collect();
                match neighbours.is_empty() {
                    true => own,
                    false => neighbours[stream.below(neighbours.len() as u64) as usize],
                }
            }
            Self::Ratio(_) => self.sample(stream),
        }
    }

    /// The value of the space that is nearest to `value`.
    fn nearest(&self, value: f64) -> f64 {
        match self {
            Self::Speed { limit, .. } => self.nearest_speed(value / limit),
            &Self::Within([low, high]) => value.clamp(low, high),
            Self::Among(angles) => {
                let distance = |angle: &f64| (angle - value).abs();
                let nearest = angles.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
                nearest.copied().unwrap_or(value)
            }
            Self::Ratio(_) => value,
        }
    }

    /// Number of values; `None` if the gene is continuous.
    #[must_use]
    pub fn values(&self) -> Option<u64> {
        match *self {
            Self::Speed { steps: 0, .. } | Self::Within(_) => None,
            Self::Speed { steps, .. } => Some(2 * u64::from(steps) + 1),
            Self::Among(ref angles) => Some(angles.len() as u64),
            Self::Ratio(count) => Some(count as u64),
        }
    }

    /// The value at `place`, which is under [`GeneSpace::values`]; 0 if the gene is continuous.
    #[must_use]
    pub fn value(&self, place: u64) -> f64 {
        match *self {
            Self::Speed { steps: 0, .. } | Self::Within(_) => 0.0,
            Self::Speed { limit, steps } => limit * ((place as f64 - f64::from(steps)) / f64::from(steps)),
            Self::Among(ref angles) => angles[place as usize],
            Self::Ratio(_) => place as f64,
        }
    }

    /// The quantile of all values at `share`, 0 to under 1.
    #[must_use]
    pub fn at(&self, share: f64) -> f64 {
        match (self, self.values()) {
            (&Self::Speed { limit, .. }, None) => limit * (2.0 * share - 1.0),
            (&Self::Within([low, high]), _) => low + share * (high - low),
            (_, values) => {
                let values = values.unwrap_or(1);
                self.value(((share * values as f64) as u64).min(values - 1))
            }
        }
    }

    /// The allowed speed nearest to `share` of the limit; 0 if the gene is not a speed.
    #[must_use]
    pub fn nearest_speed(&self, share: f64) -> f64 {
        let inside = share.clamp(-1.0, 1.0);
        match *self {
            Self::Speed { limit, steps: 0 } => limit * inside,
            Self::Speed { limit, steps } => limit * ((inside * f64::from(steps)).round() / f64::from(steps)),
            Self::Among(_) | Self::Within(_) | Self::Ratio(_) => 0.0,
        }
    }
}

/// The values one step below and above `value`, within a range. They are rounded, so that 0.7 - 0.1 is 0.6.
fn steps_within(value: f64, [low, high]: [f64; 2]) -> [f64; 2] {
    let step = (high - low) / STEPS;
    let rounded = |value: f64| (value * 1e9).round() / 1e9;
    [value - step, value + step].map(|value| rounded(value).clamp(low, high))
}

/// Checks the controllers that the first generation begins with.
fn initial(controllers: &[v1::Genes], model: &CapabilityModel) -> Result<Vec<Controller>, Invalid> {
    if controllers.len() > ControllerSpace::MAX_INITIAL {
        let value = counted(controllers.len() as u64, "controller");
        let allowed = format!("at most {} controllers", ControllerSpace::MAX_INITIAL);
        return Err(Invalid::new("initial", value, allowed));
    }
    let checked = |(i, genes): (usize, &v1::Genes)| {
        let named = |error: Invalid| Invalid {
            field: error.field.replacen("controller", &format!("initial[{i}]"), 1),
            ..error
        };
        Controller::new(model, &genes.values).map_err(named)
    };
    controllers.iter().enumerate().map(checked).collect()
}

/// The values of each gene of a model's controllers.
fn genes(model: &CapabilityModel, steps: u32, angles: &[f64]) -> Vec<GeneSpace> {
    let mut genes = Vec::with_capacity(model.genes());
    for species in model.species() {
        let robot = species.robot();
        let limits = robot.drive().limits().into_iter().cycle();
        genes.extend(
            limits
                .take(robot.speeds())
                .map(|limit| GeneSpace::Speed { limit, steps }),
        );
        genes.extend(robot.free_angles().map(|(_, free)| match (free.range(), angles) {
            (Some(range), []) => GeneSpace::Within(range),
            (Some(_), angles) => GeneSpace::Among(angles.to_vec()),
            (None, _) => GeneSpace::Among(free.choices().to_vec()),
        }));
    }
    if model.ratios().len() > 1 {
        genes.push(GeneSpace::Ratio(model.ratios().len()));
    }
    genes
}

/// Checks that some sensors are free in a range, and that each angle is in all of these ranges.
fn check_angles(angles: &[f64], model: &CapabilityModel) -> Result<(), Invalid> {
    if angles.is_empty() {
        return Ok(());
    }
    if angles.len() > SensorAngle::MAX_CHOICES {
        let allowed = format!("at most {} values", SensorAngle::MAX_CHOICES);
        return Err(Invalid::new(
            "angles",
            counted(angles.len() as u64, "value"),
            allowed,
        ));
    }
    let free = model
        .species()
        .iter()
        .flat_map(|species| species.robot().free_angles());
    let ranges: Vec<_> = free.filter_map(|(_, angle)| angle.range()).collect();
    if ranges.is_empty() {
        let allowed = match model.preset() {
            Some(Preset::SingleSensor) => "absent: the single-sensor model has no second sensor".to_owned(),
            _ => "absent: no sensor has an angle that is free in a range".to_owned(),
        };
        return Err(Invalid::new("angles", format!("{angles:?}"), allowed));
    }
    for [low, high] in ranges {
        for (i, &angle) in angles.iter().enumerate() {
            invalid::real(&format!("angles[{i}]"), angle, low..=high)?;
        }
    }
    Ok(())
}

impl From<&ControllerSpace> for v1::ControllerSpace {
    fn from(space: &ControllerSpace) -> Self {
        Self {
            step: Some(match space.steps {
                0 => 0.0,
                steps => 1.0 / f64::from(steps),
            }),
            angles: space.angles.clone(),
            initial: space.initial.iter().map(v1::Genes::from).collect(),
        }
    }
}

impl From<&Controller> for v1::Genes {
    fn from(controller: &Controller) -> Self {
        Self {
            values: controller.genes().to_vec(),
        }
    }
}

fn steps(step: f64) -> Result<u32, Invalid> {
    let allowed = "0 (continuous) or a number from 0.0001 to 1 that divides 1 evenly, such as 0.1";
    let steps = (1.0 / step).round();
    match step {
        0.0 => Ok(0),
        step if (0.0001..=1.0).contains(&step) && (step * steps - 1.0).abs() < 1e-9 => Ok(steps as u32),
        step => Err(Invalid::new("step", step, allowed)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Purpose;

    #[test]
    fn the_grid_is_the_papers_and_every_point_is_sampled() {
        let space =
            ControllerSpace::for_model(v1::ControllerSpace::default(), &Preset::SingleSensor.into()).unwrap();
        let mut stream = RandomStream::derive(1, Purpose::Propose, 0);
        let mut seen: Vec<f64> = (0..2000).map(|_| space.genes()[0].sample(&mut stream)).collect();
        seen.sort_by(f64::total_cmp);
        seen.dedup();
        let grid: Vec<f64> = (-10..=10).map(|i| f64::from(i) / 10.0).collect();
        assert_eq!(seen, grid);
        assert_eq!(space.genes()[0].nearest_speed(0.26), 0.3);
        assert_eq!(space.genes()[0].nearest_speed(-7.0), -1.0);
    }

    #[test]
    fn controllers_near_one_are_in_the_space_and_near() {
        let space =
            ControllerSpace::for_model(v1::ControllerSpace::default(), &Preset::TwoSensor.into()).unwrap();
        // The first gene and the angle lie between the values of the space.
        let genes = [0.77, 0.5, 0.6, -0.5, -0.5, 0.0, -0.2, 1.0, 1.5];
        let controller = Controller::new(space.model(), &genes).unwrap();
        let mut stream = RandomStream::derive(1, Purpose::Around, 0);
        for _ in 0..1000 {
            let near = space.near(&controller, &mut stream);
            let (speeds, angle) = near.genes().split_at(8);
            for (speed, of) in speeds.iter().zip(genes) {
                assert_eq!(*speed, space.genes()[0].nearest_speed(*speed));
                assert!((speed - of).abs() < 0.26, "{speed} is far from {of}");
            }
            let angles = [PI / 3.0, PI / 2.0, 2.0 * PI / 3.0];
            assert!(angles.contains(&angle[0]), "{angle:?}");
        }
    }

    #[test]
    fn a_step_that_does_not_divide_one_is_refused() {
        for step in [0.3, -0.1, 2.0, f64::NAN] {
            let message = v1::ControllerSpace {
                step: Some(step),
                ..Default::default()
            };
            let error = ControllerSpace::for_model(message, &Preset::TwoSensor.into()).unwrap_err();
            assert_eq!(error.field, "step");
        }
    }
}
