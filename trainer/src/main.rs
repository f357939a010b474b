//! The trainer's binary: connects to a coordinator and trains embedders until it is told to stop.

use clap::Parser;
use murmuration_link::{Credentials, Health, IdentityFiles, TrustFiles, telemetry, until_terminated};
use murmuration_trainer::client::{self, Options};
use std::{net::SocketAddr, num::NonZeroUsize, process::ExitCode};

/// Trains embedders for a Murmuration coordinator.
///
/// Stateless: the coordinator keeps what is trained, epoch by epoch. On SIGTERM or Ctrl-C it ends the epoch, hands the
/// training back, and leaves.
#[derive(Debug, Parser)]
#[command(name = "murmuration-trainer", version)]
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
    /// Name shown to people
    #[arg(long, env = "MURMURATION_TRAINER_NAME", default_value = "trainer")]
    name: String,
    /// Threads that compute; they change no bit of what is trained [default: number of cores]
    #[arg(long, env = "MURMURATION_THREADS")]
    threads: Option<NonZeroUsize>,
    /// Answer gRPC's health service at this address, such as 127.0.0.1:7701 (`murmuration health` asks it)
    #[arg(long, env = "MURMURATION_HEALTH", value_name = "ADDRESS")]
    health: Option<SocketAddr>,
}

#[tokio::main(flavor = "current_thread")]
async fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let telemetry = telemetry("murmuration-trainer", "info");
    // To rayon 0 is the number of cores.
    let threads = arguments.threads.map_or(0, NonZeroUsize::get);
    if let Err(error) = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build_global()
    {
        eprintln!("error: cannot start {threads} threads: {error}");
        return ExitCode::FAILURE;
    }
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
    };
    let code = until_terminated("leaving after this epoch", |stop| async move {
        if let Some(listen) = arguments.health {
            health.serve(listen).await?;
        }
        client::run(options, stop).await
    })
    .await;
    telemetry.end().await;
    code
}
