//! Turns: chooses the next job, its tasks, and their worker.

use super::{
    AT_ONCE, Agree, Event, Grant, HANGS_AFTER, JobId, LATE, Lease, LeaseNumber, LeaseTable, MAX_BATCH,
    SPECULATION_DELAY, WorkerId, job::Job, machine::Machine, workers::Worker,
};
use murmuration_model::MachineId;
use std::{
    collections::{BTreeMap, BTreeSet},
    time::{Duration, Instant},
};

/// A worker, the tasks to lease to it, and whether it must hold no other tasks meanwhile.
struct Choice {
    worker: WorkerId,
    tasks: Vec<usize>,
    alone: bool,
}

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

/// Size of a worker's next batch when `waiting` tasks wait and all workers together run `capacity` tasks at once.
///
/// A batch is at most half an even share of the waiting tasks, so that batches shrink towards the end of a job. A batch is also
/// at most half of the worker's credits and held tasks, divided by its capacity (but at least [`AT_ONCE`]), so that the worker
/// has tasks while it receives the next batch. Batches are whole groups of [`AT_ONCE`], as long as there are enough tasks for all
/// workers.
fn share(waiting: usize, capacity: usize, worker: &Worker) -> usize {
    let capacity = capacity.max(1);
    let even = waiting.div_ceil(2 * capacity);
    let in_hand = (worker.credits + worker.tasks)
        .div_ceil(2 * worker.capacity.max(1))
        .max(AT_ONCE);
    let wanted = if waiting >= capacity * AT_ONCE * 3 / 4 {
        even.max(AT_ONCE)
    } else {
        even
    };
    let most = wanted.min(in_hand).min(worker.credits).clamp(1, MAX_BATCH);
    if most > AT_ONCE {
        most - most % AT_ONCE
    } else {
        most
    }
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
    /// Leases the next batch, if there is work and a worker with credits for it.
    ///
    /// The job whose leased tasks cost least so far is served next. Batches shrink towards a job's end. If no task waits, an idle
    /// worker gets tasks that another worker is late with.
    pub fn grant(&mut self, now: Instant) -> Option<Grant> {
        self.decide_without_others(now);
        let mut turns: Vec<(u64, JobId)> = self
            .jobs
            .iter()
            .filter(|(_, job)| !job.queues.is_empty())
            .map(|(&id, job)| (self.served_with_earlier(job), id))
            .collect();
        turns.sort_unstable();
        let reserved = self.reserved(now);
        // Else an audit that a machine holds and does not answer would wait until no other work is left.
        if let Some((job, choice)) = self.speculate(reserved, now, |job| job.is_audits) {
            return self.lease(job, choice, now);
        }
        for (_, job) in turns {
            if let Some(choice) = self.choose(job, reserved, now) {
                return self.lease(job, choice, now);
            }
        }
        let (job, choice) = self.speculate(reserved, now, |_| true)?;
        self.lease(job, choice, now)
    }

    fn lease(&mut self, id: JobId, choice: Choice, now: Instant) -> Option<Grant> {
        let process = self.process(choice.worker)?;
        let served = self.served_with_earlier(self.jobs.get(&id)?);
        let job = self.jobs.get_mut(&id)?;
        job.served = served;
        for &place in &choice.tasks {
            job.queues.remove(place);
            job.tasks[place].out += 1;
            if !job.tasks[place].votes.is_empty() {
                job.asked.entry((place, process.machine)).or_insert(now);
            }
        }
        self.served = self.served.max(job.served);
        job.served = job
            .served
            .saturating_add(job.cost.saturating_mul(choice.tasks.len() as u64));
        let lease = LeaseNumber(self.next);
        self.next += 1;
        self.workers.owe(choice.worker, lease, now);
        job.leases.insert(lease);
        self.workers.change(choice.worker, |worker| {
            worker.credits -= choice.tasks.len();
            worker.alone = choice.alone;
            worker.holds.insert(lease);
            worker.tasks += choice.tasks.len();
        });
        let entry = Lease {
            job: id,
            tasks: choice.tasks.clone(),
            process,
            given: now,
            holder: Some(choice.worker),
        };
        self.leases.insert(lease, entry);
        Some(Grant {
            worker: choice.worker,
            lease,
            job: id,
            tasks: choice.tasks,
        })
    }

    /// Cost of a job's leased tasks, but at least that of an earlier job with which the job shares its turns. The earlier job is
    /// then always the first of the two.
    fn served_with_earlier(&self, job: &Job<R>) -> u64 {
        let earlier = job.after.and_then(|earlier| self.jobs.get(&earlier));
        earlier.map_or(job.served, |earlier| job.served.max(earlier.served))
    }

    /// Chooses tasks of a job, and a worker for them.
    fn choose(&self, id: JobId, reserved: Option<WorkerId>, now: Instant) -> Option<Choice> {
        let job = self.jobs.get(&id)?;
        let choice = self.choose_second(id, job, reserved, now);
        if let Some(choice) = choice.or_else(|| self.choose_alone(id, job, now)) {
            return Some(choice);
        }
        let waiting = job.queues.ready_len();
        let (id, worker) = self.free(id, reserved, now, |_| waiting > 0)?;
        let share = share(waiting, self.workers.capacity(job.embeds), worker);
        Some(Choice {
            worker: id,
            tasks: job.queues.ready().take(share).collect(),
            alone: false,
        })
    }

    /// Chooses a worker for tasks that another machine has already answered.
    fn choose_second(
        &self,
        id: JobId,
        job: &Job<R>,
        reserved: Option<WorkerId>,
        now: Instant,
    ) -> Option<Choice> {
        if job.queues.second.is_empty() || self.free(id, reserved, now, |_| true).is_none() {
            return None;
        }
        job.queues.second.iter().find_map(|&place| {
            let fits = |worker: &Worker| job.tasks[place].wants(worker.machine());
            let (id, worker) = self.free(id, reserved, now, fits)?;
            let wanted = |place: &usize| job.tasks[*place].wants(worker.machine());
            let tasks = job.queues.second.iter().copied().filter(wanted);
            Some(Choice {
                worker: id,
                tasks: tasks.take(worker.credits.min(MAX_BATCH)).collect(),
                alone: false,
            })
        })
    }

    /// Chooses a worker for a task that may end the worker's process. The task is leased alone.
    fn choose_alone(&self, id: JobId, job: &Job<R>, now: Instant) -> Option<Choice> {
        let idle = || self.workers.idle(job.embeds);
        if job.queues.alone.is_empty() || idle().next().is_none() {
            return None;
        }
        job.queues.alone.iter().find_map(|&place| {
            let wants = |worker: &Worker| job.tasks[place].wants(worker.machine());
            let mut fitting = idle().filter(|(_, worker)| {
                !worker.rests(id, now) && wants(worker) && !self.is_avoided(job, worker, now)
            });
            let (worker, _) = fitting.next()?;
            Some(Choice {
                worker,
                tasks: vec![place],
                alone: true,
            })
        })
    }

    /// Chooses a second worker for tasks of a late lease; the first result counts. Each further worker has twice as much time
    /// before the next worker gets the tasks.
    fn speculate(
        &self,
        reserved: Option<WorkerId>,
        now: Instant,
        of: impl Fn(&Job<R>) -> bool,
    ) -> Option<(JobId, Choice)> {
        for lease in self.late(now) {
            let job = self.jobs.get(&lease.job)?;
            if !job.speculative || !of(job) {
                continue;
            }
            let late = |place: usize| {
                let task = &job.tasks[place];
                !task.state().is_settled() && self.is_late(lease, task.out, now)
            };
            let Some(place) = lease.tasks.iter().copied().find(|&place| late(place)) else {
                continue;
            };
            let alone = !job.tasks[place].lost.is_empty();
            let new_to = |worker: &Worker, place: usize| {
                job.tasks[place].wants(worker.machine()) && !self.has_in_hand(worker, lease.job, place)
            };
            let fits = |worker: &Worker| new_to(worker, place) && (!alone || worker.holds.is_empty());
            // A machine that hangs may have further connections, which have answered nothing either. If a worker that has
            // answered something is on time, the task waits for such a worker.
            let is_proven =
                |worker: &Worker| worker.answered > 0 && worker.suits(job) && new_to(worker, place);
            let is_on_time = |worker: &Worker| {
                is_proven(worker) && !self.is_behind(worker, now) && !self.is_avoided(job, worker, now)
            };
            let waits = self.workers.iter().any(|(_, worker)| is_on_time(worker));
            let free = self.free(lease.job, reserved, now, |worker| {
                fits(worker) && (!waits || is_proven(worker))
            });
            let Some((id, worker)) = free else {
                continue;
            };
            let likewise = |&place: &usize| {
                late(place) && new_to(worker, place) && job.tasks[place].lost.is_empty() != alone
            };
            let most = if alone { 1 } else { worker.credits.min(MAX_BATCH) };
            let choice = Choice {
                worker: id,
                tasks: lease.tasks.iter().copied().filter(likewise).take(most).collect(),
                alone,
            };
            return Some((lease.job, choice));
        }
        None
    }

    /// The leases that their holders are late with, oldest first.
    fn late(&self, now: Instant) -> impl Iterator<Item = &Lease> {
        let delay = self.speculation_delay(1);
        // Leases are numbered in the order in which they were granted.
        let old = move |lease: &&Lease| now.saturating_duration_since(lease.given) > delay;
        self.leases
            .values()
            .take_while(old)
            .filter(|lease| lease.holder.is_some())
    }

    /// Whether a lease, whose tasks `hands` workers hold, was granted longer ago than its speculation delay.
    fn is_late(&self, lease: &Lease, hands: usize, now: Instant) -> bool {
        lease.holder.is_some() && now.saturating_duration_since(lease.given) > self.speculation_delay(hands)
    }

    /// Time after which a lease, whose tasks `hands` workers hold, is late.
    fn speculation_delay(&self, hands: usize) -> Duration {
        let usual = self.turnaround.map_or(SPECULATION_DELAY.1, |usual| usual * LATE);
        usual.clamp(SPECULATION_DELAY.0, SPECULATION_DELAY.1) * (1 << hands.saturating_sub(1).min(10))
    }

    fn has_in_hand(&self, worker: &Worker, job: JobId, place: usize) -> bool {
        let mut leases = worker.holds.iter().filter_map(|number| self.leases.get(number));
        leases.any(|lease| lease.job == job && lease.tasks.contains(&place))
    }

    /// The worker that gets no other work, because a task that must be leased alone waits for this worker.
    fn reserved(&self, now: Instant) -> Option<WorkerId> {
        let mut alone = self.jobs.values().flat_map(|job| {
            job.queues
                .alone
                .iter()
                .map(move |&place| (job, &job.tasks[place]))
        });
        alone.find_map(|(job, task)| {
            let fits = |worker: &Worker| {
                worker.suits(job) && task.wants(worker.machine()) && !self.is_avoided(job, worker, now)
            };
            let fitting = || self.workers.by_leases().filter(|(_, worker)| fits(worker));
            let on_time = fitting().find(|(_, worker)| !self.is_behind(worker, now));
            let (id, _) = on_time.or_else(|| fitting().next())?;
            Some(id)
        })
    }

    /// The worker with the lowest load that can get more tasks of a job. A worker on a machine that is late is chosen only if all
    /// machines are late, and a worker that is late itself only if all workers are late. A worker on a machine that
    /// hangs is chosen only if all machines hang.
    fn free(
        &self,
        id: JobId,
        reserved: Option<WorkerId>,
        now: Instant,
        fits: impl Fn(&Worker) -> bool,
    ) -> Option<(WorkerId, &Worker)> {
        let job = self.jobs.get(&id)?;
        let late: BTreeSet<MachineId> = self
            .late(now)
            .filter_map(|lease| Some(self.workers.get(lease.holder?)?.machine()))
            .collect();
        let (mut beside_late, mut behind) = (None, None);
        for (worker, known) in self.workers.free(job.embeds) {
            let is_kept = reserved == Some(worker) || known.rests(id, now);
            if is_kept || !fits(known) || self.is_avoided(job, known, now) {
                continue;
            }
            if !late.contains(&known.machine()) {
                return Some((worker, known));
            }
            match self.is_behind(known, now) {
                false => beside_late = beside_late.or(Some((worker, known))),
                true => behind = behind.or(Some((worker, known))),
            }
        }
        beside_late.or(behind)
    }

    /// Decides about tasks that need another machine, if no other machine could answer soon. Audits are postponed if another
    /// machine could answer later, and waived otherwise. Tasks with which three workers were lost are poisoned. A disputed task,
    /// or a task that one machine reports as impossible, ends the job with an event, unless another machine joins in time.
    fn decide_without_others(&mut self, now: Instant) {
        let mut concerned = BTreeSet::new();
        let mut over = BTreeMap::new();
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
                self.late_audit(id, place, now)
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

    /// The fate of an audit that no other machine could answer soon; `None` if the task is no audit.
    fn late_audit(&self, id: JobId, place: usize, now: Instant) -> Option<LateAudit> {
        let task = &self.jobs.get(&id)?.tasks[place];
        if task.votes.is_empty() || task.is_disputed() {
            return None;
        }
        Some(if !self.could_ever_say(id, place, now) {
            LateAudit::Ends
        } else if self.has_room_for_audits() {
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
        let jobs = self.jobs.iter();
        let waiting = jobs.flat_map(|(&id, job)| {
            let queues = job.queues.second.iter().chain(&job.queues.alone);
            queues.map(move |&place| (id, place))
        });
        let late = self
            .late(now)
            .flat_map(|lease| lease.tasks.iter().map(|&place| (lease.job, place)));
        let wants = |(id, place): &(JobId, usize)| {
            let job = self.jobs.get(id);
            // Audits that go on after their jobs wait for any machine that could answer (`end_hopeless_audits`).
            let is_decided = |job: &Job<R>| !job.is_audits || job.tasks[*place].votes.len() != 1;
            job.is_some_and(|job| job.tasks[*place].wants_another_machine() && is_decided(job))
        };
        waiting.chain(late).filter(wants).collect()
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
    /// A worker does not count if its machine is late with the task or hangs, if it is late with other tasks and takes no more
    /// work, or if it has long been idle without asking for work. A worker that gave the task's job back, and has completed no
    /// lease of the job since, does not count either. However, workers that gave the job back count if the job would end without
    /// them. Late, hanging and idle workers count for a task without votes that a machine refused, or whose job is not
    /// speculative: jobs that are not speculative take minutes.
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
        let is_urgent = !task.votes.is_empty() || (job.speculative && task.refused.is_empty());
        let is_no_help = |worker: &Worker| {
            // A worker that is late with another task can still get this task, unless the worker takes no more work.
            let takes_more = worker.credits > 0 && !worker.alone;
            let is_late = || self.is_behind(worker, now) && !takes_more;
            is_urgent
                && (worker.asks_for_nothing(now)
                    || late.contains(&(id, place, worker.machine()))
                    || self.workers.hangs(worker.machine(), now)
                    || self.delays_audit(job, place, worker, now)
                    || is_late())
        };
        self.anybody_says(id, place, job, |worker| !is_no_help(worker))
    }

    /// Whether a job should not wait for a worker with an audit: its machine was asked long ago, on whatever connection, or has not
    /// answered anything for a while and does not ask for work. The audit then goes on after the job.
    fn delays_audit(&self, job: &Job<R>, place: usize, worker: &Worker, now: Instant) -> bool {
        let is_longer = |since: Instant, limit| now.saturating_duration_since(since) > limit;
        let asked = job.asked.get(&(place, worker.machine()));
        let machine = self.workers.machine(worker.machine());
        // A machine that joined a moment ago is about to ask for work.
        let active = machine.and_then(|machine| machine.active.max(machine.joined));
        let is_idle = active.is_none_or(|active| is_longer(active, SPECULATION_DELAY.1));
        !job.tasks[place].votes.is_empty()
            && (asked.is_some_and(|&asked| is_longer(asked, HANGS_AFTER))
                || (is_idle && worker.credits == 0 && worker.owes.is_empty()))
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

    fn anybody_says(&self, id: JobId, place: usize, job: &Job<R>, helps: impl Fn(&Worker) -> bool) -> bool {
        let task = &job.tasks[place];
        let ends_the_job = task.is_disputed() || !task.refused.is_empty();
        let gives_back = |worker: &Worker| !ends_the_job && worker.gave_back(id);
        self.workers.iter().any(|(_, worker)| {
            let could = worker.suits(job) || self.has_in_hand(worker, id, place);
            could && task.wants(worker.machine()) && helps(worker) && !gives_back(worker)
        })
    }

    /// Whether a worker gets nothing of a job because its machine hangs and another machine, which does not, could do it.
    fn is_avoided(&self, job: &Job<R>, worker: &Worker, now: Instant) -> bool {
        self.workers.hangs(worker.machine(), now) && {
            let mut workers = self.workers.iter();
            workers.any(|(_, other)| other.suits(job) && !self.workers.hangs(other.machine(), now))
        }
    }

    /// Whether a worker is late with the answer to any lease, even if the lease's job is over: the worker is busy with it.
    fn is_behind(&self, worker: &Worker, now: Instant) -> bool {
        let since = self.workers.owes_since(worker);
        since.is_some_and(|since| now.saturating_duration_since(since) > self.speculation_delay(1))
    }
}
