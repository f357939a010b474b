//! Documents about swarms that a camera tracked.

use base64::{Engine as _, engine::general_purpose::STANDARD};
use murmuration_proto::{Evaluation, v1};
use schemars::JsonSchema;
use serde::Serialize;

/// A tracked swarm, and what in a campaign is like it.
#[derive(Debug, Serialize, JsonSchema)]
pub(in crate::cli) struct Recognised {
    /// Id of the campaign.
    pub(in crate::cli) campaign: String,
    /// Robots that were tracked.
    pub(in crate::cli) robots: u32,
    /// The first and the last frame.
    pub(in crate::cli) frames: [u32; 2],
    /// Rows that are missing, of one for each robot in each frame.
    pub(in crate::cli) missing: u64,
    /// Share of the rows that have a heading, 0 to 1; in the others a robot is taken to look where it moves.
    pub(in crate::cli) share_of_headings: f64,
    /// Time from one frame to the next, in units of the world's time.
    pub(in crate::cli) frame_time: f64,
    /// World units to a unit of the tracks.
    pub(in crate::cli) scale: f64,
    /// Steps at the end of the tracks that the picture is of.
    pub(in crate::cli) steps: u64,
    #[serde(flatten)]
    pub(in crate::cli) behaviour: Behaviour,
    /// The nearest individuals, nearest first.
    pub(in crate::cli) nearest: Vec<Neighbour>,
    /// The nearest individual that has a class; null if none has.
    pub(in crate::cli) nearest_labelled: Option<Neighbour>,
    /// The nearest medoid.
    pub(in crate::cli) medoid: Option<Neighbour>,
    /// Mean distance of the members of the nearest medoid's cluster to the medoid, in units of the behaviour space.
    pub(in crate::cli) mean_distance: f64,
    /// Whether the clusters are those of a taxonomy. Otherwise they are what they would be if the search ended now.
    pub(in crate::cli) is_taxonomy: bool,
}

/// What a swarm did.
#[derive(Debug, Serialize, JsonSchema)]
pub(in crate::cli) struct Behaviour {
    /// Average speed, angular momentum, radial variance, scatter, group rotation.
    features: Vec<f64>,
    /// Embedding by the campaign's checkpoint; empty if there is none.
    embedding: Vec<f64>,
    /// Grey values of the picture, base64, column by column.
    image: String,
}

/// An individual near a behaviour.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(inline)]
pub(in crate::cli) struct Neighbour {
    /// Place in the archive, from 0.
    index: u64,
    /// Distance from the behaviour, in units of the behaviour space.
    distance: f64,
    /// Its cluster, from 1.
    cluster: u32,
    /// Its class; null if it has none.
    class: Option<String>,
}

impl From<&Evaluation> for Behaviour {
    fn from(evaluation: &Evaluation) -> Self {
        Self {
            features: evaluation.features().to_vec(),
            embedding: evaluation.embedding().iter().copied().map(f64::from).collect(),
            image: STANDARD.encode(evaluation.image()),
        }
    }
}

impl From<&v1::Neighbour> for Neighbour {
    fn from(neighbour: &v1::Neighbour) -> Self {
        Self {
            index: neighbour.index,
            distance: neighbour.distance,
            cluster: neighbour.cluster + 1,
            class: Some(neighbour.class.clone()).filter(|class| !class.is_empty()),
        }
    }
}
