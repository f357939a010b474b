//! Limits how many entries one annotator can add to label logs, so that nobody fills up a log that other annotators use.

use std::{
    sync::{Arc, Mutex, PoisonError},
    time::{Duration, Instant},
};

/// Maximum number of entries that a token can add at once after a pause: as many as one request can have.
const AT_ONCE: f64 = 50_000.0;
/// Number of entries per second that a token can add in the long run: more than a person gives.
const PER_SECOND: f64 = 1.0;

/// The number of entries that the holder of a token can still add. Cheap to clone.
#[derive(Debug, Clone)]
pub struct LabelBudget {
    holder: u64,
    left: Arc<Mutex<Left>>,
}

#[derive(Debug)]
struct Left {
    /// Number of entries that are left; negative if more entries were added than were left, for example by an undo.
    entries: f64,
    /// The time at which `entries` was computed.
    at: Instant,
}

/// The request has more entries than the holder of a token can add now.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "this token has added many label entries lately: it may add {left} now, and one more each second; wait, or ask an \
     operator to add them"
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

    /// A number for the annotator's token. All budgets of one token have the same number until the process ends.
    #[must_use]
    pub const fn holder(&self) -> u64 {
        self.holder
    }

    /// Runs `task`, whose requests use this budget.
    pub async fn scope<F: Future>(self, task: F) -> F::Output {
        BUDGET.scope(self, task).await
    }

    /// The budget of this task; `None` if there is no limit.
    #[must_use]
    pub fn current() -> Option<Self> {
        BUDGET.try_with(Clone::clone).ok()
    }

    /// Reserves `wanted` of the entries that are left. Reserving zero entries, as for an undo, is always allowed.
    ///
    /// # Errors
    /// [`OverBudget`].
    pub fn reserve(&self, wanted: usize) -> Result<Reserved, OverBudget> {
        self.reserve_at(wanted, Instant::now())
    }

    /// Whether the budget is full and no request holds it, so that a new budget can replace it.
    #[must_use]
    pub fn is_unused(&self) -> bool {
        Arc::strong_count(&self.left) == 1 && self.left(Instant::now(), |left| left.entries >= AT_ONCE)
    }

    fn reserve_at(&self, wanted: usize, now: Instant) -> Result<Reserved, OverBudget> {
        let entries = wanted as f64;
        self.left(now, |left| match wanted > 0 && entries > left.entries {
            true => Err(OverBudget {
                left: left.entries.max(0.0) as u64,
            }),
            false => {
                left.entries -= entries;
                Ok(())
            }
        })?;
        Ok(Reserved {
            budget: self.clone(),
            entries,
        })
    }

    fn left<T>(&self, now: Instant, change: impl FnOnce(&mut Left) -> T) -> T {
        let mut left = self.left.lock().unwrap_or_else(PoisonError::into_inner);
        let passed: Duration = now.saturating_duration_since(left.at);
        left.entries = (left.entries + passed.as_secs_f64() * PER_SECOND).min(AT_ONCE);
        left.at = left.at.max(now);
        change(&mut left)
    }
}

/// Entries that a request can add. Dropping this value returns the entries to the budget.
#[derive(Debug)]
pub struct Reserved {
    budget: LabelBudget,
    entries: f64,
}

impl Reserved {
    /// Takes `added` entries from the budget for good instead of the reserved entries, even if fewer entries are left.
    pub fn settle(mut self, added: usize) {
        self.entries -= added as f64;
    }
}

impl Drop for Reserved {
    fn drop(&mut self) {
        let back = self.entries;
        self.budget.left(Instant::now(), |left| {
            left.entries = (left.entries + back).min(AT_ONCE)
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_added_comes_back_slowly_and_no_more_than_that() {
        let budget = LabelBudget::of(1);
        assert!(budget.is_unused());
        let over = |wanted, now| budget.reserve_at(wanted, now).map(drop).unwrap_err().left;
        let now = Instant::now();
        assert_eq!(over(50_001, now), 50_000);
        budget.reserve_at(50_000, now).unwrap().settle(50_000);
        assert_eq!(over(1, now), 0);
        let later = now + Duration::from_secs(10);
        assert_eq!(over(12, later), 10);
        drop(budget.reserve_at(10, later).unwrap());
        // Undoing is always allowed, and uses up the budget.
        budget.reserve_at(0, later).unwrap().settle(100);
        assert_eq!(over(1, later), 0);
        let much_later = now + Duration::from_secs(1_000_000);
        assert_eq!(over(50_001, much_later), 50_000);
    }

    #[test]
    fn requests_at_once_share_what_is_left_and_keep_the_budget() {
        let budget = LabelBudget::of(1);
        // The clone is a request that has begun and added nothing yet.
        let other = budget.clone();
        assert!(!budget.is_unused());
        let reserved = budget.reserve(45_000).unwrap();
        assert!(other.reserve(45_000).is_err());
        // A request that fails uses nothing of the budget.
        drop(reserved);
        assert!(other.reserve(45_000).is_ok());
    }

    #[tokio::test]
    async fn a_task_has_the_budget_that_it_was_given() {
        assert!(LabelBudget::current().is_none());
        let budget = LabelBudget::of(1);
        let charged = async { LabelBudget::current().unwrap().reserve(1).unwrap().settle(1) };
        budget.clone().scope(charged).await;
        assert!(!budget.is_unused());
    }
}
