//! Measures of a cell, and their figures.

use murmuration_swarm::{Class, Invalid, Pattern};
use std::{borrow::Cow, fmt, str::FromStr};

/// A measure of a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Measure {
    /// The classes of the behaviours in the cell's last taxonomies.
    Behaviours,
    /// The classes of all trials of the cell's archive, as judged by the workers.
    Shares,
    /// The accuracy of the cell's embedding on labelled sets.
    Accuracy,
    /// The loss of the cell's taxonomy, and the novelty at the end of the search.
    Search,
    /// The share of the atlas's niches and verdicts that the cell's search finds.
    Recall,
    /// The number of behaviours, estimated from how often the cell's search met each behaviour.
    Richness,
    /// Maps of the cell's controllers and behaviours; maps are pictures, not figures.
    Maps,
}

impl Measure {
    pub const ALL: [Self; 7] = [
        Self::Behaviours,
        Self::Shares,
        Self::Accuracy,
        Self::Search,
        Self::Recall,
        Self::Richness,
        Self::Maps,
    ];

    pub const fn name(self) -> &'static str {
        match self {
            Self::Behaviours => "behaviours",
            Self::Shares => "shares",
            Self::Accuracy => "accuracy",
            Self::Search => "search",
            Self::Recall => "recall",
            Self::Richness => "richness",
            Self::Maps => "maps",
        }
    }

    pub const fn title(self) -> &'static str {
        match self {
            Self::Behaviours => "Behaviours discovered",
            Self::Shares => "Shares of all trials",
            Self::Accuracy => "Embedding accuracy",
            Self::Search => "Search",
            Self::Recall => "Recall",
            Self::Richness => "How many behaviours there are",
            Self::Maps => "Maps",
        }
    }

    /// The figures of the measure, in the order of the columns of its table.
    pub fn figures(self) -> Vec<Figure> {
        match self {
            Self::Behaviours => {
                let classes = Class::ALL.map(Figure::Class);
                let distinct = [Figure::Distinct, Figure::DistinctBySecond, Figure::DistinctByBoth];
                distinct.into_iter().chain(classes).collect()
            }
            // The class `random` comes first, because the paper reports most about it.
            Self::Shares => {
                let classes = Class::ALL.into_iter().filter(|class| *class != Class::Random);
                let classes = [Class::Random].into_iter().chain(classes).map(Figure::Share);
                classes
                    .chain(Pattern::OF_ONE_SPECIES.map(Figure::PatternShare))
                    .collect()
            }
            Self::Accuracy => vec![Figure::Accuracy, Figure::AccuracyOfEveryAnchor],
            Self::Search => vec![Figure::Loss, Figure::Novelty],
            Self::Recall => {
                let classes = Class::ALL.map(Figure::Reached);
                let of_all = [Figure::NichesReached, Figure::VerdictsFound];
                of_all.into_iter().chain(classes).collect()
            }
            Self::Richness => vec![
                Figure::NichesSeen,
                Figure::NichesChao1,
                Figure::NichesAce,
                Figure::VerdictsSeen,
                Figure::VerdictsChao1,
                Figure::VerdictsAce,
            ],
            Self::Maps => Vec::new(),
        }
    }
}

impl FromStr for Measure {
    type Err = Invalid;

    fn from_str(name: &str) -> Result<Self, Invalid> {
        let found = Self::ALL.into_iter().find(|measure| measure.name() == name);
        found.ok_or_else(|| {
            let names = Self::ALL.map(Self::name).join(", ");
            Invalid::new("measures", format!("\"{name}\""), format!("some of {names}"))
        })
    }
}

/// A figure of a cell: one column of a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Figure {
    /// Distinct classes among the medoids, the mean over the last taxonomies.
    Distinct,
    /// Distinct classes that the second judge gives, the mean over the last taxonomies.
    DistinctBySecond,
    /// Distinct classes of the medoids about which both judges agree (or a person and the second judge), the mean over the last
    /// taxonomies.
    DistinctByBoth,
    /// Medoids of a class, the mean over the last taxonomies.
    Class(Class),
    /// Percentage of all trials that are of a class.
    Share(Class),
    /// Percentage of all trials that have a pattern. These trials are of the class `random` too.
    PatternShare(Pattern),
    /// Correct triplets, in percent of the triplets whose anchor is not `random`.
    Accuracy,
    /// Correct triplets, in percent of all triplets.
    AccuracyOfEveryAnchor,
    /// Sum over the archive of the distance to the nearest medoid, units of the behaviour space.
    Loss,
    /// Mean novelty of the last generation when it was evaluated, units of the behaviour space.
    Novelty,
    /// Niches of the reference that were reached, percent.
    NichesReached,
    /// Classes and patterns of the reference that were found, percent.
    VerdictsFound,
    /// Niches of a class that were reached, percent.
    Reached(Class),
    /// Niches of the reference that were met.
    NichesSeen,
    /// Number of niches, estimated by Chao1.
    NichesChao1,
    /// Number of niches, estimated by ACE.
    NichesAce,
    /// Classes and patterns that were met.
    VerdictsSeen,
    /// Number of classes and patterns, estimated by Chao1.
    VerdictsChao1,
    /// Number of classes and patterns, estimated by ACE.
    VerdictsAce,
}

impl Figure {
    /// Name in study files and tables.
    pub fn name(self) -> Cow<'static, str> {
        Cow::Borrowed(match self {
            Self::Distinct => "distinct",
            Self::DistinctBySecond => "distinct_by_second_judge",
            Self::DistinctByBoth => "distinct_by_both_judges",
            Self::Class(class) => class.name(),
            Self::Share(class) => return format!("share_{class}").into(),
            Self::PatternShare(pattern) => return format!("share_{pattern}").into(),
            Self::Reached(class) => return format!("reached_{class}").into(),
            Self::Accuracy => "accuracy",
            Self::AccuracyOfEveryAnchor => "accuracy_of_every_anchor",
            Self::Loss => "loss",
            Self::Novelty => "novelty",
            Self::NichesReached => "niches_reached",
            Self::VerdictsFound => "verdicts_found",
            Self::NichesSeen => "niches_seen",
            Self::NichesChao1 => "niches_chao1",
            Self::NichesAce => "niches_ace",
            Self::VerdictsSeen => "verdicts_seen",
            Self::VerdictsChao1 => "verdicts_chao1",
            Self::VerdictsAce => "verdicts_ace",
        })
    }

    pub fn all() -> impl Iterator<Item = Self> {
        Measure::ALL.into_iter().flat_map(Measure::figures)
    }

    /// Decimals that tables and pages show.
    pub const fn decimals(self) -> usize {
        match self {
            Self::Distinct
            | Self::DistinctBySecond
            | Self::DistinctByBoth
            | Self::Class(_)
            | Self::Accuracy
            | Self::AccuracyOfEveryAnchor
            | Self::Loss => 2,
            Self::Novelty => 4,
            Self::NichesReached
            | Self::VerdictsFound
            | Self::Reached(_)
            | Self::NichesSeen
            | Self::NichesChao1
            | Self::NichesAce
            | Self::VerdictsSeen
            | Self::VerdictsChao1
            | Self::VerdictsAce
            | Self::Share(_)
            | Self::PatternShare(_) => 1,
        }
    }
}

impl fmt::Display for Figure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Distinct => f.pad("distinct behaviours"),
            Self::DistinctBySecond => f.pad("distinct, second judge"),
            Self::DistinctByBoth => f.pad("distinct, both judges"),
            Self::AccuracyOfEveryAnchor => f.pad("accuracy, every anchor"),
            Self::Novelty => f.pad("mean novelty"),
            Self::Share(class) => f.pad(&format!("{}, %", class.words())),
            Self::PatternShare(pattern) => f.pad(&format!("{}, %", pattern.words())),
            Self::NichesReached => f.pad("niches reached, %"),
            Self::VerdictsFound => f.pad("classes and patterns found, %"),
            Self::Reached(class) => f.pad(&format!("{}, %", class.words())),
            Self::NichesSeen => f.pad("niches met"),
            Self::NichesChao1 => f.pad("niches, Chao1"),
            Self::NichesAce => f.pad("niches, ACE"),
            Self::VerdictsSeen => f.pad("classes and patterns met"),
            Self::VerdictsChao1 => f.pad("classes and patterns, Chao1"),
            Self::VerdictsAce => f.pad("classes and patterns, ACE"),
            other => f.pad(&other.name().replace('_', " ")),
        }
    }
}

impl FromStr for Figure {
    type Err = Invalid;

    fn from_str(name: &str) -> Result<Self, Invalid> {
        Self::all().find(|figure| figure.name() == name).ok_or_else(|| {
            let names: Vec<_> = Self::all().map(Self::name).collect();
            Invalid::new(
                "figures",
                format!("\"{name}\""),
                format!("one of {}", names.join(", ")),
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn names_are_different_and_read_back() {
        let names: BTreeSet<_> = Figure::all().map(Figure::name).collect();
        assert_eq!(names.len(), Figure::all().count());
        for figure in Figure::all() {
            assert_eq!(figure.name().parse(), Ok(figure));
        }
    }
}
