//! Who is next: which task of a job, which job, and which worker for it.

use super::{
    Agree, Grant, JobId, LATE, Lease, LeaseNumber, LeaseTable, MAX_BATCH, News, PATIENCE, WorkerId,
    workers::Worker,
};
use std::{
    cmp::Reverse,
    collections::{BTreeMap, BTreeSet},
    time::{Duration, Instant},
};

/// The tasks of a job that wait for a worker, by what they need; each is in one of them at most.
#[derive(Debug)]
pub(super) struct Queues {
    /// Any worker, before the others.
    first: BTreeSet<usize>,
    /// Any worker.
    next: BTreeSet<usize>,
    /// A worker that has not said yet what they are.
    second: BTreeSet<usize>,
    /// A worker that has nothing else to lose.
    alone: BTreeSet<usize>,
}

impl Queues {
    pub(super) fn new(first: impl Iterator<Item = usize>, next: impl Iterator<Item = usize>) -> Self {
        Self {
            first: first.collect(),
            next: next.collect(),
            second: BTreeSet::new(),
            alone: BTreeSet::new(),
        }
    }

    pub(super) fn want_next(&mut self, place: usize) {
        self.first.insert(place);
    }

    pub(super) fn want_second(&mut self, place: usize) {
        self.second.insert(place);
    }

    pub(super) fn want_alone(&mut self, place: usize) {
        self.alone.insert(place);
    }

    pub(super) fn remove(&mut self, place: usize) {
        for queue in [&mut self.first, &mut self.next, &mut self.second, &mut self.alone] {
            queue.remove(&place);
        }
    }

    pub(super) fn len(&self) -> usize {
        self.ready_len() + self.second.len() + self.alone.len()
    }

    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    fn ready_len(&self) -> usize {
        self.first.len() + self.next.len()
    }

    /// Tasks for any worker, in the order in which they go out.
    fn ready(&self) -> impl Iterator<Item = usize> {
        self.first.iter().chain(&self.next).copied()
    }
}

/// A worker, what it gets, and whether it must hold nothing else meanwhile.
struct Choice {
    worker: WorkerId,
    tasks: Vec<usize>,
    alone: bool,
}

impl<R: Agree> LeaseTable<R> {
    /// Leases the next batch, if there is work and a worker with credits for it.
    ///
    /// The job that has had the least effort is next. A batch is half an even share of what its job has waiting, so that
    /// batches shrink towards a job's end; where nothing waits, an idle worker gets what is late with another.
    pub fn grant(&mut self, now: Instant) -> Option<Grant> {
        self.waive_second_voices(now);
        let mut turns: Vec<(u64, JobId)> = self
            .jobs
            .iter()
            .filter(|(_, job)| !job.queues.is_empty())
            .map(|(&id, job)| (job.served, id))
            .collect();
        turns.sort_unstable();
        let reserved = self.reserved(now);
        for (_, job) in turns {
            if let Some(choice) = self.choose(job, reserved, now) {
                return self.lease(job, choice, now);
            }
        }
        let (job, choice) = self.choose_late(reserved, now)?;
        self.lease(job, choice, now)
    }

    fn lease(&mut self, id: JobId, choice: Choice, now: Instant) -> Option<Grant> {
        let job = self.jobs.get_mut(&id)?;
        let worker = self.workers.get_mut(&choice.worker)?;
        for &place in &choice.tasks {
            job.queues.remove(place);
            job.tasks[place].out += 1;
        }
        self.served = self.served.max(job.served);
        job.served = job
            .served
            .saturating_add(job.effort.saturating_mul(choice.tasks.len() as u64));
        let lease = LeaseNumber(self.next);
        self.next += 1;
        worker.credits -= choice.tasks.len();
        worker.alone = choice.alone;
        worker.holds.insert(lease);
        worker.tasks += choice.tasks.len();
        let entry = Lease {
            job: id,
            tasks: choice.tasks.clone(),
            instance: worker.instance,
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

    /// Who gets what of a job.
    fn choose(&self, id: JobId, reserved: Option<WorkerId>, now: Instant) -> Option<Choice> {
        let job = self.jobs.get(&id)?;
        for &place in &job.queues.second {
            let fits = |worker: &Worker| !job.tasks[place].has_voice(worker.instance);
            if let Some((
                worker,
                Worker {
                    instance, credits, ..
                },
            )) = self.free(id, reserved, now, fits)
            {
                let voiceless = |place: &usize| !job.tasks[*place].has_voice(*instance);
                let tasks = job.queues.second.iter().copied().filter(voiceless);
                return Some(Choice {
                    worker,
                    tasks: tasks.take((*credits).min(MAX_BATCH)).collect(),
                    alone: false,
                });
            }
        }
        if let Some(&place) = job.queues.alone.first()
            && let Some((worker, _)) = self.free(id, None, now, |worker| worker.holds.is_empty())
        {
            return Some(Choice {
                worker,
                tasks: vec![place],
                alone: true,
            });
        }
        let waiting = job.queues.ready_len();
        let (worker, Worker { credits, .. }) = self.free(id, reserved, now, |_| waiting > 0)?;
        let capacity: usize = self.workers.values().map(|worker| worker.capacity).sum();
        let share = waiting.div_ceil(2 * capacity.max(1)).clamp(1, MAX_BATCH);
        Some(Choice {
            worker,
            tasks: job.queues.ready().take(share.min(*credits)).collect(),
            alone: false,
        })
    }

    /// What an idle worker gets of a lease that is late with others: the first result counts. Whoever has it as well is
    /// given twice as long before there is a next.
    fn choose_late(&self, reserved: Option<WorkerId>, now: Instant) -> Option<(JobId, Choice)> {
        for lease in self.late(now) {
            let job = self.jobs.get(&lease.job)?;
            if !job.hurried {
                continue;
            }
            let late = |place: usize| {
                let task = &job.tasks[place];
                !task.verdict().is_settled() && self.is_late(lease, task.out, now)
            };
            let Some(place) = lease.tasks.iter().copied().find(|&place| late(place)) else {
                continue;
            };
            let alone = !job.tasks[place].lost.is_empty();
            let new_to = |worker: &Worker, place: usize| {
                !job.tasks[place].has_voice(worker.instance) && !self.has_in_hand(worker, lease.job, place)
            };
            let fits = |worker: &Worker| new_to(worker, place) && (!alone || worker.holds.is_empty());
            let Some((id, worker)) = self.free(lease.job, reserved, now, fits) else {
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

    /// The leases that somebody holds and is late with, oldest first.
    fn late(&self, now: Instant) -> impl Iterator<Item = &Lease> {
        let patience = self.patience(1);
        // Their numbers are in the order in which they were given.
        let old = move |lease: &&Lease| now.saturating_duration_since(lease.given) > patience;
        self.leases
            .values()
            .take_while(old)
            .filter(|lease| lease.holder.is_some())
    }

    /// Whether a lease whose tasks so many workers have in hand is out for longer than leases usually are.
    fn is_late(&self, lease: &Lease, hands: usize, now: Instant) -> bool {
        lease.holder.is_some() && now.saturating_duration_since(lease.given) > self.patience(hands)
    }

    /// How long a lease may be out whose tasks so many workers have in hand.
    fn patience(&self, hands: usize) -> Duration {
        let usual = self.turnaround.map_or(PATIENCE.1, |usual| usual * LATE);
        usual.clamp(PATIENCE.0, PATIENCE.1) * (1 << hands.saturating_sub(1).min(10))
    }

    fn has_in_hand(&self, worker: &Worker, job: JobId, place: usize) -> bool {
        let mut leases = worker.holds.iter().filter_map(|number| self.leases.get(number));
        leases.any(|lease| lease.job == job && lease.tasks.contains(&place))
    }

    /// The worker that is kept free for tasks that go out alone, where there are any and nobody is free.
    fn reserved(&self, now: Instant) -> Option<WorkerId> {
        if self.jobs.values().all(|job| job.queues.alone.is_empty()) {
            return None;
        }
        let takes_work = self.workers.iter().filter(|(_, worker)| worker.capacity > 0);
        let (&id, _) =
            takes_work.min_by_key(|(id, worker)| (self.is_behind(worker, now), worker.holds.len(), **id))?;
        Some(id)
    }

    /// The worker with least in hand of those that may get more of a job, those first that are not late.
    fn free(
        &self,
        job: JobId,
        reserved: Option<WorkerId>,
        now: Instant,
        fits: impl Fn(&Worker) -> bool,
    ) -> Option<(WorkerId, &Worker)> {
        self.workers
            .iter()
            .map(|(&id, worker)| (id, worker))
            .filter(|(id, worker)| {
                let may = worker.credits > 0 && !worker.alone && reserved != Some(*id);
                may && !worker.rests(job, now) && fits(worker)
            })
            .min_by_key(|(id, worker)| {
                let behind = self.is_behind(worker, now);
                (behind, worker.load(), Reverse(worker.credits), *id)
            })
    }

    /// Where nobody is there who could say soon what else a task is: an audit is waived, and a dispute ends the job aloud
    /// unless another comes in time.
    fn waive_second_voices(&mut self, now: Instant) {
        let mut concerned = BTreeSet::new();
        let mut disputed = BTreeMap::new();
        for (id, place) in self.wanting_second(now) {
            let anybody = self.could_say(id, place, now);
            let Some(job) = self.jobs.get_mut(&id) else {
                continue;
            };
            let task = &mut job.tasks[place];
            if anybody {
                task.alone_since = None;
            } else if !task.is_disputed() {
                let before = task.verdict();
                task.waive_audit();
                job.file(place, before);
                concerned.insert(id);
            } else if now.saturating_duration_since(*task.alone_since.get_or_insert(now))
                >= self.dispute_patience
            {
                disputed.insert(id, place);
            }
        }
        for (job, task) in disputed {
            let between = self.jobs.get(&job).map(|job| job.tasks[task].voices().collect());
            self.forget(job);
            self.news.push(News::Disagreement {
                job,
                task,
                between: between.unwrap_or_default(),
            });
        }
        for job in concerned {
            self.tell(job);
        }
    }

    /// Tasks that somebody has done and another has to, whether they wait for one or are late with one.
    fn wanting_second(&self, now: Instant) -> Vec<(JobId, usize)> {
        let waiting = self
            .jobs
            .iter()
            .flat_map(|(&id, job)| job.queues.second.iter().map(move |&place| (id, place)));
        let late = self
            .late(now)
            .flat_map(|lease| lease.tasks.iter().map(|&place| (lease.job, place)));
        let half_done = |(id, place): &(JobId, usize)| {
            let task = self.jobs.get(id).map(|job| &job.tasks[*place]);
            task.is_some_and(|task| !task.votes.is_empty() && !task.verdict().is_settled())
        };
        waiting.chain(late).filter(half_done).collect()
    }

    /// Whether a worker is there that has not said what a task is, and is not late with it.
    fn could_say(&self, id: JobId, place: usize, now: Instant) -> bool {
        let Some(job) = self.jobs.get(&id) else {
            return false;
        };
        self.workers.values().any(|worker| {
            worker.capacity > 0
                && !job.tasks[place].has_voice(worker.instance)
                && !(self.is_behind(worker, now) && self.has_in_hand(worker, id, place))
        })
    }

    /// Whether a worker is late with something.
    fn is_behind(&self, worker: &Worker, now: Instant) -> bool {
        let mut leases = worker.holds.iter().filter_map(|number| self.leases.get(number));
        leases.any(|lease| self.is_late(lease, 1, now))
    }
}
