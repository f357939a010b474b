//! The trainer's binary: connects to a coordinator and trains embedders until a signal stops it.

use clap::Parser;
use murmuration_link::{PeerArguments, Post, errln, parse_arguments, run_peer};
use murmuration_trainer::client::{self, Options};
use std::{num::NonZeroUsize, process::ExitCode};

/// Trains embedders for a Murmuration coordinator.
///
/// A trainer keeps no state: the coordinator stores the training after every epoch. On SIGTERM or Ctrl-C the trainer
/// finishes the epoch, returns the training, and exits.
#[derive(Debug, Parser)]
#[command(name = "murmuration-trainer", version)]
struct Arguments {
    #[command(flatten)]
    peer: PeerArguments,
    /// Name that people see
    #[arg(long, env = "MURMURATION_TRAINER_NAME", default_value = "trainer")]
    name: String,
    /// Number of threads, which does not change the result [default: number of cores]
    #[arg(long, env = "MURMURATION_THREADS")]
    threads: Option<NonZeroUsize>,
}

#[tokio::main(flavor = "current_thread")]
async fn main() -> ExitCode {
    let arguments: Arguments = match parse_arguments(std::env::args_os()) {
        Ok(arguments) => arguments,
        Err(code) => return code,
    };
    // For rayon, 0 means the number of cores.
    let threads = arguments.threads.map_or(0, NonZeroUsize::get);
    if let Err(error) = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build_global()
    {
        errln!("error: cannot start {threads} threads: {error}");
        return ExitCode::FAILURE;
    }
    let leaving = "leaving after this epoch";
    run_peer(
        "murmuration-trainer",
        leaving,
        arguments.peer,
        async |post: Post| {
            let options = Options {
                coordinator: post.coordinator,
                credentials: post.credentials,
                name: arguments.name,
                local_address: post.local_address,
                health: post.health,
            };
            client::run(options, post.stop).await
        },
    )
    .await
}
