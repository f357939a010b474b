//! Purity: how well a medoid represents its cluster.

use crate::{Judged, Report};
use murmuration_model::labels::GivenClass;
use murmuration_swarm::counted;
use std::collections::BTreeMap;

/// How many members of a cluster are of the class of its medoid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Purity {
    pub alike: usize,
    /// Members whose class is known, without the medoid; at least 1.
    pub known: usize,
    /// Whether the classes come from labels; otherwise they come from the rule-based judge.
    pub by_labels: bool,
}

impl Purity {
    /// How well the individual `medoid` represents the cluster at `place`; `None` if no other member of the cluster has a known
    /// class. `clusters` has for each individual the place of its medoid; `given` has the classes of labelled individuals.
    pub fn of_cluster(
        place: usize,
        medoid: u64,
        clusters: &[u32],
        given: &BTreeMap<u64, GivenClass>,
        judged: &Judged,
    ) -> Option<Self> {
        let is_other = |other: u64| {
            let cluster = clusters.get(other as usize);
            other != medoid && cluster.is_some_and(|cluster| *cluster as usize == place)
        };
        let labelled = given.get(&medoid).and_then(|own| {
            let others = given.iter().filter(|(other, _)| is_other(**other));
            Self::of(others.map(|(_, given)| given.class == own.class), true)
        });
        labelled.or_else(|| {
            let verdict = *judged.medoids.get(place)?;
            // The judge's verdicts say nothing about a class that the judge does not give to the medoid.
            if given
                .get(&medoid)
                .is_some_and(|own| own.class.key().as_str() != verdict.name())
            {
                return None;
            }
            let others = judged.sample.iter().filter(|(other, _)| is_other(*other));
            Self::of(others.map(|(_, other)| *other == verdict), false)
        })
    }

    /// Whether so few members are of the medoid's class that its name does not name the cluster: less than a third of five or more.
    #[must_use]
    pub const fn is_low(self) -> bool {
        self.known >= 5 && 3 * self.alike < self.known
    }

    /// The explanation that a pointer shows.
    #[must_use]
    pub fn in_words(self) -> String {
        let others = counted(self.known as u64, "other member");
        match self.by_labels {
            true => format!(
                "{others} of the cluster with a label, of which {} with that of this behaviour",
                self.alike
            ),
            false => format!(
                "{others} of the cluster that the rule-based judge looked at, of which {} with its verdict on this behaviour",
                self.alike
            ),
        }
    }

    /// The purity from one value for each member: whether the member is of the medoid's class. `None` if there are no members.
    fn of(alike: impl Iterator<Item = bool>, by_labels: bool) -> Option<Self> {
        let alike: Vec<bool> = alike.collect();
        (!alike.is_empty()).then(|| Self {
            alike: alike.iter().filter(|alike| **alike).count(),
            known: alike.len(),
            by_labels,
        })
    }
}

impl Report {
    /// See [`Purity::of_cluster`].
    pub(crate) fn purity(&self, place: usize) -> Option<Purity> {
        let medoid = self.medoids.get(place)?.index;
        Purity::of_cluster(
            place,
            medoid,
            &self.clusters,
            &self.names.by_individual,
            &self.judged,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        Report,
        sample::{self, SMALL},
    };
    use murmuration_swarm::{Class, Verdict};

    #[test]
    fn the_purity_of_a_cluster_is_that_of_its_labels_or_else_of_the_sample() {
        let mut report = sample::report(&SMALL);
        let members = |place: u32| {
            let members = (0_u64..).zip(&report.clusters);
            let medoid = report.medoids[place as usize].index;
            members
                .filter(move |(index, cluster)| **cluster == place && *index != medoid)
                .map(|(index, _)| index)
                .collect::<Vec<_>>()
        };
        let (first, second) = (members(0), members(1));
        let [milling, chain] = [Class::Milling, Class::Random].map(Verdict::Class);
        report.names = crate::Names::default();
        report.judged.medoids = vec![milling; 3];
        report.judged.sample = vec![
            (first[0], milling),
            (first[1], chain),
            (second[0], milling),
            // The medoid itself does not count as a member.
            (report.medoids[0].index, milling),
        ];
        let of = |report: &Report, place| {
            let purity = report.purity(place);
            purity.map(|purity| (purity.alike, purity.known, purity.by_labels))
        };
        assert_eq!(of(&report, 0), Some((1, 2, false)));
        assert_eq!(of(&report, 1), Some((1, 1, false)));
        assert_eq!(of(&report, 2), None);

        // Labels of the medoid and of another member take precedence over the judge.
        let label = |class: &str| GivenClass {
            class: class.parse().unwrap(),
            by_machine: false,
        };
        report.names = sample::report(&SMALL).names;
        let medoid = report.medoids[0].index;
        report.names.by_individual = [
            (medoid, "wall"),
            (first[0], "wall"),
            (first[1], "ring"),
            (second[0], "wall"),
        ]
        .map(|(index, class)| (index, label(class)))
        .into();
        assert_eq!(of(&report, 0), Some((1, 2, true)));
        report.names.by_individual.retain(|index, _| *index == medoid);
        assert_eq!(of(&report, 0), None, "the judge has no class `wall`");
        let milling = GivenClass {
            class: "milling".parse().unwrap(),
            by_machine: false,
        };
        report.names.by_individual.insert(medoid, milling);
        assert_eq!(of(&report, 0), Some((1, 2, false)));
    }
}
