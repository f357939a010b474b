//! A whole cluster in one process: a coordinator, its workers and trainers, connected by gRPC over loopback.

use crate::server::{Coordinator, Options, ServerError};
use murmuration_embed::{Device, checkpoint_folder};
use murmuration_link::{Health, Leaving, OnLost, Target, errln, process_name};
use murmuration_trainer::client as trainer;
use murmuration_worker::client as worker;
pub use murmuration_worker::client::WorkerError;
use std::{fmt::Display, num::NonZeroUsize, time::Duration};
use tokio::{sync::watch, task::JoinHandle};

/// How long workers may take to end before a message explains the wait.
const PATIENCE: Duration = Duration::from_secs(2);

/// Numbers of workers and trainers in the coordinator's process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct InProcess {
    /// Number of workers, with one thread each.
    pub workers: usize,
    /// Number of trainers. They share the process's thread pool.
    pub trainers: usize,
    /// Device on which the workers embed.
    pub embed_on: Device,
}

impl InProcess {
    /// No workers and trainers: work waits for other processes.
    pub const NONE: Self = Self {
        workers: 0,
        trainers: 0,
        embed_on: Device::Cpu,
    };
}

/// A coordinator with workers and trainers in its own process.
#[derive(Debug)]
pub struct LocalCluster {
    coordinator: Coordinator,
    stop: watch::Sender<bool>,
    /// The tasks of workers and trainers. Each task ends when it is asked to stop, or after it has logged why it failed.
    tasks: Vec<JoinHandle<()>>,
}

impl LocalCluster {
    /// Starts the coordinator, then its workers and trainers, which connect to it.
    ///
    /// # Errors
    /// If the coordinator cannot start.
    pub async fn start(options: Options, in_process: InProcess) -> Result<Self, ServerError> {
        let cache = options.data.path().join("cache");
        let coordinator = Coordinator::start(options).await?;
        let way = coordinator.local().clone();
        let (stop, stopped) = watch::channel(false);
        let work = |number| {
            let options = worker::Options {
                coordinator: way.target(),
                name: format!("in-process-{number}"),
                local_address: None,
                health: Health::new(),
                leaving: Leaving::default(),
                threads: NonZeroUsize::MIN,
                cache: cache.clone(),
                embed_on: in_process.embed_on,
            };
            spawn(worker::run(options, stopped.clone()))
        };
        let train = |number| {
            let options = trainer::Options {
                coordinator: way.target(),
                name: format!("in-process-{number}"),
                local_address: None,
                health: Health::new(),
                leaving: Leaving::default(),
            };
            spawn(trainer::run(options, stopped.clone()))
        };
        let workers = (1..=in_process.workers).map(work);
        let trainers = (1..=in_process.trainers).map(train);
        Ok(Self {
            tasks: workers.chain(trainers).collect(),
            coordinator,
            stop,
        })
    }

    #[must_use]
    pub const fn coordinator(&self) -> &Coordinator {
        &self.coordinator
    }

    /// Stops campaigns, workers, trainers and coordinator, in that order.
    ///
    /// # Errors
    /// If the server failed earlier.
    pub async fn shutdown(self) -> Result<(), ServerError> {
        self.coordinator.stop_searches().await;
        self.stop.send_replace(true);
        let ended = async {
            for member in self.tasks {
                // A panic is in the log already.
                let _ = member.await;
            }
        };
        tokio::pin!(ended);
        if tokio::time::timeout(PATIENCE, &mut ended).await.is_err() {
            errln!("waiting for running evaluations; Ctrl-C stops them at once, and nothing on disk is lost");
            ended.await;
        }
        self.coordinator.shutdown().await
    }
}

/// Works for the coordinator `target`, with this number of threads, and embeds on `embed_on`, until `stop` becomes true or the coordinator has ended. Gives up
/// if there is no coordinator for as long as `on_lost` says.
///
/// # Errors
/// If the coordinator refuses the worker, or is lost.
pub async fn work_for(
    target: Target,
    threads: NonZeroUsize,
    embed_on: Device,
    on_lost: OnLost,
    stop: watch::Receiver<bool>,
) -> Result<(), WorkerError> {
    let options = worker::Options {
        coordinator: target,
        name: process_name("worker"),
        local_address: None,
        health: Health::new(),
        leaving: Leaving::when_lost(on_lost),
        threads,
        cache: checkpoint_folder(),
        embed_on,
    };
    worker::run(options, stop).await
}

fn spawn<E: Display>(run: impl Future<Output = Result<(), E>> + Send + 'static) -> JoinHandle<()> {
    tokio::spawn(async move {
        if let Err(error) = run.await {
            tracing::error!(%error, "a worker or trainer of this process gave up");
        }
    })
}
