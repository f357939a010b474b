//! Workers join, send messages, fall silent, and leave.

use super::{
    Abilities, Agree, Back, JobId, LeaseNumber, LeaseTable, SPECULATION_DELAY, WorkerId, WorkerProcessId,
    job::Job,
};
use murmuration_model::MachineId;
use std::{
    collections::{BTreeMap, BTreeSet},
    time::{Duration, Instant},
};

#[derive(Debug)]
pub(super) struct Worker {
    pub(super) process: WorkerProcessId,
    /// Number of tasks that the worker runs at once; 0 once the worker takes no more work.
    pub(super) capacity: usize,
    /// Number of tasks that the worker has answered.
    pub(super) answered: usize,
    pub(super) embeds: bool,
    pub(super) credits: usize,
    pub(super) heard: Instant,
    /// Time when the worker joined or last completed a lease.
    pub(super) active: Instant,
    pub(super) holds: BTreeSet<LeaseNumber>,
    /// Leases that the worker has not answered; unlike in `holds`, their jobs may be over.
    pub(super) owes: BTreeSet<LeaseNumber>,
    /// Number of tasks that the worker holds.
    pub(super) tasks: usize,
    /// Whether the worker holds a task that may end the worker's process, and so gets no other task.
    pub(super) alone: bool,
    /// Jobs whose lease the worker gave back, if it has not completed a lease of the job since.
    pub(super) rests: BTreeMap<JobId, Rest>,
}

/// A worker's pause from a job that it could not do.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rest {
    /// Length of the last pause.
    length: Duration,
    until: Instant,
}

/// First and longest pause of a worker from a job whose leases it gives back.
const RESTS: (Duration, Duration) = (Duration::from_millis(200), Duration::from_secs(10));

impl Worker {
    pub(super) const fn machine(&self) -> MachineId {
        self.process.machine
    }

    /// Whether the worker takes work and can do tasks of this job.
    pub(super) const fn suits<R>(&self, job: &Job<R>) -> bool {
        self.capacity > 0 && (self.embeds || !job.embeds)
    }

    /// Number of tasks that the worker runs at once, if it has credits or holds tasks: a worker that asks for nothing must not
    /// make the batches of other workers small.
    pub(super) const fn claimed(&self) -> usize {
        if self.credits > 0 || self.tasks > 0 {
            self.capacity
        } else {
            0
        }
    }

    /// Number of tasks that the worker holds for each task that it can run at once, in thousandths.
    pub(super) fn load(&self) -> usize {
        1000 * self.tasks / self.capacity.max(1)
    }

    /// Starts a pause from this job, whose lease the worker gave back: each pause in a row is twice as long.
    pub(super) fn rest_from(&mut self, job: JobId, now: Instant) {
        let length = self
            .rests
            .get(&job)
            .map_or(RESTS.0, |rest| RESTS.1.min(rest.length * 2));
        let until = now + length;
        self.active = now;
        self.rests.insert(job, Rest { length, until });
    }

    /// Whether the worker has long been idle and has no credits.
    pub(super) fn asks_for_nothing(&self, now: Instant) -> bool {
        let idle = now.saturating_duration_since(self.active);
        self.credits == 0 && self.owes.is_empty() && idle > SPECULATION_DELAY.1
    }

    /// Whether the worker returned so many leases of this job in a row that it will hardly do any.
    pub(super) fn gave_up(&self, job: JobId) -> bool {
        self.rests.get(&job).is_some_and(|rest| rest.length == RESTS.1)
    }

    /// Whether the worker returned its last lease of this job undone.
    pub(super) fn gave_back(&self, job: JobId) -> bool {
        self.rests.contains_key(&job)
    }

    pub(super) fn rests(&self, job: JobId, now: Instant) -> bool {
        self.rests.get(&job).is_some_and(|rest| now < rest.until)
    }
}

impl<R: Agree + Clone> LeaseTable<R> {
    /// A worker joins at time `now`, without credits; `None` if its machine is quarantined. If the worker had counted as lost,
    /// its tasks are no longer blamed for the loss.
    pub fn join(
        &mut self,
        process: WorkerProcessId,
        Abilities { capacity, embeds }: Abilities,
        now: Instant,
    ) -> Option<WorkerId> {
        if self.quarantined.contains(&process.machine) {
            return None;
        }
        for job in self.jobs.values_mut() {
            job.acquit(process);
        }
        let id = WorkerId(self.fresh_number());
        let worker = Worker {
            process,
            capacity,
            answered: 0,
            embeds,
            credits: 0,
            heard: now,
            active: now,
            holds: BTreeSet::new(),
            owes: BTreeSet::new(),
            tasks: 0,
            alone: false,
            rests: BTreeMap::new(),
        };
        self.workers.insert(id, worker);
        Some(id)
    }

    /// A message of a worker arrived at time `now`.
    pub fn keep_alive(&mut self, worker: WorkerId, now: Instant) {
        self.workers.hear(worker, now);
    }

    /// A worker is ready for `count` further tasks.
    pub fn add_credits(&mut self, worker: WorkerId, count: usize) {
        if self.takes_work(worker) {
            let add = |worker: &mut Worker| worker.credits = worker.credits.saturating_add(count);
            self.workers.change(worker, add);
        }
    }

    /// A worker takes no further leases; it keeps the leases that it holds.
    pub fn drain(&mut self, worker: WorkerId) {
        self.workers.change(worker, |worker| {
            worker.credits = 0;
            worker.capacity = 0;
        });
    }

    /// A worker is gone, and its leases are returned undone. Its tasks are not blamed if the worker had announced that it would
    /// leave.
    pub fn lose(&mut self, worker: WorkerId) {
        let leaving = self
            .workers
            .get(worker)
            .is_some_and(|worker| worker.capacity == 0);
        self.drop_worker(worker, if leaving { Back::Returned } else { Back::Broken });
    }

    pub(super) fn drop_worker(&mut self, worker: WorkerId, how: Back) {
        let holds = self.workers.get(worker).map(|worker| worker.holds.clone());
        for lease in holds.unwrap_or_default() {
            self.come_back(lease, how);
        }
        self.workers.remove(worker);
    }

    /// Workers that have been silent for longer than `limit`. The caller must [`lose`](Self::lose) them.
    pub fn silent(&self, now: Instant, limit: Duration) -> Vec<WorkerId> {
        let silent = |worker: &Worker| now.saturating_duration_since(worker.heard) > limit;
        self.workers
            .iter()
            .filter(|(_, worker)| silent(worker))
            .map(|(id, _)| id)
            .collect()
    }

    #[must_use]
    pub(crate) fn takes_work(&self, worker: WorkerId) -> bool {
        self.workers.get(worker).is_some_and(|worker| worker.capacity > 0)
    }

    /// Number of workers that take work.
    #[must_use]
    pub const fn workers(&self) -> usize {
        self.workers.working()
    }

    /// Whether workers are connected, but no worker that embeds.
    #[must_use]
    pub(crate) const fn lacks_embedders(&self) -> bool {
        self.workers.working() > 0 && self.workers.embedders() == 0
    }

    /// The process at the other end of a connection.
    #[must_use]
    pub fn process(&self, worker: WorkerId) -> Option<WorkerProcessId> {
        self.workers.get(worker).map(|worker| worker.process)
    }

    pub(super) fn of_machine(&self, machine: MachineId) -> Vec<WorkerId> {
        let of = self
            .workers
            .iter()
            .filter(|(_, worker)| worker.machine() == machine);
        of.map(|(id, _)| id).collect()
    }
}
