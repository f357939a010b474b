//! How much one annotator may add to label logs, so that nobody fills a log for all others.

use std::{
    sync::{Arc, Mutex, PoisonError},
    time::{Duration, Instant},
};

/// Entries that may be added at once after a pause: as many as one request may have.
const AT_ONCE: f64 = 50_000.0;
/// Entries a second in the long run: more than a person gives.
const PER_SECOND: f64 = 1.0;

/// The entries that the holder of a token may still add. Cheap to clone.
#[derive(Debug, Clone)]
pub struct LabelBudget {
    holder: u64,
    left: Arc<Mutex<Left>>,
}

#[derive(Debug)]
struct Left {
    /// Negative where more was added than was left, as by an undo.
    entries: f64,
    /// When `entries` was right.
    at: Instant,
}

/// More entries than the holder of a token may add now.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "this token has labelled much lately and may add {left} entries to label logs now, one more each second: wait, or ask an operator to \
     add them"
)]
pub struct OverBudget {
    pub left: u64,
}

tokio::task_local! {
    static BUDGET: LabelBudget;
}

impl LabelBudget {
    /// A full budget of the token with this number.
    #[must_use]
    pub fn of(holder: u64) -> Self {
        let left = Left {
            entries: AT_ONCE,
            at: Instant::now(),
        };
        Self {
            holder,
            left: Arc::new(Mutex::new(left)),
        }
    }

    /// The number of its token, the same for as long as the process lives.
    #[must_use]
    pub const fn holder(&self) -> u64 {
        self.holder
    }

    /// Runs `task`, whose requests are within this budget.
    pub async fn scope<F: Future>(self, task: F) -> F::Output {
        BUDGET.scope(self, task).await
    }

    /// The budget of this task; none where there is no limit.
    #[must_use]
    pub fn current() -> Option<Self> {
        BUDGET.try_with(Clone::clone).ok()
    }

    /// Whether `wanted` entries may be added now; none, as for an undo, always may.
    ///
    /// # Errors
    /// [`OverBudget`].
    pub fn check(&self, wanted: usize) -> Result<(), OverBudget> {
        self.check_at(wanted, Instant::now())
    }

    /// Takes `added` entries from what is left, also beyond it.
    pub fn charge(&self, added: usize) {
        self.left(Instant::now(), |left| left.entries -= added as f64);
    }

    /// Whether nothing was taken lately, so that a new one would do as well.
    #[must_use]
    pub fn is_full(&self) -> bool {
        self.left(Instant::now(), |left| left.entries >= AT_ONCE)
    }

    fn check_at(&self, wanted: usize, now: Instant) -> Result<(), OverBudget> {
        let left = self.left(now, |left| left.entries);
        match wanted > 0 && wanted as f64 > left {
            true => Err(OverBudget {
                left: left.max(0.0) as u64,
            }),
            false => Ok(()),
        }
    }

    fn left<T>(&self, now: Instant, change: impl FnOnce(&mut Left) -> T) -> T {
        let mut left = self.left.lock().unwrap_or_else(PoisonError::into_inner);
        let passed: Duration = now.saturating_duration_since(left.at);
        left.entries = (left.entries + passed.as_secs_f64() * PER_SECOND).min(AT_ONCE);
        left.at = now;
        change(&mut left)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_added_comes_back_slowly_and_no_more_than_that() {
        let budget = LabelBudget::of(1);
        assert!(budget.is_full());
        assert_eq!(budget.check(50_001), Err(OverBudget { left: 50_000 }));
        assert_eq!(budget.check(50_000), Ok(()));
        budget.charge(50_000);
        let now = Instant::now();
        assert_eq!(budget.check_at(1, now), Err(OverBudget { left: 0 }));
        let later = now + Duration::from_secs(10);
        assert_eq!(budget.check_at(12, later), Err(OverBudget { left: 10 }));
        assert_eq!(budget.check_at(10, later), Ok(()));
        // Undoing is always allowed, and counts.
        budget.charge(100);
        assert_eq!(budget.check_at(0, later), Ok(()));
        assert_eq!(budget.check_at(1, later), Err(OverBudget { left: 0 }));
        let much_later = now + Duration::from_secs(1_000_000);
        assert_eq!(
            budget.check_at(50_001, much_later),
            Err(OverBudget { left: 50_000 })
        );
    }

    #[tokio::test]
    async fn a_task_has_the_budget_that_it_was_given() {
        assert!(LabelBudget::current().is_none());
        let budget = LabelBudget::of(1);
        let charged = async { LabelBudget::current().unwrap().charge(1) };
        budget.clone().scope(charged).await;
        assert!(!budget.is_full());
    }
}
