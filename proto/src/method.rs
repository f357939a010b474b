//! How controllers are proposed, and what novelty is measured on.

use crate::{Features, Invalid, v1};
use std::fmt;

/// How controllers are proposed, and what novelty is measured on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// Uniform samples in every generation; novelty on the hand-crafted features, for comparison only.
    Random,
    /// Novelty search on the five hand-crafted features (Brown et al.).
    HandCrafted,
    /// Novelty search on the embedding of the picture by a network trained without labels (the paper's method).
    Latent,
    /// Novelty search on the embedding by an untrained network, for comparison only.
    Untrained,
    /// Novelty search on the embedding followed by the hand-crafted features.
    Concatenate,
    /// Every controller of a space of finitely many, mirror images once, or an evenly spread sample; no novelty.
    Exhaustive,
}

impl Method {
    /// Every method.
    pub const ALL: [Self; 6] = [
        Self::Random,
        Self::HandCrafted,
        Self::Latent,
        Self::Untrained,
        Self::Concatenate,
        Self::Exhaustive,
    ];

    /// Its name in files and on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Random => "random",
            Self::HandCrafted => "hand-crafted",
            Self::Latent => "latent",
            Self::Untrained => "untrained",
            Self::Concatenate => "concatenate",
            Self::Exhaustive => "exhaustive",
        }
    }

    /// Whether the behaviour space includes the embedding.
    #[must_use]
    pub const fn embeds(self) -> bool {
        matches!(self, Self::Latent | Self::Untrained | Self::Concatenate)
    }

    /// Whether the behaviour space includes the hand-crafted features.
    #[must_use]
    pub const fn has_features(self) -> bool {
        matches!(
            self,
            Self::Random | Self::HandCrafted | Self::Concatenate | Self::Exhaustive
        )
    }

    /// Whether novelty is measured, and children are bred by it.
    #[must_use]
    pub const fn has_novelty(self) -> bool {
        !matches!(self, Self::Exhaustive)
    }

    /// The behaviour vector of an individual: its embedding, its features, or one after the other.
    #[must_use]
    pub fn behaviour(self, features: &Features, embedding: &[f32]) -> Vec<f64> {
        let embedding = embedding.iter().map(|&value| f64::from(value));
        let embedding = embedding.filter(|_| self.embeds());
        let features = features.iter().copied().filter(|_| self.has_features());
        embedding.chain(features).collect()
    }

    fn one_of() -> String {
        let names = Self::ALL.map(|method| format!("\"{}\"", method.name()));
        names.join(" or ")
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl std::str::FromStr for Method {
    type Err = Invalid;

    fn from_str(name: &str) -> Result<Self, Invalid> {
        Self::ALL
            .into_iter()
            .find(|method| method.name() == name)
            .ok_or_else(|| Invalid::new("method", format!("\"{name}\""), Self::one_of()))
    }
}

impl TryFrom<i32> for Method {
    type Error = Invalid;

    /// Converts the value of an enum field of a message.
    fn try_from(number: i32) -> Result<Self, Invalid> {
        match v1::Method::try_from(number) {
            Ok(v1::Method::Random) => Ok(Self::Random),
            Ok(v1::Method::HandCrafted) => Ok(Self::HandCrafted),
            Ok(v1::Method::Latent) => Ok(Self::Latent),
            Ok(v1::Method::Untrained) => Ok(Self::Untrained),
            Ok(v1::Method::Concatenate) => Ok(Self::Concatenate),
            Ok(v1::Method::Exhaustive) => Ok(Self::Exhaustive),
            Ok(v1::Method::Unspecified) => Err(Invalid::new("method", "nothing", Self::one_of())),
            Err(_) => Err(Invalid::new("method", number, Self::one_of())),
        }
    }
}

impl From<Method> for v1::Method {
    fn from(method: Method) -> Self {
        match method {
            Method::Random => Self::Random,
            Method::HandCrafted => Self::HandCrafted,
            Method::Latent => Self::Latent,
            Method::Untrained => Self::Untrained,
            Method::Concatenate => Self::Concatenate,
            Method::Exhaustive => Self::Exhaustive,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_behaviour_is_what_its_method_looks_at() {
        let behaviour = |method: Method| method.behaviour(&[1.0, 2.0, 3.0, 4.0, 5.0], &[0.5, -0.5]);
        assert_eq!(behaviour(Method::Random), [1.0, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(behaviour(Method::Untrained), [0.5, -0.5]);
        assert_eq!(
            behaviour(Method::Concatenate),
            [0.5, -0.5, 1.0, 2.0, 3.0, 4.0, 5.0]
        );
    }
}
