//! How a process hears that it should leave.

use tokio::sync::watch;

/// Waits until `stop` is true.
pub async fn stopped(stop: &mut watch::Receiver<bool>) {
    // Whoever could have said stop is gone: stop.
    let _ = stop.wait_for(|&stop| stop).await;
}

/// Waits for Ctrl-C ("interrupted"), or SIGTERM where there is one ("terminated"); says which of them came.
pub async fn termination() -> &'static str {
    #[cfg(unix)]
    {
        use tokio::signal::unix::{SignalKind, signal};
        if let Ok(mut terminated) = signal(SignalKind::terminate()) {
            tokio::select! {
                _ = terminated.recv() => return "terminated",
                Ok(()) = tokio::signal::ctrl_c() => return "interrupted",
            }
        }
    }
    match tokio::signal::ctrl_c().await {
        Ok(()) => "interrupted",
        // Without a way to hear of it, run until killed.
        Err(_) => std::future::pending().await,
    }
}
