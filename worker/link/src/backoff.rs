//! Pauses between attempts to connect.

use murmuration_proto::{Purpose, Stream};
use std::time::Duration;

/// Wait before connecting again: doubles from the first to the last.
const FIRST_PAUSE: Duration = Duration::from_millis(100);
const LAST_PAUSE: Duration = Duration::from_secs(5);

/// Exponential pauses, with jitter so that many workers do not come back in step.
pub(crate) struct Backoff {
    next: Duration,
    jitter: Stream,
}

impl Backoff {
    pub(crate) fn new() -> Self {
        // Not an evaluation: here two processes should differ.
        let seed = u64::from(std::process::id());
        Self {
            next: FIRST_PAUSE,
            jitter: Stream::derive(seed, Purpose::Jitter, 1),
        }
    }

    pub(crate) fn reset(&mut self) {
        self.next = FIRST_PAUSE;
    }

    pub(crate) fn next(&mut self) -> Duration {
        let pause = self.next.mul_f64(self.jitter.between(0.5, 1.0));
        self.next = (self.next * 2).min(LAST_PAUSE);
        pause
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_grow_to_a_bound_and_begin_anew() {
        let mut backoff = Backoff::new();
        for expected in [100, 200, 400, 800, 1600, 3200, 5000, 5000] {
            let pause = backoff.next();
            let most = Duration::from_millis(expected);
            assert!(most / 2 <= pause && pause <= most, "{pause:?} of {most:?}");
        }
        backoff.reset();
        assert!(backoff.next() <= FIRST_PAUSE);
    }
}
