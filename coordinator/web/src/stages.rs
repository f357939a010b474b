//! The progress of a campaign and its remaining time, in words.

use maud::{Markup, html};
use murmuration_engine::campaign::CampaignStatus;
use murmuration_model::{CampaignState, Stage, TimeLeft};
use murmuration_proto::v1;
use murmuration_swarm::{counted, grouped};

/// The state of a campaign in words; for a running campaign, its stage.
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
    let reached = status.progress();
    let (done, total) = reached
        .as_ref()
        .map_or((0, 1), |reached| (reached.done, reached.total.max(1)));
    html! {
        div.progress {
            progress value=(done) max=(total) aria-label={ "Progress of " (status.record.id) } {}
            span.figures {
                strong.stands { (state_name(status)) }
                @if let Some(reached) = reached { (grouped(reached.done)) " of " (counted(reached.total, &reached.unit)) }
            }
        }
    }
}

/// The stage of a running campaign and its progress, as a sentence.
pub(super) fn doing(status: &CampaignStatus) -> String {
    let stage = stage(status.stage);
    match status.progress() {
        Some(v1::StageProgress {
            done, total, unit, ..
        }) => {
            format!("Now {stage}: {} of {}.", grouped(done), counted(total, &unit))
        }
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

/// Remaining time of the current stage, in words, if known.
pub(super) fn stage_left(status: &CampaignStatus) -> Option<String> {
    let seconds = status.progress()?.seconds_left?;
    Some(TimeLeft::about(seconds).in_words())
}

/// Remaining time of the whole campaign, in words, if known.
pub(super) fn whole_left(status: &CampaignStatus) -> Option<String> {
    status.time_left().map(TimeLeft::in_words)
}
