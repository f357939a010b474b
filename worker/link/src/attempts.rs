//! Single calls to a coordinator that may be away for a moment.

use crate::{TRACE_PARENT, trace_parent};
use murmuration_proto::{REQUEST_ID, v1};
use std::{future::Future, time::Duration};
use tonic::{Code, Request, Status, metadata::MetadataValue};
use tracing::Span;

/// Attempts at a call, and the pause between two.
const ATTEMPTS: usize = 3;
const PAUSE: Duration = Duration::from_millis(500);

/// A request made on behalf of a lease: it goes by the lease's id, so that the coordinator's log says so too, and belongs
/// to the current span's trace.
pub fn for_lease<T>(message: T, lease: v1::LeaseId) -> Request<T> {
    let mut request = Request::new(message);
    let names = [
        (REQUEST_ID, lease.to_string()),
        (TRACE_PARENT, trace_parent(&Span::current())),
    ];
    for (header, name) in names.into_iter().filter(|(_, name)| !name.is_empty()) {
        // Digits, letters and dashes are always a header's value.
        if let Ok(value) = MetadataValue::try_from(name) {
            request.metadata_mut().insert(header, value);
        }
    }
    request
}

/// Makes a call, and makes it again, three times in all with half a second between, while what it fails of
/// [may pass](may_pass).
///
/// # Errors
/// What the last attempt failed of.
pub async fn attempts<T, F>(mut call: impl FnMut() -> F) -> Result<T, Status>
where
    F: Future<Output = Result<T, Status>>,
{
    for _ in 1..ATTEMPTS {
        match call().await {
            Err(status) if may_pass(&status) => {}
            ended => return ended,
        }
        tokio::time::sleep(PAUSE).await;
    }
    call().await
}

/// Whether the same call may work later: the coordinator is away, or the connection broke. It will not where the
/// coordinator has heard the request and finds it wrong.
#[must_use]
pub fn may_pass(status: &Status) -> bool {
    !matches!(
        status.code(),
        Code::NotFound
            | Code::DataLoss
            | Code::InvalidArgument
            | Code::FailedPrecondition
            | Code::OutOfRange
            | Code::Unimplemented
            | Code::PermissionDenied
            | Code::Unauthenticated
    )
}

/// Whether the same call may work later, or from another machine: besides what [may pass](may_pass), the coordinator may
/// not let this one in.
#[must_use]
pub fn may_pass_elsewhere(status: &Status) -> bool {
    let is_not_let_in = matches!(status.code(), Code::PermissionDenied | Code::Unauthenticated);
    is_not_let_in || may_pass(status)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    /// How many times a call was made that fails with these, one after the other, and what came of it.
    async fn calls(failures: &[Code]) -> (usize, Option<Code>) {
        let made = Cell::new(0);
        let outcome = attempts(|| async {
            let number = made.replace(made.get() + 1);
            failures
                .get(number)
                .map_or(Ok(()), |&code| Err(Status::new(code, "")))
        });
        let outcome = outcome.await.err().map(|status| status.code());
        (made.get(), outcome)
    }

    #[tokio::test(start_paused = true)]
    async fn what_may_pass_is_tried_three_times_and_the_rest_once() {
        use Code::{DeadlineExceeded, NotFound, Unavailable};
        assert_eq!(calls(&[]).await, (1, None));
        assert_eq!(calls(&[NotFound]).await, (1, Some(NotFound)));
        assert_eq!(calls(&[Unavailable, DeadlineExceeded]).await, (3, None));
        assert_eq!(calls(&[Unavailable; 4]).await, (3, Some(Unavailable)));
    }
}
