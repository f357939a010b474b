//! Work that computes or waits for the disk, where it does not hold up the network.

/// A bug: the work panicked. The log says where.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a task stopped because of a bug, which the log describes; committed data is safe")]
pub struct Broken;

/// Runs `work` on a thread that may block.
///
/// # Errors
/// [`Broken`] if it panics.
pub async fn blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Result<T, Broken> {
    tokio::task::spawn_blocking(work).await.map_err(|_| Broken)
}
