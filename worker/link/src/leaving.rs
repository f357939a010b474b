//! When a worker or trainer leaves by itself, so that it does not use up time of a cluster that others could use.

use clap::builder::BoolishValueParser;
use murmuration_proto::v1::{self, coordinator_message, worker_message};
use std::{
    collections::HashMap,
    env,
    str::FromStr,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant, SystemTime, UNIX_EPOCH},
};

/// Minimum time between leaving and the end of the process's allocation: the results of the last leases must be sent.
const LAST_RESULTS: Duration = Duration::from_secs(15);
/// A step (a lease of a worker, an epoch of a trainer) may take this many times as long as the longest step so far.
const LONGER: u32 = 2;
/// Time between two looks at clock, work and parent.
const INTERVAL: Duration = Duration::from_millis(250);

/// Arguments of every worker and trainer about its end.
#[derive(Debug, Clone, Default, clap::Args)]
pub struct LeavingArguments {
    /// Leave after this time without work, such as 10m
    #[arg(long, env = "MURMURATION_IDLE_TIMEOUT", value_name = "TIME", value_parser = humantime::parse_duration)]
    idle_timeout: Option<Duration>,
    /// Leave after this time, such as 8h
    #[arg(long, env = "MURMURATION_LIFETIME", value_name = "TIME", value_parser = humantime::parse_duration)]
    lifetime: Option<Duration>,
    /// Take no lease that cannot end within this time, and leave before: 90m, or 1-12:00:00 as in Slurm [default: until the end
    /// of the Slurm job, if there is one]
    #[arg(long, env = "MURMURATION_TIME_LIMIT", value_name = "TIME", value_parser = time_limit)]
    time_limit: Option<Duration>,
    /// Leave when the process that started this one has ended
    #[arg(long, env = "MURMURATION_END_WITH_PARENT", value_parser = BoolishValueParser::new())]
    end_with_parent: bool,
    /// After the loss of the coordinator: `retry` without end, `retry=TIME`, or `exit`
    #[arg(
        long,
        env = "MURMURATION_ON_COORDINATOR_LOST",
        value_name = "exit|retry[=TIME]",
        default_value = "retry"
    )]
    on_coordinator_lost: OnLost,
}

/// Whether a process tries to reconnect after it has lost its coordinator, and for how long.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum OnLost {
    #[default]
    Retry,
    /// Tries again for this time, also if there was no connection yet.
    RetryFor(Duration),
    /// Leaves. If there was no connection yet, the process tries again without end.
    Exit,
}

impl FromStr for OnLost {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once('=') {
            None if text == "retry" => Ok(Self::Retry),
            None if text == "exit" => Ok(Self::Exit),
            Some(("retry", time)) => {
                let time = humantime::parse_duration(time);
                Ok(Self::RetryFor(time.map_err(|error| error.to_string())?))
            }
            _ => Err("must be exit, retry, or retry=TIME such as retry=10m".to_owned()),
        }
    }
}

/// Reads a time limit: a duration such as `90m`, or in Slurm's forms `MM`, `MM:SS`, `HH:MM:SS`, `D-HH`, `D-HH:MM`, `D-HH:MM:SS`.
fn time_limit(text: &str) -> Result<Duration, String> {
    let of_slurm = slurm_time(text).map(Duration::from_secs);
    of_slurm.map_or_else(
        || humantime::parse_duration(text).map_err(|error| error.to_string()),
        Ok,
    )
}

/// The seconds of a time in Slurm's forms.
fn slurm_time(text: &str) -> Option<u64> {
    let (days, rest) = match text.split_once('-') {
        Some((days, rest)) => (Some(days.parse::<u64>().ok()?), rest),
        None => (None, text),
    };
    let parts: Vec<u64> = rest
        .split(':')
        .map(|part| part.parse().ok())
        .collect::<Option<_>>()?;
    let [hours, minutes, seconds] = match (days, parts.as_slice()) {
        (None, &[minutes]) => [0, minutes, 0],
        (None, &[minutes, seconds]) => [0, minutes, seconds],
        (Some(_), &[hours]) => [hours, 0, 0],
        (Some(_), &[hours, minutes]) => [hours, minutes, 0],
        (_, &[hours, minutes, seconds]) => [hours, minutes, seconds],
        _ => return None,
    };
    let days = days.unwrap_or_default().checked_mul(86_400)?;
    let hours = hours.checked_mul(3600)?;
    let minutes = minutes.checked_mul(60)?;
    days.checked_add(hours)?
        .checked_add(minutes)?
        .checked_add(seconds)
}

/// The time that is left to the Slurm job of this process; `None` outside a job.
fn left_to_job() -> Option<Duration> {
    let text = env::var("SLURM_JOB_END_TIME").ok()?;
    let Ok(end) = text.trim().parse::<u64>() else {
        tracing::warn!(
            "SLURM_JOB_END_TIME is no time: this process does not know when its job ends (--time-limit)"
        );
        return None;
    };
    let now = SystemTime::now().duration_since(UNIX_EPOCH).ok()?;
    Some(Duration::from_secs(end).saturating_sub(now))
}

/// Conditions under which a process leaves by itself; cheap to clone. By default, a process never leaves by itself.
#[derive(Debug, Clone, Default)]
pub struct Leaving {
    pub on_lost: OnLost,
    pub(crate) activity: Activity,
}

impl Leaving {
    /// For a process that leaves only after the loss of its coordinator.
    #[must_use]
    pub fn when_lost(on_lost: OnLost) -> Self {
        Self {
            on_lost,
            ..Self::default()
        }
    }
}

/// The leases in the hands of a process.
#[derive(Debug, Clone, Default)]
pub(crate) struct Activity(Arc<Mutex<Work>>);

#[derive(Debug)]
struct Work {
    /// The open leases, with the time of their last step: when they came, or the last report of a training.
    open: HashMap<LeaseKey, Instant>,
    idle_since: Instant,
    /// The longest step so far.
    longest: Duration,
}

/// The coordinator's epoch, and the number of the lease in it.
type LeaseKey = (u64, u64);

impl Default for Work {
    fn default() -> Self {
        Self {
            open: HashMap::new(),
            idle_since: Instant::now(),
            longest: Duration::ZERO,
        }
    }
}

impl Activity {
    /// Notes a message from the coordinator.
    pub(crate) fn received(&self, message: &coordinator_message::Message) {
        match message {
            coordinator_message::Message::Lease(lease) => {
                if let Some(lease) = key(lease.id) {
                    self.work().open.insert(lease, Instant::now());
                }
            }
            // A withdrawn lease has no result.
            coordinator_message::Message::Withdrawal(withdrawal) => self.work().end(key(withdrawal.lease)),
            coordinator_message::Message::Welcome(_) => {}
        }
    }

    /// Notes a message to the coordinator.
    pub(crate) fn sent(&self, message: &worker_message::Message) {
        match message {
            worker_message::Message::Result(result) => {
                let mut work = self.work();
                work.step(key(result.lease));
                work.end(key(result.lease));
            }
            // A trainer leaves after an epoch, not after a training.
            worker_message::Message::Training(report) => self.work().step(key(report.lease)),
            _ => {}
        }
    }

    /// Notes that the process has dropped all leases.
    pub(crate) fn dropped_all(&self) {
        let mut work = self.work();
        if !work.open.is_empty() {
            work.open.clear();
            work.idle_since = Instant::now();
        }
    }

    fn idle_for(&self) -> Duration {
        let work = self.work();
        match work.open.is_empty() {
            true => work.idle_since.elapsed(),
            false => Duration::ZERO,
        }
    }

    /// Time that the process keeps for its last results.
    fn reserve(&self) -> Duration {
        LAST_RESULTS.max(self.work().longest.saturating_mul(LONGER))
    }

    fn work(&self) -> MutexGuard<'_, Work> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Work {
    fn step(&mut self, lease: Option<LeaseKey>) {
        if let Some(last) = lease.and_then(|lease| self.open.get_mut(&lease)) {
            self.longest = self.longest.max(last.elapsed());
            *last = Instant::now();
        }
    }

    fn end(&mut self, lease: Option<LeaseKey>) {
        if lease.and_then(|lease| self.open.remove(&lease)).is_some() {
            self.idle_since = Instant::now();
        }
    }
}

fn key(lease: Option<v1::LeaseId>) -> Option<LeaseKey> {
    lease.map(|lease| (lease.epoch, lease.number))
}

impl LeavingArguments {
    pub(crate) fn leaving(&self) -> Leaving {
        Leaving {
            on_lost: self.on_coordinator_lost,
            activity: Activity::default(),
        }
    }

    /// Resolves with the reason when the process must leave.
    pub(crate) async fn time_to_leave(self, leaving: Leaving) -> String {
        let begun = Instant::now();
        let limit = self.time_limit.or_else(left_to_job);
        let parent = parent();
        let mut interval = tokio::time::interval(INTERVAL);
        loop {
            interval.tick().await;
            if let Some(timeout) = self.idle_timeout
                && leaving.activity.idle_for() >= timeout
            {
                return format!("no work for {}", humantime::format_duration(timeout));
            }
            if let Some(lifetime) = self.lifetime
                && begun.elapsed() >= lifetime
            {
                return format!("the lifetime of {} is over", humantime::format_duration(lifetime));
            }
            if let Some(limit) = limit
                && begun.elapsed() + leaving.activity.reserve() >= limit
            {
                return "the time limit is near".to_owned();
            }
            if self.end_with_parent && self::parent() != parent {
                return "the process that started this one has ended".to_owned();
            }
        }
    }
}

/// The process that started this one; another process once that one has ended.
#[cfg(unix)]
fn parent() -> Option<rustix::process::Pid> {
    rustix::process::getppid()
}

/// Other systems do not tell.
#[cfg(not(unix))]
const fn parent() -> Option<u32> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_read_as_slurm_writes_them() {
        for (text, seconds) in [
            ("30", 1800),
            ("10:30", 630),
            ("1:00:00", 3600),
            ("2-12", 216_000),
            ("1-12:30", 131_400),
            ("1-12:00:01", 129_601),
            ("90s", 90),
            ("1h 30m", 5400),
        ] {
            assert_eq!(time_limit(text), Ok(Duration::from_secs(seconds)), "{text}");
        }
        for wrong in ["", "x", "1:2:3:4", "1-2-3", "-5", "99999999999999999999-1", "1-"] {
            assert!(time_limit(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_lost_coordinator_is_awaited_as_asked() {
        assert_eq!("retry".parse(), Ok(OnLost::Retry));
        assert_eq!("exit".parse(), Ok(OnLost::Exit));
        assert_eq!(
            "retry=10m".parse(),
            Ok(OnLost::RetryFor(Duration::from_secs(600)))
        );
        for wrong in ["", "retry=", "exit=1m", "wait"] {
            assert!(wrong.parse::<OnLost>().is_err(), "{wrong}");
        }
    }

    fn lease(number: u64) -> coordinator_message::Message {
        coordinator_message::Message::Lease(v1::Lease {
            id: Some(v1::LeaseId { epoch: 7, number }),
            ..v1::Lease::default()
        })
    }

    fn result(number: u64) -> worker_message::Message {
        worker_message::Message::Result(v1::BatchResult {
            lease: Some(v1::LeaseId { epoch: 7, number }),
            ..v1::BatchResult::default()
        })
    }

    const SHORT: Duration = Duration::from_millis(5);

    #[test]
    fn a_process_with_a_lease_is_not_idle() {
        let activity = Activity::default();
        activity.received(&lease(1));
        activity.received(&lease(2));
        activity.sent(&result(2));
        // An unknown lease changes nothing.
        activity.sent(&result(9));
        std::thread::sleep(SHORT);
        assert_eq!(activity.idle_for(), Duration::ZERO);
        activity.sent(&result(1));
        std::thread::sleep(SHORT);
        assert!(activity.idle_for() >= SHORT);
        activity.received(&lease(3));
        let withdrawal = v1::Withdrawal {
            lease: Some(v1::LeaseId { epoch: 7, number: 3 }),
        };
        activity.received(&coordinator_message::Message::Withdrawal(withdrawal));
        std::thread::sleep(SHORT);
        assert!(activity.idle_for() >= SHORT, "it was withdrawn");
        activity.received(&lease(4));
        activity.dropped_all();
        std::thread::sleep(SHORT);
        assert!(activity.idle_for() >= SHORT);
    }

    /// An activity whose open lease 1 came some time ago.
    fn since(ago: Duration) -> Activity {
        let activity = Activity::default();
        activity.received(&lease(1));
        let came = Instant::now().checked_sub(ago).unwrap();
        activity.work().open.insert((7, 1), came);
        activity
    }

    #[test]
    fn twice_the_longest_step_is_kept_for_the_last_results() {
        let minute = Duration::from_secs(60);
        let activity = since(minute);
        for number in 2..5 {
            activity.received(&lease(number));
            activity.sent(&result(number));
        }
        assert_eq!(activity.reserve(), LAST_RESULTS);
        activity.sent(&result(1));
        assert!((2 * minute..3 * minute).contains(&activity.reserve()));
        // A training is a lease of many epochs.
        let activity = since(minute);
        for _ in 0..3 {
            activity.sent(&worker_message::Message::Training(v1::TrainingReport {
                lease: Some(v1::LeaseId { epoch: 7, number: 1 }),
                ..v1::TrainingReport::default()
            }));
        }
        activity.work().open.insert((7, 1), Instant::now());
        activity.sent(&result(1));
        assert!((2 * minute..3 * minute).contains(&activity.reserve()));
    }
}
