//! Machines that were found wrong: what they said is forgotten, and they are not listened to.

use super::{Agree, Back, Event, LeaseTable, WorkerProcessId, job::Job, task::Task};
use murmuration_model::MachineId;
use std::collections::BTreeSet;

impl<R: Agree> LeaseTable<R> {
    /// A machine was found wrong before this table was: it is not listened to.
    pub fn mistrust(&mut self, machine: MachineId) {
        self.quarantined.insert(machine);
    }

    /// A worker was found wrong: its machine is not listened to any more, and what that did unaudited is done again.
    pub fn quarantine(&mut self, process: WorkerProcessId) {
        self.quarantine_all(BTreeSet::from([process]));
    }

    /// Quarantines these processes. Their results are forgotten before any job can end with one.
    pub(super) fn quarantine_all(&mut self, mut processes: BTreeSet<WorkerProcessId>) {
        processes.retain(|process| !self.quarantined.contains(&process.machine));
        let again: Vec<usize> = processes
            .iter()
            .map(|process| {
                let reopened = self
                    .jobs
                    .values_mut()
                    .map(|job| job.discard_votes(process.machine));
                reopened.sum()
            })
            .collect();
        for (&process, again) in processes.iter().zip(again) {
            // Of two workers on one machine, the first has given it away.
            if !self.quarantined.insert(process.machine) {
                continue;
            }
            let workers = self.of_machine(process.machine);
            for &worker in &workers {
                self.drop_worker(worker, Back::Returned);
            }
            self.events.push(Event::Quarantined {
                process,
                workers,
                again,
            });
        }
        if !processes.is_empty() {
            self.end_impossible_jobs();
            let jobs: Vec<_> = self.jobs.keys().copied().collect();
            for job in jobs {
                self.tell(job);
            }
        }
    }

    /// Ends jobs with a task that only a machine now quarantined had found possible.
    fn end_impossible_jobs(&mut self) {
        let first = |job: &Job<R>| job.tasks.iter().position(Task::is_impossible);
        let impossible = self.jobs.iter().filter_map(|(&id, job)| Some((id, first(job)?)));
        for (id, place) in impossible.collect::<Vec<_>>() {
            self.end_as_impossible(id, place);
        }
    }
}
