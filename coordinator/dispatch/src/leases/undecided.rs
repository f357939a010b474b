//! Tasks that need another machine: audits, disputes, tasks that a machine reported as impossible, and tasks with which workers
//! were lost. Decides whether another machine could answer such a task, and what becomes of the task if none could.

use super::{
    Agree, Event, HANGS_AFTER, HOPELESS_AFTER, JobId, LONGEST_PATIENCE, Lease, LeaseTable, SPECULATION_DELAY,
    job::Job, machine::Machine, workers::Worker,
};
use murmuration_model::MachineId;
use std::{
    collections::{BTreeMap, BTreeSet},
    time::Instant,
};

/// The fate of an audit that no other machine could answer soon.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum LateAudit {
    /// The audit goes on after its job.
    GoesOn,
    /// Too many audits go on already: the job waits.
    Waits,
    /// One vote is enough.
    Ends,
}

/// Whether a task has waited for this machine's answer for longer than the machine's patience allows.
fn has_waited_for<R>(job: &Job<R>, place: usize, (id, machine): (MachineId, &Machine), now: Instant) -> bool {
    // A machine that was not asked may be busy: it counts as long as it answers other leases.
    let since = match job.asked.get(&(place, id)) {
        Some(&asked) => Some(asked),
        None => job
            .late_since
            .map(|since| machine.active.map_or(since, |active| since.max(active))),
    };
    let too_long = |since| now.saturating_duration_since(since) > machine.patience();
    machine.is_hopeless(now) || since.is_some_and(too_long)
}

impl<R: Agree + Clone> LeaseTable<R> {
    /// Decides about tasks that need another machine, if no other machine could answer soon. Audits are postponed if another
    /// machine could answer later, and waived otherwise. Tasks with which three workers were lost are poisoned. A disputed task,
    /// or a task that one machine reports as impossible, ends the job with an event, unless another machine joins in time.
    pub(super) fn decide_without_others(&mut self, now: Instant) {
        let mut concerned = BTreeSet::new();
        let mut over = BTreeMap::new();
        let mut room = None;
        let anybody_works = self.workers() > 0;
        self.end_hopeless_audits(now);
        let wanting = self.wanting_another_machine(now);
        if wanting.is_empty() {
            return;
        }
        let late = self.late_machines(now);
        for (id, place) in wanting {
            let Some(job) = self.jobs.get_mut(&id) else {
                continue;
            };
            if job.tasks[place].state().is_settled() {
                continue;
            }
            if job.tasks[place].is_disputed() {
                job.late_since.get_or_insert(now);
            }
            let anybody = self.could_say(id, place, &late, now);
            let late_audit = if anybody {
                None
            } else {
                self.late_audit(id, place, now, &mut room)
            };
            let Some(job) = self.jobs.get_mut(&id) else {
                continue;
            };
            if late_audit == Some(LateAudit::Waits) {
                job.late_since.get_or_insert(now);
            }
            let task = &mut job.tasks[place];
            let before = task.state();
            if anybody || late_audit == Some(LateAudit::Waits) {
                task.alone_since = None;
            } else if task.votes.is_empty() && task.has_lost_enough() {
                task.blame();
                job.file(place, before);
                concerned.insert(id);
            } else if let Some(late_audit) = late_audit {
                if late_audit == LateAudit::GoesOn {
                    task.postpone_audit();
                } else {
                    task.waive_audit();
                    self.events.push(Event::Waived { job: id, tasks: 1 });
                }
                job.file(place, before);
                concerned.insert(id);
            } else if task.votes.is_empty() && !anybody_works {
                // The operator may have stopped the worker that failed, and may be starting another worker.
                task.alone_since = None;
            } else if now.saturating_duration_since(*task.alone_since.get_or_insert(now))
                >= self.dispute_timeout
            {
                over.insert(id, place);
            }
        }
        for (id, task) in over {
            self.end_undecided(id, task, now);
        }
        for job in concerned {
            self.tell(job);
        }
    }

    /// The fate of an audit that no other machine could answer soon; `None` if the task is no audit. `room` is the number of
    /// further audits that may go on after their jobs, once it is counted.
    fn late_audit(
        &self,
        id: JobId,
        place: usize,
        now: Instant,
        room: &mut Option<usize>,
    ) -> Option<LateAudit> {
        let task = &self.jobs.get(&id)?.tasks[place];
        if task.votes.is_empty() || task.is_disputed() {
            return None;
        }
        Some(if !self.could_ever_say(id, place, now) {
            LateAudit::Ends
        } else if let Some(left) = room.get_or_insert_with(|| self.room_for_audits()).checked_sub(1) {
            *room = Some(left);
            LateAudit::GoesOn
        } else if self.could_answer(id, place, now, |machine| !machine.hangs(now)) {
            LateAudit::Waits
        } else {
            LateAudit::Ends
        })
    }

    /// Reports a task that is disputed or impossible, and ends its job. A job of audits goes on after a dispute.
    fn end_undecided(&mut self, id: JobId, place: usize, now: Instant) {
        let between: Vec<_> = self
            .jobs
            .get(&id)
            .map(|job| job.tasks[place].voters().collect())
            .unwrap_or_default();
        if between.is_empty() {
            self.end_as_impossible(id, place);
            return;
        }
        match self.jobs.get_mut(&id) {
            // A third machine may still come: the disagreement is not forgotten, and is an event again after a while.
            Some(job) if job.is_audits => job.tasks[place].alone_since = Some(now),
            _ => self.forget(id),
        }
        self.events.push(Event::Disagreement {
            job: id,
            task: place,
            between,
        });
    }

    /// Tasks that only another machine can settle: tasks that wait for a machine, and tasks of late leases.
    fn wanting_another_machine(&self, now: Instant) -> Vec<(JobId, usize)> {
        let wants = |job: &Job<R>, place: usize| {
            let task = &job.tasks[place];
            // Audits that go on after their jobs wait for any machine that could answer (`end_hopeless_audits`).
            task.wants_another_machine() && (!job.is_audits || task.votes.len() != 1)
        };
        let waiting = self.jobs.iter().flat_map(|(&id, job)| {
            let queues = job.queues.second.iter().chain(&job.queues.alone);
            queues
                .filter(move |&&place| wants(job, place))
                .map(move |&place| (id, place))
        });
        let leases = self
            .late(now)
            .filter_map(|lease| Some((lease, self.jobs.get(&lease.job)?)));
        let late = leases.flat_map(|(lease, job)| {
            let places = lease.tasks.iter().filter(move |&&place| wants(job, place));
            places.map(|&place| (lease.job, place))
        });
        waiting.chain(late).collect()
    }

    /// The machines that are late, with their tasks.
    fn late_machines(&self, now: Instant) -> BTreeSet<(JobId, usize, MachineId)> {
        let of = |lease: &Lease| (lease.job, lease.process.machine, lease.tasks.clone());
        let late = self.late(now).map(of);
        late.flat_map(|(job, machine, tasks)| tasks.into_iter().map(move |place| (job, place, machine)))
            .collect()
    }

    /// Whether a connected worker could soon answer a task that needs another machine.
    ///
    /// A worker does not count if it is idle and asks for no work, or if its machine has owed an answer for very long. For an
    /// audit, nor does a worker whose machine is late with the task, hangs, or was asked long ago on whatever connection, or that
    /// is late with other tasks and takes no more work. A task without votes waits for such workers: another machine may still
    /// show that the task is possible, or that it ends no worker.
    ///
    /// A worker that returned its last lease of the job does not count for an audit. For a task that ended workers, it counts
    /// until it has returned several leases in a row, and for a task that a machine reported as impossible, it always counts.
    fn could_say(
        &self,
        id: JobId,
        place: usize,
        late: &BTreeSet<(JobId, usize, MachineId)>,
        now: Instant,
    ) -> bool {
        let Some(job) = self.jobs.get(&id) else {
            return false;
        };
        let task = &job.tasks[place];
        // A disagreement is worth waiting for a slow machine: it shows that a machine is wrong.
        if task.is_disputed() {
            return self.could_ever_say(id, place, now);
        }
        let is_audit = !task.votes.is_empty();
        // A training may take an hour.
        let longest = if job.speculative {
            HOPELESS_AFTER
        } else {
            LONGEST_PATIENCE
        };
        let was_asked_long_ago = |worker: &Worker| {
            let asked = job.asked.get(&(place, worker.machine()));
            asked.is_some_and(|&asked| now.saturating_duration_since(asked) > HANGS_AFTER)
        };
        let is_no_help = |worker: &Worker| {
            // A worker that is late with another task can still get this task, unless the worker takes no more work.
            let takes_more = worker.credits > 0 && !worker.alone;
            let is_late = || self.is_behind(worker, now) && !takes_more;
            let machine = self.workers.machine(worker.machine());
            self.is_idle(worker, now)
                || machine.is_none_or(|machine| machine.owes_for(longest, now))
                || is_audit
                    && (late.contains(&(id, place, worker.machine()))
                        || self.workers.hangs(worker.machine(), now)
                        || was_asked_long_ago(worker)
                        || is_late())
        };
        let gives_back = |worker: &Worker| match (is_audit, task.refused.is_empty()) {
            (true, _) => worker.gave_back(id),
            (false, true) => worker.gave_up(id),
            (false, false) => false,
        };
        self.workers.iter().any(|(_, worker)| {
            let could = worker.suits(job) || self.has_in_hand(worker, id, place);
            could && task.wants(worker.machine()) && !is_no_help(worker) && !gives_back(worker)
        })
    }

    /// Whether a worker asks for no work, owes no answer, and has done so for a while, on whatever connection.
    pub(super) fn is_idle(&self, worker: &Worker, now: Instant) -> bool {
        let machine = self.workers.machine(worker.machine());
        // A machine that joined a moment ago is about to ask for work.
        let active = machine.and_then(|machine| machine.active.max(machine.joined));
        let is_long = |active| now.saturating_duration_since(active) > SPECULATION_DELAY.1;
        let is_machine_idle = || active.is_none_or(is_long);
        worker.asks_for_nothing(now) || (worker.credits == 0 && worker.owes.is_empty() && is_machine_idle())
    }

    /// Whether a machine could answer a task that needs another machine, however long it takes.
    pub(super) fn could_ever_say(&self, id: JobId, place: usize, now: Instant) -> bool {
        self.could_answer(id, place, now, |_| true)
    }

    /// Whether one of these machines could answer a task that needs another machine: a machine with a worker that asks for work
    /// or holds the task, or a machine whose last worker drains or has just left, since the worker may be restarting. The task
    /// must not have waited too long for the machine.
    fn could_answer(&self, id: JobId, place: usize, now: Instant, on: impl Fn(&Machine) -> bool) -> bool {
        let Some(job) = self.jobs.get(&id) else {
            return false;
        };
        let task = &job.tasks[place];
        let is_one = |id: MachineId, machine: &Machine| {
            task.wants(id) && on(machine) && !has_waited_for(job, place, (id, machine), now)
        };
        let mut workers = self.workers.iter();
        let by_worker = workers.any(|(_, worker)| {
            let machine = self.workers.machine(worker.machine());
            let asks = worker.suits(job) && !worker.asks_for_nothing(now) && !worker.gave_up(id);
            let drains = worker.capacity == 0 && (worker.embeds || !job.embeds);
            (asks || drains || self.has_in_hand(worker, id, place))
                && machine.is_some_and(|machine| is_one(worker.machine(), machine))
        });
        by_worker
            || self.workers.away(now).any(|(id, machine)| {
                let suits = (machine.embeds || !job.embeds) && !self.quarantined.contains(&id);
                suits && is_one(id, machine)
            })
    }
}
