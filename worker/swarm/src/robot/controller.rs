//! The numbers that control robots: a pair of speeds for each sensor state, the free angles, and the ratio of the species.

use super::{CapabilityModel, Robot};
use crate::{Invalid, invalid};
use std::fmt;

/// A controller of a swarm: the genes of all its species, which [`CapabilityModel::gene_names`] names (paper, Eq. 2 and 4).
///
/// Negative zero becomes zero, so that equal controllers have equal bits.
#[derive(Debug, Clone, PartialEq)]
pub struct Controller {
    model: CapabilityModel,
    genes: Box<[f64]>,
}

/// The part of a controller that controls the robots of one species.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RobotController<'a> {
    robot: &'a Robot,
    genes: &'a [f64],
}

impl Controller {
    /// A controller for `model` from its genes: for each species, a pair of speeds for each sensor state, then the free angles.
    /// The ratio is the last gene, if there are several ratios.
    ///
    /// # Errors
    /// The error names the gene that is out of range, or the expected number of genes.
    pub fn new(model: impl Into<CapabilityModel>, genes: &[f64]) -> Result<Self, Invalid> {
        let model = model.into();
        if genes.len() != model.genes() {
            let allowed = format!("{} values for the {model} model", model.genes());
            return Err(Invalid::new("controller", format!("{genes:?}"), allowed));
        }
        let mut checked = Vec::with_capacity(genes.len());
        match check_all(&model, genes, &mut checked) {
            Ok(()) => Ok(Self {
                model,
                genes: checked.into(),
            }),
            Err(error) => {
                let names = model.gene_names();
                let gene = names.get(checked.len()).map_or("", String::as_str);
                Err(Invalid {
                    field: format!("controller.{gene}"),
                    ..error
                })
            }
        }
    }

    #[must_use]
    pub const fn model(&self) -> &CapabilityModel {
        &self.model
    }

    #[must_use]
    pub const fn genes(&self) -> &[f64] {
        &self.genes
    }

    /// The controller of each species' robots, in the order of species.
    pub fn robots(&self) -> impl Iterator<Item = RobotController<'_>> + Clone {
        let mut first = 0;
        self.model.species().iter().map(move |species| {
            let robot = species.robot();
            let genes = &self.genes[first..first + robot.genes()];
            first += genes.len();
            RobotController { robot, genes }
        })
    }

    /// Number of robots of each species in a swarm of `robots` robots. If [`CapabilityModel::robots`] is a number, `robots` must
    /// equal it.
    #[must_use]
    pub fn counts(&self, robots: u32) -> Vec<u32> {
        match (self.model.ratios(), self.genes.last()) {
            ([], _) => vec![robots],
            ([only], _) => only.clone(),
            (ratios, place) => ratios[place.map_or(0, |&place| place as usize)].clone(),
        }
    }

    /// For each robot in a swarm of `robots` robots, in index order, the place of its species.
    #[must_use]
    pub fn species_of_robots(&self, robots: u32) -> Vec<usize> {
        let counts = self.counts(robots).into_iter().enumerate();
        counts
            .flat_map(|(place, count)| std::iter::repeat_n(place, count as usize))
            .collect()
    }
}

impl<'a> RobotController<'a> {
    #[must_use]
    pub const fn robot(self) -> &'a Robot {
        self.robot
    }

    /// The robots' genes: the pairs, then the free angles.
    #[must_use]
    pub const fn genes(self) -> &'a [f64] {
        self.genes
    }

    /// One pair of numbers per sensor state, in order: `[left, right]`, or `[speed, turn]` for a unicycle.
    ///
    /// A state is the number whose highest bit is S1: `sum S_j 2^(k - j)`.
    #[must_use]
    pub fn pairs(self) -> &'a [[f64; 2]] {
        self.genes[..self.robot.speeds()].as_chunks().0
    }

    /// The angle of each sensor, S1 first, radians, including fixed angles.
    pub fn angles(self) -> impl Iterator<Item = f64> + use<'a> {
        let mut free = self.genes[self.robot.speeds()..].iter();
        let sensors = self.robot.sensors().iter();
        sensors.map(move |sensor| match sensor.angle().value() {
            Some(angle) => angle,
            None => free.next().copied().unwrap_or_default(),
        })
    }
}

impl fmt::Display for Controller {
    /// `[0.6, 1, 0.4, 0.5]`; angles have four decimals.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut shown = Vec::with_capacity(self.genes.len());
        for robot in self.robots() {
            let (speeds, angles) = robot.genes().split_at(robot.robot().speeds());
            shown.extend(speeds.iter().map(f64::to_string));
            shown.extend(angles.iter().map(|angle| format!("{angle:.4}")));
        }
        shown.extend(self.genes[shown.len()..].iter().map(f64::to_string));
        write!(f, "[{}]", shown.join(", "))
    }
}

/// Appends the genes to `checked`, up to the first gene that is out of range.
fn check_all(model: &CapabilityModel, genes: &[f64], checked: &mut Vec<f64>) -> Result<(), Invalid> {
    for species in model.species() {
        let own = &genes[checked.len()..][..species.robot().genes()];
        check_genes(species.robot(), own, checked)?;
    }
    if let Some(&ratio) = genes.get(checked.len()) {
        checked.push(check_ratio(ratio, model.ratios().len())?);
    }
    Ok(())
}

/// Appends the genes of one robot to `checked`, after the genes of earlier robots.
fn check_genes(robot: &Robot, genes: &[f64], checked: &mut Vec<f64>) -> Result<(), Invalid> {
    let (speeds, angles) = genes.split_at(robot.speeds());
    for (i, &speed) in speeds.iter().enumerate() {
        let limit = robot.drive().limits()[i % 2];
        checked.push(invalid::real("controller", speed, -limit..=limit)? + 0.0);
    }
    for ((_, free), &angle) in robot.free_angles().zip(angles) {
        checked.push(free.chosen("controller", angle)?);
    }
    Ok(())
}

fn check_ratio(ratio: f64, ratios: usize) -> Result<f64, Invalid> {
    if ratio >= 0.0 && ratio < ratios as f64 && ratio.fract() == 0.0 {
        return Ok(ratio + 0.0);
    }
    let allowed = format!("the place of a ratio: a whole number from 0 to {}", ratios - 1);
    Err(Invalid::new("controller", ratio, allowed))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Preset;

    #[test]
    fn the_wrong_number_of_genes_is_named() {
        let error = Controller::new(Preset::TwoSensor, &[0.0; 4]).unwrap_err();
        assert_eq!(
            error.to_string(),
            "controller = [0.0, 0.0, 0.0, 0.0]: must be 9 values for the two-sensor model"
        );
    }

    #[test]
    fn a_gene_out_of_range_or_not_a_number_is_named() {
        for bad in [1.1, f64::NAN, f64::INFINITY] {
            let error = Controller::new(Preset::SingleSensor, &[0.0, bad, 0.0, 0.0]).unwrap_err();
            assert_eq!(error.field, "controller.right_0");
        }
    }

    #[test]
    fn negative_zero_is_zero() {
        let controller = Controller::new(Preset::SingleSensor, &[-0.0; 4]).unwrap();
        assert!(controller.genes().iter().all(|gene| gene.is_sign_positive()));
    }
}
