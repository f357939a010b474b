//! Conversions of campaigns and taxonomies to their messages.

use crate::{
    campaign::CampaignStatus,
    nearest::{Nearest, Neighbour},
    taxonomy::{ClusterName, Medoid, Names, Origin, Taxonomy},
};
use murmuration_model::{Stage, TimeLeft};
use murmuration_proto::{PART_BYTES, parts::parts, v1};
use murmuration_store::Notice;
use murmuration_swarm::CheckpointDigest;

impl From<CampaignStatus> for v1::Campaign {
    fn from(status: CampaignStatus) -> Self {
        let (progress, time_left) = (status.progress(), status.time_left());
        let record = status.record;
        let (generations, dataset_done) = (record.generations(), record.dataset_done());
        let (evaluated, evaluations) = (record.individuals(), record.evaluations());
        // A campaign whose method has no novelty stores a novelty of 0.
        let measures_novelty = record.spec.has_novelty();
        let last_novelty = record.last_novelty.filter(|_| measures_novelty);
        let arrived = |stage| if status.stage == stage { status.arrived } else { 0 };
        let digest = |checkpoint: Option<CheckpointDigest>| {
            checkpoint.map(|digest| digest.to_string()).unwrap_or_default()
        };
        Self {
            id: record.id.as_str().to_owned(),
            spec: Some((&record.spec).into()),
            state: v1::CampaignState::from(record.state) as i32,
            error: record.error,
            created_ms: record.created_ms,
            weight: record.weight.get(),
            generations_done: record.generations_done,
            evaluated_in_generation: arrived(Stage::Evolve),
            evaluations_per_second: status.per_second,
            best_novelty: last_novelty.map(|(best, _)| best),
            mean_novelty: last_novelty.map(|(_, mean)| mean),
            active: status.active,
            workers: status.workers as u32,
            stage: v1::CampaignStage::from(status.stage) as i32,
            dataset_done: dataset_done + u64::from(arrived(Stage::Dataset)),
            training: status.training,
            checkpoint: digest(record.embedder.checkpoint()),
            next_checkpoint: digest(record.embedder.next()),
            embedded: record.embedder.embedded() + u64::from(arrived(Stage::Embed)),
            trainers: status.trainers as u32,
            generations,
            rounds_done: record.rounds.done,
            labelled: arrived(Stage::Label),
            notices: status
                .notices
                .into_iter()
                .map(
                    |Notice {
                         number,
                         time_ms,
                         text,
                         generations: _,
                     }| v1::Notice {
                        time_ms,
                        text,
                        number,
                    },
                )
                .collect(),
            waiting: status.waiting.unwrap_or_default(),
            evaluations_done: evaluated + u64::from(arrived(Stage::Evolve)),
            evaluations,
            progress,
            time_left: time_left.map(|TimeLeft { seconds, is_least }| v1::TimeLeft { seconds, is_least }),
            study: record
                .study
                .map(|study| study.as_str().to_owned())
                .unwrap_or_default(),
            ended_ms: record.ended_ms,
            toml: None,
            tags: record.notes.tags.iter().map(ToString::to_string).collect(),
            note: record.notes.note.as_str().to_owned(),
        }
    }
}

impl From<Medoid> for v1::Medoid {
    fn from(medoid: Medoid) -> Self {
        Self {
            individual: Some(medoid.individual.into()),
            cluster_size: medoid.cluster_size,
            mean_distance: medoid.mean_distance,
            novelty: medoid.novelty,
            name: None,
        }
    }
}

impl From<ClusterName> for v1::ClusterName {
    fn from(name: ClusterName) -> Self {
        let carried = match name.origin {
            Origin::Carried {
                version,
                place,
                shared,
                of,
            } => Some(v1::CarriedFrom {
                version,
                cluster: place as u32,
                shared,
                members: of,
            }),
            Origin::Person | Origin::Judge => None,
        };
        Self {
            name: name.class.to_string(),
            by_machine: name.origin == Origin::Judge,
            carried,
        }
    }
}

impl From<Neighbour> for v1::Neighbour {
    fn from(neighbour: Neighbour) -> Self {
        Self {
            index: neighbour.index,
            distance: neighbour.distance,
            cluster: neighbour.cluster,
            class: neighbour.class.map(|class| class.to_string()).unwrap_or_default(),
        }
    }
}

impl From<Nearest> for v1::FindNearestResponse {
    fn from(nearest: Nearest) -> Self {
        Self {
            is_unlike: nearest.is_unlike(),
            spread: nearest.spread,
            neighbours: nearest.neighbours.into_iter().map(Into::into).collect(),
            labelled: nearest.labelled.map(Into::into),
            medoid: Some(nearest.medoid.into()),
            mean_distance: nearest.mean_distance,
            is_taxonomy: nearest.is_taxonomy,
        }
    }
}

impl Taxonomy {
    /// The messages of the taxonomy, part by part, with the names of its clusters.
    pub fn into_parts(self, names: Names) -> impl Iterator<Item = v1::Taxonomy> + Send + 'static {
        // An individual takes at most six bytes of a message, including its number of robust trials.
        const CLUSTERS: usize = PART_BYTES / 6;
        let loss = v1::Taxonomy {
            loss: self.loss,
            ..v1::Taxonomy::default()
        };
        let mut names = names.names.into_iter();
        let medoids = self.medoids.into_iter().map(move |medoid| v1::Medoid {
            name: names.next().flatten().map(Into::into),
            ..v1::Medoid::from(medoid)
        });
        let medoids = parts(medoids, |medoids| v1::Taxonomy {
            medoids,
            ..v1::Taxonomy::default()
        });
        let (clusters, robust) = (self.clusters, self.robust_trials);
        let individuals = (0..clusters.len()).step_by(CLUSTERS).map(move |begin| {
            let range = begin..clusters.len().min(begin + CLUSTERS);
            let robust = robust.get(range.clone()).unwrap_or_default();
            v1::Taxonomy {
                robust_trials: robust.iter().copied().map(u32::from).collect(),
                clusters: clusters[range].to_vec(),
                ..v1::Taxonomy::default()
            }
        });
        std::iter::once(loss).chain(medoids).chain(individuals)
    }
}
