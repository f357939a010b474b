//! How far a campaign has come, and how long it still takes, in words.

use maud::{Markup, html};
use murmuration_engine::campaign::CampaignStatus;
use murmuration_model::{CampaignState, Stage, TimeLeft, WorkLeft};
use murmuration_proto::{EmbedderSource, Feedback, counted, grouped};

/// The state of a campaign in words; of one that runs, its stage.
pub(super) fn state_name(status: &CampaignStatus) -> &'static str {
    match status.record.state {
        CampaignState::Running if !status.active => "interrupted",
        CampaignState::Running if status.waiting.is_some() => "waiting",
        CampaignState::Running => stage(status.stage),
        state => state.name(),
    }
}

/// The progress of a campaign, as a bar and in words.
pub(super) fn progress(status: &CampaignStatus) -> Markup {
    let amount = amount(status);
    let (done, total) = amount.map_or((0, 1), |(done, total, _)| (done, total.max(1)));
    html! {
        div.progress {
            progress value=(done) max=(total) aria-label={ "Progress of " (status.record.id) } {}
            span.figures {
                strong.stands { (state_name(status)) }
                @if let Some((done, total, unit)) = amount { (grouped(done)) " of " (counted(total, unit)) }
            }
        }
    }
}

/// The stage of a running campaign and its progress, as a sentence.
pub(super) fn doing(status: &CampaignStatus) -> String {
    let stage = stage(status.stage);
    match amount(status) {
        Some((done, total, unit)) => format!("Now {stage}: {} of {}.", grouped(done), counted(total, unit)),
        None => format!("Now {stage}."),
    }
}

const fn stage(stage: Stage) -> &'static str {
    match stage {
        Stage::Dataset => "simulating the dataset",
        Stage::Pretrain => "training the embedder",
        Stage::Embed => "re-embedding the archive",
        Stage::Evolve => "searching",
        Stage::Label => "labelling",
        Stage::FineTune => "learning from labels",
        Stage::Taxonomy => "clustering",
    }
}

/// The amount that the stage has done, the amount that it has to do, and their unit in the singular; nothing before a
/// trainer has reported its epochs.
fn amount(status: &CampaignStatus) -> Option<(u64, u64, &'static str)> {
    let spec = &status.record.spec;
    let search = spec.search();
    let archived = status.record.individuals();
    let evaluations = u64::from(status.record.generations()) * u64::from(search.population());
    let arrived = u64::from(status.arrived);
    let (done, total, unit) = match (status.stage, spec.embedder()) {
        (Stage::Dataset, Some(EmbedderSource::Trained { dataset, .. })) => (
            status.record.dataset_done() + arrived,
            dataset.pictures(),
            "picture",
        ),
        (Stage::Pretrain | Stage::FineTune, _) => {
            let training = status.training?;
            (training.epoch, training.epochs, "epoch")
        }
        (Stage::Embed, _) => (status.record.embedder.embedded() + arrived, archived, "picture"),
        (Stage::Label, _) => {
            let wanted = spec.feedback().map_or(0, Feedback::labels);
            (arrived, wanted.into(), "label")
        }
        (Stage::Evolve, _) => (archived + arrived, evaluations, "evaluation"),
        (Stage::Taxonomy | Stage::Dataset, _) => (archived, evaluations, "evaluation"),
    };
    Some((done.min(total), total, unit))
}

/// How long the stage still takes, if that can be told.
pub(super) fn stage_left(status: &CampaignStatus) -> Option<String> {
    seconds_left(status).map(|seconds| TimeLeft::about(seconds).in_words())
}

/// How long the whole campaign still takes, as far as that can be told.
pub(super) fn whole_left(status: &CampaignStatus) -> Option<String> {
    let record = &status.record;
    let left = WorkLeft {
        spec: &record.spec,
        stage: status.stage,
        generations_done: record.generations_done,
        arrived: status.arrived,
        rounds_done: record.rounds.done,
        is_learning: record.rounds.current_cutoff.is_some(),
        per_second: status.per_second,
        stage_seconds: seconds_left(status),
    };
    let left = left.whole().filter(|_| status.active)?;
    Some(left.in_words())
}

fn seconds_left(status: &CampaignStatus) -> Option<f64> {
    match (status.training, amount(status)) {
        _ if !status.active => None,
        (Some(training), _) => training.seconds_left,
        (None, Some((done, total, _))) if status.per_second > 0.0 => {
            Some((total - done) as f64 / status.per_second)
        }
        (None, _) => None,
    }
}
