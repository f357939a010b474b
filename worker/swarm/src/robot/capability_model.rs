//! Capabilities of the robots of a swarm: sensors and drives.

use super::{Preset, Robot, SeenRobots, Sensor, Species, SpeciesName};
use crate::{Invalid, counted, text};
use std::{fmt, sync::Arc};

/// A capability model: the species of a swarm, and the numbers of robots that each species can have (paper, "Robot Capability
/// Models").
///
/// Robots of the first species come first. Robots move, push and look in the order of their indices. Clones share one
/// description.
#[derive(Clone)]
pub struct CapabilityModel(Arc<Described>);

#[derive(PartialEq)]
struct Described {
    species: Vec<Species>,
    /// Ratios to choose from: the number of robots of each species. Empty if all robots are of one species.
    ratios: Vec<Vec<u32>>,
    genes: usize,
    preset: Option<Preset>,
}

impl CapabilityModel {
    pub const MAX_ROBOTS: u32 = 10_000;
    pub const MAX_SPECIES: usize = 8;
    /// Maximum number of ratios to choose from.
    pub const MAX_RATIOS: usize = 1000;
    /// Name of the gene that chooses the ratio.
    pub const RATIO_GENE: &str = "ratio";

    /// A swarm of any number of robots of one kind.
    ///
    /// # Errors
    /// If a sensor sees a named species: this swarm has no named species.
    pub fn of_one(robot: Robot) -> Result<Self, Invalid> {
        for (s, sensor) in robot.sensors().iter().enumerate() {
            if let SeenRobots::Species(seen) = sensor.robots() {
                let allowed = "robots, walls or obstacles: this swarm has no species";
                return Err(Invalid::new(
                    format!("sensors[{s}].sees"),
                    text::quoted(seen.as_str()),
                    allowed,
                ));
            }
        }
        Ok(Self::alone(robot))
    }

    fn alone(robot: Robot) -> Self {
        Self(Arc::new(Described {
            genes: robot.genes(),
            preset: Preset::of(&robot),
            species: vec![Species::new(SpeciesName::of_one(), robot)],
            ratios: Vec::new(),
        }))
    }

    /// A swarm of these species. Each ratio is the number of robots of each species. If there are several ratios, a gene chooses
    /// the ratio.
    ///
    /// # Errors
    /// If there are not 1 to [`CapabilityModel::MAX_SPECIES`] species, two species have one name, or a sensor sees a species that
    /// the swarm lacks. If there are not 1 to [`CapabilityModel::MAX_RATIOS`] ratios, two ratios are equal, a ratio has no robot
    /// of some species, or the ratios' totals differ or exceed [`CapabilityModel::MAX_ROBOTS`].
    pub fn new(species: Vec<Species>, ratios: Vec<Vec<u32>>) -> Result<Self, Invalid> {
        check_species(&species)?;
        check_ratios(species.len(), &ratios)?;
        let own: usize = species.iter().map(|species| species.robot().genes()).sum();
        let genes = own + usize::from(ratios.len() > 1);
        Ok(Self(Arc::new(Described {
            species,
            ratios,
            genes,
            preset: None,
        })))
    }

    /// The species, in order: 1 to [`CapabilityModel::MAX_SPECIES`].
    #[must_use]
    pub fn species(&self) -> &[Species] {
        &self.0.species
    }

    /// Ratios to choose from: the number of robots of each species. Empty if all robots are of one species, in any number.
    #[must_use]
    pub fn ratios(&self) -> &[Vec<u32>] {
        &self.0.ratios
    }

    /// Total number of robots; `None` if any number is allowed.
    #[must_use]
    pub fn robots(&self) -> Option<u32> {
        self.0.ratios.first().map(|counts| counts.iter().sum())
    }

    /// The place in [`CapabilityModel::species`] of the species with this name.
    #[must_use]
    pub fn place(&self, name: &SpeciesName) -> Option<usize> {
        self.species().iter().position(|species| species.name() == name)
    }

    /// Radius of the largest body, world units, over 0.
    #[must_use]
    pub fn largest_radius(&self) -> f64 {
        let radii = self.species().iter().map(|species| species.robot().radius());
        radii.fold(0.0, f64::max)
    }

    /// Largest distance that a robot drives in a unit of time, world units.
    #[must_use]
    pub fn top_speed(&self) -> f64 {
        let speeds = self
            .species()
            .iter()
            .map(|species| species.robot().drive().top_speed());
        speeds.fold(0.0, f64::max)
    }

    /// The preset of all robots, if the robots are a preset and can have any number. The paper's presets match robots with bodies
    /// and wheels of any radius.
    #[must_use]
    pub fn preset(&self) -> Option<Preset> {
        self.0.preset
    }

    /// Number of genes of a controller: the genes of each species, and the ratio if there are several ratios.
    #[must_use]
    pub fn genes(&self) -> usize {
        self.0.genes
    }

    /// Names of the genes, in order, as in [`Robot::gene_names`]. With several species, each name begins with the species' name
    /// and a point (`b.left_01`). With several ratios, [`CapabilityModel::RATIO_GENE`] is last.
    #[must_use]
    pub fn gene_names(&self) -> Vec<String> {
        let mut names: Vec<_> = match self.species() {
            [alone] => alone.robot().gene_names(),
            several => several.iter().flat_map(Species::qualified_gene_names).collect(),
        };
        if self.ratios().len() > 1 {
            names.push(Self::RATIO_GENE.to_owned());
        }
        names
    }
}

impl PartialEq for CapabilityModel {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0) || self.0 == other.0
    }
}

impl From<&Self> for CapabilityModel {
    fn from(model: &Self) -> Self {
        model.clone()
    }
}

impl From<Preset> for CapabilityModel {
    fn from(preset: Preset) -> Self {
        Self::alone(preset.robot())
    }
}

impl fmt::Display for CapabilityModel {
    /// The name of a preset; otherwise `3-sensor robot`, or `swarm of a and b`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.preset(), self.species()) {
            (Some(preset), _) => preset.fmt(f),
            (None, [alone]) if self.ratios().is_empty() => {
                write!(f, "{}-sensor robot", alone.robot().sensors().len())
            }
            (None, several) => {
                let names: Vec<_> = several.iter().map(|species| species.name().as_str()).collect();
                write!(f, "swarm of {}", names.join(" and "))
            }
        }
    }
}

impl fmt::Debug for CapabilityModel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("CapabilityModel")
            .field("species", &self.0.species)
            .field("ratios", &self.0.ratios)
            .finish()
    }
}

fn check_species(species: &[Species]) -> Result<(), Invalid> {
    let most = CapabilityModel::MAX_SPECIES;
    if !(1..=most).contains(&species.len()) {
        let value = format!("{} species", species.len());
        return Err(Invalid::new("species", value, format!("1 to {most} species")));
    }
    for (i, of) in species.iter().enumerate() {
        if species[..i].iter().any(|earlier| earlier.name() == of.name()) {
            let allowed = "a name that no other species has";
            return Err(Invalid::new(format!("species[{i}].name"), of.name(), allowed));
        }
        for (s, sensor) in of.robot().sensors().iter().enumerate() {
            check_seen(sensor, species)
                .map_err(|error| error.within(&format!("species[{i}].robot.sensors[{s}]")))?;
        }
    }
    Ok(())
}

fn check_seen(sensor: &Sensor, species: &[Species]) -> Result<(), Invalid> {
    match sensor.robots() {
        SeenRobots::Species(seen) if species.iter().all(|of| of.name() != seen) => {
            let names: Vec<_> = species.iter().map(|of| of.name().as_str()).collect();
            let allowed = format!(
                "robots, walls, obstacles, or one of the species {}",
                names.join(", ")
            );
            Err(Invalid::new("sees", text::quoted(seen.as_str()), allowed))
        }
        SeenRobots::None | SeenRobots::All | SeenRobots::Species(_) => Ok(()),
    }
}

fn check_ratios(species: usize, ratios: &[Vec<u32>]) -> Result<(), Invalid> {
    let most = CapabilityModel::MAX_RATIOS;
    if !(1..=most).contains(&ratios.len()) {
        let value = counted(ratios.len() as u64, "ratio");
        return Err(Invalid::new("ratios", value, format!("1 to {most} ratios")));
    }
    let total = |counts: &[u32]| counts.iter().map(|&count| u64::from(count)).sum::<u64>();
    let robots = total(&ratios[0]);
    for (i, counts) in ratios.iter().enumerate() {
        let refused = |allowed: String| {
            Err(Invalid::new(
                format!("ratios[{i}]"),
                format!("{counts:?}"),
                allowed,
            ))
        };
        if counts.len() != species || counts.contains(&0) {
            return refused(format!(
                "{species} numbers, one for each species, each at least 1"
            ));
        }
        if total(counts) != robots {
            return refused(format!("{robots} robots in all, as in the first ratio"));
        }
        if robots > u64::from(CapabilityModel::MAX_ROBOTS) {
            return refused(format!("at most {} robots in all", CapabilityModel::MAX_ROBOTS));
        }
        if ratios[..i].contains(counts) {
            return refused("a ratio that is not given twice".to_owned());
        }
    }
    Ok(())
}
