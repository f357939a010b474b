//! Audits that a job does not wait for: a new job goes on with them.
//!
//! A job must not wait for a slow machine, and no audit may be dropped because the other machines are slow: else a machine that
//! answers at once could have its results accepted unchecked. So a job ends without the audits that other machines are late with,
//! and a job of audits takes them over, with the votes that were cast. If machines disagree there, the disagreement is decided as
//! in any job, and the results of the machine that was wrong are verified where they are stored.

use super::{Agree, Event, JobId, LeaseNumber, LeaseTable, job::Job, queues::Queues};
use std::{
    collections::{BTreeMap, BTreeSet},
    time::{Duration, Instant},
};

/// Maximum number of audits that go on after their jobs. A job waits for further audits, unless all other machines hang: the
/// audits that are there already find a machine that is wrong, once another machine answers.
const MAX_AUDITS: usize = 256;

/// A job of audits that go on after their job.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Audits {
    /// The new job.
    pub job: JobId,
    /// For each task of the new job, the task's place in the old job.
    pub places: Vec<usize>,
}

impl<R: Agree + Clone> LeaseTable<R> {
    /// Starts a job for the postponed audits among the tasks of a job that is over. The new job takes over the leases of these
    /// audits that workers hold, with all their tasks, so that late answers count.
    pub(super) fn go_on_with_audits(&mut self, old: JobId) -> Option<Audits> {
        let job = self.jobs.get(&old).filter(|job| !job.is_audits)?;
        let is_postponed = |&place: &usize| job.tasks[place].is_postponed();
        let mut places: BTreeSet<usize> = (0..job.tasks.len()).filter(is_postponed).collect();
        if places.is_empty() {
            return None;
        }
        let is_held = |number: &LeaseNumber| {
            let lease = self.leases.get(number);
            lease.is_some_and(|lease| lease.holder.is_some() && lease.tasks.iter().any(is_postponed))
        };
        let held: BTreeSet<_> = job.leases.iter().copied().filter(is_held).collect();
        let tasks_of_held = held
            .iter()
            .filter_map(|number| Some(&self.leases.get(number)?.tasks));
        places.extend(tasks_of_held.flatten());
        let tasks: Vec<_> = places
            .iter()
            .map(|&place| job.tasks[place].for_audits())
            .collect();
        let places: Vec<_> = places.into_iter().collect();
        let asked = job.asked.iter().filter_map(|(&(place, machine), &at)| {
            let place = places.binary_search(&place).ok()?;
            Some(((place, machine), at))
        });
        let audits = Job {
            settled: tasks.iter().filter(|task| task.state().is_settled()).count(),
            tasks,
            queues: Queues::new(std::iter::empty()),
            served: job.served,
            cost: job.cost,
            speculative: job.speculative,
            embeds: job.embeds,
            after: None,
            is_shown: job.is_shown,
            is_audits: true,
            late_since: None,
            asked: asked.collect(),
            leases: BTreeSet::new(),
            rested: BTreeSet::new(),
            unreliable: BTreeSet::new(),
            lost_with: BTreeMap::new(),
        };
        let id = JobId(self.fresh_number());
        self.jobs.insert(id, audits);
        for number in held {
            self.take_over(number, old, (id, &places));
        }
        let open = self.jobs.get_mut(&id)?;
        for place in 0..open.tasks.len() {
            if open.tasks[place].out == 0 && !open.tasks[place].state().is_settled() {
                open.queues.want_second(place);
            }
        }
        Some(Audits { job: id, places })
    }

    /// Moves a held lease from a job to the job of its audits, whose tasks are those at these places of the old job.
    fn take_over(&mut self, number: LeaseNumber, old: JobId, (new, places): (JobId, &[usize])) {
        let Some(lease) = self.leases.get_mut(&number) else {
            return;
        };
        lease.job = new;
        for task in &mut lease.tasks {
            *task = places.partition_point(|place| place < task);
        }
        if let Some(job) = self.jobs.get_mut(&old) {
            job.leases.remove(&number);
        }
        if let Some(job) = self.jobs.get_mut(&new) {
            job.leases.insert(number);
            for &task in &lease.tasks {
                job.tasks[task].out += 1;
                job.asked
                    .entry((task, lease.process.machine))
                    .or_insert(lease.given);
            }
        }
    }

    /// Number of further audits that may go on after their jobs.
    pub(super) fn room_for_audits(&self) -> usize {
        let open = |job: &Job<R>| match job.is_audits {
            // A disagreement stays until somebody decides, and must not keep audits of others from going on.
            true => job
                .tasks
                .iter()
                .filter(|task| task.votes.len() == 1 && task.wants_another_machine())
                .count(),
            false => job.tasks.iter().filter(|task| task.is_postponed()).count(),
        };
        MAX_AUDITS.saturating_sub(self.jobs.values().map(open).sum())
    }

    /// Ends audits that no machine can finish any more. Looks only once a second, since there may be many audits.
    pub(super) fn end_hopeless_audits(&mut self, now: Instant) {
        let looked = self.looked_at_audits;
        if looked.is_some_and(|looked| now.saturating_duration_since(looked) < Duration::from_secs(1)) {
            return;
        }
        self.looked_at_audits = Some(now);
        for job in self.jobs.values_mut().filter(|job| job.is_audits) {
            job.late_since.get_or_insert(now);
        }
        let mut hopeless: BTreeMap<JobId, Vec<usize>> = BTreeMap::new();
        for (&id, job) in self.jobs.iter().filter(|(_, job)| job.is_audits) {
            let open = job
                .tasks
                .iter()
                .enumerate()
                .filter(|(_, task)| task.votes.len() == 1 && !task.state().is_settled());
            let hopeless_tasks = open.filter(|&(place, _)| !self.could_ever_say(id, place, now));
            let places: Vec<_> = hopeless_tasks.map(|(place, _)| place).collect();
            if !places.is_empty() {
                hopeless.insert(id, places);
            }
        }
        for (id, places) in hopeless {
            if let Some(job) = self.jobs.get_mut(&id) {
                for &place in &places {
                    let before = job.tasks[place].state();
                    job.tasks[place].waive_audit();
                    job.file(place, before);
                }
            }
            let tasks = places.len();
            self.events.push(Event::Waived { job: id, tasks });
            self.tell(id);
        }
    }
}
