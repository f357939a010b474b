//! The record of a machine: its capacity, and the leases that it owes answers to. The record outlives short interruptions.

use super::{HANGS, HANGS_AFTER, HOPELESS_AFTER, LONGEST_PATIENCE, LeaseNumber, workers::Worker};
use std::{
    collections::BTreeMap,
    time::{Duration, Instant},
};

/// Maximum capacity that counts for a machine that has answered no task yet.
const UNPROVEN: usize = 16;

/// A machine with connected workers, or whose last worker has left a moment ago.
#[derive(Debug, Default)]
pub(super) struct Machine {
    /// Number of the machine's connected workers.
    pub(super) workers: usize,
    /// Capacity of the workers that have credits or hold tasks: of all of them, and of those that embed.
    claimed: Capacity,
    /// Number of tasks that the machine has answered.
    answered: usize,
    /// When the machine's first worker joined.
    pub(super) joined: Option<Instant>,
    /// Time of the machine's last answer, if any.
    pub(super) active: Option<Instant>,
    /// Whether any worker of the machine embeds, or embedded.
    pub(super) embeds: bool,
    /// Leases that the machine has not answered, with the times when they were granted. A lease stays here after its job is over,
    /// since workers answer such leases too; it goes with the connection of its worker.
    owed: BTreeMap<LeaseNumber, Instant>,
    /// Usual time between a lease and the machine's answer.
    usual: Option<Duration>,
}

/// Number of tasks that all workers, or those that embed, run at once.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Capacity {
    pub(super) all: usize,
    pub(super) embedders: usize,
}

impl Machine {
    /// The part of the claimed capacity that counts when work is shared out: little before the machine has answered any task. A
    /// machine that claims much and never answers must not make all batches small.
    pub(super) fn proven(&self) -> Capacity {
        let proven = UNPROVEN.saturating_add(self.answered);
        Capacity {
            all: self.claimed.all.min(proven),
            embedders: self.claimed.embedders.min(proven),
        }
    }

    pub(super) fn add(&mut self, worker: &Worker) {
        let claimed = worker.claimed();
        self.claimed.all += claimed;
        self.claimed.embedders += if worker.embeds { claimed } else { 0 };
    }

    pub(super) fn take_away(&mut self, worker: &Worker) {
        let claimed = worker.claimed();
        self.claimed.all -= claimed;
        self.claimed.embedders -= if worker.embeds { claimed } else { 0 };
    }

    pub(super) fn owe(&mut self, lease: LeaseNumber, now: Instant) {
        self.owed.insert(lease, now);
    }

    /// When a lease was granted to which the machine owes the answer.
    pub(super) fn granted(&self, lease: LeaseNumber) -> Option<Instant> {
        self.owed.get(&lease).copied()
    }

    /// Removes a lease that the machine has answered, or need not answer any more.
    pub(super) fn excuse(&mut self, lease: LeaseNumber) {
        self.owed.remove(&lease);
    }

    /// Records an answer at time `now` to a lease of this many tasks, which took this long.
    pub(super) fn learn(&mut self, tasks: usize, took: Duration, now: Instant) {
        self.active = Some(now);
        self.answered = self.answered.saturating_add(tasks);
        self.usual = Some(self.usual.map_or(took, |usual| (usual * 7 + took) / 8));
    }

    /// Whether the machine owes an answer for so long that it gets no more work, although its workers send heartbeats.
    pub(super) fn hangs(&self, now: Instant) -> bool {
        self.owes_for(HANGS_AFTER, now)
    }

    /// Whether the machine owes an answer for so long that not even audits wait for the machine.
    pub(super) fn is_hopeless(&self, now: Instant) -> bool {
        self.owes_for(HOPELESS_AFTER, now)
    }

    /// How long an audit waits for the machine's answer.
    pub(super) fn patience(&self) -> Duration {
        self.limit(HOPELESS_AFTER)
    }

    fn limit(&self, least: Duration) -> Duration {
        least.max((self.usual.unwrap_or_default() * HANGS).min(LONGEST_PATIENCE))
    }

    /// Whether the machine owes an answer for longer than this, and for longer than [`HANGS`] times its own usual turnaround.
    pub(super) fn owes_for(&self, least: Duration, now: Instant) -> bool {
        let limit = self.limit(least);
        // Numbers of leases grow with time.
        let oldest = self.owed.first_key_value();
        oldest.is_some_and(|(_, &granted)| now.saturating_duration_since(granted) > limit)
    }
}
