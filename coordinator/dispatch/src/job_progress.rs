//! Progress of a job, reported while its submitter waits.

use std::sync::{
    Mutex, PoisonError,
    atomic::{AtomicBool, AtomicU32, Ordering},
};

/// Error text when no connected worker can embed.
const NO_EMBEDDER: &str = "no connected worker can embed: start one where ONNX Runtime is installed (`make runtime`), or \
                           see in the workers' logs why they cannot";

/// Progress of a job, and what holds it up.
#[derive(Debug, Default)]
pub struct JobProgress {
    done: AtomicU32,
    trouble: Mutex<Option<String>>,
    lacks_embedder: AtomicBool,
}

impl JobProgress {
    /// Number of tasks whose results have arrived. The number falls if a machine is quarantined.
    #[must_use]
    pub fn done(&self) -> u32 {
        self.done.load(Ordering::Relaxed)
    }

    /// Why the job makes no progress: no worker can embed, or the reason with which a worker returned the last lease.
    #[must_use]
    pub fn trouble(&self) -> Option<String> {
        if self.lacks_embedder.load(Ordering::Relaxed) {
            return Some(NO_EMBEDDER.to_owned());
        }
        let trouble = self.trouble.lock();
        trouble.unwrap_or_else(PoisonError::into_inner).clone()
    }

    pub(crate) fn set_done(&self, count: u32) {
        self.done.store(count, Ordering::Relaxed);
    }

    pub fn one_more(&self) {
        self.done.fetch_add(1, Ordering::Relaxed);
    }

    pub(super) fn set_lacks_embedder(&self, lacks: bool) {
        self.lacks_embedder.store(lacks, Ordering::Relaxed);
    }

    pub(super) fn set_trouble(&self, trouble: Option<String>) {
        *self.trouble.lock().unwrap_or_else(PoisonError::into_inner) = trouble;
    }
}
