//! The methods that propose controllers.

use crate::Invalid;
use murmuration_proto::v1;
use std::fmt;

/// How controllers are proposed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// Uniform samples in every generation, for comparison only.
    Random,
    /// Novelty search on the five hand-crafted features (Brown et al.).
    HandCrafted,
    /// Novelty search with the embedding of the picture by a network trained without labels (the paper's method).
    Latent,
    /// Novelty search with the embedding by an untrained network, for comparison only.
    Untrained,
    /// Every controller of a finite space, or an evenly spread sample; of two mirror images, only one. Novelty is not measured.
    Exhaustive,
}

impl Method {
    pub const ALL: [Self; 5] = [
        Self::Random,
        Self::HandCrafted,
        Self::Latent,
        Self::Untrained,
        Self::Exhaustive,
    ];

    /// Name of the method in files and on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Random => "random",
            Self::HandCrafted => "hand-crafted",
            Self::Latent => "latent",
            Self::Untrained => "untrained",
            Self::Exhaustive => "exhaustive",
        }
    }

    /// Whether novelty is measured.
    #[must_use]
    pub const fn has_novelty(self) -> bool {
        !matches!(self, Self::Exhaustive)
    }

    /// The names of all methods, in their order.
    pub(crate) const NAMES: [&str; 5] = {
        let mut names = [""; 5];
        let mut place = 0;
        while place < names.len() {
            names[place] = Self::ALL[place].name();
            place += 1;
        }
        names
    };

    fn one_of() -> String {
        let names = Self::NAMES.map(|name| format!("\"{name}\""));
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
            Ok(v1::Method::Exhaustive) => Ok(Self::Exhaustive),
            Ok(v1::Method::Unspecified) => Err(Invalid::missing("method", Self::one_of())),
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
            Method::Exhaustive => Self::Exhaustive,
        }
    }
}
