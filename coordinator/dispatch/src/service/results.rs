//! Results and failures of leases, and their consequences for jobs and workers.

use super::{Given, Job, Service};
use crate::{
    JobError, JoinError, TrainingJob,
    leases::{Event, JobId, LeaseNumber, Refused, WorkerId, WorkerProcessId},
    submitted::{Closing, Vote},
};
use murmuration_model::Quarantined;
use murmuration_proto::v1::{FailureClass, batch_result::Outcome};
use murmuration_swarm::EmbeddingKind;
use std::time::Instant;
use tonic::Status;
use tracing::Span;

impl Service {
    pub(super) fn take_result(&mut self, worker: WorkerId, lease: LeaseNumber, outcome: Outcome) {
        let Some(id) = self.table.leased(worker, lease) else {
            tracing::debug!(
                ?worker,
                ?lease,
                "a result for a lease that the worker does not hold"
            );
            self.table.note_answer(worker);
            return;
        };
        let (kind, places) = (self.kind(worker), self.table.tasks(lease));
        let Some(job) = self.jobs.get_mut(&id) else {
            return;
        };
        let given = self.given.remove(&lease);
        let span = given.as_ref().map_or_else(Span::none, |given| given.span.clone());
        let _in_lease = span.entered();
        match outcome {
            Outcome::Failure(failure) => {
                let is_fatal = failure.class() == FailureClass::Fatal;
                tracing::info!(
                    ?worker,
                    is_fatal,
                    message = failure.message,
                    "a worker gave a batch back"
                );
                self.metrics.returned(1);
                if self.table.takes_work(worker) {
                    let name = self
                        .workers
                        .get(&worker)
                        .map_or("?", |worker| worker.name.as_str());
                    let what = match is_fatal {
                        true => "reports that work cannot be done; another machine will try",
                        false => "returned work, which will be tried again",
                    };
                    let trouble = format!("{name} {what}: {}", failure.message);
                    job.job_progress.set_trouble(Some(trouble));
                }
                if is_fatal {
                    job.refusal = Some(failure.message);
                    self.table.refuse(worker, lease, Instant::now());
                } else {
                    self.table.give_back(worker, lease, Instant::now());
                }
            }
            outcome => match job.submitted.keep(places, outcome, kind) {
                Ok(votes) => {
                    if let Some(Given { at, .. }) = given {
                        self.metrics
                            .answered(job.submitted.kind(), votes.len(), at.elapsed());
                    }
                    job.job_progress.set_trouble(None);
                    self.count_votes(worker, lease, votes);
                }
                Err(unsound) => self.found_wrong(worker, &unsound.to_string()),
            },
        }
    }

    fn kind(&self, worker: WorkerId) -> EmbeddingKind {
        let worker = self.workers.get(&worker);
        worker.map_or(EmbeddingKind::UNKNOWN, |worker| worker.kind)
    }

    fn count_votes(&mut self, worker: WorkerId, lease: LeaseNumber, votes: Vec<Vote>) {
        match self.table.complete(worker, lease, votes, Instant::now()) {
            Ok(()) | Err(Refused::UnknownLease | Refused::NotYours) => {}
            Err(refused @ Refused::WrongCount { .. }) => self.found_wrong(worker, &refused.to_string()),
        }
    }

    /// Dismisses and quarantines a worker that sent what no sound worker sends.
    fn found_wrong(&mut self, worker: WorkerId, what: &str) {
        let Some(process) = self.table.process(worker) else {
            return;
        };
        // The worker is dismissed before the quarantine forgets it, so that the worker receives the reason.
        self.dismiss(worker, Some(Status::invalid_argument(what)));
        self.table.quarantine(process);
    }

    /// Handles the events of the lease table.
    pub(super) fn tell_events(&mut self) {
        for events in self.table.take_events() {
            match events {
                Event::Progress { job, settled } => {
                    if let Some(job) = self.jobs.get(&job) {
                        job.job_progress.set_done(settled as u32);
                    }
                }
                Event::Done { job, results } => {
                    if let Some(Job { submitted, .. }) = self.close(job) {
                        let closing = Closing {
                            names: &|processes| self.names(processes),
                            metrics: &self.metrics,
                        };
                        submitted.finish(results, &closing);
                    }
                }
                Event::Disagreement { job, task, between } => {
                    let workers = self.names(&between);
                    self.metrics.disagreed();
                    tracing::error!(
                        ?workers,
                        task,
                        "machines disagree, and no third machine can decide"
                    );
                    self.fail(job, JobError::Disagreement { task, workers });
                }
                Event::Impossible { job, by } => {
                    let workers = self.names(&by).join(" and ");
                    let message = self.jobs.get_mut(&job).and_then(|job| job.refusal.take());
                    let message = message.unwrap_or_default();
                    tracing::error!(workers, message, "work cannot be done");
                    self.fail(job, JobError::Fatal(format!("{message} (reported by {workers})")));
                }
                Event::Quarantined {
                    process,
                    workers,
                    again,
                } => self.tell_quarantine(process, workers, again),
            }
        }
    }

    fn tell_quarantine(&mut self, process: WorkerProcessId, workers: Vec<WorkerId>, again: usize) {
        let (machine, name) = (process.machine, self.names(&[process]).concat());
        self.metrics.quarantined();
        tracing::error!(
            worker = name,
            %machine,
            again,
            "a machine was found wrong, and is quarantined"
        );
        for worker in workers {
            let status = Status::failed_precondition(JoinError::Quarantined(machine).to_string());
            self.dismiss(worker, Some(status));
        }
        if self.table.workers() == 0 {
            let trouble = format!(
                "{name} returned wrong results and is quarantined: start a worker on another machine"
            );
            for job in self.jobs.values() {
                job.job_progress.set_trouble(Some(trouble.clone()));
            }
        }
        self.wrong
            .send_modify(|wrong| wrong.push(Quarantined { machine, name }));
    }

    fn fail(&mut self, id: JobId, error: JobError) {
        if let Some(Job { submitted, .. }) = self.close(id) {
            submitted.fail(error);
        }
    }

    /// Forgets a job that is over.
    fn close(&mut self, id: JobId) -> Option<Job> {
        self.given.retain(|_, given| given.job != id);
        self.jobs.remove(&id)
    }

    fn names(&self, processes: &[WorkerProcessId]) -> Vec<String> {
        let name = |process| self.names.get(process).map_or("?", String::as_str);
        processes.iter().map(|process| name(process).to_owned()).collect()
    }

    /// Passes on a trainer's report on the training under a lease, if the training is still wanted.
    pub(super) fn tell_training(
        &mut self,
        worker: WorkerId,
        lease: LeaseNumber,
        tell: impl FnOnce(&TrainingJob),
    ) {
        let job = self.table.leased(worker, lease).and_then(|id| self.jobs.get(&id));
        if let Some(job) = job
            && let Some(training) = job.training()
        {
            tell(training);
            job.job_progress.set_trouble(None);
            self.table.get_on(lease);
        }
    }
}
