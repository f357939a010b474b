//! The worker's binary: connects to a coordinator and evaluates and embeds until it is told to stop.

use clap::Parser;
use murmuration_embed::checkpoint_folder;
use murmuration_link::{Credentials, Health, IdentityFiles, TrustFiles, telemetry, until_terminated};
use murmuration_worker::client::{self, Options};
use std::{net::SocketAddr, num::NonZeroUsize, path::PathBuf, process::ExitCode, thread};

/// Evaluates controllers for a Murmuration coordinator, and embeds their pictures.
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
    #[command(flatten)]
    trust: TrustFiles,
    #[command(flatten)]
    identity: IdentityFiles,
    /// Evaluations at once [default: number of cores]
    #[arg(long, env = "MURMURATION_THREADS")]
    threads: Option<NonZeroUsize>,
    /// Name shown to people
    #[arg(long, env = "MURMURATION_WORKER_NAME", default_value = "worker")]
    name: String,
    /// Folder for checkpoints, up to 1 GiB [default: murmuration/checkpoints in the user's cache folder]
    #[arg(long, env = "MURMURATION_CACHE", value_name = "DIR")]
    cache: Option<PathBuf>,
    /// Answer gRPC's health service at this address, such as 127.0.0.1:7701 (`murmuration health` asks it)
    #[arg(long, env = "MURMURATION_HEALTH", value_name = "ADDRESS")]
    health: Option<SocketAddr>,
}

#[tokio::main(flavor = "current_thread")]
async fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let telemetry = telemetry("murmuration-worker", "info");
    let cores = thread::available_parallelism().unwrap_or(NonZeroUsize::MIN);
    let credentials = match Credentials::read(&arguments.trust, &arguments.identity) {
        Ok(credentials) => credentials,
        Err(error) => {
            eprintln!("error: {error}");
            return ExitCode::FAILURE;
        }
    };
    let health = Health::new();
    let options = Options {
        coordinator: arguments.coordinator,
        credentials,
        name: arguments.name,
        health: health.clone(),
        threads: arguments.threads.unwrap_or(cores),
        cache: arguments.cache.unwrap_or_else(checkpoint_folder),
    };
    let code = until_terminated("leaving", |stop| async move {
        if let Some(listen) = arguments.health {
            health.serve(listen).await?;
        }
        client::run(options, stop).await
    })
    .await;
    telemetry.end().await;
    code
}
