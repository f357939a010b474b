//! The parts of a campaign as messages.

use super::{Medoids, Member, Part};
use crate::{ArchivedIndividual, ClusterMeasures, GenerationRecord, Trial};
use murmuration_model::labels::{Entry, RequestId};
use murmuration_proto::{CampaignSpec, Controller, Evaluation, Extras, Invalid, v1};
use murmuration_search::breeding::is_start_of;

impl From<Part> for v1::CampaignPart {
    fn from(part: Part) -> Self {
        use v1::campaign_part::Part as Message;
        let part = match part {
            Part::Campaign(campaign) => Message::Campaign((*campaign).into()),
            Part::Checkpoint(record) => Message::Checkpoint(record.into()),
            Part::Chunk(data) => Message::Chunk(v1::CheckpointChunk { data }),
            Part::Generation(record) => Message::Generation(record.into()),
            Part::Individuals(members) => Message::Individuals(v1::ExportedIndividuals {
                individuals: members.into_iter().map(Into::into).collect(),
            }),
            Part::Labels(entries) => Message::Labels(v1::ExportedLabels {
                labels: entries.into_iter().map(label).collect(),
            }),
            Part::Taxonomy(taxonomy) => Message::Taxonomy(taxonomy.into()),
        };
        Self { part: Some(part) }
    }
}

fn label((request, entry): (RequestId, Entry)) -> v1::ExportedLabel {
    v1::ExportedLabel {
        entry: Some(entry.into()),
        request_id: request.to_string(),
    }
}

impl From<Member> for v1::ExportedIndividual {
    fn from(member: Member) -> Self {
        let individual = member.individual;
        let trial = |trial: Trial| v1::Evaluation {
            features: trial.features.to_vec(),
            image: trial.image.unwrap_or_default(),
            embedding: trial.embedding,
            verdict: trial.verdict.map_or(0, |verdict| verdict.number().into()),
        };
        Self {
            index: individual.index,
            controller: individual.controller.genes().to_vec(),
            seed: individual.seed,
            novelty: individual.novelty,
            trials: individual.trials.into_iter().map(trial).collect(),
            cluster: member.cluster,
            robust_trials: member.robust_trials.map(Into::into),
        }
    }
}

impl From<Medoids> for v1::ExportedTaxonomy {
    fn from(taxonomy: Medoids) -> Self {
        let medoid = |(index, measures): (u64, ClusterMeasures)| v1::ExportedMedoid {
            index,
            mean_distance: measures.mean_distance,
            novelty: measures.novelty,
        };
        Self {
            medoids: taxonomy.medoids.into_iter().map(medoid).collect(),
            loss: taxonomy.loss,
        }
    }
}

/// A number of which none is below zero, such as a distance.
fn measure(field: &str, value: f64) -> Result<f64, Invalid> {
    match value.is_finite() && value >= 0.0 {
        true => Ok(value),
        false => Err(Invalid::new(field, value, "0 or more, and finite")),
    }
}

/// A generation; its individuals are not counted.
pub(super) fn generation(message: &v1::GenerationSummary) -> Result<GenerationRecord, Invalid> {
    if message.filtered > i64::MAX.unsigned_abs() {
        return Err(Invalid::new("filtered", message.filtered, "at most 2^63 - 1"));
    }
    Ok(GenerationRecord {
        generation: message.generation,
        best_novelty: measure("best_novelty", message.best_novelty)?,
        mean_novelty: measure("mean_novelty", message.mean_novelty)?,
        filtered: message.filtered,
    })
}

/// An individual of a campaign of this specification, of whose embeddings the length is known.
pub(super) fn member(
    message: v1::ExportedIndividual,
    spec: &CampaignSpec,
    dimensions: Option<usize>,
) -> Result<Member, Invalid> {
    let novelty = measure("novelty", message.novelty)?;
    let starts = spec.starts().get();
    if message.trials.len() != starts {
        let allowed = format!("{starts}, the starts of the campaign");
        return Err(Invalid::new("trials", message.trials.len(), allowed));
    }
    let extras = Extras {
        dimensions,
        judge: spec.judges(),
    };
    let controller = Controller::new(spec.model(), &message.controller)?;
    if !is_start_of(spec, message.index, &controller, message.seed) {
        let allowed = "the seed that follows from that of the specification and from the index";
        return Err(Invalid::new("seed", message.seed, allowed));
    }
    let trial = |trial| {
        let evaluation = Evaluation::for_format(trial, spec.image(), extras)?;
        Ok(Trial {
            features: *evaluation.features(),
            embedding: evaluation.embedding().to_vec(),
            verdict: evaluation.verdict(),
            image: Some(evaluation.into_image()),
        })
    };
    let trials: Result<_, Invalid> = message.trials.into_iter().map(trial).collect();
    let robust = |trials: u32| match u8::try_from(trials) {
        Ok(robust) if usize::from(robust) <= starts => Ok(robust),
        _ => Err(Invalid::new(
            "robust_trials",
            trials,
            format!("at most {starts}, the starts"),
        )),
    };
    let individual = ArchivedIndividual {
        index: message.index,
        generation: (message.index / u64::from(spec.search().population())) as u32,
        controller,
        seed: message.seed,
        trials: trials?,
        novelty,
    };
    Ok(Member {
        individual,
        cluster: message.cluster,
        robust_trials: message.robust_trials.map(robust).transpose()?,
    })
}

/// A taxonomy of at most so many medoids, of an archive whose individuals are in these `clusters`.
pub(super) fn taxonomy(
    message: v1::ExportedTaxonomy,
    clusters: &[u32],
    most: usize,
) -> Result<Medoids, Invalid> {
    if message.medoids.len() > most {
        let allowed = format!("at most {most}, the medoids of the specification");
        return Err(Invalid::new("medoids", message.medoids.len(), allowed));
    }
    let loss = measure("loss", message.loss)?;
    check_clusters(&message.medoids, clusters)?;
    let medoid = |(place, medoid): (usize, v1::ExportedMedoid)| {
        let within = |error: Invalid| error.within(&format!("medoids[{place}]"));
        let measures = ClusterMeasures {
            mean_distance: measure("mean_distance", medoid.mean_distance).map_err(within)?,
            novelty: measure("novelty", medoid.novelty).map_err(within)?,
        };
        Ok((medoid.index, measures))
    };
    let medoids: Result<_, Invalid> = message.medoids.into_iter().enumerate().map(medoid).collect();
    Ok(Medoids {
        medoids: medoids?,
        loss,
    })
}

/// Checks that each medoid is a member of its own cluster, that every individual is in a cluster that has a medoid, and that
/// larger clusters come first.
fn check_clusters(medoids: &[v1::ExportedMedoid], clusters: &[u32]) -> Result<(), Invalid> {
    let mut sizes = vec![0_u64; medoids.len()];
    for &cluster in clusters {
        let Some(size) = sizes.get_mut(cluster as usize) else {
            let allowed = format!("more than {cluster}, which an individual names");
            return Err(Invalid::new("medoids", medoids.len(), allowed));
        };
        *size += 1;
    }
    for (place, medoid) in medoids.iter().enumerate() {
        let index = usize::try_from(medoid.index).unwrap_or(usize::MAX);
        if clusters
            .get(index)
            .is_none_or(|&cluster| cluster as usize != place)
        {
            let allowed = format!("an individual of cluster {place}");
            let field = format!("medoids[{place}].index");
            return Err(Invalid::new(&field, medoid.index, allowed));
        }
    }
    match sizes.is_sorted_by(|one, next| one >= next) {
        true => Ok(()),
        false => Err(Invalid::new(
            "medoids",
            "another order",
            "the largest cluster first",
        )),
    }
}

/// Entries of a label log.
pub(super) fn labels(message: v1::ExportedLabels) -> Result<Vec<(RequestId, Entry)>, Invalid> {
    let label = |label: v1::ExportedLabel| {
        let entry = label
            .entry
            .ok_or_else(|| Invalid::new("entry", "nothing", "an entry of a label log"))?;
        Ok((RequestId::known(&label.request_id)?, entry.try_into()?))
    };
    message.labels.into_iter().map(label).collect()
}
