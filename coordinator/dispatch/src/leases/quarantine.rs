//! Quarantine of machines that were found wrong: their results are discarded, and their workers may not join.

use super::{Agree, Back, Event, LeaseTable, WorkerProcessId, job::Job, task::Task};
use murmuration_model::MachineId;
use std::collections::BTreeSet;

impl<R: Agree + Clone> LeaseTable<R> {
    /// Refuses a machine that was found wrong before this table existed.
    pub fn mistrust(&mut self, machine: MachineId) {
        self.quarantined.insert(machine);
    }

    /// Quarantines the machine of a worker that was found wrong; the machine's unaudited results are computed again.
    pub fn quarantine(&mut self, process: WorkerProcessId) {
        self.quarantine_all(BTreeSet::from([process]));
    }

    /// Quarantines the machines of `processes`. The machines' results are discarded before any job can end with such a result.
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
            // Only the first worker of a machine is reported.
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

    /// Ends jobs with a task that is impossible once the results of the quarantined machines are discarded.
    fn end_impossible_jobs(&mut self) {
        let first = |job: &Job<R>| job.tasks.iter().position(Task::is_impossible);
        let impossible = self.jobs.iter().filter_map(|(&id, job)| Some((id, first(job)?)));
        for (id, place) in impossible.collect::<Vec<_>>() {
            self.end_as_impossible(id, place);
        }
    }
}
