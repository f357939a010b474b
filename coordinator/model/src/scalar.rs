//! Scalars of campaigns: numbers by which people compare campaigns in a list.

use murmuration_swarm::{Invalid, text::quoted};
use std::str::FromStr;

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Scalar {
    /// Individuals of complete generations.
    Evaluations,
    /// Complete generations.
    Generations,
    /// Best novelty of the last complete generation.
    BestNovelty,
    /// Mean novelty of the last complete generation.
    MeanNovelty,
    /// Clusters of the current taxonomy.
    Clusters,
    /// Entries of the label log.
    LabelEntries,
    /// Mean loss of the last epoch of the last training.
    Loss,
    /// Accuracy on held-out triplets after the last epoch of the last training, from 0 to 1.
    Accuracy,
    /// Time from the creation of the campaign until it ended or was paused, or until now if it is running, milliseconds. A campaign
    /// that was imported has none until it runs.
    Duration,
}

impl Scalar {
    pub const ALL: [Self; 9] = [
        Self::Evaluations,
        Self::Generations,
        Self::BestNovelty,
        Self::MeanNovelty,
        Self::Clusters,
        Self::LabelEntries,
        Self::Loss,
        Self::Accuracy,
        Self::Duration,
    ];

    /// The name in addresses.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Evaluations => "evaluations",
            Self::Generations => "generations",
            Self::BestNovelty => "best-novelty",
            Self::MeanNovelty => "mean-novelty",
            Self::Clusters => "clusters",
            Self::LabelEntries => "label-entries",
            Self::Loss => "loss",
            Self::Accuracy => "accuracy",
            Self::Duration => "duration",
        }
    }

    /// The name on pages.
    pub fn title(self) -> String {
        self.name().replace('-', " ")
    }
}

impl FromStr for Scalar {
    type Err = Invalid;

    fn from_str(text: &str) -> Result<Self, Invalid> {
        let known = Self::ALL.into_iter().find(|scalar| scalar.name() == text);
        known.ok_or_else(|| {
            let names = Self::ALL.map(Self::name).join(", ");
            Invalid::new("scalar", quoted(text), format!("one of {names}"))
        })
    }
}
