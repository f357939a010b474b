//! Species: robots of one kind, and their names.

use super::Robot;
use crate::{Invalid, text};
use std::fmt;

/// A species: robots of one kind, all with the same controller.
#[derive(Debug, Clone, PartialEq)]
pub struct Species {
    name: SpeciesName,
    robot: Robot,
}

impl Species {
    /// Robots of one kind, with a name.
    #[must_use]
    pub const fn new(name: SpeciesName, robot: Robot) -> Self {
        Self { name, robot }
    }

    #[must_use]
    pub const fn name(&self) -> &SpeciesName {
        &self.name
    }

    #[must_use]
    pub const fn robot(&self) -> &Robot {
        &self.robot
    }

    /// Names of the species' genes, each after the species' name: `b.left_01`.
    pub(super) fn qualified_gene_names(&self) -> impl Iterator<Item = String> {
        let names = self.robot.gene_names().into_iter();
        names.map(|gene| format!("{}.{gene}", self.name))
    }
}

/// The name of a species: 1 to 32 letters (of English), digits, `-` and `_`, beginning with a letter. `all`, `robots`, `walls`
/// and `obstacles` are not allowed, because they name what a sensor sees.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct SpeciesName(String);

impl SpeciesName {
    const MAX_CHARS: usize = 32;
    const RESERVED: [&str; 4] = ["all", "robots", "walls", "obstacles"];

    /// The name of the only species of a swarm, which is shown nowhere.
    pub(super) fn of_one() -> Self {
        Self("robot".to_owned())
    }

    /// Checks a name.
    ///
    /// # Errors
    /// The error names `field` if the name is not allowed.
    pub fn parse(field: &str, name: &str) -> Result<Self, Invalid> {
        let inner = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_');
        let fits = name.starts_with(|c: char| c.is_ascii_alphabetic())
            && name.len() <= Self::MAX_CHARS
            && name.chars().all(inner);
        if fits && !Self::RESERVED.contains(&name) {
            return Ok(Self(name.to_owned()));
        }
        let allowed = format!(
            "1 to {} letters, digits, - and _, beginning with a letter, and not one of {}",
            Self::MAX_CHARS,
            Self::RESERVED.join(", ")
        );
        Err(Invalid::new(field, text::quoted(name), allowed))
    }

    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for SpeciesName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}
