//! The body of a response. It holds the seat of its request until the body has been sent or given up, or the client has taken no
//! part of it for too long.

use crate::{
    connections::ConnectionHandle,
    limits::PART_LIMIT,
    seats::{CostClass, NoSeat, Seat, Seats},
};
use axum::{
    body::{Body, Bytes},
    http::{HeaderMap, HeaderValue, Response, header::CONTENT_TYPE},
};
use http_body::{Body as _, Frame, SizeHint};
use std::{
    collections::HashMap,
    pin::Pin,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
    task::{Context, Poll, Waker},
    time::Duration,
};
use tokio::time::Instant;
use tonic::Status;

/// Bytes that a connection gets at once. A connection takes one part more than its client has asked for, and keeps this part
/// after the body has ended.
const PART_BYTES: usize = 16 << 10;
/// Interval of the check for bodies that no client takes.
const LOOK_INTERVAL: Duration = Duration::from_secs(5);

/// The bodies that are being sent; cheap to clone.
#[derive(Debug, Clone)]
pub(crate) struct Bodies {
    open: Arc<Mutex<HashMap<u64, Arc<Shared>>>>,
    next: Arc<AtomicU64>,
}

/// A body that holds a seat.
struct SeatedBody {
    number: u64,
    shared: Arc<Shared>,
    bodies: Bodies,
}

#[derive(Debug)]
struct Shared {
    form: Form,
    /// Whether a shutdown ends the body.
    ends_at_shutdown: bool,
    /// Whether the body ends if its client takes nothing. Streams that follow something do not end in this way: they take little
    /// memory, and their clients may sleep.
    ends_untaken: bool,
    /// The connection that the body is sent on.
    handle: Option<ConnectionHandle>,
    content: Mutex<Content>,
}

#[derive(Debug)]
struct Content {
    /// `None` once the body is complete or was ended.
    open: Option<(Body, Arc<Seat>)>,
    /// Part of the body that the connection has not taken yet.
    rest: Bytes,
    /// Why the body was ended, until the client has received the reason.
    ended: Option<Ending>,
    /// Time since which the connection has not asked for the next part.
    untaken_since: Option<Instant>,
    waker: Option<Waker>,
}

/// How the client learns that a response is incomplete.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Form {
    /// The client gets a status, in trailers.
    Grpc,
    /// The client learns nothing: an event stream has no end, and pages open it again.
    Events,
    /// The connection breaks off.
    Other,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
enum Ending {
    #[error("the client read nothing of the response for {} seconds: send the request again", PART_LIMIT.as_secs())]
    Untaken,
    #[error("{}", NoSeat::Closing)]
    Closing,
}

impl Bodies {
    /// The bodies that hold a seat of `seats`.
    pub(crate) fn of(seats: &Seats) -> Self {
        let bodies = Self {
            open: Arc::default(),
            next: Arc::default(),
        };
        let (open, seats) = (Arc::downgrade(&bodies.open), seats.clone());
        tokio::spawn(async move {
            loop {
                let is_closing = tokio::select! {
                    () = seats.closed() => true,
                    () = tokio::time::sleep(LOOK_INTERVAL) => false,
                };
                let Some(open) = open.upgrade() else { return };
                let sent: Vec<_> = lock(&open).values().cloned().collect();
                for shared in sent {
                    shared.look(is_closing);
                }
                if is_closing {
                    return;
                }
            }
        });
        bodies
    }

    /// The response, which holds `seat` for as long as its body is sent.
    pub(crate) fn seated(
        &self,
        seat: Arc<Seat>,
        handle: Option<ConnectionHandle>,
        response: Response<Body>,
    ) -> Response<Body> {
        if response.body().is_end_stream() {
            return response;
        }
        let (head, body) = response.into_parts();
        let class = seat.class();
        let shared = Arc::new(Shared {
            form: Form::of(&head.headers),
            ends_at_shutdown: class.ends_at_shutdown(),
            ends_untaken: class != CostClass::Streaming,
            handle,
            content: Mutex::new(Content {
                open: Some((body, seat)),
                rest: Bytes::new(),
                ended: None,
                untaken_since: Some(Instant::now()),
                waker: None,
            }),
        });
        let number = self.next.fetch_add(1, Ordering::Relaxed);
        lock(&self.open).insert(number, shared.clone());
        let body = SeatedBody {
            number,
            shared,
            bodies: self.clone(),
        };
        Response::from_parts(head, Body::new(body))
    }
}

impl Form {
    fn of(headers: &HeaderMap) -> Self {
        let kind = headers.get(CONTENT_TYPE).map_or(&b""[..], HeaderValue::as_bytes);
        if kind.starts_with(b"application/grpc") {
            Self::Grpc
        } else if kind.starts_with(b"text/event-stream") {
            Self::Events
        } else {
            Self::Other
        }
    }
}

impl Shared {
    /// Ends the body if its client has taken nothing for too long, or if a shutdown ends it.
    fn look(&self, is_closing: bool) {
        let mut content = lock(&self.content);
        let is_untaken = content
            .untaken_since
            .is_some_and(|since| since.elapsed() >= PART_LIMIT);
        let ending = match (
            is_untaken && self.ends_untaken,
            is_closing && self.ends_at_shutdown,
        ) {
            (true, _) => Ending::Untaken,
            (false, true) => Ending::Closing,
            (false, false) => return,
        };
        let Some(given_up) = content.open.take() else {
            return;
        };
        content.ended = Some(ending);
        content.rest = Bytes::new();
        let waker = content.waker.take();
        drop(content);
        // Drops the prepared bytes and the seat.
        drop(given_up);
        if let Some(waker) = waker {
            waker.wake();
        }
        // The HTTP library keeps a part until the client takes the part, or the connection ends.
        if let (Ending::Untaken, Some(handle)) = (ending, &self.handle) {
            tracing::debug!("a client does not read its response: its connection is closed");
            handle.close();
        }
    }
}

type Sent = Option<Result<Frame<Bytes>, axum::Error>>;

impl Content {
    fn poll(&mut self, form: Form, context: &mut Context<'_>) -> Poll<Sent> {
        if self.rest.is_empty() {
            let Some((body, _seat)) = &mut self.open else {
                return Poll::Ready(self.ended.take().and_then(|ending| ending.told(form)));
            };
            let polled = Pin::new(body).poll_frame(context);
            self.untaken_since = polled.is_ready().then(Instant::now);
            match polled {
                Poll::Pending => {
                    self.waker = Some(context.waker().clone());
                    return Poll::Pending;
                }
                Poll::Ready(Some(Ok(frame))) => match frame.into_data() {
                    Ok(data) => self.rest = data,
                    Err(trailers) => return Poll::Ready(Some(Ok(trailers))),
                },
                Poll::Ready(end) => {
                    self.open = None;
                    return Poll::Ready(end);
                }
            }
        }
        self.untaken_since = Some(Instant::now());
        let part = self.rest.split_to(self.rest.len().min(PART_BYTES));
        // The part is copied, because a slice of the data would keep all of it in memory.
        Poll::Ready(Some(Ok(Frame::data(Bytes::copy_from_slice(&part)))))
    }
}

impl Ending {
    fn told(self, form: Form) -> Sent {
        match form {
            Form::Events => None,
            Form::Other => Some(Err(axum::Error::new(self))),
            Form::Grpc => {
                let status = match self {
                    Self::Untaken => Status::deadline_exceeded(self.to_string()),
                    Self::Closing => Status::unavailable(self.to_string()),
                };
                let mut trailers = HeaderMap::new();
                Some(match status.add_header(&mut trailers) {
                    Ok(()) => Ok(Frame::trailers(trailers)),
                    Err(error) => Err(axum::Error::new(error)),
                })
            }
        }
    }
}

impl http_body::Body for SeatedBody {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Sent> {
        lock(&self.shared.content).poll(self.shared.form, context)
    }

    fn is_end_stream(&self) -> bool {
        let content = lock(&self.shared.content);
        match &content.open {
            Some((body, _)) => content.rest.is_empty() && body.is_end_stream(),
            None => content.ended.is_none(),
        }
    }

    fn size_hint(&self) -> SizeHint {
        let content = lock(&self.shared.content);
        let mut hint = content
            .open
            .as_ref()
            .map_or_else(SizeHint::new, |(body, _)| body.size_hint());
        let rest = content.rest.len() as u64;
        if let Some(upper) = hint.upper() {
            hint.set_upper(upper + rest);
        }
        hint.set_lower(hint.lower() + rest);
        hint
    }
}

impl Drop for SeatedBody {
    fn drop(&mut self) {
        lock(&self.bodies.open).remove(&self.number);
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seats::Principal;
    use std::future::poll_fn;
    use tokio_stream::wrappers::ReceiverStream;

    type Parts = tokio::sync::mpsc::Sender<Result<Bytes, axum::Error>>;

    /// A response of this content type that holds a seat of `class`, and the sender of its parts.
    async fn response(seats: &Seats, class: CostClass, kind: &'static str) -> (Parts, Body) {
        let bodies = Bodies::of(seats);
        let seat = seats
            .take(class, Principal::Unknown, None)
            .await
            .unwrap()
            .unwrap();
        let (parts, stream) = tokio::sync::mpsc::channel(4);
        let mut response = Response::new(Body::from_stream(ReceiverStream::new(stream)));
        response
            .headers_mut()
            .insert(CONTENT_TYPE, HeaderValue::from_static(kind));
        (parts, bodies.seated(Arc::new(seat), None, response).into_body())
    }

    async fn next(body: &mut Body) -> Sent {
        poll_fn(|context| Pin::new(&mut *body).poll_frame(context)).await
    }

    fn answered(seats: &Seats, class: CostClass) -> usize {
        let mut counts = seats.counts();
        counts.find(|(of, _)| *of == class).unwrap().1.answered
    }

    #[tokio::test(start_paused = true)]
    async fn a_seat_is_held_until_the_body_is_sent_or_dropped() {
        let seats = Seats::new(&[]);
        let reading = CostClass::Reading;
        let (parts, mut body) = response(&seats, reading, "text/csv").await;
        parts.send(Ok(Bytes::from_static(b"a"))).await.unwrap();
        drop(parts);
        assert!(next(&mut body).await.unwrap().unwrap().is_data());
        assert_eq!(answered(&seats, reading), 1);
        assert!(next(&mut body).await.is_none());
        assert_eq!(answered(&seats, reading), 0);
        let (parts, body) = response(&seats, reading, "text/csv").await;
        drop(body);
        assert!(answered(&seats, reading) == 0 && parts.is_closed());
    }

    #[tokio::test(start_paused = true)]
    async fn a_connection_is_handed_little_at_once() {
        let seats = Seats::new(&[]);
        let (parts, mut body) = response(&seats, CostClass::Reading, "application/grpc").await;
        let whole: Vec<u8> = (0..5 * PART_BYTES / 2).map(|byte| byte as u8).collect();
        parts.send(Ok(whole.clone().into())).await.unwrap();
        drop(parts);
        let mut sent = Vec::new();
        while let Some(frame) = next(&mut body).await {
            assert_eq!(answered(&seats, CostClass::Reading), 1);
            let data = frame.unwrap().into_data().unwrap();
            assert!(data.len() <= PART_BYTES);
            sent.extend(data);
        }
        assert!(sent == whole && body.is_end_stream());
        assert_eq!(answered(&seats, CostClass::Reading), 0);
        let fixed = Response::new(Body::from(whole.clone()));
        let seat = seats
            .take(CostClass::Light, Principal::Unknown, None)
            .await
            .unwrap();
        let mut fixed = Bodies::of(&seats)
            .seated(Arc::new(seat.unwrap()), None, fixed)
            .into_body();
        assert_eq!(fixed.size_hint().exact(), Some(whole.len() as u64));
        next(&mut fixed).await.unwrap().unwrap();
        assert_eq!(fixed.size_hint().exact(), Some((whole.len() - PART_BYTES) as u64));
    }

    #[tokio::test(start_paused = true)]
    async fn what_nobody_takes_is_given_up_and_said_in_the_form_of_the_client() {
        for (kind, class) in [
            ("application/grpc", CostClass::Reading),
            ("text/csv", CostClass::Computing),
        ] {
            let seats = Seats::new(&[]);
            let (parts, mut body) = response(&seats, class, kind).await;
            // Its handler may take as long as it needs.
            let making = async {
                tokio::time::sleep(2 * PART_LIMIT).await;
                parts.send(Ok(Bytes::from_static(b"a"))).await.unwrap();
            };
            let (part, ()) = tokio::join!(next(&mut body), making);
            assert!(part.unwrap().unwrap().is_data());
            tokio::time::sleep(PART_LIMIT + LOOK_INTERVAL).await;
            assert!(answered(&seats, class) == 0 && parts.is_closed());
            match next(&mut body).await.unwrap() {
                Ok(frame) => {
                    let trailers = frame.into_trailers().unwrap();
                    assert_eq!(trailers["grpc-status"], "4");
                }
                Err(error) => assert!(kind == "text/csv" && error.to_string().contains("60 seconds")),
            }
            assert!(next(&mut body).await.is_none());
        }
    }

    #[tokio::test(start_paused = true)]
    async fn a_stream_that_follows_something_may_be_left_untaken() {
        let seats = Seats::new(&[]);
        let (parts, mut body) = response(&seats, CostClass::Streaming, "application/grpc").await;
        parts.send(Ok(Bytes::from_static(b"a"))).await.unwrap();
        next(&mut body).await.unwrap().unwrap();
        tokio::time::sleep(10 * PART_LIMIT).await;
        assert!(!parts.is_closed() && answered(&seats, CostClass::Streaming) == 1);
    }

    #[tokio::test(start_paused = true)]
    async fn a_shutdown_ends_what_is_followed_and_read() {
        let seats = Seats::new(&[]);
        let (_events, mut events) = response(&seats, CostClass::Streaming, "text/event-stream").await;
        let (_calls, mut calls) = response(&seats, CostClass::Reading, "application/grpc").await;
        let (decided, mut decision) = response(&seats, CostClass::Decision, "application/grpc").await;
        let closing = async {
            tokio::time::sleep(Duration::from_secs(1)).await;
            seats.close();
        };
        let (ended, told, ()) = tokio::join!(next(&mut events), next(&mut calls), closing);
        assert!(ended.is_none());
        let trailers = told.unwrap().unwrap().into_trailers().unwrap();
        assert_eq!(trailers["grpc-status"], "14");
        decided.send(Ok(Bytes::from_static(b"a"))).await.unwrap();
        assert!(next(&mut decision).await.unwrap().unwrap().is_data());
    }
}
