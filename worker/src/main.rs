//! The worker's binary: connects to a coordinator and evaluates until it is told to stop.

use clap::Parser;
use murmuration_worker::client::{self, Options};
use std::{num::NonZeroUsize, process::ExitCode, thread};
use tokio::sync::watch;
use tracing_subscriber::EnvFilter;

/// Evaluates controllers for a Murmuration coordinator.
///
/// Stateless: start and stop as many as you like, wherever you like. On SIGTERM or Ctrl-C it gives back what it
/// has not begun, finishes the rest, and leaves.
#[derive(Debug, Parser)]
#[command(name = "murmuration-worker", version)]
struct Arguments {
    /// URL of the coordinator
    #[arg(
        long,
        env = "MURMURATION_COORDINATOR",
        default_value = "http://127.0.0.1:7700"
    )]
    coordinator: String,
    /// Evaluations at once [default: number of cores]
    #[arg(long, env = "MURMURATION_THREADS")]
    threads: Option<NonZeroUsize>,
    /// Name shown to people
    #[arg(long, env = "MURMURATION_WORKER_NAME", default_value = "worker")]
    name: String,
}

#[tokio::main(flavor = "current_thread")]
async fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("info"));
    tracing_subscriber::fmt()
        .with_writer(std::io::stderr)
        .with_env_filter(filter)
        .init();
    let (stop, stopped) = watch::channel(false);
    tokio::spawn(async move {
        termination().await;
        tracing::info!("leaving");
        stop.send_replace(true);
    });
    let cores = thread::available_parallelism().unwrap_or(NonZeroUsize::MIN);
    let options = Options {
        coordinator: arguments.coordinator,
        name: arguments.name,
        threads: arguments.threads.unwrap_or(cores),
    };
    match client::run(options, stopped).await {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Ctrl-C, or SIGTERM where there is one.
async fn termination() {
    #[cfg(unix)]
    {
        use tokio::signal::unix::{SignalKind, signal};
        if let Ok(mut terminated) = signal(SignalKind::terminate()) {
            tokio::select! {
                _ = terminated.recv() => return,
                _ = tokio::signal::ctrl_c() => return,
            }
        }
    }
    // Without a way to hear of it, run until killed.
    if tokio::signal::ctrl_c().await.is_err() {
        std::future::pending::<()>().await;
    }
}
