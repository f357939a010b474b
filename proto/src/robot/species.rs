//! Species, and the swarms that they form.

use super::{Robot, SeenRobots, Sensor, SpeciesName};
use crate::{Invalid, World, counted, invalid, text};

/// A species: robots of one kind, all with the same controller.
#[derive(Debug, Clone, PartialEq)]
pub struct Species {
    name: SpeciesName,
    robot: Robot,
    count: u32,
}

/// The species of one swarm, 1 to [`Population::MAX_SPECIES`].
///
/// Robots of the first species come first. Their index is the order in which they move, push and look.
#[derive(Debug, Clone, PartialEq)]
pub struct Population(Vec<Species>);

impl Species {
    /// `count` robots of one kind.
    ///
    /// # Errors
    /// If the count is not from 1 to [`World::MAX_AGENTS`].
    pub fn new(name: SpeciesName, robot: Robot, count: u32) -> Result<Self, Invalid> {
        let count = invalid::whole("count", count, 1..=World::MAX_AGENTS)?;
        Ok(Self { name, robot, count })
    }

    /// Its name.
    #[must_use]
    pub const fn name(&self) -> &SpeciesName {
        &self.name
    }

    /// What its robots are.
    #[must_use]
    pub const fn robot(&self) -> &Robot {
        &self.robot
    }

    /// Number of its robots, 1 to [`World::MAX_AGENTS`].
    #[must_use]
    pub const fn count(&self) -> u32 {
        self.count
    }
}

impl Population {
    /// Maximum number of species.
    pub const MAX_SPECIES: usize = 8;

    /// The swarm of these species.
    ///
    /// # Errors
    /// If there are not 1 to [`Population::MAX_SPECIES`], two have one name, a sensor sees a species that is not here, or there
    /// are more than [`World::MAX_AGENTS`] robots.
    pub fn new(species: Vec<Species>) -> Result<Self, Invalid> {
        if !(1..=Self::MAX_SPECIES).contains(&species.len()) {
            let value = format!("{} species", species.len());
            return Err(Invalid::new(
                "species",
                value,
                format!("1 to {} species", Self::MAX_SPECIES),
            ));
        }
        for (i, of) in species.iter().enumerate() {
            if species[..i].iter().any(|earlier| earlier.name == of.name) {
                let allowed = "a name that no other species has";
                return Err(Invalid::new(format!("species[{i}].name"), &of.name, allowed));
            }
            for (s, sensor) in of.robot.sensors().iter().enumerate() {
                check_seen(sensor, &species)
                    .map_err(|error| error.within(&format!("species[{i}].robot.sensors[{s}]")))?;
            }
        }
        let robots: u64 = species.iter().map(|of| u64::from(of.count)).sum();
        if robots > u64::from(World::MAX_AGENTS) {
            let allowed = format!("at most {} robots in all", World::MAX_AGENTS);
            return Err(Invalid::new("species", counted(robots, "robot"), allowed));
        }
        Ok(Self(species))
    }

    /// The species, in order.
    #[must_use]
    pub fn species(&self) -> &[Species] {
        &self.0
    }

    /// The place in [`Population::species`] of the species with this name.
    #[must_use]
    pub fn place(&self, name: &SpeciesName) -> Option<usize> {
        self.0.iter().position(|species| species.name == *name)
    }

    /// Number of robots of all species, 1 to [`World::MAX_AGENTS`].
    #[must_use]
    pub fn robots(&self) -> u32 {
        self.0.iter().map(Species::count).sum()
    }

    /// The species of each robot by its place in [`Population::species`], in index order.
    pub fn species_of_robots(&self) -> impl Iterator<Item = usize> + Clone {
        let counts = self.0.iter().map(|species| species.count as usize).enumerate();
        counts.flat_map(|(place, count)| std::iter::repeat_n(place, count))
    }

    /// Number of genes of a controller of each species, one after the other.
    #[must_use]
    pub fn genes(&self) -> usize {
        self.0.iter().map(|species| species.robot.genes()).sum()
    }

    /// Names of the genes, in order: [`Robot::gene_names`], after the name of the species and a point if there are several
    /// species (`b.left_01`).
    #[must_use]
    pub fn gene_names(&self) -> Vec<String> {
        match self.0.as_slice() {
            [alone] => alone.robot.gene_names(),
            several => several.iter().flat_map(Species::qualified_gene_names).collect(),
        }
    }
}

impl Species {
    fn qualified_gene_names(&self) -> impl Iterator<Item = String> {
        let names = self.robot.gene_names().into_iter();
        names.map(|gene| format!("{}.{gene}", self.name))
    }
}

fn check_seen(sensor: &Sensor, species: &[Species]) -> Result<(), Invalid> {
    match sensor.robots() {
        SeenRobots::Species(seen) if species.iter().all(|of| of.name != *seen) => {
            let names: Vec<_> = species.iter().map(|of| of.name.as_str()).collect();
            let allowed = format!(
                "robots, walls, obstacles, or one of the species {}",
                names.join(", ")
            );
            Err(Invalid::new("sees", text::quoted(seen.as_str()), allowed))
        }
        SeenRobots::None | SeenRobots::All | SeenRobots::Species(_) => Ok(()),
    }
}
