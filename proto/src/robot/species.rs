//! Species: robots of one kind.

use super::{Robot, SpeciesName};

/// A species: robots of one kind, all with the same controller.
#[derive(Debug, Clone, PartialEq)]
pub struct Species {
    name: SpeciesName,
    robot: Robot,
}

impl Species {
    /// Robots of one kind, under a name.
    #[must_use]
    pub const fn new(name: SpeciesName, robot: Robot) -> Self {
        Self { name, robot }
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

    /// Names of its genes among those of other species: `b.left_01`.
    pub(super) fn qualified_gene_names(&self) -> impl Iterator<Item = String> {
        let names = self.robot.gene_names().into_iter();
        names.map(|gene| format!("{}.{gene}", self.name))
    }
}
