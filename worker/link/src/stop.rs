//! Signals that tell a process to leave.

use tokio::sync::watch;

/// Exit code of a process that was told twice to leave: a shell's for one that Ctrl-C ended.
#[cfg(unix)]
const IMPATIENT: i32 = 130;

/// Waits until `stop` is true.
pub async fn stopped(stop: &mut watch::Receiver<bool>) {
    // Nobody is left who could say stop, so stop.
    let _ = stop.wait_for(|&stop| stop).await;
}

/// Waits for Ctrl-C ("interrupted") or, where it exists, SIGTERM ("terminated"), and returns which one came. From this call
/// on neither ends the process, whether the future is polled or not; but once one came, the next ends it at once with exit
/// code 130, because what the process finishes first may take long. Must be called within a runtime.
#[cfg(unix)]
pub fn termination() -> impl Future<Output = &'static str> + Send {
    use tokio::signal::unix::{Signal, SignalKind, signal};
    async fn heard(signal: Option<&mut Signal>) {
        match signal {
            Some(signal) => drop(signal.recv().await),
            // Without a way to hear of it, run until killed.
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

/// Waits for Ctrl-C ("interrupted").
#[cfg(not(unix))]
pub async fn termination() -> &'static str {
    match tokio::signal::ctrl_c().await {
        Ok(()) => "interrupted",
        // Without a way to hear of it, run until killed.
        Err(_) => std::future::pending().await,
    }
}
