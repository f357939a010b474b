//! Calls to a coordinator that can be unavailable for a moment.

use crate::{TRACE_PARENT, trace_parent};
use backon::{ConstantBuilder, Retryable as _};
use murmuration_proto::{REQUEST_ID, v1};
use std::{future::Future, time::Duration};
use tonic::{Code, Request, Status, metadata::MetadataValue};
use tracing::Span;

/// Number of retries of a call, and the pause before each retry.
const FURTHER_ATTEMPTS: usize = 2;
const PAUSE: Duration = Duration::from_millis(500);

/// A request on behalf of a lease. The lease's id becomes the request's id, for the coordinator's log. The request belongs to the
/// current span's trace.
pub fn for_lease<T>(message: T, lease: v1::LeaseId) -> Request<T> {
    let mut request = Request::new(message);
    let names = [
        (REQUEST_ID, lease.to_string()),
        (TRACE_PARENT, trace_parent(&Span::current())),
    ];
    for (header, name) in names.into_iter().filter(|(_, name)| !name.is_empty()) {
        // Digits, letters and dashes are always valid in a header.
        if let Ok(value) = MetadataValue::try_from(name) {
            request.metadata_mut().insert(header, value);
        }
    }
    request
}

/// Makes up to three attempts at a call, half a second apart. Tries again only after an error that [may pass](may_pass).
///
/// # Errors
/// The error of the last attempt.
pub async fn attempts<T, F>(call: impl FnMut() -> F) -> Result<T, Status>
where
    F: Future<Output = Result<T, Status>>,
{
    let pauses = ConstantBuilder::default().with_delay(PAUSE);
    call.retry(pauses.with_max_times(FURTHER_ATTEMPTS))
        .when(may_pass)
        .await
}

/// Whether the same call may succeed later: true if the coordinator is unavailable or the connection broke, false if the
/// coordinator refused the request.
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

/// Whether the same call may succeed later or from another machine: the error [may pass](may_pass), or the coordinator does
/// not admit this machine.
#[must_use]
pub fn may_pass_elsewhere(status: &Status) -> bool {
    let is_not_let_in = matches!(status.code(), Code::PermissionDenied | Code::Unauthenticated);
    is_not_let_in || may_pass(status)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    /// Number of attempts at a call whose attempts fail with these errors in order, and the call's final error.
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
