//! The dispatcher's task: it owns the lease table, and no other task writes to workers.

mod results;

use super::{
    Command, JobProgress, JoinError, JoinRequest, OpenAudits, Options, Outbox, Publication, Request,
    TrainingJob, TrainingLease, WorkerReport,
    submitted::{AnyJob, Vote},
};
use crate::{
    ConnectedMachine, DispatchMetrics, Load, WorkInHand,
    leases::{Abilities, Grant, JobId, JobParams, LeaseNumber, LeaseTable, WorkerId, WorkerProcessId},
    pace::Pace,
};
use murmuration_link::trace_parent;
use murmuration_model::{CampaignId, MachineId, Quarantined};
use murmuration_proto::v1;
use murmuration_swarm::{EmbeddingKind, Purpose, RandomStream};
use rand::RngExt as _;
use std::{
    collections::{BTreeMap, BTreeSet},
    convert::Infallible,
    sync::Arc,
    time::{Duration, Instant, SystemTime, UNIX_EPOCH},
};
use tokio::{
    sync::{mpsc, oneshot, watch},
    time::MissedTickBehavior,
};
use tonic::Status;
use tracing::Span;

/// How often the service looks for silent workers and late leases.
const TICK: Duration = Duration::from_millis(100);
/// Longest time from one wake of the service to the next that counts when it judges machines. If the coordinator was stopped or
/// busy for longer, it has read no messages of this time.
const STALL: Duration = Duration::from_millis(250);
/// Once this number of names is remembered, names of processes that are gone are forgotten.
const MOST_NAMES: usize = 4096;
/// Maximum number of answers on one connection to leases that the worker does not owe. A sound worker sends a few after it or the
/// coordinator has restarted.
const MAX_STRAYS: u32 = 4096;
/// Maximum number of checkpoints that trainers may publish for one training. One checkpoint is needed. More checkpoints come if
/// trainers repeat a request, or are lost before they report the checkpoint.
const MOST_PUBLICATIONS: u32 = 64;

/// Most requests that are handled before leases are sent again.
const AT_ONCE: usize = 64;

/// The kinds of commands that were handled.
enum Taken {
    /// Signs of life only, as most messages of a large cluster. Such messages change no turn.
    SignsOfLife,
    Work,
    Stop,
}

/// The dispatcher itself, owned by its one task.
pub(super) struct Service {
    options: Options,
    epoch: u64,
    table: LeaseTable<Vote>,
    jobs: BTreeMap<JobId, Job>,
    workers: BTreeMap<WorkerId, Worker>,
    /// Names and addresses of processes, including processes that are gone.
    names: BTreeMap<WorkerProcessId, String>,
    /// Decides which tasks are audited, and numbers processes that report no number.
    chance: RandomStream,
    count: watch::Sender<usize>,
    wrong: watch::Sender<Vec<Quarantined>>,
    metrics: DispatchMetrics,
    audits: watch::Sender<OpenAudits>,
    /// Leases without an answer, whose jobs are not over.
    given: BTreeMap<LeaseNumber, Given>,
    /// When the service last woke; it wakes at every tick.
    woken: Instant,
    /// Time by which the lease table judges machines. It is the same for all messages of a wake, and stands still while the
    /// coordinator is stopped.
    clock: Instant,
    pace: Pace,
}

/// A granted lease.
struct Given {
    at: Instant,
    /// Identifies the lease in the log; the worker logs under the same span.
    span: Span,
}

struct Job {
    submitted: Box<dyn AnyJob>,
    /// For audits that go on after their job: the places of their tasks in that job.
    audits: Option<Vec<usize>>,
    job_progress: Arc<JobProgress>,
    /// A worker's reason why the job is impossible.
    refusal: Option<String>,
    /// Number of checkpoints that trainers published for the job.
    publications: u32,
}

struct Worker {
    name: String,
    kind: EmbeddingKind,
    outbox: Outbox,
    _present: oneshot::Sender<Infallible>,
    /// Leases of trainings that were granted to the worker.
    trainings: BTreeSet<LeaseNumber>,
    /// Number of answers to leases that the worker did not owe.
    strays: u32,
}

impl Job {
    fn training(&self) -> Option<&TrainingJob> {
        self.submitted.training()
    }
}

impl Service {
    /// A service without jobs and workers. `count` receives the number of workers that take work. `wrong` holds the machines that
    /// were quarantined earlier, and receives newly quarantined machines.
    pub(super) fn new(
        options: Options,
        count: watch::Sender<usize>,
        wrong: watch::Sender<Vec<Quarantined>>,
        audits: watch::Sender<OpenAudits>,
        metrics: DispatchMetrics,
    ) -> Self {
        let epoch = SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .map_or(0, |age| age.as_nanos() as u64);
        let mut table = LeaseTable::new(options.silence_limit);
        for wrong in wrong.borrow().iter() {
            table.mistrust(wrong.machine);
        }
        Self {
            options,
            epoch,
            table,
            jobs: BTreeMap::new(),
            workers: BTreeMap::new(),
            names: BTreeMap::new(),
            chance: RandomStream::derive(epoch, Purpose::Audit, 0),
            count,
            wrong,
            metrics,
            audits,
            given: BTreeMap::new(),
            woken: Instant::now(),
            clock: Instant::now(),
            pace: Pace::default(),
        }
    }

    /// Serves until the last handle is dropped or a `Stop` command arrives.
    pub(super) async fn run(mut self, mut inbox: mpsc::Receiver<Command>) {
        let mut tick = tokio::time::interval(TICK);
        tick.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut commands = Vec::with_capacity(AT_ONCE);
        loop {
            tokio::select! {
                received = inbox.recv_many(&mut commands, AT_ONCE) => {
                    self.wake();
                    match self.take_all(&mut commands) {
                        _ if received == 0 => break,
                        Taken::Stop => break,
                        Taken::SignsOfLife => continue,
                        Taken::Work => {}
                    }
                }
                _ = tick.tick() => {
                    self.wake();
                    self.pace.look(self.table.busy_threads(), self.clock);
                    self.lose_silent_workers();
                }
            }
            self.follow_up();
        }
        let workers: Vec<_> = self.workers.keys().copied().collect();
        for worker in workers {
            self.lose(
                worker,
                Some(Status::unavailable("the coordinator is shutting down")),
            );
        }
    }

    /// Tells submitters and workers what follows from the messages that were taken.
    fn follow_up(&mut self) {
        // A job that is over must not be forgotten as withdrawn before its event: audits may go on after it.
        self.tell_events();
        self.forget_withdrawn_jobs();
        self.send_leases();
        self.tell_events();
        self.tell_lacks();
        let count = self.table.workers();
        self.metrics.stand(count, self.table.waiting(), self.table.out());
        self.count
            .send_if_modified(|known| std::mem::replace(known, count) != count);
    }

    fn take_all(&mut self, commands: &mut Vec<Command>) -> Taken {
        let mut taken = Taken::SignsOfLife;
        for command in commands.drain(..) {
            let Command::Work(request) = command else {
                return Taken::Stop;
            };
            if self.take(request) {
                taken = Taken::Work;
            }
        }
        taken
    }

    /// Handles a request. Returns whether leases or events may follow from it: most messages of a large cluster are signs of
    /// life, and answers that nobody waits for must not cost more.
    fn take(&mut self, request: Request) -> bool {
        match request {
            Request::Submit { job, job_progress } => {
                let (chance, share) = (&mut self.chance, self.options.audited.get());
                let params = job.params(&mut || chance.random_bool(share));
                let after = self.earlier(job.as_ref()).filter(|_| job.is_next());
                let id = self.table.submit(JobParams { after, ..params });
                let job = Job {
                    submitted: job,
                    audits: None,
                    job_progress,
                    refusal: None,
                    publications: 0,
                };
                self.jobs.insert(id, job);
                return true;
            }
            Request::Join { join_request, reply } => {
                self.welcome(join_request, reply);
                return true;
            }
            Request::Report { worker, report } => return self.take_report(worker, report),
            Request::WithdrawAudits(submitter) => self.withdraw_audits(&submitter),
            Request::Mistrust { wrong, reply } => {
                self.mistrust(wrong);
                // The caller may have gone.
                let _ = reply.send(());
                return true;
            }
            Request::TrainingLease {
                worker,
                epoch,
                lease,
                reply,
            } => {
                // The client may have disconnected.
                let _ = reply.send(self.training_lease(worker, epoch, lease));
            }
            Request::LeasedTraining {
                machine,
                epoch,
                lease,
                reply,
            } => {
                // The client may have disconnected.
                let _ = reply.send(self.leased_training(machine, epoch, lease));
            }
            Request::Publication { publication, reply } => {
                // The client may have disconnected.
                let _ = reply.send(self.may_publish(&publication));
            }
            Request::Connected { reply } => {
                // The client may have disconnected.
                let _ = reply.send(self.connected());
            }
            Request::Load { reply } => {
                // The client may have disconnected.
                let _ = reply.send(self.load());
            }
        }
        false
    }

    fn take_report(&mut self, worker: WorkerId, report: WorkerReport) -> bool {
        self.table.keep_alive(worker, self.clock);
        match report {
            WorkerReport::Credits(count) => self.table.add_credits(worker, count),
            WorkerReport::Heartbeat => return false,
            WorkerReport::Drain => self.table.drain(worker),
            WorkerReport::Gone => self.lose(worker, None),
            WorkerReport::Result {
                epoch,
                lease,
                outcome,
            } if epoch == self.epoch => return self.take_result(worker, lease, outcome),
            WorkerReport::Training {
                epoch,
                lease,
                progress,
            } if epoch == self.epoch => self.tell_training(worker, lease, |job| {
                job.progress.send_replace(Some(progress));
            }),
            WorkerReport::Saved {
                epoch,
                lease,
                training,
            } if epoch == self.epoch => self.tell_training(worker, lease, |job| {
                job.saved.send_replace(Some(training));
            }),
            WorkerReport::Result { .. } | WorkerReport::Training { .. } | WorkerReport::Saved { .. } => {
                return self.count_stray(worker);
            }
        }
        true
    }

    /// Counts an answer to a lease that the worker does not owe; returns whether that was too many, and the worker is dropped.
    fn count_stray(&mut self, worker: WorkerId) -> bool {
        let Some(known) = self.workers.get_mut(&worker) else {
            return false;
        };
        known.strays += 1;
        let is_flood = known.strays > MAX_STRAYS;
        if is_flood {
            let text = format!("over {MAX_STRAYS} answers to leases that this worker does not have");
            self.lose(worker, Some(Status::resource_exhausted(text)));
        }
        is_flood
    }

    /// The last job of the same kind and campaign.
    fn earlier(&self, job: &dyn AnyJob) -> Option<JobId> {
        let mut jobs = self.jobs.iter().rev();
        let earlier = jobs.find(|(_, earlier)| {
            let submitted = &earlier.submitted;
            earlier.audits.is_none()
                && submitted.kind() == job.kind()
                && submitted
                    .campaign()
                    .is_some_and(|campaign| job.campaign() == Some(campaign))
        });
        earlier.map(|(&id, _)| id)
    }

    fn welcome(&mut self, join_request: JoinRequest, reply: oneshot::Sender<Result<WorkerId, JoinError>>) {
        let JoinRequest {
            name,
            origin,
            instance,
            capacity,
            kind,
            outbox,
            present,
        } = join_request;
        let process = WorkerProcessId {
            machine: origin.machine,
            instance: instance.unwrap_or_else(|| self.chance.random()),
        };
        let abilities = Abilities {
            capacity,
            embeds: kind.is_known(),
        };
        let Some(id) = self.table.join(process, abilities, self.clock) else {
            // The worker may have disconnected.
            let _ = reply.send(Err(JoinError::Quarantined(process.machine)));
            return;
        };
        let welcome = v1::coordinator_message::Message::Welcome(v1::Welcome {
            epoch: self.epoch,
            heartbeat_interval_ms: self.options.heartbeat_interval.as_millis() as u32,
            silence_limit_ms: self.options.silence_limit.as_millis() as u32,
        });
        tracing::info!(name, capacity, "joined");
        self.remember(process, format!("{name} at {}", origin.address));
        let trainings = BTreeSet::new();
        self.workers.insert(
            id,
            Worker {
                name,
                kind,
                outbox,
                _present: present,
                trainings,
                strays: 0,
            },
        );
        self.send(id, welcome);
        if reply.send(Ok(id)).is_err() {
            self.lose(id, None);
        }
    }

    fn remember(&mut self, process: WorkerProcessId, name: String) {
        if self.names.len() >= MOST_NAMES {
            let here: BTreeSet<_> = self
                .workers
                .keys()
                .filter_map(|&id| self.table.process(id))
                .collect();
            self.names.retain(|process, _| here.contains(process));
        }
        self.names.insert(process, name);
    }

    /// Records in each job that embeds whether connected workers exist and none of them can embed.
    fn tell_lacks(&self) {
        let lacks = self.table.lacks_embedders();
        for job in self.jobs.values().filter(|job| job.submitted.embeds()) {
            job.job_progress.set_lacks_embedder(lacks);
        }
    }

    fn forget_withdrawn_jobs(&mut self) {
        let withdrawn: Vec<_> = self
            .jobs
            .iter()
            .filter(|(_, job)| job.submitted.is_withdrawn())
            .map(|(&id, _)| id)
            .collect();
        for id in withdrawn {
            let held: Vec<_> = self.table.held(id).collect();
            self.table.forget(id);
            self.forget_given();
            let job = self.jobs.remove(&id);
            // Only trainings are withdrawn: an evaluation ends before the message would arrive.
            if job.is_some_and(|job| job.training().is_some()) {
                for (worker, lease) in held {
                    self.withdraw(worker, lease);
                }
            }
        }
    }

    /// Tells a trainer to stop its training. The trainer need not answer.
    fn withdraw(&mut self, worker: WorkerId, lease: LeaseNumber) {
        self.table.excuse(worker, lease);
        let lease = Some(self.lease_id(lease));
        let withdrawal = v1::coordinator_message::Message::Withdrawal(v1::Withdrawal { lease });
        self.send(worker, withdrawal);
    }

    fn wake(&mut self) {
        let last = std::mem::replace(&mut self.woken, Instant::now());
        self.clock += self.woken.saturating_duration_since(last).min(STALL);
    }

    fn lose_silent_workers(&mut self) {
        for id in self.table.silent(self.clock, self.options.silence_limit) {
            let text = format!(
                "no message for {:?}: the leases went to other workers",
                self.options.silence_limit
            );
            self.lose(id, Some(Status::deadline_exceeded(text)));
        }
    }

    /// Loses a worker: every loss goes through this function. The worker receives `reason` if it is still connected.
    fn lose(&mut self, id: WorkerId, reason: Option<Status>) {
        let with_workers = self.table.out();
        self.table.lose(id);
        self.metrics.returned(with_workers - self.table.out());
        self.dismiss(id, reason);
    }

    /// Forgets the worker; the lease table handles its leases.
    fn dismiss(&mut self, id: WorkerId, reason: Option<Status>) {
        let Some(worker) = self.workers.remove(&id) else {
            return;
        };
        match reason {
            Some(status) => {
                self.metrics.dropped();
                tracing::warn!(worker = worker.name, reason = status.message(), "worker dropped");
                let _ = worker.outbox.try_send(Err(status));
            }
            None => tracing::info!(name = worker.name, "left"),
        }
    }

    fn send_leases(&mut self) {
        while let Some(Grant {
            worker,
            lease,
            job,
            tasks,
        }) = self.table.grant(self.clock)
        {
            // The job may be of audits that have only just begun.
            self.tell_events();
            let Some(content) = self.jobs.get(&job) else {
                // The event ended the job. The worker never learns of the lease, and need not answer it.
                self.table.forget(job);
                self.table.excuse(worker, lease);
                self.table.add_credits(worker, tasks.len());
                continue;
            };
            let id = self.lease_id(lease);
            let campaign = content.submitted.campaign().map(ToString::to_string);
            let campaign = campaign.unwrap_or_default();
            let is_training = content.training().is_some();
            if let Some(holder) = self.workers.get_mut(&worker).filter(|_| is_training) {
                holder.trainings.insert(lease);
            }
            let holder = self.workers.get(&worker).map(|worker| &worker.name);
            let span = tracing::info_span!(parent: None, "lease", %id, campaign, worker = holder);
            span.in_scope(|| tracing::debug!(tasks = tasks.len(), "given"));
            let message = v1::coordinator_message::Message::Lease(v1::Lease {
                id: Some(id),
                campaign,
                trace_parent: trace_parent(&span),
                work: Some(content.submitted.batch(&tasks)),
            });
            let at = Instant::now();
            self.given.insert(lease, Given { at, span });
            self.send(worker, message);
        }
    }

    /// Answers a trainer that asks for the training under a lease.
    fn training_lease(&self, worker: WorkerId, epoch: u64, lease: LeaseNumber) -> TrainingLease {
        let given = self
            .workers
            .get(&worker)
            .is_some_and(|worker| epoch == self.epoch && worker.trainings.contains(&lease));
        let job = self.table.leased(worker, lease).filter(|_| given);
        let job = job.and_then(|id| self.jobs.get(&id));
        match job.and_then(Job::training) {
            Some(training) => TrainingLease::Held(Box::new(training.leased())),
            None if given => TrainingLease::Over,
            None => TrainingLease::Never,
        }
    }

    /// Campaign of the training under `lease`, if a trainer on `machine` holds the lease.
    fn leased_training(&self, machine: MachineId, epoch: u64, lease: LeaseNumber) -> Option<CampaignId> {
        let job = self
            .table
            .held_by(machine, lease)
            .filter(|_| epoch == self.epoch)?;
        let training = self.jobs.get(&job)?.training()?;
        Some(training.campaign.clone())
    }

    fn may_publish(&mut self, publication: &Publication) -> bool {
        let is_result = |training: &TrainingJob| {
            let leased = training.leased();
            leased.parent == publication.parent
                && leased.configuration.to_toml() == publication.configuration
                // A snapshot holds every parameter several times.
                && publication.bytes <= leased.snapshot_bytes
        };
        for (&id, worker) in &self.workers {
            if self.table.process(id).map(|process| process.machine) != Some(publication.machine) {
                continue;
            }
            for &lease in &worker.trainings {
                let job = self.table.leased(id, lease);
                if let Some(job) = job.and_then(|job| self.jobs.get_mut(&job))
                    && job.publications < MOST_PUBLICATIONS
                    && job.training().is_some_and(is_result)
                {
                    job.publications += 1;
                    return true;
                }
            }
        }
        false
    }

    fn lease_id(&self, lease: LeaseNumber) -> v1::LeaseId {
        v1::LeaseId {
            epoch: self.epoch,
            number: lease.0,
        }
    }

    fn send(&mut self, id: WorkerId, message: v1::coordinator_message::Message) {
        let message = v1::CoordinatorMessage {
            message: Some(message),
        };
        let Some(worker) = self.workers.get(&id) else {
            return;
        };
        match worker.outbox.try_send(Ok(message)) {
            Ok(()) => {}
            Err(mpsc::error::TrySendError::Closed(_)) => self.lose(id, None),
            Err(mpsc::error::TrySendError::Full(_)) => {
                let text = "this worker does not read its messages";
                self.lose(id, Some(Status::resource_exhausted(text)));
            }
        }
    }

    /// All connected workers, by name.
    fn load(&self) -> Load {
        let jobs = self.jobs.iter();
        let open = jobs.filter(|(_, job)| job.submitted.campaign().is_none() && job.audits.is_none());
        let mut load = Load {
            seconds_per_step: self.pace.seconds_per_step(),
            workers: self.table.workers(),
            threads: self.table.threads(),
            ..Load::default()
        };
        for (&id, job) in open {
            let (tasks, cost) = (self.table.unsettled(id), job.submitted.cost());
            load.tasks += tasks;
            load.steps = load.steps.saturating_add(cost.saturating_mul(tasks as u64));
        }
        load
    }

    fn connected(&self) -> Vec<ConnectedMachine> {
        let mut machines: Vec<_> = self.workers.keys().map(|&id| self.machine(id)).collect();
        machines.sort_by(|one, other| one.name.cmp(&other.name));
        machines
    }

    fn machine(&self, id: WorkerId) -> ConnectedMachine {
        let process = self.table.process(id);
        let name = process.and_then(|process| self.names.get(&process));
        let mut work: Vec<WorkInHand> = Vec::new();
        for (job, tasks) in self.table.in_hand(id) {
            self.add(&mut work, job, tasks);
        }
        ConnectedMachine {
            name: name.cloned().unwrap_or_default(),
            capacity: self.table.capacity(id),
            work,
        }
    }

    fn add(&self, work: &mut Vec<WorkInHand>, job: JobId, tasks: usize) {
        let Some(job) = self.jobs.get(&job) else { return };
        let (kind, campaign) = (job.submitted.kind(), job.submitted.campaign());
        let known = work
            .iter_mut()
            .find(|known| known.kind == kind && known.campaign.as_ref() == campaign);
        match known {
            Some(known) => known.tasks += tasks,
            None => work.push(WorkInHand {
                kind,
                campaign: campaign.cloned(),
                tasks,
            }),
        }
    }
}

#[cfg(test)]
mod tests;
