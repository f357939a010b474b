//! The runs of campaigns in this process.
//!
//! A function that starts or stops a campaign's run holds the lock of that campaign ([`Deciding`]). Other campaigns and readers
//! do not wait for this lock. The registry's own lock is held only for look-ups, never during waits or computations.

use super::run_handle::Progress;
use murmuration_model::{CampaignId, TimeLeft};
use murmuration_search::interrupt::Interrupt;
use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};
use tokio::{
    sync::{OwnedMutexGuard, watch},
    task::JoinHandle,
};

/// The runs of campaigns; all clones share the same runs.
#[derive(Debug, Clone, Default)]
pub(super) struct Registry(Arc<Mutex<Entries>>);

#[derive(Debug, Default)]
struct Entries {
    campaigns: BTreeMap<CampaignId, Entry>,
    /// Whether the coordinator is ending, so that no run starts any more.
    is_ending: bool,
}

#[derive(Debug, Default)]
struct Entry {
    deciding: Arc<tokio::sync::Mutex<()>>,
    /// The newest run of the campaign in this process.
    at_work: Option<AtWork>,
}

/// The lock of a campaign, held from a decision about it until its run has been stopped or started.
#[derive(Debug)]
pub(super) struct Deciding {
    pub(super) id: CampaignId,
    _held: OwnedMutexGuard<()>,
}

/// A run that was started in this process.
#[derive(Debug)]
pub(super) struct AtWork {
    pub(super) stop: watch::Sender<bool>,
    pub(super) interrupt: Interrupt,
    pub(super) progress: watch::Receiver<Progress>,
    pub(super) task: JoinHandle<()>,
}

/// The state of a run at one instant.
#[derive(Debug, Clone, Default)]
pub(super) struct Snapshot {
    /// Whether the run is at work and was not asked to stop.
    pub(super) active: bool,
    pub(super) progress: Progress,
}

impl Registry {
    /// Waits until no other decision about the campaign is in progress, and locks the campaign.
    pub(super) async fn deciding(&self, id: &CampaignId) -> Deciding {
        let lock = {
            let mut entries = self.lock();
            Arc::clone(&entries.campaigns.entry(id.clone()).or_default().deciding)
        };
        Deciding {
            id: id.clone(),
            _held: lock.lock_owned().await,
        }
    }

    /// Starts a run of the campaign. `begin` gets the former run, which was asked to stop but may still be at work. Once the
    /// coordinator is ending, no run starts.
    pub(super) fn start(&self, deciding: &Deciding, begin: impl FnOnce(Option<JoinHandle<()>>) -> AtWork) {
        let mut entries = self.lock();
        if entries.is_ending {
            return;
        }
        entries.campaigns.retain(|_, entry| entry.is_needed());
        let entry = entries.campaigns.entry(deciding.id.clone()).or_default();
        let former = entry.at_work.take().map(|former| former.task);
        entry.at_work = Some(begin(former));
    }

    /// Asks the run of the campaign to stop, if there is a run.
    pub(super) fn stop(&self, deciding: &Deciding) {
        if let Some(Entry {
            at_work: Some(at_work),
            ..
        }) = self.lock().campaigns.get(&deciding.id)
        {
            at_work.tell_to_stop();
        }
    }

    /// Asks every run to stop, and waits until all runs have stopped. No run starts after this call.
    pub(super) async fn end(&self) {
        let at_work: Vec<AtWork> = {
            let mut entries = self.lock();
            entries.is_ending = true;
            let entries = entries.campaigns.values_mut();
            entries.filter_map(|entry| entry.at_work.take()).collect()
        };
        at_work.iter().for_each(AtWork::tell_to_stop);
        for at_work in at_work {
            // A run that panicked has ended too.
            let _ = at_work.task.await;
        }
    }

    /// The state of a campaign's run; inactive if the campaign has no run.
    pub(super) fn snapshot(&self, id: &CampaignId) -> Snapshot {
        let entries = self.lock();
        let entry = entries.campaigns.get(id);
        entry.and_then(Entry::snapshot).unwrap_or_default()
    }

    /// Remaining time of a campaign's training; `None` if the campaign does not train, or its trainer does not know.
    pub(super) fn training_left(&self, id: &CampaignId) -> Option<TimeLeft> {
        let training = self.snapshot(id).progress.training?;
        training.seconds_left.map(TimeLeft::about)
    }

    pub(super) fn snapshots(&self) -> BTreeMap<CampaignId, Snapshot> {
        let entries = self.lock();
        let snapshot = |(id, entry): (&CampaignId, &Entry)| Some((id.clone(), entry.snapshot()?));
        entries.campaigns.iter().filter_map(snapshot).collect()
    }

    /// The progress of a campaign's run, while it is active.
    pub(super) fn progress(&self, id: &CampaignId) -> Option<watch::Receiver<Progress>> {
        let entries = self.lock();
        let at_work = entries.campaigns.get(id)?.at_work.as_ref()?;
        at_work.is_active().then(|| at_work.progress.clone())
    }

    fn lock(&self) -> MutexGuard<'_, Entries> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Entry {
    fn snapshot(&self) -> Option<Snapshot> {
        let at_work = self.at_work.as_ref()?;
        Some(Snapshot {
            active: at_work.is_active(),
            progress: at_work.progress.borrow().clone(),
        })
    }

    /// Whether the entry is needed: a decision is in progress, the run has not ended, or only the run's progress shows that it
    /// failed.
    fn is_needed(&self) -> bool {
        let tells =
            |at_work: &AtWork| !at_work.task.is_finished() || at_work.progress.borrow().failed.is_some();
        Arc::strong_count(&self.deciding) > 1 || self.at_work.as_ref().is_some_and(tells)
    }
}

impl AtWork {
    fn is_active(&self) -> bool {
        !*self.stop.borrow() && !self.task.is_finished()
    }

    fn tell_to_stop(&self) {
        self.stop.send_replace(true);
        self.interrupt.raise();
    }
}
