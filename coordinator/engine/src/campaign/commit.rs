//! Commits the results of a stage, and waits as long as the disk refuses them.

use super::{CampaignError, context::StageContext, run_handle::CommitHandle};
use backon::{BackoffBuilder as _, ExponentialBuilder};
use murmuration_search::interrupt::Interrupted;
use murmuration_store::Store;
use std::{sync::Arc, time::Duration};

/// Pauses before a refused commit is retried. The pause doubles from `FIRST_PAUSE` up to `LAST_PAUSE`.
const FIRST_PAUSE: Duration = Duration::from_secs(2);
const LAST_PAUSE: Duration = Duration::from_secs(30);

impl StageContext {
    /// Makes a change to the store. While the disk is full, read-only or failing, the campaign reports this and retries the
    /// change, so that the workers' results are not lost.
    ///
    /// # Errors
    /// [`Interrupted`] if the campaign must stop while it waits; the store is then unchanged.
    pub(super) async fn commit<T: Send + 'static, E: Into<CampaignError> + Send + 'static>(
        &self,
        handle: &CommitHandle,
        change: impl Fn(&Store) -> Result<T, E> + Send + Sync + 'static,
    ) -> Result<T, CampaignError> {
        let change = Arc::new(change);
        let pauses = ExponentialBuilder::default()
            .with_min_delay(FIRST_PAUSE)
            .with_max_delay(LAST_PAUSE)
            .without_max_times();
        let mut pauses = pauses.build();
        loop {
            let once = Arc::clone(&change);
            let once = move |store: &Store| once(store).map_err(Into::<CampaignError>::into);
            let error = match self.store.run(once).await {
                Ok(made) => {
                    handle.refused(None);
                    return Ok(made);
                }
                Err(error) if error.may_pass() => error.to_string(),
                Err(error) => return Err(error),
            };
            tracing::warn!(error, "waits for the disk");
            handle.refused(Some(error));
            tokio::select! {
                () = handle.stopped() => return Err(Interrupted.into()),
                () = tokio::time::sleep(pauses.next().unwrap_or(LAST_PAUSE)) => {}
            }
        }
    }
}
