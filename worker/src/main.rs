//! The worker's binary: connects to a coordinator, and evaluates and embeds until it must stop.

use clap::Parser;
use murmuration_embed::{Device, checkpoint_folder};
use murmuration_link::{PeerArguments, Post, cores, parse_arguments, process_name, run_peer};
use murmuration_worker::client::{self, Options};
use std::{num::NonZeroUsize, path::PathBuf, process::ExitCode};

/// Simulates controllers for a Murmuration coordinator, and embeds their pictures.
///
/// A worker keeps no state: start and stop as many as you like, on any machine. On SIGTERM or Ctrl-C it returns the work
/// that it has not started, finishes the rest, and exits.
#[derive(Debug, Parser)]
#[command(name = "murmuration-worker", version)]
struct Arguments {
    #[command(flatten)]
    peer: PeerArguments,
    /// Number of simultaneous evaluations [default: number of cores that this process may use]
    #[arg(long, env = "MURMURATION_THREADS", value_parser = threads)]
    threads: Option<NonZeroUsize>,
    /// Name that people see [default: name of the machine, and of the job if a scheduler started this process]
    #[arg(long, env = "MURMURATION_WORKER_NAME")]
    name: Option<String>,
    /// Folder for cached checkpoints, up to 1 GiB [default: murmuration/checkpoints in the user's cache folder]
    #[arg(long, env = "MURMURATION_CACHE", value_name = "DIR")]
    cache: Option<PathBuf>,
    /// Device that embeds pictures; `cuda` needs a build of ONNX Runtime for CUDA
    #[arg(
        long,
        env = "MURMURATION_EMBED_ON",
        value_name = "DEVICE",
        value_enum,
        default_value_t
    )]
    embed_on: Device,
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
    run_peer(
        "murmuration-worker",
        "leaving",
        arguments.peer,
        async |post: Post| {
            let options = Options {
                coordinator: post.coordinator,
                name: arguments.name.unwrap_or_else(|| process_name("worker")),
                local_address: post.local_address,
                health: post.health,
                leaving: post.leaving,
                threads: arguments.threads.unwrap_or_else(cores),
                cache: arguments.cache.unwrap_or_else(checkpoint_folder),
                embed_on: arguments.embed_on,
            };
            client::run(options, post.stop).await
        },
    )
    .await
}
