//! The dispatcher's task: it owns the lease table, and is the only one to write to workers.

use super::{
    Command, JobError, Options, Outbox, Request, TrainingJob, WorkerReport,
    job::{Output, Work},
};
use crate::leases::{Grant, JobId, LeaseNumber, LeaseTable, Progress, Refused, WorkerId};
use murmuration_proto::v1;
use std::{
    collections::BTreeMap,
    sync::{
        Arc,
        atomic::{AtomicU32, Ordering},
    },
    time::{Instant, SystemTime, UNIX_EPOCH},
};
use tokio::{
    sync::{mpsc, oneshot, watch},
    time::MissedTickBehavior,
};
use tonic::Status;

/// The dispatcher itself: everything here is owned by its one task.
pub(super) struct Service {
    options: Options,
    epoch: u64,
    table: LeaseTable<Output>,
    jobs: BTreeMap<JobId, Job>,
    workers: BTreeMap<WorkerId, Worker>,
    count: watch::Sender<usize>,
}

struct Job {
    work: Work,
    done: Arc<AtomicU32>,
    reply: oneshot::Sender<Result<Vec<Output>, JobError>>,
}

struct Worker {
    name: String,
    outbox: Outbox,
}

impl Service {
    /// One without jobs and workers; `count` is told the number of workers that take work.
    pub(super) fn new(options: Options, count: watch::Sender<usize>) -> Self {
        let epoch = SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .map_or(0, |age| age.as_nanos() as u64);
        Self {
            options,
            epoch,
            table: LeaseTable::new(),
            jobs: BTreeMap::new(),
            workers: BTreeMap::new(),
            count,
        }
    }

    /// Serves until the last handle is dropped or says stop.
    pub(super) async fn run(mut self, mut inbox: mpsc::Receiver<Command>) {
        let mut tick = tokio::time::interval(self.options.silence_limit / 10);
        tick.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            tokio::select! {
                command = inbox.recv() => match command {
                    None | Some(Command::Stop) => break,
                    Some(Command::Work(request)) => self.take(request),
                },
                _ = tick.tick() => self.lose_silent_workers(),
            }
            self.forget_withdrawn_jobs();
            self.send_leases();
            let count = self.table.workers();
            self.count
                .send_if_modified(|known| std::mem::replace(known, count) != count);
        }
        let workers: Vec<_> = self.workers.keys().copied().collect();
        for worker in workers {
            self.lose(
                worker,
                Some(Status::unavailable("the coordinator is shutting down")),
            );
        }
    }

    fn take(&mut self, request: Request) {
        match request {
            Request::Submit { work, done, reply } => {
                let id = self.table.submit(work.tasks());
                self.jobs.insert(id, Job { work, done, reply });
            }
            Request::Join {
                name,
                capacity,
                outbox,
                reply,
            } => self.welcome(name, capacity, outbox, reply),
            Request::Report { worker, report } => {
                self.table.hear(worker, Instant::now());
                match report {
                    WorkerReport::Credits(count) => self.table.add_credits(worker, count),
                    WorkerReport::Heartbeat => {}
                    WorkerReport::Drain => self.table.drain(worker),
                    WorkerReport::Gone => self.lose(worker, None),
                    WorkerReport::Result {
                        epoch,
                        lease,
                        outcome,
                    } if epoch == self.epoch => {
                        self.take_result(worker, lease, outcome);
                    }
                    WorkerReport::Training {
                        epoch,
                        lease,
                        progress,
                    } if epoch == self.epoch => self.tell_training(lease, |job| {
                        job.progress.send_replace(Some(progress));
                    }),
                    WorkerReport::Saved {
                        epoch,
                        lease,
                        training,
                    } if epoch == self.epoch => self.tell_training(lease, |job| {
                        job.saved.send_replace(Some(training));
                    }),
                    WorkerReport::Result { .. }
                    | WorkerReport::Training { .. }
                    | WorkerReport::Saved { .. } => {
                        tracing::debug!(?worker, "a report on a lease of an earlier epoch");
                    }
                }
            }
        }
    }

    fn welcome(&mut self, name: String, capacity: usize, outbox: Outbox, reply: oneshot::Sender<WorkerId>) {
        let welcome = v1::coordinator_message::Message::Welcome(v1::Welcome {
            epoch: self.epoch,
            heartbeat_interval_ms: self.options.heartbeat_interval.as_millis() as u32,
            silence_limit_ms: self.options.silence_limit.as_millis() as u32,
        });
        let id = self.table.join(capacity, Instant::now());
        tracing::info!(worker = name, capacity, "worker joined");
        self.workers.insert(id, Worker { name, outbox });
        self.send(id, welcome);
        if reply.send(id).is_err() {
            self.lose(id, None);
        }
    }

    fn take_result(&mut self, worker: WorkerId, lease: LeaseNumber, outcome: v1::batch_result::Outcome) {
        use v1::batch_result::Outcome;
        let Some(id) = self.table.leased(lease) else {
            return;
        };
        let Some(job) = self.jobs.get(&id) else { return };
        match outcome {
            Outcome::Failure(failure) if failure.class() == v1::FailureClass::Fatal => {
                self.end(id, Err(JobError::Fatal(failure.message)));
            }
            Outcome::Failure(failure) => {
                tracing::info!(?worker, message = failure.message, "a worker gave a batch back");
                self.table.come_back(lease);
            }
            outcome => match job.work.outputs(outcome) {
                Ok(outputs) => self.keep(worker, lease, outputs),
                Err(invalid) => self.lose(worker, Some(Status::invalid_argument(invalid.to_string()))),
            },
        }
    }

    fn keep(&mut self, worker: WorkerId, lease: LeaseNumber, outputs: Vec<Output>) {
        match self.table.complete(lease, outputs) {
            Ok(Progress::Kept { job, fresh }) => self.count_done(job, fresh),
            Ok(Progress::JobDone { job, results }) => self.end(job, Ok(results)),
            Ok(Progress::Disagreement { job, task }) => {
                let worker = self
                    .workers
                    .get(&worker)
                    .map_or("?", |worker| &worker.name)
                    .to_owned();
                tracing::error!(worker, task, "two workers disagree about one evaluation");
                self.end(job, Err(JobError::Disagreement { task, worker }));
            }
            Err(Refused::UnknownLease) => {}
            Err(refused @ Refused::WrongCount { .. }) => {
                self.lose(worker, Some(Status::invalid_argument(refused.to_string())));
            }
        }
    }

    fn count_done(&self, job: JobId, fresh: usize) {
        if let Some(job) = self.jobs.get(&job) {
            job.done.fetch_add(fresh as u32, Ordering::Relaxed);
        }
    }

    fn end(&mut self, id: JobId, result: Result<Vec<Output>, JobError>) {
        self.table.forget(id);
        if let Some(job) = self.jobs.remove(&id) {
            // Whoever waited may have stopped waiting.
            let _ = job.reply.send(result);
        }
    }

    fn forget_withdrawn_jobs(&mut self) {
        let withdrawn: Vec<_> = self
            .jobs
            .iter()
            .filter(|(_, job)| job.reply.is_closed())
            .map(|(&id, _)| id)
            .collect();
        for id in withdrawn {
            let held: Vec<_> = self.table.held(id).collect();
            self.table.forget(id);
            let job = self.jobs.remove(&id);
            // Evaluations are done before a word of theirs would be; a training may have minutes to go.
            if job.is_some_and(|job| matches!(job.work, Work::Training(_))) {
                for (worker, lease) in held {
                    let lease = Some(self.lease_id(lease));
                    let withdrawal = v1::coordinator_message::Message::Withdrawal(v1::Withdrawal { lease });
                    self.send(worker, withdrawal);
                }
            }
        }
    }

    fn lose_silent_workers(&mut self) {
        for id in self.table.silent(Instant::now(), self.options.silence_limit) {
            let said = format!(
                "nothing heard for {:?}: leases given to others",
                self.options.silence_limit
            );
            self.lose(id, Some(Status::deadline_exceeded(said)));
        }
    }

    /// The one way in which a worker goes; `reason` is told to it, if it still listens.
    fn lose(&mut self, id: WorkerId, reason: Option<Status>) {
        self.table.lose(id);
        let Some(worker) = self.workers.remove(&id) else {
            return;
        };
        match reason {
            Some(status) => {
                tracing::warn!(worker = worker.name, reason = status.message(), "worker dropped");
                let _ = worker.outbox.try_send(Err(status));
            }
            None => tracing::info!(worker = worker.name, "worker left"),
        }
    }

    fn send_leases(&mut self) {
        while let Some(Grant {
            worker,
            lease,
            job,
            tasks,
        }) = self.table.grant()
        {
            let Some(content) = self.jobs.get(&job) else {
                continue;
            };
            let message = v1::coordinator_message::Message::Lease(v1::Lease {
                id: Some(self.lease_id(lease)),
                work: Some(content.work.batch(&tasks)),
            });
            self.send(worker, message);
        }
    }

    fn lease_id(&self, lease: LeaseNumber) -> v1::LeaseId {
        v1::LeaseId {
            epoch: self.epoch,
            number: lease.0,
        }
    }

    /// Passes on what a trainer says of the training under a lease, if it is still wanted.
    fn tell_training(&self, lease: LeaseNumber, tell: impl FnOnce(&TrainingJob)) {
        let job = self.table.leased(lease).and_then(|id| self.jobs.get(&id));
        if let Some(Job {
            work: Work::Training(job),
            ..
        }) = job
        {
            tell(job);
        }
    }

    fn send(&mut self, id: WorkerId, message: v1::coordinator_message::Message) {
        let message = v1::CoordinatorMessage {
            message: Some(message),
        };
        let sent = self
            .workers
            .get(&id)
            .is_some_and(|worker| worker.outbox.try_send(Ok(message)).is_ok());
        if !sent {
            self.lose(
                id,
                Some(Status::resource_exhausted(
                    "this worker does not read its messages",
                )),
            );
        }
    }
}
