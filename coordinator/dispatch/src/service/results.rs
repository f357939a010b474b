//! What comes back: results and failures of leases, and what becomes of jobs and of workers that were found wrong.

use super::{Given, Job, Service};
use crate::{
    Evaluated, JobError, JoinError, SetAside, TrainingJob,
    leases::{Event, JobId, LeaseNumber, Refused, Settled, WorkerId, WorkerProcessId},
    work::{Output, Work},
};
use murmuration_model::{Maker, Quarantined};
use murmuration_proto::{
    EmbeddingKind,
    v1::{FailureClass, batch_result::Outcome},
};
use std::time::Instant;
use tonic::Status;
use tracing::Span;

impl Service {
    /// Takes in what became of a lease.
    pub(super) fn take_result(&mut self, worker: WorkerId, lease: LeaseNumber, outcome: Outcome) {
        let Some(id) = self.table.leased(worker, lease) else {
            tracing::debug!(?worker, ?lease, "a result that nobody waits for");
            return;
        };
        let kind = self.kind(worker);
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
                        true => "says that work cannot be done, and another machine is asked",
                        false => "gave work back, which is tried again",
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
            outcome => match job.work.outputs(outcome, kind) {
                Ok(outputs) => {
                    if let Some(Given { at, .. }) = given {
                        self.metrics
                            .answered(job.work.kind(), outputs.len(), at.elapsed());
                    }
                    job.job_progress.set_trouble(None);
                    self.keep(worker, lease, outputs);
                }
                Err(invalid) => self.found_wrong(worker, &invalid.to_string()),
            },
        }
    }

    fn kind(&self, worker: WorkerId) -> EmbeddingKind {
        let worker = self.workers.get(&worker);
        worker.map_or(EmbeddingKind::UNKNOWN, |worker| worker.kind)
    }

    fn keep(&mut self, worker: WorkerId, lease: LeaseNumber, outputs: Vec<Output>) {
        match self.table.complete(worker, lease, outputs, Instant::now()) {
            Ok(()) | Err(Refused::UnknownLease | Refused::NotYours) => {}
            Err(refused @ Refused::WrongCount { .. }) => self.found_wrong(worker, &refused.to_string()),
        }
    }

    /// A worker sent what no sound worker sends.
    fn found_wrong(&mut self, worker: WorkerId, what: &str) {
        let Some(process) = self.table.process(worker) else {
            return;
        };
        // Before it is forgotten, so that it is told what was wrong.
        self.dismiss(worker, Some(Status::invalid_argument(what)));
        self.table.quarantine(process);
    }

    /// Passes on what became of jobs and workers.
    pub(super) fn tell_events(&mut self) {
        for events in self.table.take_events() {
            match events {
                Event::Progress { job, settled } => {
                    if let Some(job) = self.jobs.get(&job) {
                        job.job_progress.set_done(settled as u32);
                    }
                }
                Event::Done { job, results } => {
                    let results = self.outcome(job, results);
                    self.reply(job, results);
                }
                Event::Disagreement { job, task, between } => {
                    let workers = self.names(&between);
                    self.metrics.disagreed();
                    tracing::error!(?workers, task, "machines disagree, and there is no other to ask");
                    self.reply(job, Err(JobError::Disagreement { task, workers }));
                }
                Event::Impossible { job, by } => {
                    let workers = self.names(&by).join(" and ");
                    let said = self.jobs.get_mut(&job).and_then(|job| job.refusal.take());
                    let said = said.unwrap_or_default();
                    tracing::error!(workers, said, "work cannot be done");
                    self.reply(job, Err(JobError::Fatal(format!("{said} (so {workers})"))));
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
            let trouble =
                format!("{name} was found wrong and is quarantined: start a worker on another machine");
            for job in self.jobs.values() {
                job.job_progress.set_trouble(Some(trouble.clone()));
            }
        }
        self.wrong
            .send_modify(|wrong| wrong.push(Quarantined { machine, name }));
    }

    /// What a job's tasks come to; where nothing could take the place of one that was set aside, nothing.
    fn outcome(&self, job: JobId, results: Vec<Settled<Output>>) -> Result<Vec<Output>, JobError> {
        let evaluations = self
            .jobs
            .get(&job)
            .is_some_and(|job| matches!(job.work, Work::Evaluations(_)));
        let maker = |kind, by: WorkerProcessId, audited: bool| Maker {
            kind,
            unaudited: (!audited).then_some(by.machine),
        };
        let settle = |settled| match settled {
            Settled::Result {
                value: Output::Evaluation(evaluation, kind),
                by,
                audited,
            } => {
                if audited {
                    self.metrics.audited();
                }
                Ok(Output::Evaluated(Evaluated::Done {
                    evaluation,
                    maker: maker(kind, by, audited),
                }))
            }
            Settled::Result {
                value: Output::Embedding(embedding, kind),
                by,
                audited,
            } => Ok(Output::Embedded(embedding, maker(kind, by, audited))),
            Settled::Result { value, .. } => Ok(value),
            Settled::SetAside { lost } => {
                let set_aside = SetAside {
                    workers: self.names(&lost),
                };
                self.metrics.set_aside(1);
                tracing::error!(%set_aside, "work was set aside");
                match evaluations {
                    true => Ok(Output::Evaluated(Evaluated::SetAside(set_aside))),
                    false => Err(set_aside.into()),
                }
            }
        };
        results.into_iter().map(settle).collect()
    }

    pub(super) fn reply(&mut self, id: JobId, result: Result<Vec<Output>, JobError>) {
        self.given.retain(|_, given| given.job != id);
        if let Some(job) = self.jobs.remove(&id) {
            // Whoever waited may have stopped waiting.
            let _ = job.reply.send(result);
        }
    }

    /// Names and addresses of processes.
    fn names(&self, processes: &[WorkerProcessId]) -> Vec<String> {
        let name = |process| self.names.get(process).map_or("?", String::as_str);
        processes.iter().map(|process| name(process).to_owned()).collect()
    }

    /// Passes on what a trainer says of the training under a lease, if it is still wanted.
    pub(super) fn tell_training(
        &mut self,
        worker: WorkerId,
        lease: LeaseNumber,
        tell: impl FnOnce(&TrainingJob),
    ) {
        let job = self.table.leased(worker, lease).and_then(|id| self.jobs.get(&id));
        if let Some(Job {
            work: Work::Training(job),
            job_progress,
            ..
        }) = job
        {
            tell(job);
            job_progress.set_trouble(None);
            self.table.get_on(lease);
        }
    }
}
