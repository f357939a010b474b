//! A campaign at work: one stage after the other, each begun where the disk says that it was left.

use super::{
    CampaignError, dataset, embed, fine_tune, label, live::Live, metrics::CampaignMetrics, pretrain, recheck,
    search,
};
use crate::{
    blocking::blocking,
    checkpoints::Checkpoints,
    dispatch::{Dispatch, Trainers},
    model::{CampaignId, CampaignRecord, CampaignState, Embedder, Stage},
    store::{RunId, Store, Suspects},
    synthetic::SyntheticAnnotator,
};
use murmuration_proto::ImageFormat;

/// What the stages of a campaign work with.
#[derive(Debug, Clone)]
pub(super) struct Means {
    /// That of the run: it takes no change once the run is over.
    pub(super) store: Store,
    pub(super) dispatch: Dispatch,
    pub(super) trainers: Trainers,
    pub(super) checkpoints: Checkpoints,
    pub(super) annotator: SyntheticAnnotator,
    pub(super) metrics: CampaignMetrics,
}

impl Means {
    /// The same for a run of a campaign.
    pub(super) fn during(&self, run: RunId) -> Self {
        Self {
            store: self.store.during(run),
            ..self.clone()
        }
    }

    /// What embeds a campaign's individuals, if anything.
    pub(super) async fn embedder(&self, record: &CampaignRecord) -> Result<Option<Embedder>, CampaignError> {
        Ok(match record.checkpoint {
            Some(checkpoint) => Some(self.checkpoints.embedder(checkpoint, record.spec.image()).await?),
            None => None,
        })
    }
}

/// Bytes of pictures that a stage holds at a time, where it need not hold more.
const PICTURE_BYTES: usize = 256 << 20;

/// Pictures that a stage handles at a time: `most`, or as many as fit.
pub(super) fn pictures_at_once(image: &ImageFormat, most: usize) -> usize {
    (PICTURE_BYTES / image.pixels()).clamp(1, most)
}

/// How a stage ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Outcome {
    /// All of it is on disk.
    Done,
    /// It was told to stop; what is on disk is whole.
    Stopped,
}

impl Outcome {
    /// That of a stage that ends with a [`Means::commit`].
    pub(super) const fn of(committed: Option<()>) -> Self {
        match committed {
            Some(()) => Self::Done,
            None => Self::Stopped,
        }
    }
}

/// Runs the campaign from where it stands until it is complete, failed or stopped; `means` are those of the run.
pub(super) async fn run(means: Means, run: RunId, mut live: Live) {
    let id = run.campaign().clone();
    match stages(&means, &run, &mut live).await {
        Ok(Outcome::Done) => tracing::info!(campaign = %id, "completed"),
        Ok(Outcome::Stopped) => {}
        // Whoever decided something about it has told people; whoever shuts the coordinator down wants the campaign to go on
        // with the next one.
        Err(error) if error.is_stop() => {}
        Err(error) => {
            let said = error.to_string();
            tracing::error!(campaign = %id, error = said, "failed");
            live.failed(&said);
            let store = means.store;
            let recorded = blocking(move || store.set_state(&id, CampaignState::Failed, &said)).await;
            if let Ok(Err(error)) = recorded {
                tracing::warn!(%error, "the failure could not be recorded");
            }
        }
    }
}

async fn stages(means: &Means, run: &RunId, live: &mut Live) -> Result<Outcome, CampaignError> {
    let id = run.campaign();
    let mut before = None;
    loop {
        live.interrupt().check()?;
        let Some((suspects, seen)) = suspects(means, id, live).await? else {
            return Ok(Outcome::Stopped);
        };
        let record = read(&means.store, id).await?;
        if record.state != CampaignState::Running || record.run_id() != *run {
            return Ok(Outcome::Stopped);
        }
        live.begin();
        if !suspects.is_empty() {
            match recheck::recheck(means, &record, suspects, live).await? {
                Outcome::Stopped => return Ok(Outcome::Stopped),
                Outcome::Done => before = None,
            }
            continue;
        }
        // A stage that leaves no trace would be begun for ever.
        if before.replace((record.clone(), seen)).as_ref() == Some(&(record.clone(), seen)) {
            return Err(CampaignError::Broken);
        }
        let stage = Stage::of(&record);
        tracing::info!(campaign = %id, ?stage, "begins");
        let outcome = match stage {
            Stage::Dataset => dataset::collect(means, record, live).await?,
            Stage::Pretrain => pretrain::pretrain(means, record, live).await?,
            Stage::Embed => embed::embed(means, record, live).await?,
            Stage::Label => label::label(means, record, live).await?,
            Stage::FineTune => fine_tune::fine_tune(means, record, live).await?,
            Stage::Evolve => search::evolve(means, record, seen, live).await?,
            Stage::Taxonomy => match search::complete(means, record, live).await? {
                Some(true) => return Ok(Outcome::Done),
                // A worker was found wrong meanwhile.
                Some(false) => Outcome::Done,
                None => Outcome::Stopped,
            },
        };
        if outcome == Outcome::Stopped {
            return Ok(Outcome::Stopped);
        }
    }
}

/// What of a campaign rests on the word of machines that were found wrong, and how many those are; on disk too. `None` if
/// the campaign is to stop.
async fn suspects(
    means: &Means,
    id: &CampaignId,
    live: &Live,
) -> Result<Option<(Suspects, usize)>, CampaignError> {
    let quarantined = means.dispatch.quarantined().borrow().clone();
    let seen = quarantined.len();
    if seen == 0 {
        return Ok(Some((Suspects::default(), seen)));
    }
    let remember = move |store: &Store| store.quarantine(&quarantined);
    if means.commit(live, remember).await?.is_none() {
        return Ok(None);
    }
    let (store, id) = (means.store.clone(), id.clone());
    let suspects = blocking(move || store.suspects(&id)).await??;
    Ok(Some((suspects, seen)))
}

/// A campaign as it is on disk now.
pub(super) async fn read(store: &Store, id: &CampaignId) -> Result<CampaignRecord, CampaignError> {
    let (store, id) = (store.clone(), id.clone());
    Ok(blocking(move || store.campaign(id.as_str())).await??)
}
