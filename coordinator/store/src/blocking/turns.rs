//! Limits the processor time and the threads that one client gets for work that no campaign waits for.
//!
//! A person who opens a page now and then must not wait because of a busy campaign, and a guest who opens hundreds of pages must
//! not slow that campaign. So each client has a small allowance of processor time with normal priority, which refills slowly;
//! work beyond the allowance has low priority.

use std::{
    cell::Cell,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

/// Maximum number of pieces of work of one client that run at once.
pub(super) const AT_ONCE: usize = 2;
/// Full allowance of a client: processor time with normal priority.
const MOST: Duration = Duration::from_secs(1);
/// Rate at which the allowance refills, as a share of one core.
const SHARE: f64 = 0.02;

/// Limits the background work of one client: two pieces of work run at once, and further pieces wait. Cheap to clone.
#[derive(Debug, Clone)]
pub struct Turns {
    client: Arc<Client>,
    /// Whether further pieces of work wait.
    waits: bool,
}

#[derive(Debug)]
struct Client {
    free: Arc<Semaphore>,
    /// For long work, of which one piece runs at a time.
    long: Arc<Semaphore>,
    allowance: Mutex<Allowance>,
}

/// Permission to work, until dropped.
#[derive(Debug)]
pub(super) struct Turn {
    of: Arc<Client>,
    /// Whether the work has normal priority.
    pub(super) is_prompt: bool,
    /// Processor time of this thread when work with normal priority began.
    begun: Option<Duration>,
    _permit: Option<OwnedSemaphorePermit>,
}

impl Default for Turns {
    fn default() -> Self {
        Self {
            client: Arc::new(Client {
                free: Arc::new(Semaphore::new(AT_ONCE)),
                long: Arc::new(Semaphore::new(1)),
                allowance: Mutex::new(Allowance::new(Instant::now())),
            }),
            waits: true,
        }
    }
}

impl Turns {
    /// Whether this value has no other clone and its allowance is full, so that a new value can replace it.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        Arc::strong_count(&self.client) == 1 && self.client.allowance().is_full(Instant::now())
    }

    /// The same client's turns, but work does not wait for other work of the client.
    pub(super) fn at_once(self) -> Self {
        Self { waits: false, ..self }
    }

    pub(super) async fn next(self) -> Turn {
        let free = Arc::clone(&self.client.free);
        let permit = match self.waits {
            // The semaphore is never closed.
            true => free.acquire_owned().await.ok(),
            false => free.try_acquire_owned().ok(),
        };
        let left = self.client.allowance().left(Instant::now());
        Turn {
            is_prompt: left > 0.0 && permit.is_some(),
            of: self.client,
            begun: None,
            _permit: permit,
        }
    }

    /// The client's permit for long work, unless it has such work.
    pub(super) fn long(self) -> Option<OwnedSemaphorePermit> {
        Arc::clone(&self.client.long).try_acquire_owned().ok()
    }
}

impl Turn {
    /// Notes that the work begins on this thread. The turn must be dropped on the same thread when the work ends.
    pub(super) fn begin(&mut self) {
        USED_BY_OTHERS.set(Duration::ZERO);
        self.begun = self.is_prompt.then(used_by_this_thread);
    }
}

impl Drop for Turn {
    fn drop(&mut self) {
        if let Some(begun) = self.begun {
            let used = used_by_this_thread().saturating_sub(begun);
            self.of.allowance().use_up(used + USED_BY_OTHERS.take());
        }
    }
}

impl Client {
    fn allowance(&self) -> MutexGuard<'_, Allowance> {
        self.allowance.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[derive(Debug)]
struct Allowance {
    /// Seconds of processor time that are left; negative if work used more than was left when the work began.
    left: f64,
    /// The time at which `left` was computed.
    at: Instant,
}

impl Allowance {
    fn new(now: Instant) -> Self {
        Self {
            left: MOST.as_secs_f64(),
            at: now,
        }
    }

    fn left(&mut self, now: Instant) -> f64 {
        let gained = now.saturating_duration_since(self.at).as_secs_f64() * SHARE;
        self.left = (self.left + gained).min(MOST.as_secs_f64());
        self.at = now;
        self.left
    }

    fn is_full(&mut self, now: Instant) -> bool {
        self.left(now) >= MOST.as_secs_f64()
    }

    fn use_up(&mut self, used: Duration) {
        self.left -= used.as_secs_f64();
    }
}

thread_local! {
    /// Processor time that other threads used for the work of this thread.
    static USED_BY_OTHERS: Cell<Duration> = const { Cell::new(Duration::ZERO) };
}

/// Runs a computation of several threads, and counts it as if it kept all of them busy.
pub(super) fn counted<T: Send>(compute: impl FnOnce() -> T + Send) -> T {
    let begun = Instant::now();
    let computed = compute();
    let threads = rayon::current_num_threads().try_into().unwrap_or(u32::MAX);
    let used = begun.elapsed().saturating_mul(threads);
    USED_BY_OTHERS.set(USED_BY_OTHERS.get().saturating_add(used));
    computed
}

#[cfg(target_os = "linux")]
fn used_by_this_thread() -> Duration {
    let used = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    Duration::try_from(used).unwrap_or_default()
}

/// On other systems no thread has low priority, so processor time is not counted.
#[cfg(not(target_os = "linux"))]
fn used_by_this_thread() -> Duration {
    Duration::ZERO
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_used_comes_back_slowly() {
        let mut now = Instant::now();
        let mut allowance = Allowance::new(now);
        assert!(allowance.is_full(now));
        allowance.use_up(MOST + Duration::from_secs(1));
        now += Duration::from_secs(49);
        assert!(allowance.left(now) < 0.0, "1 s takes 50 s");
        now += Duration::from_secs(2);
        assert!(allowance.left(now) > 0.0 && !allowance.is_full(now));
        now += Duration::from_secs(1_000_000);
        assert!(allowance.is_full(now));
        allowance.use_up(MOST);
        assert!(allowance.left(now) <= 0.0, "no more than the most is kept");
    }
}
