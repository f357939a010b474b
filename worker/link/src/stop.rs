//! Signals that ask a process to leave.

use tokio::sync::watch;

/// Exit code after a second signal: the code that shells report for a process that Ctrl-C ended.
#[cfg(unix)]
const IMPATIENT: i32 = 130;

/// Waits until `stop` is true or its sender is dropped.
pub async fn stopped(stop: &mut watch::Receiver<bool>) {
    // An error means that the sender is gone, so stop.
    let _ = stop.wait_for(|&stop| stop).await;
}

/// Waits for Ctrl-C or SIGTERM, and returns "interrupted" or "terminated". From this call on the first signal does not end the
/// process, whether the future is polled or not. A second signal ends the process at once with exit code 130, because the clean
/// exit can take long. Call this function within a tokio runtime.
#[cfg(unix)]
pub fn termination() -> impl Future<Output = &'static str> + Send {
    use tokio::signal::unix::{Signal, SignalKind, signal};
    async fn heard(signal: Option<&mut Signal>) {
        match signal {
            Some(signal) => drop(signal.recv().await),
            // If signals cannot be received, the process runs until it is killed.
            None => std::future::pending().await,
        }
    }
    let mut terminated = signal(SignalKind::terminate()).ok();
    let mut interrupted = signal(SignalKind::interrupt()).ok();
    async move {
        let first = tokio::select! {
            () = heard(terminated.as_mut()) => "terminated",
            () = heard(interrupted.as_mut()) => "interrupted",
        };
        tokio::spawn(async move {
            tokio::select! {
                () = heard(terminated.as_mut()) => {}
                () = heard(interrupted.as_mut()) => {}
            }
            std::process::exit(IMPATIENT);
        });
        first
    }
}

/// Waits for Ctrl-C, and returns "interrupted".
#[cfg(not(unix))]
pub async fn termination() -> &'static str {
    match tokio::signal::ctrl_c().await {
        Ok(()) => "interrupted",
        // If signals cannot be received, the process runs until it is killed.
        Err(_) => std::future::pending().await,
    }
}
