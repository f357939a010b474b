//! The novelty and training curves of a campaign, for the scripts of its Progress page.

use super::{Web, page_error::Refused};
use axum::{
    Json,
    extract::{Path, State},
};
use murmuration_model::{CampaignRecord, Stage};
use murmuration_report::{GenerationSummary, condensed, picture::columns::column};
use murmuration_service::OrStatus as _;
use murmuration_store::{Store, StoreError};
use serde::Serialize;

/// The best and the mean novelty when evaluated of each generation, in columns. If there are many generations, each row covers
/// several generations.
#[derive(Debug, Serialize)]
pub(super) struct GenerationsView {
    generation: String,
    best: String,
    mean: String,
}

pub(super) async fn generations(
    State(web): State<Web>,
    Path(id): Path<String>,
) -> Result<Json<GenerationsView>, Refused> {
    let id = web.campaigns.status(&id).await.or_status()?.record.id;
    let records = web.store.run(move |store| store.generations(&id)).await;
    let all: Vec<_> = records
        .or_status()?
        .into_iter()
        .map(|record| GenerationSummary {
            generation: record.generation,
            best_novelty: record.best_novelty,
            mean_novelty: record.mean_novelty,
            filtered: record.filtered,
        })
        .collect();
    let steps = condensed(&all);
    Ok(Json(GenerationsView {
        generation: column(steps.iter().map(|step| step.generation.to_le_bytes())),
        best: column(steps.iter().map(|step| step.best_novelty.to_le_bytes())),
        mean: column(steps.iter().map(|step| step.mean_novelty.to_le_bytes())),
    }))
}

/// The trainings of a campaign.
#[derive(Debug, Serialize)]
pub(super) struct EpochsView {
    /// Round, epoch, loss and accuracy of each epoch, in order.
    epochs: Vec<(u32, u64, Option<f64>, Option<f64>)>,
    events: Vec<EventView>,
}

/// The end of a round, or a notice.
#[derive(Debug, Serialize)]
struct EventView {
    /// Number of complete generations when the event happened.
    generation: u32,
    text: String,
}

pub(super) async fn epochs(
    State(web): State<Web>,
    Path(id): Path<String>,
) -> Result<Json<EpochsView>, Refused> {
    let status = web.campaigns.status(&id).await.or_status()?;
    let id = status.record.id.clone();
    let epochs = web.store.run(move |store| store.epochs(&id)).await.or_status()?;
    let mut events = Vec::new();
    for pair in epochs.windows(2) {
        if let [(last, at), (first, _)] = pair
            && last.round != first.round
        {
            events.push(learned(last.round, *at));
        }
    }
    if let Some((last, at)) = epochs.last()
        && has_ended(&status.record, last.round)
    {
        events.push(learned(last.round, *at));
    }
    for notice in status.notices {
        events.push(EventView {
            generation: notice.generations,
            text: notice.text,
        });
    }
    let epochs = epochs
        .iter()
        .map(|(epoch, _)| (epoch.round, epoch.epoch, epoch.loss, epoch.accuracy))
        .collect();
    Ok(Json(EpochsView { epochs, events }))
}

/// Whether the training of a round has ended. The known epochs alone cannot show the end, because a campaign can be paused during
/// a training.
fn has_ended(record: &CampaignRecord, round: u32) -> bool {
    match round {
        0 => Stage::of(record) != Stage::Pretrain,
        round => record.rounds.done >= round,
    }
}

fn learned(round: u32, generation: u32) -> EventView {
    let text = match round {
        0 => "first checkpoint".to_owned(),
        round => format!("new checkpoint, after round {round}"),
    };
    EventView { generation, text }
}

const SHOWN: u32 = super::pages::SHOWN as u32;

/// The newest and the most novel individuals, whose motions the page of a searching campaign plays. Each individual has its
/// index, its generation, and its novelty when evaluated.
#[derive(Debug, Serialize)]
pub(super) struct ShownView {
    newest: Vec<(u64, u32, f64)>,
    novel: Vec<(u64, u32, f64)>,
}

pub(super) async fn shown(
    State(web): State<Web>,
    Path(id): Path<String>,
) -> Result<Json<ShownView>, Refused> {
    let record = web.campaigns.status(&id).await.or_status()?.record;
    let read = move |store: &Store| -> Result<_, StoreError> {
        let last = record.individuals();
        let range = last.saturating_sub(u64::from(SHOWN))..last;
        let newest = store.individuals(&record.id, record.spec.model(), range, false)?;
        Ok((newest, store.most_novel(&record.id, SHOWN)?))
    };
    let (newest, novel) = web.store.run(read).await.or_status()?;
    let newest = newest
        .iter()
        .map(|one| (one.index, one.generation, one.novelty))
        .collect();
    Ok(Json(ShownView { newest, novel }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples;
    use murmuration_model::{ArchiveEmbedder, CampaignState, Rounds};
    use murmuration_swarm::CheckpointDigest;

    #[test]
    fn a_training_in_the_middle_of_which_a_campaign_is_paused_has_not_ended() {
        let first = CampaignRecord {
            state: CampaignState::Paused,
            pictures_done: 20_000,
            ..samples::record("model = \"two-sensor\"\nmethod = \"latent\"")
        };
        assert!(!has_ended(&first, 0));
        let taught = CampaignRecord {
            embedder: ArchiveEmbedder::Checkpoint(CheckpointDigest::of(b"own")),
            rounds: Rounds {
                current_cutoff: Some(9),
                ..Rounds::default()
            },
            ..first
        };
        assert!(has_ended(&taught, 0) && !has_ended(&taught, 1));
        let rounds = Rounds {
            done: 1,
            ..Rounds::default()
        };
        assert!(has_ended(&CampaignRecord { rounds, ..taught }, 1));
    }
}
