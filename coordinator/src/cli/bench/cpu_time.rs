//! CPU time, which other programs of a shared machine hardly change.

use rustix::time::{ClockId, clock_gettime};
use std::time::Duration;

/// CPU time that was used, in user and in system mode.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct CpuTime(Duration);

impl CpuTime {
    /// Of all threads of this process so far.
    pub(super) fn of_process() -> Self {
        Self::read(ClockId::ProcessCPUTime)
    }

    /// Of this thread so far.
    pub(super) fn of_thread() -> Self {
        Self::read(ClockId::ThreadCPUTime)
    }

    fn read(clock: ClockId) -> Self {
        let time = clock_gettime(clock);
        Self(Duration::new(
            time.tv_sec.unsigned_abs(),
            time.tv_nsec.unsigned_abs() as u32,
        ))
    }

    /// The same without that of `other`.
    pub(super) const fn without(self, other: Self) -> Self {
        Self(self.0.saturating_sub(other.0))
    }

    /// The sum of both.
    pub(super) const fn with(self, other: Self) -> Self {
        Self(self.0.saturating_add(other.0))
    }

    pub(super) fn as_secs_f64(self) -> f64 {
        self.0.as_secs_f64()
    }
}
