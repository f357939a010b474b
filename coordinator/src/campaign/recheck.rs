//! When a worker is found wrong, what it did for a campaign before is done again by others; the generations from the first
//! that differs on are taken back.
//!
//! Limits: reaches back to where this stage began. What an embedder was trained on, or a person labelled, cannot be taken
//! back without them.

use super::{
    CampaignError,
    evaluate::evaluate,
    live::Live,
    run::{Means, blocking},
};
use crate::{
    dispatch::{Embedder, EvaluationJob, Quarantined},
    leases::Instance,
    store::{ArchivedIndividual, CampaignRecord, Store},
};
use murmuration_proto::{Evaluation, Feedback, same_embedding};

/// Individuals that are evaluated again at a time.
const CHUNK: usize = 1024;

/// What this stage has looked at.
pub(super) struct Recheck {
    campaign: CampaignRecord,
    /// First generation of the stage.
    first: u32,
    /// Workers found wrong whose work was looked at.
    seen: usize,
}

impl Recheck {
    /// Of a campaign that begins, or goes on, to evolve.
    pub(super) fn of(record: &CampaignRecord) -> Self {
        let further = record.spec.feedback().map_or(0, Feedback::generations);
        let stage = match record.rounds_done {
            0 => record.spec.search().generations(),
            _ => further,
        };
        Self {
            first: record.generations().saturating_sub(stage),
            campaign: record.clone(),
            seen: 0,
        }
    }

    /// Does again what workers did that were found wrong since it last looked; whether generations were taken back.
    /// `None` if the campaign is to stop.
    pub(super) async fn look(
        &mut self,
        means: &Means,
        embedder: Option<Embedder>,
        live: &mut Live,
    ) -> Result<Option<bool>, CampaignError> {
        let quarantined = means.dispatch.quarantined();
        let newly = &quarantined[self.seen..];
        if newly.is_empty() {
            return Ok(Some(false));
        }
        let instances: Vec<Instance> = newly.iter().map(|wrong| wrong.instance).collect();
        let (store, id, first) = (means.store.clone(), self.campaign.id.clone(), self.first);
        let indices = blocking(move || store.evaluated_by(&id, &instances, first)).await??;
        let mut differs = None;
        for chunk in indices.chunks(CHUNK) {
            let Some(found) = self.first_that_differs(means, embedder, live, chunk).await? else {
                return Ok(None);
            };
            differs = found;
            if differs.is_some() {
                break;
            }
        }
        let said = self.tell(newly, indices.len(), differs.as_ref());
        self.seen = quarantined.len();
        let Some(said) = said else {
            return Ok(Some(false));
        };
        tracing::warn!(campaign = %self.campaign.id, "{said}");
        let id = self.campaign.id.clone();
        let taken_back = differs.map(|individual| individual.generation);
        let change = move |store: &Store| match taken_back {
            Some(generation) => store.take_back(&id, generation, &said),
            None => store.notify(&id, &said),
        };
        Ok(means.commit(live, change).await?.map(|()| taken_back.is_some()))
    }

    /// The first of these individuals whose evaluation is not what the archive says; `None` outside if the campaign is
    /// to stop.
    async fn first_that_differs(
        &self,
        means: &Means,
        embedder: Option<Embedder>,
        live: &mut Live,
        indices: &[u64],
    ) -> Result<Option<Option<ArchivedIndividual>>, CampaignError> {
        let (store, id, model) = (
            means.store.clone(),
            self.campaign.id.clone(),
            self.campaign.spec.model(),
        );
        let wanted = indices.to_vec();
        let archived = blocking(move || {
            let individual = |index| store.individual(&id, model, index);
            wanted.into_iter().map(individual).collect::<Result<Vec<_>, _>>()
        })
        .await??;
        let tasks: Vec<_> = archived.iter().map(|old| (old.controller, old.seed)).collect();
        let job = EvaluationJob::of(&self.campaign, embedder, tasks.clone());
        let again = |place: usize, _| Ok(vec![(place, tasks[place])]);
        let Some(done) = evaluate(&means.dispatch, live, job, again).await? else {
            return Ok(None);
        };
        let mut both = archived.into_iter().zip(&done.evaluations);
        Ok(Some(
            both.find(|(old, new)| !agrees(old, new)).map(|(old, _)| old),
        ))
    }

    /// What there is to say, if anything was this campaign's.
    fn tell(
        &self,
        wrong: &[Quarantined],
        again: usize,
        differs: Option<&ArchivedIndividual>,
    ) -> Option<String> {
        if again == 0 {
            return None;
        }
        let names: Vec<_> = wrong.iter().map(|wrong| wrong.name.as_str()).collect();
        let begins = format!(
            "worker {} returned wrong results and is quarantined; what it alone had evaluated here was evaluated again",
            names.join(", ")
        );
        Some(match differs {
            Some(ArchivedIndividual {
                index, generation, ..
            }) => {
                format!(
                    "{begins}: individual {index} differs, the generations from {generation} on are evaluated anew"
                )
            }
            None => format!("{begins}: all {again} evaluations are right"),
        })
    }
}

fn agrees(old: &ArchivedIndividual, new: &Evaluation) -> bool {
    old.features.map(f64::to_bits) == new.features().map(f64::to_bits)
        && old.image.as_deref() == Some(new.image())
        && same_embedding(&old.embedding, new.embedding())
}
