//! A behaviour to ask about, and why.

use murmuration_proto::counted;
use std::fmt;

/// Why a behaviour is asked about, in words for whoever is asked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reason {
    /// At random.
    Random,
    /// It stands for a cluster.
    Medoid {
        /// The cluster, from 1, the largest first.
        cluster: usize,
        /// How many behaviours it has.
        size: usize,
    },
    /// It is nearly as far from the medoid of its own cluster as from that of another.
    Uncertain {
        /// Its cluster, from 1.
        cluster: usize,
        /// The other; `None` where there is but one cluster.
        other: Option<usize>,
    },
    /// The window asked for it, for instance because its answer was undone.
    Again,
}

/// A behaviour to ask about.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Query {
    /// Its index in the archive.
    pub index: usize,
    /// Why.
    pub reason: Reason,
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Random => f.write_str("drawn at random"),
            Self::Medoid { cluster, size: 1 } => write!(f, "the only behaviour of cluster {cluster}"),
            Self::Medoid { cluster, size } => {
                write!(
                    f,
                    "medoid of cluster {cluster}; its name stands for {}",
                    counted(*size as u64, "behaviour")
                )
            }
            Self::Uncertain {
                cluster,
                other: Some(other),
            } => write!(f, "between cluster {cluster} and cluster {other}"),
            Self::Uncertain { cluster, other: None } => write!(f, "in cluster {cluster}"),
            Self::Again => f.write_str("to be answered again"),
        }
    }
}
