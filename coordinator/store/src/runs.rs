//! Decisions about campaigns, and the runs that they begin and end.
//!
//! A decision checks and changes the campaign's state in one transaction, which also counts the decision. A *run* lasts from one
//! decision to the next, and only the current run can change the campaign. A run writes through [`Store::during`]: every
//! transaction first checks that the campaign still runs, and that no decision was made since the run began. So an acknowledged
//! decision holds even if an earlier run goes on computing.

use super::{
    Store, StoreError,
    campaigns::{ended_ms, number_of},
    embeddings::begin_move,
    numbers::clamped,
    rounds,
};
use murmuration_model::{CampaignId, CampaignState, Change, NotAllowed, RunId};
use murmuration_swarm::{CampaignSpec, CheckpointDigest, Invalid};
use rusqlite::{Transaction, params};

/// A person's decision about a campaign.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Decision {
    /// The campaign stops, and can be resumed.
    Pause,
    Resume,
    /// The campaign ends for good.
    Cancel,
    /// The campaign moves to this checkpoint, and goes on.
    Adopt(CheckpointDigest),
    /// The campaign learns from its label log up to this label cutoff, and goes on.
    Refine(u64),
    /// The campaign's search has this number of generations, more than before, and goes on.
    Extend(u32),
}

/// Why a decision was not made.
#[derive(Debug, thiserror::Error)]
pub enum DecisionError {
    /// The store could not be read or written.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The campaign's state does not allow the decision.
    #[error(transparent)]
    NotAllowed(#[from] NotAllowed),
    /// The campaign cannot have that number of generations.
    #[error(transparent)]
    Generations(#[from] Invalid),
}

impl Decision {
    #[must_use]
    pub const fn change(self) -> Change {
        match self {
            Self::Pause => Change::Pause,
            Self::Resume => Change::Resume,
            Self::Cancel => Change::Cancel,
            Self::Adopt(_) => Change::Adopt,
            Self::Refine(_) => Change::Refine,
            Self::Extend(_) => Change::Extend,
        }
    }
}

impl Store {
    /// A handle of the store for a run. Changes through this handle succeed only while the campaign runs and no decision was made
    /// since the run began. Later changes fail with [`StoreError::Superseded`].
    #[must_use]
    pub fn during(&self, run: RunId) -> Self {
        Self {
            run: Some(run.into()),
            ..self.clone()
        }
    }

    /// Makes a decision about a campaign, and ends the campaign's current run, if any. With `has_failed`, the run failed and
    /// could not record its failure.
    ///
    /// # Errors
    /// [`DecisionError::NotAllowed`] if the campaign's state does not allow the decision; [`DecisionError::Generations`] if an
    /// extension has no more generations than the campaign, or too many; [`StoreError::NoCheckpoint`] if the checkpoint is not
    /// stored. Nothing has changed then.
    pub fn decide(
        &self,
        campaign: &CampaignId,
        decision: Decision,
        has_failed: bool,
    ) -> Result<(), DecisionError> {
        self.write(|transaction| {
            let number = number_of(transaction, campaign)?;
            let state = match state(transaction, number)? {
                CampaignState::Running if has_failed => CampaignState::Failed,
                state => state,
            };
            let change = decision.change();
            let Some(after) = state.after(change) else {
                let id = campaign.clone();
                return Ok(Err(NotAllowed { id, change, state }.into()));
            };
            if let Decision::Extend(generations) = decision {
                match extended(transaction, number, generations)? {
                    Ok(spec) => transaction.execute(
                        "UPDATE campaigns SET spec = ?2 WHERE number = ?1",
                        params![number, spec.to_toml()],
                    )?,
                    Err(refused) => return Ok(Err(DecisionError::Generations(refused))),
                };
            }
            transaction.execute(
                "UPDATE campaigns SET state = ?2, error = '', decisions = decisions + 1,
                    ended_ms = CASE WHEN ?3 IS NULL THEN NULL ELSE coalesce(ended_ms, ?3) END
                 WHERE number = ?1",
                params![number, after.name(), ended_ms(after)],
            )?;
            match decision {
                Decision::Adopt(checkpoint) => begin_move(transaction, number, checkpoint)?,
                Decision::Refine(cutoff) => rounds::begin(transaction, number, cutoff)?,
                Decision::Pause | Decision::Resume | Decision::Cancel | Decision::Extend(_) => {}
            }
            Ok(Ok(()))
        })?
    }

    /// Sets a completed campaign running again, so that its results are checked; returns false if the campaign was not completed.
    pub fn reopen(&self, campaign: &CampaignId) -> Result<bool, StoreError> {
        self.write(|transaction| {
            let reopened = transaction.execute(
                "UPDATE campaigns SET state = ?2, error = '', decisions = decisions + 1, ended_ms = NULL
                 WHERE number = ?1 AND state = ?3",
                params![
                    number_of(transaction, campaign)?,
                    CampaignState::Running.name(),
                    CampaignState::Completed.name()
                ],
            )?;
            Ok(reopened > 0)
        })
    }

    /// Checks that the run of this handle, if any, can still change its campaign.
    pub(super) fn check_run(&self, transaction: &Transaction<'_>) -> Result<(), StoreError> {
        let Some(run) = &self.run else {
            return Ok(());
        };
        let may = transaction.query_row(
            "SELECT count(*) FROM campaigns WHERE id = ?1 AND state = ?2 AND decisions = ?3",
            params![
                run.campaign().as_str(),
                CampaignState::Running.name(),
                clamped(run.number())
            ],
            |row| row.get::<_, i64>(0),
        )?;
        match may {
            0 => Err(StoreError::Superseded(run.campaign().clone())),
            _ => Ok(()),
        }
    }
}

/// The specification of a campaign with more generations.
fn extended(
    transaction: &Transaction<'_>,
    number: i64,
    generations: u32,
) -> Result<Result<CampaignSpec, Invalid>, StoreError> {
    let spec: String =
        transaction.query_row("SELECT spec FROM campaigns WHERE number = ?1", [number], |row| {
            row.get(0)
        })?;
    let spec = CampaignSpec::from_toml(&spec).map_err(|error| StoreError::damaged(error.to_string()))?;
    let before = spec.search().generations();
    if generations <= before {
        let allowed = format!("the new total, more than the {before} that the campaign has");
        return Ok(Err(Invalid::new("generations", generations, allowed)));
    }
    Ok(spec.with_generations(generations))
}

pub(super) fn state(transaction: &Transaction<'_>, number: i64) -> Result<CampaignState, StoreError> {
    let name: String =
        transaction.query_row("SELECT state FROM campaigns WHERE number = ?1", [number], |row| {
            row.get(0)
        })?;
    CampaignState::from_name(&name).ok_or_else(|| StoreError::damaged(format!("state {name:?}")))
}

#[cfg(test)]
mod tests;
