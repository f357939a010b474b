//! A whole cluster in one process: a coordinator, its workers and trainers, over loopback gRPC all the same.

use crate::server::{Coordinator, Options, ServerError};
use murmuration_trainer::client as trainer;
use murmuration_worker::client as worker;
use std::num::NonZeroUsize;
use tokio::{sync::watch, task::JoinHandle};

/// How many helpers a coordinator has in its own process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Helpers {
    /// Workers, of one thread each.
    pub workers: usize,
    /// Trainers; they share the process's thread pool.
    pub trainers: usize,
}

impl Helpers {
    /// None: work waits for processes elsewhere.
    pub const NONE: Self = Self {
        workers: 0,
        trainers: 0,
    };
}

/// A coordinator with helpers in its own process.
#[derive(Debug)]
pub struct LocalCluster {
    coordinator: Coordinator,
    stop: watch::Sender<bool>,
    /// Each ends when it was told to stop, or has said in the log why it failed.
    helpers: Vec<JoinHandle<()>>,
}

impl LocalCluster {
    /// Starts the coordinator, then the helpers, which connect to it.
    ///
    /// # Errors
    /// If the coordinator cannot start.
    pub async fn start(options: Options, helpers: Helpers) -> Result<Self, ServerError> {
        let cache = options.data.path().join("cache");
        let coordinator = Coordinator::start(options).await?;
        let url = coordinator.url();
        let (stop, stopped) = watch::channel(false);
        let work = |number| {
            let options = worker::Options {
                coordinator: url.clone(),
                name: format!("in-process-{number}"),
                threads: NonZeroUsize::MIN,
                cache: cache.clone(),
            };
            let stopped = stopped.clone();
            tokio::spawn(async move {
                if let Err(error) = worker::run(options, stopped).await {
                    tracing::error!(%error, "a worker of this process gave up");
                }
            })
        };
        let train = |number| {
            let options = trainer::Options {
                coordinator: url.clone(),
                name: format!("in-process-{number}"),
            };
            let stopped = stopped.clone();
            tokio::spawn(async move {
                if let Err(error) = trainer::run(options, stopped).await {
                    tracing::error!(%error, "a trainer of this process gave up");
                }
            })
        };
        let workers = (1..=helpers.workers).map(work);
        let trainers = (1..=helpers.trainers).map(train);
        Ok(Self {
            helpers: workers.chain(trainers).collect(),
            coordinator,
            stop,
        })
    }

    /// The coordinator.
    #[must_use]
    pub const fn coordinator(&self) -> &Coordinator {
        &self.coordinator
    }

    /// Stops campaigns, helpers and coordinator, in that order.
    ///
    /// # Errors
    /// If the server had broken.
    pub async fn shutdown(self) -> Result<(), ServerError> {
        self.coordinator.stop_searches().await;
        self.stop.send_replace(true);
        for helper in self.helpers {
            // One that panicked has said so in the log.
            let _ = helper.await;
        }
        self.coordinator.shutdown().await
    }
}
