//! What processes have in common: a log on stderr, and that they are told to leave.

use crate::stop::termination;
use std::{fmt::Display, process::ExitCode};
use tokio::sync::watch;
use tracing_subscriber::EnvFilter;

/// Logs to stderr what `RUST_LOG` lets through; without it, all from the level `default` on ("info", say). Once a process.
pub fn log_to_stderr(default: &str) {
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(default));
    tracing_subscriber::fmt()
        .with_writer(std::io::stderr)
        .with_env_filter(filter)
        .init();
}

/// Runs what a process is for, which is told to stop on SIGTERM or Ctrl-C; `leaving` says in the log when it will. An
/// error is named on stderr.
pub async fn until_terminated<E: Display, R: Future<Output = Result<(), E>>>(
    leaving: &'static str,
    run: impl FnOnce(watch::Receiver<bool>) -> R,
) -> ExitCode {
    let (stop, stopped) = watch::channel(false);
    tokio::spawn(async move {
        let signal = termination().await;
        tracing::info!("{signal}, {leaving}");
        stop.send_replace(true);
    });
    match run(stopped).await {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}
