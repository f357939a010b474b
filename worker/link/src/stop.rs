//! How a process hears that it should leave.

use tokio::sync::watch;

/// Waits until `stop` is true.
pub async fn stopped(stop: &mut watch::Receiver<bool>) {
    // Whoever could have said stop is gone: stop.
    let _ = stop.wait_for(|&stop| stop).await;
}

/// Waits for Ctrl-C ("interrupted"), or SIGTERM where there is one ("terminated"); says which of them came. Neither ends
/// the process any more from this call on, whether the future is polled or not; within a runtime.
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
        tokio::select! {
            () = heard(terminated.as_mut()) => "terminated",
            () = heard(interrupted.as_mut()) => "interrupted",
        }
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
