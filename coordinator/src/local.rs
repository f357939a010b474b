//! A whole cluster in one process: a coordinator and its workers, over loopback gRPC all the same.

use crate::server::{Coordinator, Options, ServerError};
use murmuration_worker::client;
use std::num::NonZeroUsize;
use tokio::{sync::watch, task::JoinHandle};

/// A coordinator with workers of one thread each.
#[derive(Debug)]
pub struct LocalCluster {
    coordinator: Coordinator,
    stop_workers: watch::Sender<bool>,
    workers: Vec<JoinHandle<Result<(), client::WorkerError>>>,
}

impl LocalCluster {
    /// Starts the coordinator, then `workers` workers that connect to it.
    ///
    /// # Errors
    /// If the coordinator cannot start.
    pub async fn start(options: Options, workers: usize) -> Result<Self, ServerError> {
        let coordinator = Coordinator::start(options).await?;
        let (stop_workers, stop) = watch::channel(false);
        let worker = |number: usize| {
            let options = client::Options {
                coordinator: coordinator.url(),
                name: format!("in-process-{number}"),
                threads: NonZeroUsize::MIN,
            };
            tokio::spawn(client::run(options, stop.clone()))
        };
        let workers = (1..=workers).map(worker).collect();
        Ok(Self {
            coordinator,
            stop_workers,
            workers,
        })
    }

    /// The coordinator.
    #[must_use]
    pub const fn coordinator(&self) -> &Coordinator {
        &self.coordinator
    }

    /// Stops searches, workers and coordinator, in that order.
    ///
    /// # Errors
    /// If the server had broken.
    pub async fn shutdown(self) -> Result<(), ServerError> {
        self.coordinator.stop_searches().await;
        self.stop_workers.send_replace(true);
        for worker in self.workers {
            // A worker that failed has said so in the log.
            let _ = worker.await;
        }
        self.coordinator.shutdown().await
    }
}
