//! The controllers that a search can propose.

use crate::{CapabilityModel, Controller, Invalid, RandomStream, counted, invalid, v1};
use std::f64::consts::PI;

/// The controller space U(C): wheel speeds on a grid over \[-1, 1\] (or continuous), and a set of sensor angles
/// (paper, appendix "Informed Heuristic Filtering").
#[derive(Debug, Clone, PartialEq)]
pub struct ControllerSpace {
    model: CapabilityModel,
    /// Grid steps in a unit of speed; 0 for a continuous space.
    steps_per_unit: u32,
    /// Empty for the single-sensor model.
    angles: Vec<f64>,
}

impl ControllerSpace {
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
    /// Names the invalid field: a step that does not divide 1 evenly, an angle out of range, angles for a model that has
    /// none.
    pub fn for_model(message: v1::ControllerSpace, model: CapabilityModel) -> Result<Self, Invalid> {
        let angles = match model {
            CapabilityModel::SingleSensor if !message.angles.is_empty() => {
                let allowed = "absent: the single-sensor model has no second sensor";
                return Err(Invalid::new("angles", format!("{:?}", message.angles), allowed));
            }
            CapabilityModel::SingleSensor => Vec::new(),
            CapabilityModel::TwoSensor if message.angles.is_empty() => Self::paper_angles(),
            CapabilityModel::TwoSensor => message.angles,
        };
        for (i, &angle) in angles.iter().enumerate() {
            invalid::real(&format!("angles[{i}]"), angle, -PI..=PI)?;
        }
        if angles.len() > 1000 {
            return Err(Invalid::new(
                "angles",
                counted(angles.len() as u64, "value"),
                "at most 1000 values",
            ));
        }
        Ok(Self {
            model,
            steps_per_unit: steps_per_unit(message.step.unwrap_or(0.1))?,
            angles,
        })
    }

    /// The capability model of these controllers.
    #[must_use]
    pub const fn model(&self) -> CapabilityModel {
        self.model
    }

    /// The possible angles of the second sensor, radians; empty for the single-sensor model.
    #[must_use]
    pub fn angles(&self) -> &[f64] {
        &self.angles
    }

    /// A uniform sample of the space.
    pub fn sample(&self, stream: &mut RandomStream) -> Controller {
        let mut genes = [0.0; 9];
        let genes = &mut genes[..self.model.genes()];
        for gene in &mut genes[..self.model.speeds()] {
            *gene = self.sample_speed(stream);
        }
        for gene in &mut genes[self.model.speeds()..] {
            *gene = self.sample_angle(stream);
        }
        self.controller(genes)
    }

    /// A uniform sample of the space's wheel speeds.
    pub fn sample_speed(&self, stream: &mut RandomStream) -> f64 {
        match self.steps_per_unit {
            0 => stream.between(-1.0, 1.0),
            steps => {
                let place = stream.below(2 * u64::from(steps) + 1);
                (place as f64 - f64::from(steps)) / f64::from(steps)
            }
        }
    }

    /// A uniform sample of the space's angles (0 if there are none).
    pub fn sample_angle(&self, stream: &mut RandomStream) -> f64 {
        match self.angles.len() {
            0 => 0.0,
            count => self.angles[stream.below(count as u64) as usize],
        }
    }

    /// The speed of the space nearest to `speed`.
    #[must_use]
    pub fn nearest_speed(&self, speed: f64) -> f64 {
        let inside = speed.clamp(-1.0, 1.0);
        match self.steps_per_unit {
            0 => inside,
            steps => (inside * f64::from(steps)).round() / f64::from(steps),
        }
    }

    /// The controller of these genes, each already a member of the space.
    #[expect(clippy::expect_used, reason = "members of the space are valid genes")]
    pub fn controller(&self, genes: &[f64]) -> Controller {
        Controller::new(self.model, genes).expect("genes taken from the controller space")
    }
}

impl From<&ControllerSpace> for v1::ControllerSpace {
    fn from(space: &ControllerSpace) -> Self {
        Self {
            step: Some(match space.steps_per_unit {
                0 => 0.0,
                steps => 1.0 / f64::from(steps),
            }),
            angles: space.angles.clone(),
        }
    }
}

fn steps_per_unit(step: f64) -> Result<u32, Invalid> {
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
        let space = ControllerSpace::for_model(v1::ControllerSpace::default(), CapabilityModel::SingleSensor)
            .unwrap();
        let mut stream = RandomStream::derive(1, Purpose::Propose, 0);
        let mut seen: Vec<f64> = (0..2000).map(|_| space.sample_speed(&mut stream)).collect();
        seen.sort_by(f64::total_cmp);
        seen.dedup();
        let grid: Vec<f64> = (-10..=10).map(|i| f64::from(i) / 10.0).collect();
        assert_eq!(seen, grid);
        assert_eq!(space.nearest_speed(0.26), 0.3);
        assert_eq!(space.nearest_speed(-7.0), -1.0);
    }

    #[test]
    fn a_step_that_does_not_divide_one_is_refused() {
        for step in [0.3, -0.1, 2.0, f64::NAN] {
            let message = v1::ControllerSpace {
                step: Some(step),
                ..Default::default()
            };
            let error = ControllerSpace::for_model(message, CapabilityModel::TwoSensor).unwrap_err();
            assert_eq!(error.field, "step");
        }
    }
}
