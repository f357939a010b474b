//! What programs read: one versioned schema for each kind of thing.

use murmuration_link::{OutputError, outln};
use murmuration_proto::{CampaignSpec, CapabilityModel, CheckpointDigest, Dataset, EmbedderSource, v1};
use murmuration_store::{
    Recoverable,
    backup::Manifest,
    checkpoints::Condition,
    doctor::{CampaignFindings, Findings, Prospect, Salvaged},
};
use serde_json::{Value, json};

/// Version of every object printed here; it rises when a field changes its meaning or goes.
pub(super) const SCHEMA: u32 = 1;

/// What a campaign's embedder is trained on, if one is.
fn dataset(spec: &CampaignSpec) -> Option<&Dataset> {
    match spec.embedder()? {
        EmbedderSource::Trained { dataset, .. } => Some(dataset),
        EmbedderSource::Published(_) => None,
    }
}

/// Prints one value on one line.
pub(super) fn print(value: &Value) -> Result<(), OutputError> {
    outln!("{value}")
}

pub(super) fn campaign(campaign: &v1::Campaign) -> Value {
    let spec = campaign
        .spec
        .clone()
        .map(CampaignSpec::try_from)
        .and_then(Result::ok);
    let search = spec.as_ref().map(|spec| *spec.search());
    let evaluations =
        |generations| search.map(|search| u64::from(generations) * u64::from(search.population()));
    let in_stage = |stage| campaign.active && campaign.stage() == stage;
    json!({
        "schema": SCHEMA,
        "campaign": campaign.id,
        "state": campaign.state().as_str_name().trim_start_matches("CAMPAIGN_STATE_").to_lowercase(),
        "active": campaign.active,
        "error": campaign.error,
        "created_ms": campaign.created_ms,
        "weight": campaign.weight,
        "generations_done": campaign.generations_done,
        "generations": campaign.generations,
        "evaluations_done": evaluations(campaign.generations_done).map(|done| done + u64::from(campaign.evaluated_in_generation)),
        "evaluations": evaluations(campaign.generations),
        "evaluations_per_second": campaign.evaluations_per_second,
        "novelty_of_the_last_generation": novelty(campaign),
        "workers": campaign.workers,
        "trainers": campaign.trainers,
        "stage": campaign.stage().as_str_name().trim_start_matches("CAMPAIGN_STAGE_").to_lowercase().replace('_', "-"),
        "dataset_done": campaign.dataset_done,
        "dataset": spec.as_ref().and_then(dataset).map(|dataset| dataset.pictures()),
        "training": campaign.training.as_ref().map(training),
        "checkpoint": campaign.checkpoint,
        "next_checkpoint": campaign.next_checkpoint,
        "embedded": campaign.embedded,
        "rounds_done": campaign.rounds_done,
        "labelled_in_this_stage": in_stage(v1::CampaignStage::Label).then_some(campaign.labelled),
        "notices": campaign.notices.iter().map(notice).collect::<Vec<_>>(),
        "waiting": campaign.waiting,
        "spec": spec.map(|spec| spec.to_toml()),
    })
}

/// Novelty of the individuals of the last complete generation, when they were evaluated.
fn novelty(campaign: &v1::Campaign) -> Option<Value> {
    let (best, mean) = (campaign.best_novelty?, campaign.mean_novelty?);
    Some(json!({ "best": best, "mean": mean }))
}

fn training(progress: &v1::TrainingProgress) -> Value {
    json!({
        "epoch": progress.epoch,
        "epochs": progress.epochs,
        "loss": progress.loss,
        "learning_rate": progress.learning_rate,
        "triplets_per_second": progress.triplets_per_second,
        "seconds_left": progress.seconds_left,
        "triplet_accuracy": progress.triplet_accuracy,
        "spread": progress.spread,
        "rank": progress.rank,
    })
}

pub(super) fn individual(individual: &v1::Individual) -> Value {
    use base64::{Engine as _, engine::general_purpose::STANDARD};
    json!({
        "schema": SCHEMA,
        "index": individual.index,
        "generation": individual.generation,
        "controller": individual.controller,
        "seed": individual.seed,
        "features": individual.features,
        "novelty_when_evaluated": individual.novelty,
        "embedding": individual.embedding,
        "image": individual.image.as_deref().map(|image| STANDARD.encode(image)),
    })
}

/// How a run ended.
pub(super) fn outcome(
    campaign: &str,
    digest: &v1::GetDigestResponse,
    report: Option<&str>,
    seconds: f64,
) -> Value {
    json!({
        "schema": SCHEMA,
        "campaign": campaign,
        "digest": digest.digest,
        "report": report,
        "evaluations": digest.evaluations,
        "seconds": seconds,
    })
}

pub(super) fn digest(campaign: &str, digest: &v1::GetDigestResponse) -> Value {
    json!({
        "schema": SCHEMA,
        "campaign": campaign,
        "digest": digest.digest,
        "evaluations": digest.evaluations,
    })
}

pub(super) fn checkpoint(checkpoint: &v1::Checkpoint) -> Value {
    let metrics: std::collections::BTreeMap<_, _> = checkpoint.metrics.iter().collect();
    json!({
        "schema": SCHEMA,
        "checkpoint": checkpoint.digest,
        "size": checkpoint.size,
        "parent": checkpoint.parent,
        "data_digest": checkpoint.data_digest,
        "label_digest": checkpoint.label_digest,
        "configuration": checkpoint.configuration,
        "metrics": metrics,
        "created_ms": checkpoint.created_ms,
    })
}

/// What `murmuration label` added, and the digest of what stands then.
fn notice(notice: &v1::Notice) -> Value {
    json!({ "time_ms": notice.time_ms, "text": notice.text })
}

pub(super) fn labelled(campaign: &str, added: usize, digest: &str) -> Value {
    json!({
        "schema": SCHEMA,
        "campaign": campaign,
        "added": added,
        "label_digest": digest,
    })
}

pub(super) fn label(label: &v1::Label) -> Value {
    let answer = label.answer.clone().unwrap_or_default();
    json!({
        "schema": SCHEMA,
        "index": answer.index,
        "class": answer.answer,
        "annotator": answer.annotator,
        "time_ms": answer.time_ms,
        "entry": label.entry,
    })
}

pub(super) fn label_class(class: &v1::LabelClass) -> Value {
    json!({
        "schema": SCHEMA,
        "class": class.name,
        "colour": class.colour,
        "labels": class.labels,
        "near": class.near,
    })
}

pub(super) fn agreement(first: &str, second: &str, agreement: &v1::Agreement) -> Value {
    let confusion = |confusion: &v1::Confusion| {
        json!({
            "first": confusion.first,
            "second": confusion.second,
            "individuals": confusion.individuals,
        })
    };
    let disagreement = |difference: &v1::Disagreement| {
        json!({
            "index": difference.index,
            "first": difference.first,
            "second": difference.second,
        })
    };
    json!({
        "schema": SCHEMA,
        "annotators": [first, second],
        "both": agreement.both,
        "agreed": agreement.agreed,
        "kappa": agreement.kappa,
        "confusions": agreement.confusions.iter().map(confusion).collect::<Vec<_>>(),
        "disagreements": agreement.disagreements.iter().map(disagreement).collect::<Vec<_>>(),
    })
}

pub(super) fn backup(folder: &str, manifest: &Manifest) -> Value {
    json!({
        "schema": SCHEMA,
        "folder": folder,
        "created_ms": manifest.created_ms,
        "database": manifest.database,
        "checkpoints": manifest.checkpoints,
        "checkpoint_store": manifest.checkpoint_store,
    })
}

/// What the doctor found, and what of it was saved.
pub(super) fn findings(found: &Findings, salvaged: Option<&Salvaged>) -> Value {
    let remains = |remains: &Recoverable| {
        json!({
            "pictures": remains.pictures,
            "generations": remains.generations,
            "individuals": remains.individuals,
            "labels": remains.labels,
            "taxonomy": remains.taxonomy,
        })
    };
    let campaign = |campaign: &CampaignFindings| {
        json!({
            "campaign": campaign.id.as_str(),
            "state": campaign.state.map(|state| state.name()),
            "condition": match campaign.prospect {
                Prospect::Whole => "whole",
                Prospect::LacksCheckpoint => "lacks-checkpoint",
                Prospect::Partly => "partly",
                Prospect::Lost => "lost",
            },
            "stored": remains(&campaign.stored),
            "whole": remains(&campaign.remains),
            "problems": campaign.problems,
            "note": campaign.note,
        })
    };
    let checkpoint = |(digest, condition): &(CheckpointDigest, Condition)| {
        json!({
            "checkpoint": digest.to_string(),
            "condition": match condition {
                Condition::Whole => "whole",
                Condition::Missing => "missing",
                Condition::Damaged => "damaged",
                Condition::Unread(_) => "unread",
            },
        })
    };
    json!({
        "schema": SCHEMA,
        "healthy": found.is_healthy(),
        "database": found.database.display().to_string(),
        "database_schema": found.schema,
        "faults": found.faults,
        "checkpoints": found.checkpoints.iter().map(checkpoint).collect::<Vec<_>>(),
        "campaigns": found.campaigns.iter().map(campaign).collect::<Vec<_>>(),
        "salvaged": salvaged.map(salvaged_json),
    })
}

fn salvaged_json(salvaged: &Salvaged) -> Value {
    let lost = salvaged.lost.iter();
    let lost = lost.map(|(campaign, reason)| json!({ "campaign": campaign.as_str(), "reason": reason }));
    let checkpoints = salvaged.checkpoints.iter().map(ToString::to_string);
    json!({
        "campaigns": salvaged.campaigns.iter().map(|campaign| campaign.as_str()).collect::<Vec<_>>(),
        "lost": lost.collect::<Vec<_>>(),
        "checkpoints": checkpoints.collect::<Vec<_>>(),
    })
}

/// A figure of `murmuration bench simulate`.
pub(super) fn bench_simulate(model: CapabilityModel, what: &str, per_second: f64, ratio: f64) -> Value {
    json!({
        "schema": SCHEMA,
        "model": model.name(),
        "what": what,
        "evaluations_per_second_per_core": per_second,
        "ratio_to_scalar": ratio,
    })
}

/// A figure of `murmuration bench train`.
pub(super) fn bench_train(figures: &murmuration_trainer::bench::Figures) -> Value {
    json!({
        "schema": SCHEMA,
        "network": figures.network,
        "recipe": figures.recipe,
        "weights": figures.weights,
        "triplets_per_step": figures.triplets_per_step,
        "seconds_per_step": figures.step_seconds,
        "seconds_per_epoch": figures.epoch_seconds,
        "peak_memory_bytes": figures.peak_memory,
    })
}
