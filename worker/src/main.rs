//! The worker's binary: connects to a coordinator, and evaluates and embeds until it must stop.

use clap::Parser;
use murmuration_embed::checkpoint_folder;
use murmuration_link::{PeerArguments, Post, parse_arguments, run_peer};
use murmuration_worker::client::{self, Options};
use std::{num::NonZeroUsize, path::PathBuf, process::ExitCode, thread};

/// Simulates controllers for a Murmuration coordinator, and embeds their pictures.
///
/// A worker keeps no state: start and stop as many as you like, on any machine. On SIGTERM or Ctrl-C it returns the work
/// that it has not started, finishes the rest, and exits.
#[derive(Debug, Parser)]
#[command(name = "murmuration-worker", version)]
struct Arguments {
    #[command(flatten)]
    peer: PeerArguments,
    /// Number of simultaneous evaluations [default: number of cores]
    #[arg(long, env = "MURMURATION_THREADS", value_parser = threads)]
    threads: Option<NonZeroUsize>,
    /// Name that people see
    #[arg(long, env = "MURMURATION_WORKER_NAME", default_value = "worker")]
    name: String,
    /// Folder for cached checkpoints, up to 1 GiB [default: murmuration/checkpoints in the user's cache folder]
    #[arg(long, env = "MURMURATION_CACHE", value_name = "DIR")]
    cache: Option<PathBuf>,
}

/// Parses a number of threads. Coordinators refuse capacities over 4,096, and so many threads would fill the memory.
fn threads(text: &str) -> Result<NonZeroUsize, String> {
    let number = text
        .parse()
        .ok()
        .filter(|number: &NonZeroUsize| number.get() <= 4096);
    number.ok_or_else(|| "must be a whole number from 1 to 4,096".to_owned())
}

#[tokio::main(flavor = "current_thread")]
async fn main() -> ExitCode {
    let arguments: Arguments = match parse_arguments(std::env::args_os()) {
        Ok(arguments) => arguments,
        Err(code) => return code,
    };
    let cores = thread::available_parallelism().unwrap_or(NonZeroUsize::MIN);
    run_peer(
        "murmuration-worker",
        "leaving",
        arguments.peer,
        async |post: Post| {
            let options = Options {
                coordinator: post.coordinator,
                credentials: post.credentials,
                name: arguments.name,
                local_address: post.local_address,
                health: post.health,
                threads: arguments.threads.unwrap_or(cores),
                cache: arguments.cache.unwrap_or_else(checkpoint_folder),
            };
            client::run(options, post.stop).await
        },
    )
    .await
}
