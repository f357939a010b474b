//! Leases of workers as a pure state machine, without clock, network or disk.
//!
//! A *job* is a list of tasks (such as one generation of a campaign). Tasks are leased in *batches*. Each *lease* belongs to one
//! worker until the worker answers or is lost. Random schedules test all these invariants:
//!
//! - a task is never forgotten: until it is settled, it waits for a lease or belongs to a lease that a worker holds;
//! - a task is settled once: by one result, or by two machines that agree if it is audited or disputed;
//! - a machine has one vote, however many workers it runs, and a machine that contradicts itself has no vote;
//! - results of a quarantined machine do not count, and tasks that these results settled are done again;
//! - a task is poisoned when three workers were lost with it, if they were on two machines or no other machine can try the task;
//! - a job ends as impossible once two machines report a task as impossible, or one machine does and there is no other machine;
//! - one code path handles every lease that is returned undone, whatever the reason.
//!
//! [`LeaseTable::take_events`] returns what happened to jobs and machines; [`LeaseTable::grant`] returns the next lease to send.

mod audits;
mod held;
mod job;
mod machine;
mod quarantine;
mod queues;
mod roster;
mod task;
mod turns;
mod undecided;
mod workers;

pub use audits::Audits;
use job::Job;
use murmuration_model::MachineId;
use queues::Queues;
use roster::Roster;
use std::{
    collections::{BTreeMap, BTreeSet},
    time::{Duration, Instant},
};
use task::Task;

/// Maximum number of tasks in one batch.
pub const MAX_BATCH: usize = 64;
/// Number of tasks that a thread of a worker can run at once: one swarm for each lane of the widest vectors.
pub const AT_ONCE: usize = 8;
/// Number of lost workers after which a task is poisoned.
pub(crate) const MOST_LOST: usize = 3;
/// Shortest and longest time after which a lease is also given to an idle worker.
const SPECULATION_DELAY: (Duration, Duration) = (Duration::from_millis(100), Duration::from_secs(5));
/// A lease is late after `LATE` times the usual turnaround.
const LATE: u32 = 4;
/// A machine hangs if it owes the answer to a lease for longer than this time, or than [`HANGS`] times its own usual turnaround
/// if that is longer.
const HANGS_AFTER: Duration = Duration::from_secs(30);
const HANGS: u32 = 8;
/// Audits and disagreements wait for a machine that owes an answer for at least this time: its first task may take long.
const HOPELESS_AFTER: Duration = Duration::from_secs(300);
/// Longest time for which a machine's own usual turnaround makes others wait: a machine could answer slowly on purpose.
const LONGEST_PATIENCE: Duration = Duration::from_hours(1);
/// Audits and disagreements wait for a machine whose last worker has left for this time: the worker may be restarting.
const AWAY: Duration = Duration::from_secs(30);

/// Decides when two results of a task count as the same result.
pub trait Agree {
    /// Whether `other` is the same result.
    fn agrees_with(&self, other: &Self) -> bool;
}

/// The number of a worker's connection; a worker that reconnects gets a new number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct WorkerId(u64);

/// A worker's process, with the same identifier over all its connections from one machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct WorkerProcessId {
    /// The machine that the process runs on.
    pub machine: MachineId,
    /// A number that the process chooses, to distinguish it from other processes on its machine. Votes are counted by machine.
    pub instance: u64,
}

/// The abilities of a worker.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Abilities {
    /// Number of tasks that the worker runs at once, 1 or more.
    pub capacity: usize,
    /// Whether the worker embeds pictures.
    pub embeds: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct JobId(u64);

/// A lease; numbers are never used twice in one run of the coordinator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct LeaseNumber(pub u64);

#[derive(Debug, Clone)]
pub struct JobParams {
    /// Number of tasks, at least one.
    pub tasks: usize,
    /// Cost of a task, at least 1. Jobs take turns by cost, so all jobs must use the same unit (such as agents times steps over a
    /// weight).
    pub cost: u64,
    /// Places of the tasks that a second machine repeats, if there is a second machine.
    pub audited: BTreeSet<usize>,
    /// Whether only workers that embed can do the tasks.
    pub embeds: bool,
    /// Whether a late lease is also given to a worker that would be idle.
    pub speculative: bool,
    /// An earlier job whose tasks are leased first; both jobs have one turn.
    pub after: Option<JobId>,
    /// Whether the results are only shown to a person. All such jobs share one turn, and pay eight times their cost.
    pub is_shown: bool,
}

/// Factor of the cost of jobs whose results are only shown, so that all guests together take about a tenth of the workers from a
/// running campaign: the judge, which such jobs also ask, adds to their time and not to their cost.
const SHOWN_CHARGE: u64 = 8;

/// A batch that was just leased; the caller sends it to the worker.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Grant {
    /// Worker that holds the lease.
    pub worker: WorkerId,
    pub lease: LeaseNumber,
    /// The job that the tasks belong to.
    pub job: JobId,
    /// Places of the tasks in the job.
    pub tasks: Vec<usize>,
}

/// Outcome of a task.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Settled<R> {
    Result {
        /// The result.
        value: R,
        /// Worker that did the task, or the first of the workers that agree.
        by: WorkerProcessId,
        /// Whether another machine had the same result.
        audited: bool,
    },
    /// Workers were lost with the task, and it is not tried again.
    Poisoned {
        /// Workers that were lost while they held the task, the last two while they held nothing else.
        lost: Vec<WorkerProcessId>,
    },
}

/// A change that concerns submitters of jobs or observers of workers.
#[derive(Debug, PartialEq, Eq)]
pub enum Event<R> {
    /// The number of settled tasks of a job has changed. It falls if a machine is quarantined.
    Progress {
        job: JobId,
        /// Number of settled tasks.
        settled: usize,
    },
    /// All tasks of a job are settled; the job is now forgotten.
    Done {
        job: JobId,
        /// Outcome of each task, in the order of the tasks.
        results: Vec<Settled<R>>,
        /// Audits that the job does not wait for.
        audits: Option<Audits>,
    },
    /// Machines disagree about a task, and no other machine can decide; the job is now forgotten.
    Disagreement {
        job: JobId,
        /// The place of the task.
        task: usize,
        /// Workers whose results differ.
        between: Vec<WorkerProcessId>,
    },
    /// Audits end without a second result, because no other machine can repeat the tasks.
    Waived {
        /// The job of the tasks; it may be over.
        job: JobId,
        /// Number of tasks.
        tasks: usize,
    },
    /// Workers on two machines (or on the only machine) report that a task is impossible. The job is now forgotten.
    Impossible {
        job: JobId,
        /// Workers that report the task as impossible.
        by: Vec<WorkerProcessId>,
    },
    /// A worker made no progress for long with a lease that is not speculative, and another worker gets the tasks.
    TakenBack {
        job: JobId,
        /// Worker without progress.
        worker: WorkerId,
        lease: LeaseNumber,
    },
    /// A machine was found wrong: its connections are closed, and its unaudited results are computed again.
    Quarantined {
        /// The worker that was found wrong.
        process: WorkerProcessId,
        /// The machine's connections, which are forgotten.
        workers: Vec<WorkerId>,
        /// Number of results of running jobs that no longer count.
        again: usize,
    },
}

/// Why results were refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Refused {
    /// The lease was never granted, it was answered, or its job is over. Late results cause this error, which is harmless.
    #[error("the lease does not exist; its job may be over")]
    UnknownLease,
    /// The lease belongs to another worker.
    #[error("the lease was given to another worker")]
    NotYours,
    /// The number of results is not the number of tasks: the worker violates the protocol.
    #[error("{got} results for a lease of {wanted} tasks")]
    WrongCount {
        /// Number of results.
        got: usize,
        /// Number of tasks of the lease.
        wanted: usize,
    },
}

/// Why a lease is returned undone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Back {
    /// The lease's worker could not or would not do the tasks now, left as announced, or was quarantined.
    Returned,
    /// The lease's worker was lost.
    Broken,
}

/// Jobs, workers, and the leases between them.
#[derive(Debug)]
pub struct LeaseTable<R> {
    jobs: BTreeMap<JobId, Job<R>>,
    workers: Roster,
    leases: BTreeMap<LeaseNumber, Lease>,
    quarantined: BTreeSet<MachineId>,
    events: Vec<Event<R>>,
    /// Cost of the leased tasks of the job that was served last. New jobs begin with it, so that they get no head start.
    served: u64,
    /// The cost of the leased tasks of all jobs whose results are only shown, as [`Job::served`] of one job.
    shown: u64,
    /// How long a disputed task, or a task that a single machine reports as impossible, waits for another machine.
    dispute_timeout: Duration,
    /// Usual time between a lease and its result.
    turnaround: Option<Duration>,
    /// When audits that go on after their jobs were last looked at.
    looked_at_audits: Option<Instant>,
    next: u64,
}

/// A lease stays in the table after its holder is lost, until its job is over: a late result still counts.
#[derive(Debug)]
struct Lease {
    job: JobId,
    tasks: Vec<usize>,
    process: WorkerProcessId,
    given: Instant,
    holder: Option<WorkerId>,
}

impl<R: Agree + Clone> LeaseTable<R> {
    /// An empty table; `dispute_timeout` is how long a dispute waits for a machine that can decide it.
    #[must_use]
    pub const fn new(dispute_timeout: Duration) -> Self {
        Self {
            dispute_timeout,
            jobs: BTreeMap::new(),
            workers: Roster::new(),
            leases: BTreeMap::new(),
            quarantined: BTreeSet::new(),
            events: Vec::new(),
            served: 0,
            shown: 0,
            turnaround: None,
            looked_at_audits: None,
            next: 0,
        }
    }

    pub fn submit(&mut self, params: JobParams) -> JobId {
        let id = JobId(self.fresh_number());
        if params.is_shown && !self.jobs.values().any(|job| job.is_shown) {
            self.shown = self.shown.max(self.served);
        }
        let tasks = (0..params.tasks).map(|place| Task::new(params.audited.contains(&place)));
        let job = Job {
            tasks: tasks.collect(),
            // Audited tasks have no place of their own in the order, so that no worker knows them.
            queues: Queues::new(0..params.tasks),
            settled: 0,
            served: self.served,
            cost: params.cost.max(1),
            speculative: params.speculative,
            embeds: params.embeds,
            after: params.after,
            is_shown: params.is_shown,
            is_audits: false,
            late_since: None,
            asked: BTreeMap::new(),
            leases: BTreeSet::new(),
            rested: BTreeSet::new(),
            unreliable: BTreeSet::new(),
            lost_with: BTreeMap::new(),
        };
        self.jobs.insert(id, job);
        id
    }

    /// Forgets a job and all its leases; later results are refused.
    pub fn forget(&mut self, job: JobId) {
        let Some(over) = self.jobs.remove(&job) else {
            return;
        };
        for number in over.leases {
            self.release(number);
            self.leases.remove(&number);
        }
        for job in self.jobs.values_mut().filter(|other| other.after == Some(job)) {
            job.served = job.served.max(over.served);
            job.after = None;
        }
        for worker in over.rested {
            self.workers.change(worker, |worker| worker.rests.remove(&job));
        }
    }

    /// Number of tasks that wait for a worker.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.jobs.values().map(|job| job.queues.len()).sum()
    }

    /// Number of tasks of a job without a settled result; 0 if the job is over.
    #[must_use]
    pub fn unsettled(&self, job: JobId) -> usize {
        let job = self.jobs.get(&job);
        job.map_or(0, |job| job.tasks.len() - job.settled)
    }

    /// Number of threads of all workers that take work, as far as their machines have answered tasks.
    #[must_use]
    pub const fn threads(&self) -> usize {
        self.workers.capacity(false)
    }

    /// Number of threads of workers that hold tasks.
    #[must_use]
    pub fn busy_threads(&self) -> usize {
        let workers = self.workers.iter();
        let busy: usize = workers.map(|(_, worker)| worker.tasks.min(worker.capacity)).sum();
        busy.min(self.threads())
    }

    /// Number of leases that workers hold.
    #[must_use]
    pub const fn out(&self) -> usize {
        self.workers.out()
    }

    /// Whether machines disagree about a task, and nothing has decided yet which of them is right.
    #[must_use]
    pub fn is_disputed(&self, job: JobId, place: usize) -> bool {
        let task = self.jobs.get(&job).and_then(|job| job.tasks.get(place));
        task.is_some_and(|task| task.is_disputed() && task.wants_another_machine())
    }

    /// Takes the events since the last call.
    pub fn take_events(&mut self) -> Vec<Event<R>> {
        std::mem::take(&mut self.events)
    }

    /// Takes the results of a lease, one for each task, in the order of the tasks. The results count even if the lease was lost
    /// meanwhile.
    ///
    /// # Errors
    /// See [`Refused`]; the table is then unchanged.
    pub fn complete(
        &mut self,
        worker: WorkerId,
        number: LeaseNumber,
        results: Vec<R>,
        now: Instant,
    ) -> Result<(), Refused> {
        self.answered(worker, number, now);
        let lease = self.leases.get(&number).ok_or(Refused::UnknownLease)?;
        let process = self.process(worker).ok_or(Refused::UnknownLease)?;
        if lease.process != process {
            return Err(Refused::NotYours);
        }
        if results.len() != lease.tasks.len() {
            return Err(Refused::WrongCount {
                got: results.len(),
                wanted: lease.tasks.len(),
            });
        }
        let (id, took) = (lease.job, now.saturating_duration_since(lease.given));
        let answered = lease.tasks.len();
        self.workers.change(worker, |worker| {
            worker.rests.remove(&id);
            worker.answered = worker.answered.saturating_add(answered);
        });
        self.workers.learn(process.machine, answered, took, now);
        self.learn_turnaround(took);
        let held = self.release(number);
        let Some(Lease { tasks, .. }) = self.leases.remove(&number) else {
            return Err(Refused::UnknownLease);
        };
        if let Some(job) = self.jobs.get_mut(&id) {
            job.leases.remove(&number);
            job.unreliable.remove(&process.machine);
        }
        let mut wrong = BTreeSet::new();
        for (place, result) in tasks.into_iter().zip(results) {
            if let Some(job) = self.jobs.get_mut(&id) {
                wrong.extend(job.record_vote(place, process, result, held));
            }
        }
        self.quarantine_all(wrong);
        self.tell(id);
        Ok(())
    }

    /// A worker returns a lease that it could not do. The worker gets no tasks of that job for a pause, which grows with each
    /// return in a row. The returned tasks are leased next.
    pub fn give_back(&mut self, worker: WorkerId, number: LeaseNumber, now: Instant) {
        let Some(job) = self.leased(worker, number) else {
            return;
        };
        self.answered(worker, number, now);
        self.workers.change(worker, |worker| worker.rest_from(job, now));
        if let Some(job) = self.jobs.get_mut(&job) {
            job.rested.insert(worker);
            job.leases.remove(&number);
        }
        self.come_back(number, Back::Returned);
        // The worker will not answer a lease that it has given back.
        self.leases.remove(&number);
    }

    /// A worker reports that the tasks of a lease are impossible. Other machines get the tasks, and the job ends if a second
    /// machine reports the same. The worker gets no tasks of that job for a while.
    pub fn refuse(&mut self, worker: WorkerId, number: LeaseNumber, now: Instant) {
        let is_out = |lease: &&Lease| lease.holder.is_some();
        let (Some(id), Some(lease)) = (
            self.leased(worker, number),
            self.leases.get(&number).filter(is_out),
        ) else {
            return;
        };
        let (process, tasks) = (lease.process, lease.tasks.clone());
        let mut impossible = None;
        for place in tasks {
            let task = self.jobs.get_mut(&id).map(|job| &mut job.tasks[place]);
            if task.is_some_and(|task| task.refuse(process)) {
                impossible = Some(place);
            }
        }
        self.give_back(worker, number, now);
        if let Some(place) = impossible {
            self.end_as_impossible(id, place);
        }
    }

    fn end_as_impossible(&mut self, id: JobId, place: usize) {
        let by = self.jobs.get(&id).map(|job| job.tasks[place].refused.clone());
        self.forget(id);
        let by = by.unwrap_or_default();
        self.events.push(Event::Impossible { job: id, by });
    }

    /// Takes back a lease that its holder will not answer. The lease's tasks are leased next.
    fn come_back(&mut self, number: LeaseNumber, how: Back) {
        if !self.release(number) {
            return;
        }
        let Some(Lease {
            job: id,
            tasks,
            process,
            ..
        }) = self.leases.get(&number)
        else {
            return;
        };
        let id = *id;
        if let Some(job) = self.jobs.get_mut(&id) {
            job.unreliable.insert(process.machine);
            for &place in tasks {
                job.come_back(place, (how == Back::Broken).then_some(*process));
            }
        }
        self.tell(id);
    }

    /// A lease makes progress, so its tasks are not to blame for workers lost before.
    pub(crate) fn get_on(&mut self, number: LeaseNumber, now: Instant) {
        let Some(Lease {
            job, tasks, holder, ..
        }) = self.leases.get(&number)
        else {
            return;
        };
        if let Some(job) = self.jobs.get_mut(job) {
            for &place in tasks {
                job.tasks[place].lost.clear();
            }
        }
        if let Some(holder) = *holder {
            self.workers.renew(holder, number, now);
        }
    }

    /// A worker need not answer a lease any more.
    pub fn excuse(&mut self, worker: WorkerId, number: LeaseNumber) {
        self.workers.excuse(worker, number);
    }

    /// A worker has answered a lease, whose job may be over. Returns whether the worker owed the answer.
    pub fn answered(&mut self, worker: WorkerId, number: LeaseNumber, now: Instant) -> bool {
        let owed = self.workers.excuse(worker, number);
        if owed {
            self.workers.be_active(worker, now);
        }
        owed
    }

    /// Records a job's progress as an event, and forgets the job once it is over.
    fn tell(&mut self, id: JobId) {
        let Some(job) = self.jobs.get(&id) else { return };
        if job.settled < job.tasks.len() {
            let settled = job.settled;
            self.events.push(Event::Progress { job: id, settled });
            return;
        }
        let audits = self.go_on_with_audits(id);
        let tasks = self.jobs.get_mut(&id).map(|job| std::mem::take(&mut job.tasks));
        let tasks = tasks.unwrap_or_default();
        self.forget(id);
        let results = tasks.into_iter().filter_map(Task::into_settled).collect();
        self.events.push(Event::Done {
            job: id,
            results,
            audits,
        });
    }

    /// Takes a lease from its holder; false if no worker holds it.
    fn release(&mut self, number: LeaseNumber) -> bool {
        let Some(lease) = self.leases.get_mut(&number) else {
            return false;
        };
        let Some(holder) = lease.holder.take() else {
            return false;
        };
        let tasks = lease.tasks.len();
        self.workers.change(holder, |worker| {
            worker.holds.remove(&number);
            worker.tasks -= tasks;
            worker.alone = false;
        });
        true
    }

    /// Updates the moving average of the turnaround. A lease counts as at most `LATE` times the usual turnaround, so that a late
    /// lease raises the average only a little.
    fn learn_turnaround(&mut self, took: Duration) {
        let learned = |usual: Duration| (usual * 7 + took.min(usual * LATE)) / 8;
        self.turnaround = Some(self.turnaround.map_or(took, learned));
    }

    fn fresh_number(&mut self) -> u64 {
        self.next += 1;
        self.next - 1
    }
}

#[cfg(test)]
mod schedules;
#[cfg(test)]
mod tests;
