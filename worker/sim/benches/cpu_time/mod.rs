//! The CPU time of this thread, which other programs on the machine disturb less than wall-clock time.

use rustix::time::{ClockId, clock_gettime};

/// Seconds of this thread's CPU time that `work` takes.
pub fn timed(work: impl FnOnce()) -> f64 {
    let now = || {
        let now = clock_gettime(ClockId::ThreadCPUTime);
        now.tv_sec as f64 + now.tv_nsec as f64 * 1e-9
    };
    let begun = now();
    work();
    now() - begun
}
