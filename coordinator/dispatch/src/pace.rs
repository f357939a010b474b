//! The measured cost of work: how long a thread of the connected workers takes for a step of an agent.

use std::time::{Duration, Instant};

/// Time after which a measurement counts half.
const HALF_LIFE: Duration = Duration::from_secs(60);

/// Measures the time of threads that hold tasks, and the tasks that they complete.
#[derive(Debug, Default)]
pub(super) struct Pace {
    /// Seconds of threads that held tasks, up to the last completion.
    busy: f64,
    /// Cost of the completed tasks, in steps of an agent.
    pub(super) steps: f64,
    /// Seconds of threads that have held tasks since the last completion, and the seconds during which there was such a thread.
    open: (f64, f64),
    looked: Option<Instant>,
}

impl Pace {
    /// Counts the time since the last look for `threads` threads that hold tasks.
    pub(super) fn look(&mut self, threads: usize, now: Instant) {
        let last = self.looked.replace(now).unwrap_or(now);
        // A pause without work says nothing about the cost of work.
        if threads > 0 {
            let seconds = now.saturating_duration_since(last).as_secs_f64();
            self.open.0 += seconds * threads as f64;
            self.open.1 += seconds;
        } else {
            // The tasks were withdrawn, or lost with their workers.
            self.open = (0.0, 0.0);
        }
    }

    /// Counts completed tasks, whose cost is `steps` steps of an agent in total.
    pub(super) fn complete(&mut self, steps: u64) {
        // Time counts together with the tasks that it was spent on, however long they take.
        let (busy, seconds) = std::mem::take(&mut self.open);
        let kept = (-seconds / HALF_LIFE.as_secs_f64()).exp2();
        self.busy = kept * self.busy + busy;
        self.steps = kept * self.steps + steps as f64;
    }

    /// Seconds of a thread for a step of an agent; `None` before the first result.
    pub(super) fn seconds_per_step(&self) -> Option<f64> {
        (self.steps > 0.0 && self.busy > 0.0).then(|| self.busy / self.steps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cost_of_a_step_is_that_of_the_last_minutes() {
        let mut pace = Pace::default();
        let mut now = Instant::now();
        pace.look(0, now);
        assert_eq!(pace.seconds_per_step(), None);
        let work = |pace: &mut Pace, now: &mut Instant, threads: usize, steps: u64, seconds: u64| {
            for _ in 0..10 * seconds {
                *now += Duration::from_millis(100);
                pace.look(threads, *now);
                if steps > 0 {
                    pace.complete(steps);
                }
            }
        };
        // Two threads take 0.1 s for 20 steps.
        work(&mut pace, &mut now, 2, 20, 100);
        let expected = 0.01;
        let found = pace.seconds_per_step().unwrap();
        assert!((found / expected - 1.0).abs() < 0.01, "{found}");
        // The machines rest for an hour, then simpler tasks come.
        work(&mut pace, &mut now, 0, 0, 3600);
        assert_eq!(pace.seconds_per_step(), Some(found));
        work(&mut pace, &mut now, 2, 200, 600);
        let found = pace.seconds_per_step().unwrap();
        assert!((found / 0.001 - 1.0).abs() < 0.05, "{found}");
        // Tasks of ten minutes: a thread takes 0.6 s for a step.
        for _ in 0..5 {
            for _ in 0..6000 {
                now += Duration::from_millis(100);
                pace.look(1, now);
                assert!(pace.seconds_per_step().unwrap() < 0.61);
            }
            pace.complete(1000);
        }
        let found = pace.seconds_per_step().unwrap();
        assert!((found / 0.6 - 1.0).abs() < 0.05, "{found}");
    }
}
