//! Turns: chooses the next job, its tasks, and their worker.

use super::{
    AT_ONCE, Agree, Back, Event, Grant, HOPELESS_AFTER, JobId, LATE, LONGEST_PATIENCE, Lease, LeaseNumber,
    LeaseTable, MAX_BATCH, SHOWN_CHARGE, SPECULATION_DELAY, WorkerId, job::Job, workers::Worker,
};
use murmuration_model::MachineId;
use std::{
    cell::OnceCell,
    collections::BTreeSet,
    time::{Duration, Instant},
};

/// Facts that decide who gets the next lease.
struct Turn {
    now: Instant,
    /// The worker that gets no other work, because a task that must be leased alone waits for this worker.
    reserved: Option<WorkerId>,
    /// Machines with a worker that is late with a lease.
    late: BTreeSet<MachineId>,
    /// Workers that could take work from machines that hang; looked up only if a machine hangs.
    sound: OnceCell<Vec<WorkerId>>,
}

/// A worker, the tasks to lease to it, and whether it must hold no other tasks meanwhile.
struct Choice {
    worker: WorkerId,
    tasks: Vec<usize>,
    alone: bool,
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

impl<R: Agree + Clone> LeaseTable<R> {
    /// Leases the next batch, if there is work and a worker with credits for it.
    ///
    /// The job whose leased tasks cost least so far is served next. Batches shrink towards a job's end. If no task waits, an idle
    /// worker gets tasks that another worker is late with.
    pub fn grant(&mut self, now: Instant) -> Option<Grant> {
        self.decide_without_others(now);
        self.take_back_stalled(now);
        let mut turns: Vec<(u64, JobId)> = self
            .jobs
            .iter()
            .filter(|(_, job)| !job.queues.is_empty())
            .map(|(&id, job)| (self.served_with_earlier(job), id))
            .collect();
        turns.sort_unstable();
        let late = self.late(now);
        let mut turn = Turn {
            now,
            reserved: None,
            late: late
                .filter_map(|lease| Some(self.workers.get(lease.holder?)?.machine()))
                .collect(),
            sound: OnceCell::new(),
        };
        turn.reserved = self.reserved(&turn);
        // Else an audit that a machine holds and does not answer would wait until no other work is left.
        if let Some((job, choice)) = self.speculate(&turn, |job| job.is_audits) {
            return self.lease(job, choice, now);
        }
        for (_, job) in turns {
            if let Some(choice) = self.choose(job, &turn) {
                return self.lease(job, choice, now);
            }
        }
        let (job, choice) = self.speculate(&turn, |_| true)?;
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
        let cost = job.cost.saturating_mul(choice.tasks.len() as u64);
        match job.is_shown {
            true => self.shown = served.saturating_add(cost.saturating_mul(SHOWN_CHARGE)),
            false => job.served = served.saturating_add(cost),
        }
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
    /// then always the first of the two. Jobs whose results are only shown have one cost together.
    fn served_with_earlier(&self, job: &Job<R>) -> u64 {
        if job.is_shown {
            return self.shown;
        }
        let earlier = job.after.and_then(|earlier| self.jobs.get(&earlier));
        earlier.map_or(job.served, |earlier| job.served.max(earlier.served))
    }

    /// Chooses tasks of a job, and a worker for them.
    fn choose(&self, id: JobId, turn: &Turn) -> Option<Choice> {
        let job = self.jobs.get(&id)?;
        let choice = self.choose_second(id, job, turn);
        if let Some(choice) = choice.or_else(|| self.choose_alone(id, job, turn)) {
            return Some(choice);
        }
        let waiting = job.queues.ready_len();
        let (id, worker) = self.free((id, None), turn, |_| waiting > 0)?;
        let share = share(waiting, self.workers.capacity(job.embeds), worker);
        Some(Choice {
            worker: id,
            tasks: job.queues.ready().take(share).collect(),
            alone: false,
        })
    }

    /// Chooses a worker for tasks that another machine has already answered.
    fn choose_second(&self, id: JobId, job: &Job<R>, turn: &Turn) -> Option<Choice> {
        self.workers.free(job.embeds).next()?;
        job.queues.second.iter().find_map(|&place| {
            let fits = |worker: &Worker| job.tasks[place].wants(worker.machine());
            let (chosen, worker) = self.free((id, Some(place)), turn, fits)?;
            let wanted = |&place: &usize| {
                let is_avoided = self.is_avoided(turn, (id, job), Some(place), worker);
                job.tasks[place].wants(worker.machine()) && !is_avoided
            };
            let tasks = job.queues.second.iter().copied().filter(wanted);
            Some(Choice {
                worker: chosen,
                tasks: tasks.take(worker.credits.min(MAX_BATCH)).collect(),
                alone: false,
            })
        })
    }

    /// Chooses a worker for a task that may end the worker's process. The task is leased alone.
    fn choose_alone(&self, id: JobId, job: &Job<R>, turn: &Turn) -> Option<Choice> {
        let idle = || self.workers.idle(job.embeds);
        if job.queues.alone.is_empty() || idle().next().is_none() {
            return None;
        }
        job.queues.alone.iter().find_map(|&place| {
            let could = |worker: &Worker| {
                !worker.rests(id, turn.now)
                    && job.tasks[place].wants(worker.machine())
                    && !self.is_avoided(turn, (id, job), Some(place), worker)
            };
            let fitting = || idle().filter(|(_, worker)| could(worker));
            let reliable = fitting().find(|(_, worker)| job.is_reliable(worker.machine()));
            let (worker, _) = reliable.or_else(|| fitting().next())?;
            Some(Choice {
                worker,
                tasks: vec![place],
                alone: true,
            })
        })
    }

    /// Chooses a second worker for tasks of a late lease; the first result counts. Each further worker has twice as much time
    /// before the next worker gets the tasks.
    fn speculate(&self, turn: &Turn, of: impl Fn(&Job<R>) -> bool) -> Option<(JobId, Choice)> {
        let now = turn.now;
        self.workers.free(false).next()?;
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
                is_proven(worker)
                    && !self.is_behind(worker, now)
                    && !self.is_avoided(turn, (lease.job, job), Some(place), worker)
            };
            let waits = self.workers.iter().any(|(_, worker)| is_on_time(worker));
            let free = self.free((lease.job, Some(place)), turn, |worker| {
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

    /// Takes back leases that are not speculative and have made no progress for long, if another worker is free. Each further time
    /// takes twice as long, so that a task whose steps take long is not handed round for ever.
    fn take_back_stalled(&mut self, now: Instant) {
        let stalled: Vec<_> = self
            .leases
            .iter()
            .take_while(|(_, lease)| now.saturating_duration_since(lease.given) > HOPELESS_AFTER)
            .filter(|(number, lease)| self.is_stalled(**number, lease, now))
            .filter_map(|(&number, lease)| Some((number, lease.job, lease.holder?)))
            .collect();
        for (lease, id, worker) in stalled {
            let Some(job) = self.jobs.get_mut(&id) else {
                continue;
            };
            for &place in self.leases.get(&lease).iter().flat_map(|lease| &lease.tasks) {
                job.tasks[place].taken_back += 1;
            }
            self.excuse(worker, lease);
            self.come_back(lease, Back::Returned);
            let job = id;
            self.events.push(Event::TakenBack { job, worker, lease });
        }
    }

    fn is_stalled(&self, number: LeaseNumber, lease: &Lease, now: Instant) -> bool {
        let job = self.jobs.get(&lease.job).filter(|job| !job.speculative);
        let (Some(holder), Some(job)) = (lease.holder, job) else {
            return false;
        };
        let tasks = || lease.tasks.iter().map(|&place| &job.tasks[place]);
        let times = tasks().map(|task| task.taken_back).max().unwrap_or_default();
        let patience = (HOPELESS_AFTER * (1 << times.min(10))).min(LONGEST_PATIENCE);
        let machine = self.workers.machine(lease.process.machine);
        // A report of progress counts as a new beginning.
        let since = machine.and_then(|machine| machine.granted(number));
        let is_free =
            |other: &Worker| !other.rests(lease.job, now) && tasks().all(|task| task.wants(other.machine()));
        since.is_some_and(|since| now.saturating_duration_since(since) > patience)
            && self
                .workers
                .free(job.embeds)
                .any(|(id, other)| id != holder && is_free(other))
    }

    /// The leases that their holders are late with, oldest first.
    pub(super) fn late(&self, now: Instant) -> impl Iterator<Item = &Lease> {
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

    pub(super) fn has_in_hand(&self, worker: &Worker, job: JobId, place: usize) -> bool {
        let mut leases = worker.holds.iter().filter_map(|number| self.leases.get(number));
        leases.any(|lease| lease.job == job && lease.tasks.contains(&place))
    }

    /// The worker that gets no other work, because a task that must be leased alone waits for this worker.
    fn reserved(&self, turn: &Turn) -> Option<WorkerId> {
        let now = turn.now;
        let mut alone = self
            .jobs
            .iter()
            .flat_map(|(&id, job)| job.queues.alone.iter().map(move |&place| (id, job, place)));
        alone.find_map(|(id, job, place)| {
            // A worker that asks for no work would be reserved for ever, and the task would never be leased.
            let could = |worker: &Worker| worker.suits(job) && worker.claimed() > 0 && !worker.rests(id, now);
            let fits = |worker: &Worker| {
                could(worker)
                    && job.tasks[place].wants(worker.machine())
                    && !self.is_avoided(turn, (id, job), Some(place), worker)
            };
            let fitting = || self.workers.by_leases().filter(|(_, worker)| fits(worker));
            let is_best = |worker: &Worker| job.is_reliable(worker.machine()) && !self.is_behind(worker, now);
            let best = fitting().find(|(_, worker)| is_best(worker));
            let (id, _) = best.or_else(|| fitting().next())?;
            Some(id)
        })
    }

    /// The worker with the lowest load that can get more tasks of a job, or the task at a place of it. A worker on a machine that
    /// is late, or that has returned or lost its last lease of the job, is chosen only if there are no others, and a worker that is late
    /// itself only if all workers are late. A worker on a machine that hangs is chosen only if all machines hang.
    fn free(
        &self,
        (id, place): (JobId, Option<usize>),
        turn: &Turn,
        fits: impl Fn(&Worker) -> bool,
    ) -> Option<(WorkerId, &Worker)> {
        let (job, now) = (self.jobs.get(&id)?, turn.now);
        let (mut beside_late, mut behind) = (None, None);
        for (worker, known) in self.workers.free(job.embeds) {
            let is_kept = turn.reserved == Some(worker) || known.rests(id, now);
            if is_kept || !fits(known) || self.is_avoided(turn, (id, job), place, known) {
                continue;
            }
            if !turn.late.contains(&known.machine()) && job.is_reliable(known.machine()) {
                return Some((worker, known));
            }
            match self.is_behind(known, now) {
                false => beside_late = beside_late.or(Some((worker, known))),
                true => behind = behind.or(Some((worker, known))),
            }
        }
        beside_late.or(behind)
    }

    /// Whether a worker gets nothing of a job, or not the task at a place of it, because its machine hangs and another machine,
    /// which does not, could do it. An audit goes on after its job instead, so it never needs a machine that hangs.
    fn is_avoided(
        &self,
        turn: &Turn,
        (id, job): (JobId, &Job<R>),
        place: Option<usize>,
        worker: &Worker,
    ) -> bool {
        if !self.workers.hangs(worker.machine(), turn.now) {
            return false;
        }
        let task = place.map(|place| &job.tasks[place]);
        let needed = task.filter(|task| task.votes.is_empty() || task.is_disputed());
        let could = |other: &Worker| {
            other.suits(job) && !other.gave_back(id) && needed.is_none_or(|task| task.wants(other.machine()))
        };
        let is_sound =
            |other: &Worker| !self.workers.hangs(other.machine(), turn.now) && !self.is_idle(other, turn.now);
        let sound = turn.sound.get_or_init(|| {
            let workers = self.workers.iter().filter(|(_, other)| is_sound(other));
            workers.map(|(id, _)| id).collect()
        });
        sound.iter().filter_map(|&id| self.workers.get(id)).any(could)
    }

    /// Whether a worker is late with the answer to any lease, even if the lease's job is over: the worker is busy with it.
    pub(super) fn is_behind(&self, worker: &Worker, now: Instant) -> bool {
        let since = self.workers.owes_since(worker);
        since.is_some_and(|since| now.saturating_duration_since(since) > self.speculation_delay(1))
    }
}
