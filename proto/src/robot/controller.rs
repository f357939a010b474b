//! The numbers that control robots: a pair of speeds for each sensor state, and the free angles.

use super::{Population, Robot};
use crate::{Invalid, counted, invalid};
use std::sync::Arc;

/// The controller of one kind of robot.
///
/// Negative zero becomes zero, so that equal controllers have equal bits.
#[derive(Debug, Clone, PartialEq)]
pub struct RobotController {
    genes: Vec<f64>,
    /// How many of the genes are speeds.
    speeds: usize,
    /// The angle of each sensor, fixed or chosen.
    angles: Vec<f64>,
}

/// A controller for each species of a swarm.
#[derive(Debug, Clone, PartialEq)]
pub struct SwarmController {
    population: Arc<Population>,
    controllers: Vec<RobotController>,
}

impl RobotController {
    /// A controller for `robot` from its genes, which [`Robot::gene_names`] names: a pair for each of the 2^k sensor states in
    /// their order, then the free angles.
    ///
    /// # Errors
    /// Says which gene is out of range, or how many genes there should have been.
    pub fn new(robot: &Robot, genes: &[f64]) -> Result<Self, Invalid> {
        Self::starting_at(robot, genes, 0)
    }

    /// As [`RobotController::new`], in an error the first gene having the number `first`.
    fn starting_at(robot: &Robot, genes: &[f64], first: usize) -> Result<Self, Invalid> {
        if genes.len() != robot.genes() {
            return Err(wrong_count(genes.len(), robot.genes()));
        }
        let field = |i: usize| format!("controller[{}]", first + i);
        let mut checked = Vec::with_capacity(genes.len());
        for (i, &speed) in genes[..robot.speeds()].iter().enumerate() {
            let limit = robot.drive().limits()[i % 2];
            checked.push(invalid::real(&field(i), speed, -limit..=limit)? + 0.0);
        }
        let mut angles = Vec::with_capacity(robot.sensors().len());
        for sensor in robot.sensors() {
            angles.push(match sensor.angle().value() {
                Some(angle) => angle,
                None => {
                    let i = checked.len();
                    let angle = sensor.angle().chosen(&field(i), genes[i])?;
                    checked.push(angle);
                    angle
                }
            });
        }
        Ok(Self {
            genes: checked,
            speeds: robot.speeds(),
            angles,
        })
    }

    /// All genes: the pairs, then the free angles.
    #[must_use]
    pub fn genes(&self) -> &[f64] {
        &self.genes
    }

    /// The pair of each sensor state, in order: `[left, right]`, or `[speed, turn]` of a unicycle.
    ///
    /// The state is the number whose highest bit is S1: `sum S_j 2^(k - j)`.
    pub fn pairs(&self) -> impl ExactSizeIterator<Item = [f64; 2]> {
        let (pairs, _) = self.genes[..self.speeds].as_chunks();
        pairs.iter().copied()
    }

    /// The angle of each sensor, S1 first, radians: the fixed ones too.
    #[must_use]
    pub fn angles(&self) -> &[f64] {
        &self.angles
    }
}

impl SwarmController {
    /// Controllers of all species from their genes, one species after the other, which [`Population::gene_names`] names.
    ///
    /// # Errors
    /// Says which gene is out of range, or how many genes there should have been.
    pub fn new(population: Arc<Population>, genes: &[f64]) -> Result<Self, Invalid> {
        if genes.len() != population.genes() {
            return Err(wrong_count(genes.len(), population.genes()));
        }
        let mut controllers = Vec::with_capacity(population.species().len());
        let (mut rest, mut first) = (genes, 0);
        for species in population.species() {
            let robot = species.robot();
            let (own, others) = rest.split_at(robot.genes());
            controllers.push(RobotController::starting_at(robot, own, first)?);
            (rest, first) = (others, first + own.len());
        }
        Ok(Self {
            population,
            controllers,
        })
    }

    /// The swarm that it controls.
    #[must_use]
    pub const fn population(&self) -> &Arc<Population> {
        &self.population
    }

    /// A controller for each species, in their order.
    #[must_use]
    pub fn controllers(&self) -> &[RobotController] {
        &self.controllers
    }

    /// The genes of all species, one after the other.
    #[must_use]
    pub fn genes(&self) -> Vec<f64> {
        let genes = self.controllers.iter().flat_map(RobotController::genes);
        genes.copied().collect()
    }
}

fn wrong_count(given: usize, needed: usize) -> Invalid {
    let [given, needed] = [given, needed].map(|count| counted(count as u64, "value"));
    Invalid::new("controller", given, needed)
}
