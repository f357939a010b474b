//! How many may do at once what goes on for long, or computes.

use murmuration_access::limits::{
    MAX_EVALUATION_STREAMS, MAX_EXPORTS, MAX_IMPORTS, MAX_REPLAYS, MAX_SIMULATIONS, MAX_WATCHES,
};
use std::sync::Arc;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tonic::Status;

/// Room for those who watch, for replays, for searches elsewhere, for exports, for imports, and for simulations of the
/// coordinator; shared by gRPC and pages, cheap to clone.
#[derive(Debug, Clone)]
pub struct Permits {
    watches: Arc<Semaphore>,
    replays: Arc<Semaphore>,
    evaluations: Arc<Semaphore>,
    exports: Arc<Semaphore>,
    imports: Arc<Semaphore>,
    simulations: Arc<Semaphore>,
}

/// One seat, until it is dropped.
pub type Permit = OwnedSemaphorePermit;

impl Default for Permits {
    fn default() -> Self {
        Self::new([
            MAX_WATCHES,
            MAX_REPLAYS,
            MAX_EVALUATION_STREAMS,
            MAX_EXPORTS,
            MAX_IMPORTS,
            MAX_SIMULATIONS,
        ])
    }
}

impl Permits {
    /// As many of each as the fields are in order.
    fn new(counts: [usize; 6]) -> Self {
        let [watches, replays, evaluations, exports, imports, simulations] =
            counts.map(|count| Arc::new(Semaphore::new(count)));
        Self {
            watches,
            replays,
            evaluations,
            exports,
            imports,
            simulations,
        }
    }

    /// For somebody who watches.
    pub fn watch(&self) -> Result<Permit, Status> {
        take(
            &self.watches,
            "too many clients watch this coordinator: close one, or try again later",
        )
    }

    /// Lets nobody watch any more: a stream of events that holds such a permit ends when it looks next ([`is_over`]).
    pub fn end_watches(&self) {
        self.watches.close();
    }

    /// For a replay.
    pub fn replay(&self) -> Result<Permit, Status> {
        take(
            &self.replays,
            "too many replays are simulated or wait to be: try again later",
        )
    }

    /// For a search that runs elsewhere.
    pub fn evaluations(&self) -> Result<Permit, Status> {
        take(
            &self.evaluations,
            "too many searches evaluate on this coordinator: try again later",
        )
    }

    /// For a campaign, or the report of a study, that is exported.
    pub fn export(&self) -> Result<Permit, Status> {
        take(
            &self.exports,
            "too many campaigns and studies are exported from this coordinator: try again later",
        )
    }

    /// For a campaign that is imported.
    pub fn import(&self) -> Result<Permit, Status> {
        take(
            &self.imports,
            "too many campaigns are imported into this coordinator: try again later",
        )
    }

    /// For a part of a motion that the coordinator itself simulates, once others have finished theirs: parts are short.
    pub async fn simulation(&self) -> Result<Permit, Status> {
        let room = self.simulations.clone().acquire_owned().await;
        room.map_err(|_| Status::unavailable("the coordinator simulates no more"))
    }
}

/// Whether what is done with this permit is to end.
#[must_use]
pub fn is_over(permit: &Permit) -> bool {
    permit.semaphore().is_closed()
}

fn take(permits: &Arc<Semaphore>, full: &str) -> Result<Permit, Status> {
    permits
        .clone()
        .try_acquire_owned()
        .map_err(|_| Status::resource_exhausted(full))
}

#[cfg(test)]
mod tests {
    use super::*;
    use tonic::Code;

    #[test]
    fn who_watches_is_told_that_it_is_over() {
        let permits = Permits::default();
        let permit = permits.clone().watch().unwrap();
        assert!(!is_over(&permit));
        permits.end_watches();
        assert!(is_over(&permit) && permits.watch().is_err());
        assert!(!is_over(&permits.replay().unwrap()));
    }

    #[test]
    fn one_too_many_is_refused_until_another_leaves() {
        let permits = Permits::new([2, 1, 1, 1, 1, 1]);
        let first = permits.watch().unwrap();
        let _second = permits.clone().watch().unwrap();
        assert_eq!(permits.watch().unwrap_err().code(), Code::ResourceExhausted);
        drop(first);
        assert!(permits.watch().is_ok());
        let replay = permits.replay().unwrap();
        assert_eq!(permits.replay().unwrap_err().code(), Code::ResourceExhausted);
        drop(replay);
        assert!(permits.replay().is_ok());
        let search = permits.evaluations().unwrap();
        assert_eq!(permits.evaluations().unwrap_err().code(), Code::ResourceExhausted);
        drop(search);
        assert!(permits.evaluations().is_ok());
        let _export = permits.export().unwrap();
        assert_eq!(permits.export().unwrap_err().code(), Code::ResourceExhausted);
        // Viewers export, and operators import: the first do not keep the others away.
        let _import = permits.import().unwrap();
        assert_eq!(permits.import().unwrap_err().code(), Code::ResourceExhausted);
    }
}
