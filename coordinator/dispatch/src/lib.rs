//! The dispatcher: one asynchronous task that owns the lease table and exchanges messages with every worker.
//!
//! Campaigns submit jobs to the dispatcher and wait for the results; the worker service passes on the workers' messages. The
//! dispatcher drops the results of a job when the job is over, and writes nothing to disk.

mod job;
mod job_progress;
pub mod leases;
mod metrics;
mod open_audits;
mod pace;
mod service;
mod submitted;
mod trainers;
mod work;

pub use job::{
    EmbeddingJob, Evaluated, EvaluationJob, FineTuningParams, JobError, PoisonedTask, ReplayJob, Submitter,
    TrainingJob,
};
pub use job_progress::JobProgress;
pub use leases::{LeaseNumber, WorkerId};
pub use metrics::{DispatchMetrics, Families, PeerKind, WorkKind};
pub use trainers::Trainers;
pub use work::{embedding_cost, simulation_cost};

use murmuration_model::{CampaignId, MachineId, Maker, Origin, Quarantined, SavedTraining};
use murmuration_proto::v1;
use murmuration_swarm::{CheckpointDigest, EmbeddingKind, Invalid, Replay, training::Configuration};
use open_audits::OpenAudits;
use service::Service;
use std::{
    convert::Infallible,
    fmt,
    str::FromStr,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
    time::Duration,
};
use submitted::{AnyJob, Submitted};
use tokio::sync::{mpsc, oneshot, watch};
use tonic::Status;
use work::Work;

/// A connected worker or trainer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ConnectedMachine {
    /// Name and address of the worker or trainer.
    pub name: String,
    /// Number of tasks that the machine runs at once; 0 once it takes no more work.
    pub capacity: usize,
    pub work: Vec<WorkInHand>,
}

/// Tasks of one campaign and kind that a machine holds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WorkInHand {
    pub kind: WorkKind,
    /// Campaign of the tasks, if any.
    pub campaign: Option<CampaignId>,
    pub tasks: usize,
}

/// How busy a dispatcher and its workers are.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Load {
    /// Tasks of jobs without a campaign that have no accepted result yet.
    pub tasks: usize,
    /// Cost of these tasks, in steps of an agent.
    pub steps: u64,
    /// Measured seconds of a worker's thread for a step of an agent; `None` before the first result.
    pub seconds_per_step: Option<f64>,
    /// Number of workers that take work.
    pub workers: usize,
    /// Number of threads of these workers.
    pub threads: usize,
}

/// How the dispatcher treats its workers.
#[derive(Debug, Clone, Copy)]
pub struct Options {
    /// How often a worker must send something.
    pub heartbeat_interval: Duration,
    /// How long a worker may be silent before it counts as lost.
    pub silence_limit: Duration,
    /// Share of the evaluations and embeddings that a second machine repeats.
    pub audited: Share,
}

/// A share of a whole, 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Share(f64);

impl Share {
    #[must_use]
    pub const fn get(self) -> f64 {
        self.0
    }
}

/// The default share: one in a hundred.
impl Default for Share {
    fn default() -> Self {
        Self(0.01)
    }
}

impl fmt::Display for Share {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl FromStr for Share {
    type Err = Invalid;

    fn from_str(text: &str) -> Result<Self, Invalid> {
        let share = text.parse().ok().filter(|share| (0.0..=1.0).contains(share));
        share
            .map(Self)
            .ok_or_else(|| Invalid::new("share", text, "a number from 0 to 1"))
    }
}

impl Default for Options {
    fn default() -> Self {
        Self {
            heartbeat_interval: Duration::from_secs(1),
            silence_limit: Duration::from_secs(4),
            audited: Share::default(),
        }
    }
}

/// Error text when no worker is connected.
pub const NO_WORKER: &str = "no worker is connected: start one with `murmuration-worker --access FILE`";

/// How long [`Dispatch::while_staffed`] waits for a worker. A worker that is starting connects within this time.
const FIRST_WORKER_TIMEOUT: Duration = Duration::from_secs(10);

/// Capacity of the queue of messages to a worker. If it is full, the worker counts as lost.
pub const OUTBOX: usize = 1024;

/// Queue of messages to a worker. An error in the queue ends the worker's stream.
pub type Outbox = mpsc::Sender<Result<v1::CoordinatorMessage, Status>>;

/// A handle on the dispatcher; cheap to clone. The dispatcher ends when the last handle is dropped.
#[derive(Debug, Clone)]
pub struct Dispatch {
    commands: mpsc::Sender<Command>,
    workers: watch::Receiver<usize>,
    quarantined: watch::Receiver<Vec<Quarantined>>,
    audits: watch::Sender<OpenAudits>,
    /// Number of streams without a campaign so far.
    streams: Arc<AtomicU64>,
}

#[derive(Debug)]
pub struct JoinRequest {
    /// The worker's name, for people.
    pub name: String,
    /// Where the worker connects from.
    pub origin: Origin,
    /// Number of the worker's process, unique on its machine; `None` if the process reports no number.
    pub instance: Option<u64>,
    /// Number of tasks that the worker runs at once.
    pub capacity: usize,
    /// The worker's kind of embedding, if it embeds.
    pub kind: EmbeddingKind,
    /// Receives the messages to the worker.
    pub outbox: Outbox,
    /// Dropped when the dispatcher forgets the worker: messages from the worker no longer count.
    pub present: oneshot::Sender<Infallible>,
}

/// Why a worker may not join.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum JoinError {
    /// The dispatcher has ended.
    #[error("the coordinator is shutting down")]
    ShuttingDown,
    /// The worker's machine is quarantined.
    #[error(
        "this machine returned wrong results and is quarantined: repair it, then run `murmuration quarantine --lift {0}` \
         over the coordinator's data directory"
    )]
    Quarantined(MachineId),
}

/// A validated message of a worker that has joined.
#[derive(Debug)]
pub enum WorkerReport {
    /// The worker is ready for so many further evaluations.
    Credits(usize),
    /// The outcome of a lease.
    Result {
        /// Epoch of the coordinator that granted the lease.
        epoch: u64,
        lease: LeaseNumber,
        outcome: v1::batch_result::Outcome,
    },
    /// Progress of the training under a lease.
    Training {
        /// Epoch of the coordinator that granted the lease.
        epoch: u64,
        lease: LeaseNumber,
        progress: v1::TrainingProgress,
    },
    /// A saved state of the training under a lease.
    Saved {
        /// Epoch of the coordinator that granted the lease.
        epoch: u64,
        lease: LeaseNumber,
        training: SavedTraining,
    },
    Heartbeat,
    /// The worker takes no more leases.
    Drain,
    /// The worker's stream has ended.
    Gone,
}

/// Answer to a trainer that asks for the training under a lease.
#[derive(Debug, Clone, PartialEq)]
pub enum TrainingLease {
    Held(Box<LeasedTraining>),
    /// The lease is over: its training is not wanted any more.
    Over,
    /// The trainer never had the lease.
    Never,
}

/// A checkpoint that a trainer wants to publish.
#[derive(Debug, Clone, PartialEq)]
pub struct Publication {
    pub machine: MachineId,
    /// The training configuration, in TOML.
    pub configuration: String,
    /// The checkpoint that was fine-tuned; `None` if the embedder was trained from scratch.
    pub parent: Option<CheckpointDigest>,
    /// Bytes of the model.
    pub bytes: usize,
}

/// Properties of a leased training that its result is checked against.
#[derive(Debug, Clone, PartialEq)]
pub struct LeasedTraining {
    pub configuration: Configuration,
    /// The checkpoint that is fine-tuned; `None` if the embedder is trained from scratch.
    pub parent: Option<CheckpointDigest>,
    /// Maximum number of bytes of the training's snapshots.
    pub snapshot_bytes: usize,
}

#[derive(Debug)]
enum Command {
    Work(Request),
    Stop,
}

#[derive(Debug)]
enum Request {
    Submit {
        job: Box<dyn AnyJob>,
        job_progress: Arc<JobProgress>,
    },
    Join {
        join_request: JoinRequest,
        reply: oneshot::Sender<Result<WorkerId, JoinError>>,
    },
    Report {
        worker: WorkerId,
        report: WorkerReport,
    },
    WithdrawAudits(Submitter),
    Mistrust {
        wrong: Vec<Quarantined>,
        reply: oneshot::Sender<()>,
    },
    TrainingLease {
        worker: WorkerId,
        epoch: u64,
        lease: LeaseNumber,
        reply: oneshot::Sender<TrainingLease>,
    },
    LeasedTraining {
        machine: MachineId,
        epoch: u64,
        lease: LeaseNumber,
        reply: oneshot::Sender<Option<CampaignId>>,
    },
    Publication {
        publication: Publication,
        reply: oneshot::Sender<bool>,
    },
    Connected {
        reply: oneshot::Sender<Vec<ConnectedMachine>>,
    },
    Load {
        reply: oneshot::Sender<Load>,
    },
}

impl Dispatch {
    /// Starts a dispatcher on the current runtime. The dispatcher refuses the machines in `wrong`, which were quarantined
    /// earlier.
    #[must_use]
    pub fn start(options: Options, metrics: DispatchMetrics, wrong: Vec<Quarantined>) -> Self {
        let (commands, inbox) = mpsc::channel(1024);
        let (count, workers) = watch::channel(0);
        let (wrong, quarantined) = watch::channel(wrong);
        let audits = watch::Sender::default();
        tokio::spawn(Service::new(options, count, wrong, audits.clone(), metrics).run(inbox));
        Self {
            commands,
            workers,
            quarantined,
            audits,
            streams: Arc::default(),
        }
    }

    /// A submitter of evaluations without a campaign.
    #[must_use]
    pub fn new_stream(&self) -> Submitter {
        Submitter::Stream(self.streams.fetch_add(1, Ordering::Relaxed))
    }

    /// Waits until the audits are over that went on after the jobs of a submitter, until one ends in a disagreement, or until
    /// there are other than `seen` quarantined machines; returns false in the last case. `job_progress` says meanwhile what is
    /// waited for.
    pub async fn audited(&self, submitter: &Submitter, seen: usize, job_progress: &JobProgress) -> bool {
        let text = "another machine repeats some evaluations, to compare the results (an audit)";
        job_progress.set_trouble(Some(text.to_owned()));
        let (mut audits, mut wrong) = (self.audits.subscribe(), self.quarantined.clone());
        // Results of a machine that was found wrong are computed again first.
        tokio::select! {
            biased;
            _ = wrong.wait_for(|wrong| wrong.len() != seen) => false,
            _ = audits.wait_for(|audits| audits.is_over(submitter)) => self.quarantined.borrow().len() == seen,
        }
    }

    /// Quarantines machines that were found wrong elsewhere, and returns when they are quarantined.
    pub async fn mistrust(&self, wrong: Vec<Quarantined>) {
        let (reply, done) = oneshot::channel();
        let mistrust = Request::Mistrust { wrong, reply };
        if self.commands.send(Command::Work(mistrust)).await.is_ok() {
            // A dispatcher that has ended quarantines nobody.
            let _ = done.await;
        }
    }

    /// Ends the audits that go on after the jobs of a submitter, which wants no results any more.
    pub async fn withdraw_audits(&self, submitter: Submitter) {
        // Nothing goes on if the dispatcher has ended.
        let _ = self
            .commands
            .send(Command::Work(Request::WithdrawAudits(submitter)))
            .await;
    }

    /// The disagreement that an audit found after a job of this submitter, if no third machine could decide it. It is an error
    /// again after a while, unless it is decided meanwhile.
    #[must_use]
    pub fn take_disagreement(&self, submitter: &Submitter) -> Option<JobError> {
        let mut taken = None;
        self.audits.send_if_modified(|audits| {
            taken = audits.take_disagreement(submitter);
            taken.is_some()
        });
        taken
    }

    /// Evaluates a job on the workers; `job_progress` receives the job's progress. Results are in the order of the tasks.
    /// Dropping the future withdraws the job.
    ///
    /// # Errors
    /// See [`JobError`].
    pub async fn evaluate(
        &self,
        job: EvaluationJob,
        job_progress: Arc<JobProgress>,
    ) -> Result<Vec<Evaluated>, JobError> {
        self.submit(job, job_progress).await
    }

    /// Embeds stored pictures on the workers; `job_progress` receives the progress. Returns, in the order of the individuals, one
    /// embedding for each picture, and the maker of each individual's embeddings. Dropping the future withdraws the job.
    ///
    /// # Errors
    /// See [`JobError`].
    pub async fn embed(
        &self,
        job: EmbeddingJob,
        job_progress: Arc<JobProgress>,
    ) -> Result<Vec<(Vec<Vec<f32>>, Maker)>, JobError> {
        self.submit(job, job_progress).await
    }

    /// Simulates an individual again on a worker, and returns its motion.
    ///
    /// # Errors
    /// See [`JobError`].
    pub async fn replay(&self, job: ReplayJob) -> Result<Replay, JobError> {
        self.submit_one(job, Arc::default()).await
    }

    /// The output of `work`, or an error once no worker has been connected for a while.
    ///
    /// # Errors
    /// [`JobError::NoWorker`].
    pub async fn while_staffed<T>(&self, work: impl Future<Output = T>) -> Result<T, JobError> {
        tokio::select! {
            biased;
            done = work => Ok(done),
            () = self.deserted() => Err(JobError::NoWorker),
        }
    }

    /// Resolves once no worker has been connected for a while.
    async fn deserted(&self) {
        let mut workers = self.workers();
        // If the dispatcher has ended, its jobs fail by themselves.
        while workers.wait_for(|&count| count == 0).await.is_ok() {
            let somebody = workers.wait_for(|&count| count > 0);
            if tokio::time::timeout(FIRST_WORKER_TIMEOUT, somebody)
                .await
                .is_err()
            {
                return;
            }
        }
        std::future::pending().await
    }

    /// Fails if no worker is connected now.
    ///
    /// # Errors
    /// [`JobError::NoWorker`].
    pub fn check_staffed(&self) -> Result<(), JobError> {
        match *self.workers.borrow() {
            0 => Err(JobError::NoWorker),
            _ => Ok(()),
        }
    }

    /// Ends every worker's stream and every job.
    pub async fn stop(&self) {
        // `send` fails if the dispatcher has already ended.
        let _ = self.commands.send(Command::Stop).await;
    }

    /// Receiver of the number of workers that take work: the current number, and each change.
    #[must_use]
    pub fn workers(&self) -> watch::Receiver<usize> {
        self.workers.clone()
    }

    /// Receiver of the quarantined machines, oldest first: the current list, and each addition.
    #[must_use]
    pub fn quarantined(&self) -> watch::Receiver<Vec<Quarantined>> {
        self.quarantined.clone()
    }

    /// Registers a worker that connects.
    pub async fn join(&self, join_request: JoinRequest) -> Result<WorkerId, JoinError> {
        let (reply, answer) = oneshot::channel();
        let command = Command::Work(Request::Join { join_request, reply });
        let sent = self.commands.send(command).await;
        sent.map_err(|_| JoinError::ShuttingDown)?;
        answer.await.map_err(|_| JoinError::ShuttingDown)?
    }

    /// Passes on a worker's message to the dispatcher.
    pub async fn report(&self, worker: WorkerId, report: WorkerReport) {
        // A dispatcher that has ended needs no reports.
        let _ = self
            .commands
            .send(Command::Work(Request::Report { worker, report }))
            .await;
    }

    /// The training under a lease, if the lease was granted in `epoch` of the coordinator.
    pub async fn training_lease(&self, worker: WorkerId, epoch: u64, lease: LeaseNumber) -> TrainingLease {
        let (reply, answer) = oneshot::channel();
        let request = Request::TrainingLease {
            worker,
            epoch,
            lease,
            reply,
        };
        // A dispatcher that has ended wants no trainings.
        match self.commands.send(Command::Work(request)).await {
            Ok(()) => answer.await.unwrap_or(TrainingLease::Over),
            Err(_) => TrainingLease::Over,
        }
    }

    /// Campaign of the training under `lease`. `None` if no trainer on `machine` holds the lease, or the lease was not granted in
    /// `epoch` of the coordinator.
    pub async fn leased_training(
        &self,
        machine: MachineId,
        epoch: u64,
        lease: LeaseNumber,
    ) -> Option<CampaignId> {
        let (reply, answer) = oneshot::channel();
        let request = Request::LeasedTraining {
            machine,
            epoch,
            lease,
            reply,
        };
        // Nobody holds leases of a dispatcher that has ended.
        self.commands.send(Command::Work(request)).await.ok()?;
        answer.await.ok()?
    }

    /// Whether a trainer on the publication's machine holds the lease of a training with such a result. Each training allows
    /// several publications, because trainers can repeat a request or be lost.
    pub async fn may_publish(&self, publication: Publication) -> bool {
        let (reply, answer) = oneshot::channel();
        let request = Request::Publication { publication, reply };
        // Nobody holds leases of a dispatcher that has ended.
        match self.commands.send(Command::Work(request)).await {
            Ok(()) => answer.await.unwrap_or(false),
            Err(_) => false,
        }
    }

    /// All connected workers, by name; empty once the dispatcher has ended.
    pub async fn connected(&self) -> Vec<ConnectedMachine> {
        let (reply, answer) = oneshot::channel();
        let request = Command::Work(Request::Connected { reply });
        match self.commands.send(request).await {
            Ok(()) => answer.await.unwrap_or_default(),
            Err(_) => Vec::new(),
        }
    }

    /// How busy the dispatcher and its workers are; idle once the dispatcher has ended.
    pub async fn load(&self) -> Load {
        let (reply, answer) = oneshot::channel();
        match self.commands.send(Command::Work(Request::Load { reply })).await {
            Ok(()) => answer.await.unwrap_or_default(),
            Err(_) => Load::default(),
        }
    }

    async fn submit<W: Work>(
        &self,
        work: W,
        job_progress: Arc<JobProgress>,
    ) -> Result<Vec<W::Outcome>, JobError> {
        let (job, answer) = Submitted::new(work);
        let command = Command::Work(Request::Submit {
            job: Box::new(job),
            job_progress,
        });
        let sent = self.commands.send(command).await;
        sent.map_err(|_| JobError::ShuttingDown)?;
        answer.await.map_err(|_| JobError::ShuttingDown)?
    }

    /// Submits work of one task, and returns its outcome.
    async fn submit_one<W: Work>(
        &self,
        work: W,
        job_progress: Arc<JobProgress>,
    ) -> Result<W::Outcome, JobError> {
        let outcome = self.submit(work, job_progress).await?.pop();
        outcome.ok_or(JobError::ShuttingDown)
    }
}
