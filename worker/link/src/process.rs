//! What processes have in common: they are told to leave.

use crate::stop::termination;
use std::{fmt::Display, process::ExitCode};
use tokio::sync::watch;

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
