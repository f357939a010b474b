//! What is asked.

use murmuration_proto::Strategy;
use std::fmt;

/// What is asked, and how it is chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Questions {
    /// For the class of a behaviour.
    Names(Strategy),
    /// Which of two behaviours is more like a third; the embedder is unsure about it.
    Comparisons,
}

impl Questions {
    /// Everything that can be asked.
    pub const ALL: [Self; 3] = [
        Self::Names(Strategy::Random),
        Self::Names(Strategy::Medoids),
        Self::Comparisons,
    ];

    /// What is asked: `names` or `comparisons`.
    #[must_use]
    pub const fn kind(self) -> &'static str {
        match self {
            Self::Names(_) => "names",
            Self::Comparisons => "comparisons",
        }
    }

    /// How it is chosen: the name of the strategy, or `unsure`.
    #[must_use]
    pub const fn choice(self) -> &'static str {
        match self {
            Self::Names(strategy) => strategy.name(),
            Self::Comparisons => "unsure",
        }
    }
}

impl fmt::Display for Questions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Names(strategy) => write!(f, "names, {strategy}"),
            Self::Comparisons => f.write_str("comparisons"),
        }
    }
}
