//! How many may do at once what goes on for long.

use murmuration_access::limits::{MAX_REPLAYS, MAX_WATCHES};
use std::sync::Arc;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tonic::Status;

/// Room for those who watch, and for replays; shared by gRPC and pages, cheap to clone.
#[derive(Debug, Clone)]
pub struct Seats {
    watches: Arc<Semaphore>,
    replays: Arc<Semaphore>,
}

/// One seat, until it is dropped.
pub type Seat = OwnedSemaphorePermit;

impl Default for Seats {
    fn default() -> Self {
        Self::new(MAX_WATCHES, MAX_REPLAYS)
    }
}

impl Seats {
    fn new(watches: usize, replays: usize) -> Self {
        Self {
            watches: Arc::new(Semaphore::new(watches)),
            replays: Arc::new(Semaphore::new(replays)),
        }
    }

    /// For somebody who watches.
    pub fn watch(&self) -> Result<Seat, Status> {
        take(
            &self.watches,
            "too many watch this coordinator: close a window, or try again later",
        )
    }

    /// For a replay.
    pub fn replay(&self) -> Result<Seat, Status> {
        take(
            &self.replays,
            "too many replays are waiting for workers: try again later",
        )
    }
}

fn take(seats: &Arc<Semaphore>, full: &str) -> Result<Seat, Status> {
    seats
        .clone()
        .try_acquire_owned()
        .map_err(|_| Status::resource_exhausted(full))
}

#[cfg(test)]
mod tests {
    use super::*;
    use tonic::Code;

    #[test]
    fn one_too_many_is_refused_until_another_leaves() {
        let seats = Seats::new(2, 1);
        let first = seats.watch().unwrap();
        let _second = seats.clone().watch().unwrap();
        assert_eq!(seats.watch().unwrap_err().code(), Code::ResourceExhausted);
        drop(first);
        assert!(seats.watch().is_ok());
        let replay = seats.replay().unwrap();
        assert_eq!(seats.replay().unwrap_err().code(), Code::ResourceExhausted);
        drop(replay);
        assert!(seats.replay().is_ok());
    }
}
