//! Which work is with whom: leases as a pure state machine, without clock, network or disk.
//!
//! A *job* is a list of tasks (one generation of a campaign, say). Tasks go out in *batches*, each under a
//! *lease* that belongs to one worker until it answers or is lost. Invariants, each tested below:
//!
//! - a task is done exactly once: the first result is kept, a later one must agree with it;
//! - a task is never forgotten: until it is done it is pending or under a lease that some worker holds;
//! - there is one code path for a lease that comes back undone, whatever the reason.

use std::{
    collections::{BTreeMap, BTreeSet, VecDeque},
    time::{Duration, Instant},
};

/// A worker's connection; a worker that connects anew is another one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct WorkerId(u64);

/// A job that was submitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct JobId(u64);

/// A lease; numbers are never used twice in one run of the coordinator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct LeaseNumber(pub u64);

/// Most tasks in one batch.
pub const MAX_BATCH: usize = 64;

/// When two results of the same task count as the same.
pub trait Agree {
    /// Whether `other` is the same result.
    fn agrees_with(&self, other: &Self) -> bool;
}

/// A batch that was just leased: send it to its worker.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Grant {
    /// Who holds the lease.
    pub worker: WorkerId,
    /// The lease.
    pub lease: LeaseNumber,
    /// The job that the tasks belong to.
    pub job: JobId,
    /// Places of the tasks in the job.
    pub tasks: Vec<usize>,
}

/// What the results of a lease changed.
#[derive(Debug, PartialEq, Eq)]
pub enum Progress<R> {
    /// Kept; the job goes on. How many of its tasks were not done before.
    Kept {
        /// The job.
        job: JobId,
        /// Tasks that these results finished.
        fresh: usize,
    },
    /// Kept, and that was the last of the job, which is now forgotten: its results in the order of its tasks.
    JobDone {
        /// The job.
        job: JobId,
        /// One result a task.
        results: Vec<R>,
    },
    /// A task already has a result and this one differs; neither can be trusted. The job is forgotten.
    Disagreement {
        /// The job.
        job: JobId,
        /// Place of the first task in dispute.
        task: usize,
    },
}

/// Why results were not taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Refused {
    /// The lease was never given, or its job is over. Harmless: late results look like this.
    #[error("there is no such lease (its job may be over)")]
    UnknownLease,
    /// Not one result a task: the worker does not speak the protocol.
    #[error("{got} results for a lease of {wanted} tasks")]
    WrongCount {
        /// Results that came.
        got: usize,
        /// Tasks of the lease.
        wanted: usize,
    },
}

/// Jobs, workers, and the leases between them.
#[derive(Debug)]
pub struct LeaseTable<R> {
    jobs: BTreeMap<JobId, Job<R>>,
    /// Jobs in the order in which they are served next, so that none starves another.
    turns: VecDeque<JobId>,
    workers: BTreeMap<WorkerId, Worker>,
    leases: BTreeMap<LeaseNumber, Lease>,
    next: u64,
}

#[derive(Debug)]
struct Job<R> {
    results: Vec<Option<R>>,
    missing: usize,
    pending: VecDeque<usize>,
}

#[derive(Debug)]
struct Worker {
    capacity: usize,
    credits: usize,
    heard: Instant,
    holds: BTreeSet<LeaseNumber>,
}

/// A lease outlives its holder until its job is over, so that a late result still counts.
#[derive(Debug)]
struct Lease {
    job: JobId,
    tasks: Vec<usize>,
    holder: Option<WorkerId>,
}

impl<R: Agree> LeaseTable<R> {
    /// An empty table.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            jobs: BTreeMap::new(),
            turns: VecDeque::new(),
            workers: BTreeMap::new(),
            leases: BTreeMap::new(),
            next: 0,
        }
    }

    /// Takes in a job of `tasks` tasks (at least one).
    pub fn submit(&mut self, tasks: usize) -> JobId {
        let id = JobId(self.fresh_number());
        let job = Job {
            results: (0..tasks).map(|_| None).collect(),
            missing: tasks,
            pending: (0..tasks).collect(),
        };
        self.jobs.insert(id, job);
        self.turns.push_back(id);
        id
    }

    /// Forgets a job and all its leases; results that still come are refused.
    pub fn forget(&mut self, job: JobId) {
        self.end(job);
    }

    /// The leases of a job that are with a worker.
    pub fn held(&self, job: JobId) -> impl Iterator<Item = (WorkerId, LeaseNumber)> {
        self.leases
            .iter()
            .filter(move |(_, lease)| lease.job == job)
            .filter_map(|(&number, lease)| Some((lease.holder?, number)))
    }

    /// A worker that runs `capacity` tasks at once came at time `now`. It has no credits yet.
    pub fn join(&mut self, capacity: usize, now: Instant) -> WorkerId {
        let id = WorkerId(self.fresh_number());
        let worker = Worker {
            capacity,
            credits: 0,
            heard: now,
            holds: BTreeSet::new(),
        };
        self.workers.insert(id, worker);
        id
    }

    /// A worker gave a sign of life.
    pub fn hear(&mut self, worker: WorkerId, now: Instant) {
        if let Some(worker) = self.workers.get_mut(&worker) {
            worker.heard = now;
        }
    }

    /// A worker is ready for `count` further tasks.
    pub fn add_credits(&mut self, worker: WorkerId, count: usize) {
        if let Some(worker) = self.workers.get_mut(&worker) {
            worker.credits = worker.credits.saturating_add(count);
        }
    }

    /// A worker takes no further leases; those it holds stay with it.
    pub fn drain(&mut self, worker: WorkerId) {
        if let Some(worker) = self.workers.get_mut(&worker) {
            worker.credits = 0;
            worker.capacity = 0;
        }
    }

    /// A worker is gone: its leases come back undone.
    pub fn lose(&mut self, worker: WorkerId) {
        let Some(worker) = self.workers.remove(&worker) else {
            return;
        };
        for lease in worker.holds {
            self.come_back(lease);
        }
    }

    /// Workers that have been silent for longer than `limit`. Whoever asks must [`lose`](Self::lose) them.
    pub fn silent(&self, now: Instant, limit: Duration) -> Vec<WorkerId> {
        let silent = |worker: &Worker| now.saturating_duration_since(worker.heard) > limit;
        self.workers
            .iter()
            .filter(|(_, worker)| silent(worker))
            .map(|(&id, _)| id)
            .collect()
    }

    /// Number of workers that take work.
    #[must_use]
    pub fn workers(&self) -> usize {
        self.workers.values().filter(|worker| worker.capacity > 0).count()
    }

    /// Leases the next batch, if there is pending work and a worker with credits.
    ///
    /// Jobs take turns; the worker with most credits is served. A batch is half an even share of what its job
    /// has pending, so that batches shrink towards a job's end and no worker is left with a long tail.
    pub fn grant(&mut self) -> Option<Grant> {
        let capacity: usize = self.workers.values().map(|worker| worker.capacity).sum();
        let turn = self
            .turns
            .iter()
            .position(|job| self.jobs.get(job).is_some_and(|job| !job.pending.is_empty()))?;
        let (&id, worker) = self
            .workers
            .iter_mut()
            .filter(|(_, worker)| worker.credits > 0)
            .max_by_key(|(id, worker)| (worker.credits, std::cmp::Reverse(**id)))?;

        let job_id = self.turns.remove(turn)?;
        self.turns.push_back(job_id);
        let job = self.jobs.get_mut(&job_id)?;
        let share = job.pending.len().div_ceil(2 * capacity.max(1));
        let batch = share.clamp(1, MAX_BATCH).min(worker.credits);
        let tasks: Vec<usize> = job.pending.drain(..batch).collect();

        let lease = LeaseNumber(self.next);
        self.next += 1;
        worker.credits -= tasks.len();
        worker.holds.insert(lease);
        self.leases.insert(
            lease,
            Lease {
                job: job_id,
                tasks: tasks.clone(),
                holder: Some(id),
            },
        );
        Some(Grant {
            worker: id,
            lease,
            job: job_id,
            tasks,
        })
    }

    /// The job and the tasks of a lease whose job is not over.
    #[must_use]
    pub fn leased(&self, lease: LeaseNumber) -> Option<JobId> {
        self.leases.get(&lease).map(|lease| lease.job)
    }

    /// Results of a lease, one a task and in their order; also of one that was lost meanwhile.
    ///
    /// # Errors
    /// See [`Refused`]; nothing has changed then.
    pub fn complete(&mut self, number: LeaseNumber, results: Vec<R>) -> Result<Progress<R>, Refused> {
        let lease = self.leases.get(&number).ok_or(Refused::UnknownLease)?;
        if results.len() != lease.tasks.len() {
            return Err(Refused::WrongCount {
                got: results.len(),
                wanted: lease.tasks.len(),
            });
        }
        let (id, tasks) = (lease.job, lease.tasks.clone());
        self.release(number);
        let job = self.jobs.get_mut(&id).ok_or(Refused::UnknownLease)?;
        let missing_before = job.missing;
        for (task, result) in tasks.into_iter().zip(results) {
            match &job.results[task] {
                None => {
                    job.results[task] = Some(result);
                    job.missing -= 1;
                }
                Some(kept) if kept.agrees_with(&result) => {}
                Some(_) => {
                    self.end(id);
                    return Ok(Progress::Disagreement { job: id, task });
                }
            }
        }
        let (fresh, missing) = (missing_before - job.missing, job.missing);
        let Job { results, pending, .. } = job;
        pending.retain(|&task| results[task].is_none());
        if missing > 0 {
            return Ok(Progress::Kept { job: id, fresh });
        }
        let results = self
            .end(id)
            .into_iter()
            .flat_map(|job| job.results)
            .flatten()
            .collect();
        Ok(Progress::JobDone { job: id, results })
    }

    /// A lease that its holder will not answer comes back; its tasks that are not done are the next to go out.
    pub fn come_back(&mut self, number: LeaseNumber) {
        if !self.release(number) {
            return;
        }
        let Some(lease) = self.leases.get(&number) else {
            return;
        };
        let Some(job) = self.jobs.get_mut(&lease.job) else {
            return;
        };
        for &task in lease.tasks.iter().rev() {
            if job.results[task].is_none() {
                job.pending.push_front(task);
            }
        }
    }

    /// Takes a lease from its holder; false if nobody holds it.
    fn release(&mut self, number: LeaseNumber) -> bool {
        let Some(holder) = self.leases.get_mut(&number).and_then(|lease| lease.holder.take()) else {
            return false;
        };
        if let Some(worker) = self.workers.get_mut(&holder) {
            worker.holds.remove(&number);
        }
        true
    }

    fn end(&mut self, id: JobId) -> Option<Job<R>> {
        let over: Vec<_> = self
            .leases
            .iter()
            .filter(|(_, lease)| lease.job == id)
            .map(|(&n, _)| n)
            .collect();
        for number in over {
            self.release(number);
            self.leases.remove(&number);
        }
        self.turns.retain(|&turn| turn != id);
        self.jobs.remove(&id)
    }

    fn fresh_number(&mut self) -> u64 {
        self.next += 1;
        self.next - 1
    }
}

impl<R: Agree> Default for LeaseTable<R> {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests;
