//! Limits on the body of a request. The body fails when no part of it arrives for too long, because a request that never ends
//! would keep its seat. A long decision needs a seat of another class than a short decision.

use crate::{
    Refusal,
    limits::{MAX_DECISION_BODY, PART_LIMIT},
    seats::{CostClass, Seat},
};
use axum::{
    BoxError,
    body::{Body, BodyDataStream, Bytes, HttpBody as _},
};
use futures_util::stream::unfold;
use std::sync::Arc;
use tokio::time::timeout;
use tokio_stream::StreamExt as _;
use tonic::Status;

/// `body` with a time limit: it fails when no part of it arrives for [`PART_LIMIT`]. gRPC clients get `DEADLINE_EXCEEDED`. A
/// decision of more than [`MAX_DECISION_BODY`] bytes exchanges `seat` for a seat of the class `bulk` before it continues.
pub(crate) fn in_time(body: Body, seat: &Arc<Seat>) -> Body {
    if body.is_end_stream() {
        return body;
    }
    let parts = Parts {
        body: body.into_data_stream(),
        short: (seat.class() == CostClass::Decision).then(|| (MAX_DECISION_BODY, Arc::clone(seat))),
    };
    Body::from_stream(unfold(parts, async |mut parts| {
        let next = parts.next().await.transpose()?;
        Some((next, parts))
    }))
}

struct Parts {
    body: BodyDataStream,
    /// For the body of a short decision: the number of bytes that may still arrive, and the seat of the decision.
    short: Option<(usize, Arc<Seat>)>,
}

impl Parts {
    async fn next(&mut self) -> Result<Option<Bytes>, BoxError> {
        let Ok(next) = timeout(PART_LIMIT, self.body.next()).await else {
            let seconds = PART_LIMIT.as_secs();
            let message = format!("no part of the request arrived for {seconds} seconds: send it again");
            return Err(Status::deadline_exceeded(message).into());
        };
        let Some(part) = next.transpose()? else {
            return Ok(None);
        };
        if let Some((left, seat)) = self.short.take() {
            match left.checked_sub(part.len()) {
                Some(left) => self.short = Some((left, seat)),
                None => seat
                    .exchange(CostClass::Bulk)
                    .await
                    .map_err(|refusal| Status::from(Refusal::from(refusal)))?,
            }
        }
        Ok(Some(part))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seats::{Principal, Seats};
    use std::convert::Infallible;
    use tokio::sync::mpsc;
    use tokio_stream::wrappers::ReceiverStream;
    use tonic::Code;

    async fn seat(seats: &Seats, class: CostClass) -> Arc<Seat> {
        let seat = seats.take(class, Principal::Unknown, None).await;
        Arc::new(seat.unwrap().unwrap())
    }

    fn answered(seats: &Seats) -> [usize; 2] {
        let counts = |class| seats.counts().find(|(of, _)| *of == class).unwrap().1.answered;
        [CostClass::Decision, CostClass::Bulk].map(counts)
    }

    #[tokio::test(start_paused = true)]
    async fn a_silent_client_fails_and_a_slow_one_does_not() {
        let seat = seat(&Seats::new(&[]), CostClass::Light).await;
        let (parts, body) = mpsc::channel::<Result<Bytes, Infallible>>(1);
        let mut body = in_time(Body::from_stream(ReceiverStream::new(body)), &seat).into_data_stream();
        for _ in 0..3 {
            parts.send(Ok("part".into())).await.unwrap();
            tokio::time::sleep(PART_LIMIT / 2).await;
            assert_eq!(body.next().await.unwrap().unwrap(), "part");
        }
        let failed = body.next().await.unwrap().unwrap_err();
        let status = Status::from_error(failed.into());
        assert_eq!(status.code(), Code::DeadlineExceeded, "{status}");
    }

    #[tokio::test(start_paused = true)]
    async fn a_long_decision_leaves_its_seat_to_short_ones_and_waits_for_its_turn() {
        let seats = Seats::new(&[]);
        let first = seat(&seats, CostClass::Decision).await;
        let long = |seat| {
            let body = Body::from(vec![0; MAX_DECISION_BODY + 1]);
            in_time(body, seat).into_data_stream()
        };
        let mut read = long(&first);
        assert_eq!(answered(&seats), [1, 0]);
        assert_eq!(read.next().await.unwrap().unwrap().len(), MAX_DECISION_BODY + 1);
        assert!(read.next().await.is_none());
        assert_eq!(answered(&seats), [0, 1]);
        let second = seat(&seats, CostClass::Decision).await;
        let mut waits = long(&second);
        let waited = timeout(10 * PART_LIMIT, waits.next()).await;
        assert!(waited.is_err(), "one principal has one seat for such requests");
        assert_eq!(answered(&seats), [0, 1]);
        drop((read, first));
        assert!(waits.next().await.unwrap().is_ok());
        assert_eq!(answered(&seats), [0, 1]);
        drop((waits, second));
        assert_eq!(answered(&seats), [0, 0]);
    }

    #[tokio::test]
    async fn a_short_decision_keeps_its_seat() {
        let seats = Seats::new(&[]);
        let seat = seat(&seats, CostClass::Decision).await;
        let body = in_time(Body::from(vec![0; MAX_DECISION_BODY]), &seat);
        let read = axum::body::to_bytes(body, usize::MAX).await.unwrap();
        assert_eq!((read.len(), answered(&seats)), (MAX_DECISION_BODY, [1, 0]));
    }
}
