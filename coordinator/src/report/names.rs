//! What people called the behaviours of a report.

use crate::labels::{Class, ClassName};
use std::collections::BTreeMap;

/// The classes of a campaign, and which individuals are of them.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Names {
    /// The classes that a standing answer names, in the order in which they were first named.
    pub classes: Vec<Class>,
    /// The class of each individual that has one, by index: where annotators differ, what was said last.
    pub by_individual: BTreeMap<u64, ClassName>,
}

impl Names {
    /// The class of an individual, and its place among the classes.
    pub(super) fn of(&self, index: u64) -> Option<(usize, &Class)> {
        let name = self.by_individual.get(&index)?;
        let mut classes = self.classes.iter().enumerate();
        classes.find(|(_, class)| class.name == *name)
    }

    /// How many individuals are of a class.
    pub(super) fn individuals(&self, class: &Class) -> usize {
        self.by_individual
            .values()
            .filter(|name| **name == class.name)
            .count()
    }
}
