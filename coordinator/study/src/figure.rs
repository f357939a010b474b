//! What is measured of a cell, and the figures that come of it.

use murmuration_proto::Class;
use murmuration_proto::Invalid;
use std::{fmt, str::FromStr};

/// What is measured of a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Measure {
    /// The classes of the behaviours that its last taxonomies consist of.
    Behaviours,
    /// The accuracy of its embedding on labelled sets.
    Accuracy,
    /// How its search and its taxonomy ended.
    Search,
}

impl Measure {
    /// Every measure.
    pub const ALL: [Self; 3] = [Self::Behaviours, Self::Accuracy, Self::Search];

    /// Its name in study files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Behaviours => "behaviours",
            Self::Accuracy => "accuracy",
            Self::Search => "search",
        }
    }

    /// The title of its table.
    #[must_use]
    pub const fn title(self) -> &'static str {
        match self {
            Self::Behaviours => "Behaviours discovered",
            Self::Accuracy => "Embedding accuracy",
            Self::Search => "Search",
        }
    }

    /// Its figures, in the order of the columns of its table.
    #[must_use]
    pub fn figures(self) -> Vec<Figure> {
        match self {
            Self::Behaviours => {
                let classes = Class::ALL.map(Figure::Class);
                [Figure::Distinct].into_iter().chain(classes).collect()
            }
            Self::Accuracy => vec![Figure::Accuracy, Figure::AccuracyOfEveryAnchor],
            Self::Search => vec![Figure::Loss, Figure::Novelty],
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

/// A number that a cell has: a column of a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Figure {
    /// Distinct classes among the medoids, the mean over the last taxonomies.
    Distinct,
    /// Medoids of a class, the mean over the last taxonomies.
    Class(Class),
    /// Percentage of correct triplets whose anchor is not `random`.
    Accuracy,
    /// Percentage of correct triplets.
    AccuracyOfEveryAnchor,
    /// Sum over the archive of the distance to the nearest medoid, units of the behaviour space.
    Loss,
    /// Mean novelty of the last generation when it was evaluated, units of the behaviour space.
    Novelty,
}

impl Figure {
    /// Its name in study files and tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Distinct => "distinct",
            Self::Class(class) => class.name(),
            Self::Accuracy => "accuracy",
            Self::AccuracyOfEveryAnchor => "accuracy_of_every_anchor",
            Self::Loss => "loss",
            Self::Novelty => "novelty",
        }
    }

    /// Every figure.
    pub fn all() -> impl Iterator<Item = Self> {
        Measure::ALL.into_iter().flat_map(Measure::figures)
    }

    /// Decimals that it is shown with.
    #[must_use]
    pub const fn decimals(self) -> usize {
        match self {
            Self::Distinct | Self::Class(_) | Self::Accuracy | Self::AccuracyOfEveryAnchor | Self::Loss => 2,
            Self::Novelty => 4,
        }
    }
}

impl fmt::Display for Figure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Distinct => f.pad("distinct behaviours"),
            Self::AccuracyOfEveryAnchor => f.pad("accuracy, every anchor"),
            Self::Novelty => f.pad("mean novelty"),
            other => f.pad(&other.name().replace('_', " ")),
        }
    }
}

impl FromStr for Figure {
    type Err = Invalid;

    fn from_str(name: &str) -> Result<Self, Invalid> {
        Self::all().find(|figure| figure.name() == name).ok_or_else(|| {
            let names: Vec<&str> = Self::all().map(Self::name).collect();
            Invalid::new(
                "figures",
                format!("\"{name}\""),
                format!("one of {}", names.join(", ")),
            )
        })
    }
}
