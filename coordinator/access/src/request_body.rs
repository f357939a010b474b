//! The body of a request, which fails once its client has sent no part of it for too long: a request that never ends would keep
//! its seat.

use crate::limits::PART_LIMIT;
use axum::{
    BoxError,
    body::{Body, HttpBody as _},
};
use tokio_stream::StreamExt as _;
use tonic::Status;

/// `body`, which fails when no part of it arrives for [`PART_LIMIT`]. gRPC clients are told `DEADLINE_EXCEEDED`.
pub(crate) fn in_time(body: Body) -> Body {
    if body.is_end_stream() {
        return body;
    }
    let parts = body.into_data_stream().timeout(PART_LIMIT);
    Body::from_stream(parts.map(|part| match part {
        Ok(part) => part.map_err(BoxError::from),
        Err(_) => {
            let seconds = PART_LIMIT.as_secs();
            let said = format!("no part of the request arrived for {seconds} seconds: send it again");
            Err(Status::deadline_exceeded(said).into())
        }
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::body::Bytes;
    use std::convert::Infallible;
    use tokio::sync::mpsc;
    use tokio_stream::wrappers::ReceiverStream;
    use tonic::Code;

    #[tokio::test(start_paused = true)]
    async fn a_silent_client_fails_and_a_slow_one_does_not() {
        let (parts, body) = mpsc::channel::<Result<Bytes, Infallible>>(1);
        let mut body = in_time(Body::from_stream(ReceiverStream::new(body))).into_data_stream();
        for _ in 0..3 {
            parts.send(Ok("part".into())).await.unwrap();
            tokio::time::sleep(PART_LIMIT / 2).await;
            assert_eq!(body.next().await.unwrap().unwrap(), "part");
        }
        let failed = body.next().await.unwrap().unwrap_err();
        let status = Status::from_error(failed.into());
        assert_eq!(status.code(), Code::DeadlineExceeded, "{status}");
    }
}
