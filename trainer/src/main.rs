//! The trainer's binary: connects to a coordinator and trains embedders until a signal stops it.

use clap::Parser;
use murmuration_link::{PeerArguments, Post, cores, errln, parse_arguments, process_name, run_peer};
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
    /// Name that people see [default: name of the machine, and of the job if a scheduler started this process]
    #[arg(long, env = "MURMURATION_TRAINER_NAME")]
    name: Option<String>,
    /// Number of threads, which does not change the result [default: number of cores that this process may use]
    #[arg(long, env = "MURMURATION_THREADS")]
    threads: Option<NonZeroUsize>,
}

#[tokio::main(flavor = "current_thread")]
async fn main() -> ExitCode {
    let arguments: Arguments = match parse_arguments(std::env::args_os()) {
        Ok(arguments) => arguments,
        Err(code) => return code,
    };
    let threads = arguments.threads.unwrap_or_else(cores).get();
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
                name: arguments.name.unwrap_or_else(|| process_name("trainer")),
                local_address: post.local_address,
                health: post.health,
                leaving: post.leaving,
            };
            client::run(options, post.stop).await
        },
    )
    .await
}
