//! Audits that a job does not wait for: a new job goes on with them.
//!
//! A job must not wait for a slow machine, and no audit may be dropped because the other machines are slow: else a machine that
//! answers at once could have its results accepted unchecked. So a job ends without the audits that other machines are late with,
//! and a job of audits takes them over, with the votes that were cast. If machines disagree there, the disagreement is decided as
//! in any job, and the results of the machine that was wrong are verified where they are stored.

use super::{Agree, Event, JobId, LeaseTable, job::Job, queues::Queues, task::Task};
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
    /// Starts a job for the postponed audits among the tasks of a job that is over.
    pub(super) fn go_on_with_audits(&mut self, old: JobId) -> Option<Audits> {
        let job = self.jobs.get(&old).filter(|job| !job.is_audits)?;
        let postponed = |(place, task): (usize, &Task<R>)| Some((place, task.postponed()?));
        let (places, tasks): (Vec<_>, Vec<_>) = job.tasks.iter().enumerate().filter_map(postponed).unzip();
        if places.is_empty() {
            return None;
        }
        let mut queues = Queues::new(std::iter::empty());
        (0..tasks.len()).for_each(|place| queues.want_second(place));
        let audits = Job {
            tasks,
            queues,
            settled: 0,
            served: job.served,
            cost: job.cost,
            speculative: job.speculative,
            embeds: job.embeds,
            after: None,
            is_audits: true,
            leases: BTreeSet::new(),
            rested: BTreeSet::new(),
            lost_with: BTreeMap::new(),
        };
        let id = JobId(self.fresh_number());
        self.jobs.insert(id, audits);
        Some(Audits { job: id, places })
    }

    /// Whether a further audit may go on after its job.
    pub(super) fn has_room_for_audits(&self) -> bool {
        let open = |job: &Job<R>| match job.is_audits {
            true => job.tasks.len() - job.settled,
            false => job.tasks.iter().filter(|task| task.is_postponed()).count(),
        };
        self.jobs.values().map(open).sum::<usize>() < MAX_AUDITS
    }

    /// Ends audits that no machine can finish any more. Looks only once a second, since there may be many audits.
    pub(super) fn end_hopeless_audits(&mut self, now: Instant) {
        let looked = self.looked_at_audits;
        if looked.is_some_and(|looked| now.saturating_duration_since(looked) < Duration::from_secs(1)) {
            return;
        }
        self.looked_at_audits = Some(now);
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
