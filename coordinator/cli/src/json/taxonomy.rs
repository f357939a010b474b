//! The clusters of a campaign.

use murmuration_proto::v1;
use schemars::JsonSchema;
use serde::Serialize;

/// The taxonomy of a completed campaign.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct Taxonomy {
    /// Id of the campaign.
    campaign: String,
    /// Its clusters, largest first.
    clusters: Vec<Cluster>,
    /// Sum of the distances of all individuals to their nearest medoids, in units of the behaviour space.
    loss: f64,
}

/// A cluster.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(inline)]
struct Cluster {
    /// Its number, from 1.
    cluster: u64,
    /// Place of its medoid in the archive, from 0.
    medoid: u64,
    /// Individuals in it, the medoid included.
    individuals: u64,
    /// Mean distance of its individuals to the medoid, in units of the behaviour space.
    mean_distance: f64,
    /// Mean distance of the medoid to its nearest neighbours in the whole archive, in units of the behaviour space.
    novelty: f64,
    /// What it is called; null if it has no name.
    name: Option<ClusterName>,
}

/// The name of a cluster.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(inline)]
struct ClusterName {
    /// The class.
    class: String,
    /// Whether nobody but the rule-based judge gave it to the medoid.
    by_machine: bool,
    /// The cluster of an earlier version of the taxonomy that it was carried over from; null if it was given to the medoid.
    carried_from: Option<CarriedFrom>,
}

/// A cluster of an earlier version.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(inline)]
struct CarriedFrom {
    /// The version, from 1.
    version: u32,
    /// Number of the cluster in that version, from 1.
    cluster: u64,
    /// Its individuals that are in the cluster with the name now.
    shared: u64,
    /// All its individuals.
    individuals: u64,
}

impl Taxonomy {
    pub(crate) fn new(campaign: &str, taxonomy: &v1::Taxonomy) -> Self {
        let medoids = taxonomy.medoids.iter().zip(1..);
        Self {
            campaign: campaign.to_owned(),
            clusters: medoids
                .map(|(medoid, number)| Cluster::new(number, medoid))
                .collect(),
            loss: taxonomy.loss,
        }
    }
}

impl Cluster {
    fn new(number: u64, medoid: &v1::Medoid) -> Self {
        Self {
            cluster: number,
            medoid: medoid
                .individual
                .as_ref()
                .map_or(0, |individual| individual.index),
            individuals: medoid.cluster_size,
            mean_distance: medoid.mean_distance,
            novelty: medoid.novelty,
            name: medoid.name.as_ref().map(ClusterName::from),
        }
    }
}

impl From<&v1::ClusterName> for ClusterName {
    fn from(name: &v1::ClusterName) -> Self {
        Self {
            class: name.name.clone(),
            by_machine: name.by_machine,
            carried_from: name.carried.as_ref().map(|from| CarriedFrom {
                version: from.version,
                cluster: u64::from(from.cluster) + 1,
                shared: from.shared,
                individuals: from.members,
            }),
        }
    }
}
