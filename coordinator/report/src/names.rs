//! The names of the behaviours of a report, and who gave them.

use murmuration_model::labels::{Class, GivenClass};
use std::collections::BTreeMap;

/// The classes of a campaign, and the individuals of each.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Names {
    /// The classes of the answers that stand, in the order in which they were first named.
    pub classes: Vec<Class>,
    /// The class of each individual that has one, by index: where annotators differ, the last answer.
    pub by_individual: BTreeMap<u64, GivenClass>,
}

/// Numbers of individuals that have a class, by who gave it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Named {
    /// Named by a person.
    pub(super) people: u64,
    /// Named only by the rule-based judge.
    pub(super) machine: u64,
}

impl Named {
    fn of<'a>(given: impl Iterator<Item = &'a GivenClass>) -> Self {
        let (machine, people): (Vec<_>, Vec<_>) = given.partition(|given| given.by_machine);
        Self {
            people: people.len() as u64,
            machine: machine.len() as u64,
        }
    }

    /// All of them.
    pub(super) const fn total(self) -> u64 {
        self.people + self.machine
    }
}

impl Names {
    /// The class of an individual, and its place among the classes.
    pub(super) fn of(&self, index: u64) -> Option<(usize, &Class)> {
        let given = self.by_individual.get(&index)?;
        let mut classes = self.classes.iter().enumerate();
        classes.find(|(_, class)| class.name == given.class)
    }

    /// Whether only the rule-based judge gave an individual its class.
    pub(super) fn is_by_machine(&self, index: u64) -> bool {
        self.by_individual
            .get(&index)
            .is_some_and(|given| given.by_machine)
    }

    /// How many individuals have a class.
    pub(super) fn named(&self) -> Named {
        Named::of(self.by_individual.values())
    }

    /// How many individuals are of a class.
    pub(super) fn individuals(&self, class: &Class) -> Named {
        Named::of(
            self.by_individual
                .values()
                .filter(|given| given.class == class.name),
        )
    }
}
