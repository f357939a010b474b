//! The names of the behaviours of a report, and who gave them.

use super::{
    Report,
    card::{CardName, Namer},
};
use murmuration_model::labels::{Class, ClassName, Colour, GivenClass};
use std::collections::BTreeMap;

/// The classes of a campaign, and the individuals of each class.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Names {
    /// The classes of the current answers, in the order in which they were first named.
    pub classes: Vec<Class>,
    /// The class of each labelled individual, by index. If annotators disagree about an individual, only the last answer counts.
    pub by_individual: BTreeMap<u64, GivenClass>,
}

/// The name that a cluster inherits from an earlier version of its taxonomy.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CarriedName {
    pub class: ClassName,
    /// The earlier version, from 1.
    pub version: u32,
    /// Index of the earlier cluster in the earlier version, from 0.
    pub place: usize,
    /// Number of members that the earlier cluster and this cluster share.
    pub shared: u64,
    /// Number of members of the earlier cluster.
    pub of: u64,
}

/// The name of a cluster.
#[derive(Debug, Clone, Copy)]
pub(super) struct ClusterName<'a> {
    pub(super) class: &'a ClassName,
    /// The colour of the class; `None` if no current answer names the class.
    pub(super) colour: Option<Colour>,
    /// The origin of a name that was not given to this medoid.
    pub(super) carried: Option<&'a CarriedName>,
    /// Whether only the rule-based judge gave the name.
    pub(super) by_machine: bool,
}

impl ClusterName<'_> {
    /// The name as the page shows it, with a remark on its origin if no person gave it to this medoid.
    pub(super) fn in_words(&self) -> String {
        let shown = self.class.shown();
        match self.namer() {
            Namer::Earlier => format!("{shown} (carried over)"),
            Namer::Judge => format!("{shown} (by the rule-based judge)"),
            Namer::Annotator => shown,
        }
    }

    pub(super) const fn namer(&self) -> Namer {
        match (self.carried, self.by_machine) {
            (Some(_), _) => Namer::Earlier,
            (None, true) => Namer::Judge,
            (None, false) => Namer::Annotator,
        }
    }
}

impl Report {
    /// The name of a cluster: the inherited name, or else the class of the medoid.
    pub(super) fn name_of(&self, place: usize) -> Option<ClusterName<'_>> {
        let medoid = self.medoids.get(place)?;
        if let Some(carried) = &medoid.carried {
            let mut known = self.names.classes.iter();
            let known = known.find(|class| class.name == carried.class);
            return Some(ClusterName {
                class: &carried.class,
                colour: known.map(|class| class.colour),
                carried: Some(carried),
                by_machine: false,
            });
        }
        self.names.of(medoid.index).map(|(_, class)| ClusterName {
            class: &class.name,
            colour: Some(class.colour),
            carried: None,
            by_machine: self.names.is_by_machine(medoid.index),
        })
    }

    /// The name of a behaviour, or else the judge's verdict on it.
    pub(super) fn card_name(&self, place: usize) -> Option<CardName> {
        let given = self.name_of(place).map(|name| CardName {
            name: name.class.shown(),
            by: name.namer(),
        });
        let verdict = self.judged.medoids.get(place);
        given.or_else(|| verdict.map(|verdict| CardName::of_verdict(*verdict, self.purity(place))))
    }
}

/// Numbers of individuals that have a class, by who gave the class.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Named {
    /// Individuals that a person named.
    pub(super) people: u64,
    /// Individuals that only the rule-based judge named.
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

    pub(super) const fn total(self) -> u64 {
        self.people + self.machine
    }
}

impl Names {
    /// The class of an individual, and its index among the classes.
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
