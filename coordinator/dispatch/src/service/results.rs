//! Results and failures of leases, and their consequences for jobs and workers.

use super::{Given, Job, Service};
use crate::{
    JobError, JoinError, Submitter, TrainingJob,
    leases::{Audits, Event, JobId, LeaseNumber, Refused, Settled, WorkerId, WorkerProcessId},
    submitted::{Closing, Vote},
};
use murmuration_model::{MachineId, Quarantined};
use murmuration_proto::v1::{FailureClass, batch_result::Outcome};
use murmuration_swarm::EmbeddingKind;
use std::sync::Arc;
use tonic::Status;
use tracing::Span;

impl Service {
    /// Takes the outcome of a lease. Returns whether leases or events may follow from it.
    pub(super) fn take_result(&mut self, worker: WorkerId, lease: LeaseNumber, outcome: Outcome) -> bool {
        // A result of the same batch of messages may have moved the lease to a job of audits.
        self.tell_events();
        let Some(id) = self.table.leased(worker, lease) else {
            tracing::debug!(?worker, ?lease, "a result that nobody waits for");
            // A worker that owed the answer may have been avoided until now.
            return self.table.answered(worker, lease, self.clock) || self.count_stray(worker);
        };
        let (kind, places, now) = (self.kind(worker), self.table.tasks(lease), self.clock);
        let Some(job) = self.jobs.get_mut(&id) else {
            return false;
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
                    self.table.refuse(worker, lease, now);
                } else {
                    self.table.give_back(worker, lease, now);
                }
            }
            outcome => match job.submitted.keep(places, outcome, kind) {
                Ok(votes) => {
                    let cost = job.submitted.cost();
                    self.pace.complete(cost.saturating_mul(votes.len() as u64));
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
        true
    }

    fn kind(&self, worker: WorkerId) -> EmbeddingKind {
        let worker = self.workers.get(&worker);
        worker.map_or(EmbeddingKind::UNKNOWN, |worker| worker.kind)
    }

    fn count_votes(&mut self, worker: WorkerId, lease: LeaseNumber, votes: Vec<Vote>) {
        match self.table.complete(worker, lease, votes, self.clock) {
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
                    let Some(known) = self.jobs.get(&job) else {
                        continue;
                    };
                    known.job_progress.set_done(settled as u32);
                    if known.audits.is_some() {
                        let is_disputed = |place| self.table.is_disputed(job, place);
                        self.audits
                            .send_if_modified(|audits| audits.settle(job, is_disputed));
                    }
                }
                Event::Done { job, results, audits } => self.finish(job, results, audits),
                Event::Waived { job, tasks } => {
                    self.metrics.waived(tasks);
                    tracing::debug!(?job, tasks, "audits ended without a second result");
                }
                Event::Disagreement { job, task, between } => self.disagree(job, task, &between),
                Event::TakenBack { job, worker, lease } => self.take_back(job, worker, lease),
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

    /// Sends a job's results to its submitter, and goes on with the audits for which the job does not wait.
    fn finish(&mut self, id: JobId, results: Vec<Settled<Vote>>, audits: Option<Audits>) {
        let job = self.close(id);
        if let Some(Audits { job: next, places }) = audits {
            self.begin_audits(next, job.as_ref(), places);
        }
        let Some(job) = job else { return };
        let closing = Closing {
            names: &|processes| self.names(processes),
            metrics: &self.metrics,
        };
        job.submitted.finish(results, &closing);
    }

    /// Goes on with audits of a job, or ends them if nobody has waited for the job's results.
    fn begin_audits(&mut self, id: JobId, job: Option<&Job>, places: Vec<usize>) {
        let wanted = job.filter(|job| !job.submitted.is_withdrawn());
        let audits =
            wanted.and_then(|job| Some((job.submitted.audits(&places)?, job.submitted.submitter()?)));
        let Some((submitted, submitter)) = audits else {
            self.table.forget(id);
            self.forget_given();
            return;
        };
        self.audits.send_modify(|audits| audits.begin(id, submitter));
        let audits = Job {
            submitted,
            audits: Some(places),
            job_progress: Arc::default(),
            refusal: None,
            publications: 0,
        };
        self.jobs.insert(id, audits);
    }

    /// Fails a job because machines disagree about a task. Audits that go on after their job stay, and their submitter learns of
    /// the disagreement.
    fn disagree(&mut self, id: JobId, task: usize, between: &[WorkerProcessId]) {
        let workers = self.names(between);
        let Some(job) = self.jobs.get(&id) else { return };
        let Some(places) = &job.audits else {
            self.metrics.disagreed();
            tracing::error!(
                ?workers,
                task,
                "machines disagree, and no third machine can decide"
            );
            self.fail(id, JobError::Disagreement { task, workers });
            return;
        };
        let error = JobError::Disagreement {
            task: places[task],
            workers,
        };
        let submitter = job.submitted.submitter();
        let submitter = submitter
            .map(|submitter| submitter.to_string())
            .unwrap_or_default();
        let mut is_new = false;
        self.audits
            .send_modify(|audits| is_new = audits.disagree(id, task, error.clone()));
        if is_new {
            self.metrics.disagreed();
            tracing::error!(submitter, %error, "an audit ends in a disagreement");
        }
    }

    /// Ends the audits of a submitter that wants no results any more.
    pub(super) fn withdraw_audits(&mut self, submitter: &Submitter) {
        // The submitter's last job may just have ended.
        self.tell_events();
        let of = |job: &Job| job.audits.is_some() && job.submitted.submitter().as_ref() == Some(submitter);
        let withdrawn: Vec<_> = self
            .jobs
            .iter()
            .filter(|(_, job)| of(job))
            .map(|(&id, _)| id)
            .collect();
        for id in withdrawn {
            self.table.forget(id);
            self.close(id);
        }
    }

    /// Tells a trainer that another one goes on with its training.
    fn take_back(&mut self, job: JobId, worker: WorkerId, lease: LeaseNumber) {
        let process = self.table.process(worker);
        let name = self.names(process.as_slice()).concat();
        let text = format!("{name} has reported no progress for long, so another trainer goes on");
        tracing::warn!("{text}");
        self.metrics.returned(1);
        if let Some(job) = self.jobs.get(&job) {
            job.job_progress.set_trouble(Some(text));
        }
        self.withdraw(worker, lease);
    }

    /// Quarantines machines that were found wrong by another dispatcher.
    pub(super) fn mistrust(&mut self, wrong: Vec<Quarantined>) {
        self.tell_events();
        for wrong in wrong {
            let machine = wrong.machine;
            if self.is_known_as_wrong(machine) {
                continue;
            }
            let process = WorkerProcessId { machine, instance: 0 };
            self.remember(process, wrong.name.clone());
            self.wrong.send_modify(|known| known.push(wrong));
            self.table.quarantine(process);
        }
        self.tell_events();
    }

    fn is_known_as_wrong(&self, machine: MachineId) -> bool {
        self.wrong.borrow().iter().any(|known| known.machine == machine)
    }

    fn tell_quarantine(&mut self, process: WorkerProcessId, workers: Vec<WorkerId>, again: usize) {
        let machine = process.machine;
        let name = self.names(&[process]).concat();
        if !self.is_known_as_wrong(machine) {
            self.metrics.quarantined();
            tracing::error!(
                worker = name,
                %machine,
                again,
                "a machine was found wrong, and is quarantined"
            );
            let name = name.clone();
            self.wrong
                .send_modify(|wrong| wrong.push(Quarantined { machine, name }));
        }
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
    }

    fn fail(&mut self, id: JobId, error: JobError) {
        if let Some(Job { submitted, .. }) = self.close(id) {
            submitted.fail(error);
        }
    }

    /// Forgets the leases of jobs that are over. A job of audits can have taken over leases of its job.
    pub(super) fn forget_given(&mut self) {
        self.given.retain(|&lease, _| self.table.job(lease).is_some());
    }

    /// Forgets a job that is over.
    fn close(&mut self, id: JobId) -> Option<Job> {
        self.forget_given();
        let job = self.jobs.remove(&id)?;
        if job.audits.is_some() {
            self.audits.send_modify(|audits| audits.end(id));
        }
        Some(job)
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
            self.table.get_on(lease, self.clock);
        }
    }
}
