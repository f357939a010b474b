//! Limits on the messages of a gRPC request while they arrive. The requirement of a method limits the length of its messages. The
//! long messages of one principal, and of all principals, may only take a certain memory.

use crate::{
    Role,
    limits::{
        LONG_MESSAGE, LONG_MESSAGE_PACE, MAX_ARRIVING, MAX_ARRIVING_PER_PRINCIPAL, MAX_LABEL_MESSAGE,
        MAX_MESSAGE, MAX_NAMING_MESSAGE, MAX_PROBE_MESSAGE, MAX_WORKER_MESSAGE, PART_LIMIT,
    },
    machine::MachineKind,
    requirement::Requirement,
    seats::Principal,
};
use axum::{
    BoxError,
    body::{Body, BodyDataStream, Bytes, HttpBody as _},
};
use futures_util::stream::unfold;
use std::{
    collections::HashMap,
    sync::{Arc, Mutex, PoisonError, Weak},
    time::Duration,
};
use tokio::{
    sync::{OwnedSemaphorePermit, Semaphore},
    time::{Instant, timeout_at},
};
use tokio_stream::StreamExt as _;
use tonic::Status;

/// Bytes of the head of a message: whether it is compressed, and its length.
const HEAD: usize = 5;

/// Bytes of room that one permit stands for.
const UNIT: usize = 1 << 10;

/// Longest message, in bytes, of a method with this requirement. Methods for viewers only name what the viewer asks for.
const fn longest(requirement: Requirement) -> usize {
    match requirement {
        Requirement::Nothing => MAX_PROBE_MESSAGE,
        Requirement::Person(Role::Viewer) | Requirement::AnyMachineOr(Role::Viewer) => MAX_NAMING_MESSAGE,
        Requirement::Person(Role::Annotator) => MAX_LABEL_MESSAGE,
        Requirement::Machine(MachineKind::Worker) => MAX_WORKER_MESSAGE,
        _ => MAX_MESSAGE,
    }
}

/// Room for long messages that are arriving; cheap to clone.
#[derive(Debug, Clone)]
pub(crate) struct MessageRoom(Arc<Room>);

#[derive(Debug)]
struct Room {
    of_people: Arc<Semaphore>,
    /// The room of machines' messages, which people cannot take.
    of_machines: Arc<Semaphore>,
    by_principal: Mutex<HashMap<Principal, Weak<Semaphore>>>,
}

impl Default for MessageRoom {
    fn default() -> Self {
        Self(Arc::new(Room {
            of_people: Arc::new(Semaphore::new(MAX_ARRIVING / 2 / UNIT)),
            of_machines: Arc::new(Semaphore::new(MAX_ARRIVING / 2 / UNIT)),
            by_principal: Mutex::default(),
        }))
    }
}

impl MessageRoom {
    /// `body` with limits on its messages. A message that is too long ends the body with `OUT_OF_RANGE`; a long message waits
    /// until there is room.
    pub(crate) fn limited(&self, body: Body, requirement: Requirement, principal: Principal) -> Body {
        if body.is_end_stream() {
            return body;
        }
        let arriving = Arriving {
            body: body.into_data_stream(),
            longest: longest(requirement),
            all: Arc::clone(match requirement {
                Requirement::Machine(_) => &self.0.of_machines,
                _ => &self.0.of_people,
            }),
            own: self.of(principal),
            head: Vec::with_capacity(HEAD),
            left: 0,
            held: None,
        };
        Body::from_stream(unfold(arriving, async |mut arriving| {
            let next = arriving.next().await.transpose()?;
            Some((next, arriving))
        }))
    }

    fn of(&self, principal: Principal) -> Arc<Semaphore> {
        let mut by_principal = self.0.by_principal.lock().unwrap_or_else(PoisonError::into_inner);
        by_principal.retain(|_, room| room.strong_count() > 0);
        match by_principal.get(&principal).and_then(Weak::upgrade) {
            Some(room) => room,
            None => {
                let room = Arc::new(Semaphore::new(MAX_ARRIVING_PER_PRINCIPAL / UNIT));
                by_principal.insert(principal, Arc::downgrade(&room));
                room
            }
        }
    }
}

/// A body whose messages are being counted.
struct Arriving {
    body: BodyDataStream,
    longest: usize,
    all: Arc<Semaphore>,
    own: Arc<Semaphore>,
    /// The bytes of the next message's head that have arrived.
    head: Vec<u8>,
    /// Number of bytes of the present message that have not arrived.
    left: usize,
    /// The room of the present message, if it is long.
    held: Option<HeldRoom>,
}

/// The room of a message, and the time until which the message must have arrived.
struct HeldRoom {
    until: Instant,
    _permits: [OwnedSemaphorePermit; 2],
}

impl Arriving {
    async fn next(&mut self) -> Result<Option<Bytes>, BoxError> {
        let next = match &self.held {
            Some(held) if self.left > 0 => timeout_at(held.until, self.body.next()).await,
            _ => Ok(self.body.next().await),
        };
        let Ok(next) = next else {
            let message = "the message arrived too slowly, and others wait for its room: send it again";
            return Err(Status::deadline_exceeded(message).into());
        };
        let Some(part) = next.transpose()? else {
            return Ok(None);
        };
        let mut rest = part.as_ref();
        while !rest.is_empty() {
            if self.left > 0 {
                let taken = self.left.min(rest.len());
                (self.left, rest) = (self.left - taken, &rest[taken..]);
                continue;
            }
            // The previous message has arrived and is decoded, so its room is free again.
            self.held = None;
            let taken = (HEAD - self.head.len()).min(rest.len());
            self.head.extend(&rest[..taken]);
            rest = &rest[taken..];
            if let [_, length @ ..] = self.head.as_slice()
                && let Ok(length) = <[u8; 4]>::try_from(length)
            {
                let length = u32::from_be_bytes(length) as usize;
                self.head.clear();
                self.begin(length).await?;
            }
        }
        Ok(Some(part))
    }

    /// Waits for room for a message of `length` bytes.
    async fn begin(&mut self, length: usize) -> Result<(), Status> {
        if length > self.longest {
            let message = format!(
                "the message has {length} bytes: at most {} are allowed for this method",
                self.longest
            );
            return Err(Status::out_of_range(message));
        }
        self.left = length;
        if length > LONG_MESSAGE {
            let permits = u32::try_from(length.div_ceil(UNIT)).unwrap_or(u32::MAX);
            let closed = |_| Status::unavailable("the coordinator is shutting down");
            let own = Arc::clone(&self.own).acquire_many_owned(permits).await;
            let all = Arc::clone(&self.all).acquire_many_owned(permits).await;
            self.held = Some(HeldRoom {
                _permits: [own.map_err(closed)?, all.map_err(closed)?],
                until: Instant::now() + PART_LIMIT + Duration::from_secs((length / LONG_MESSAGE_PACE) as u64),
            });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{convert::Infallible, time::Duration};
    use tokio::{sync::mpsc, time::timeout};
    use tokio_stream::wrappers::ReceiverStream;
    use tonic::Code;

    /// A message of `length` bytes as it is sent, with its head.
    fn framed(length: usize) -> Vec<u8> {
        let mut bytes = vec![0];
        bytes.extend((length as u32).to_be_bytes());
        bytes.extend(vec![1; length]);
        bytes
    }

    fn body(
        room: &MessageRoom,
        requirement: Requirement,
        address: u8,
    ) -> (mpsc::Sender<Result<Vec<u8>, Infallible>>, BodyDataStream) {
        let (sender, parts) = mpsc::channel(1000);
        let body = Body::from_stream(ReceiverStream::new(parts));
        let limited = room.limited(body, requirement, Principal::Address([127, 0, 0, address].into()));
        (sender, limited.into_data_stream())
    }

    async fn all(mut body: BodyDataStream) -> Result<usize, Code> {
        let mut bytes = 0;
        while let Some(part) = body.next().await {
            let part = part.map_err(|error| Status::from_error(error.into()).code())?;
            bytes += part.len();
        }
        Ok(bytes)
    }

    #[tokio::test]
    async fn messages_are_as_long_as_their_method_allows() {
        let room = MessageRoom::default();
        let viewer = Requirement::VIEWER;
        for (length, expected) in [
            (MAX_NAMING_MESSAGE, Ok(2 * (MAX_NAMING_MESSAGE + HEAD))),
            (MAX_NAMING_MESSAGE + 1, Err(Code::OutOfRange)),
        ] {
            let (sender, parts) = body(&room, viewer, 1);
            // The bytes arrive in parts that end anywhere.
            let bytes = [framed(length), framed(length)].concat();
            for part in bytes.chunks(1 + length / 7) {
                sender.send(Ok(part.to_vec())).await.unwrap();
            }
            drop(sender);
            assert_eq!(all(parts).await, expected, "{length}");
        }
    }

    #[tokio::test]
    async fn long_messages_of_one_principal_wait_for_room_and_those_of_others_do_not() {
        let room = MessageRoom::default();
        let worker = Requirement::Machine(MachineKind::Worker);
        let count = MAX_ARRIVING_PER_PRINCIPAL / MAX_WORKER_MESSAGE;
        // None of these messages ever ends.
        let begun = framed(MAX_WORKER_MESSAGE)[..1000].to_vec();
        let mut open = Vec::new();
        for _ in 0..count {
            let (sender, mut parts) = body(&room, worker, 1);
            sender.send(Ok(begun.clone())).await.unwrap();
            assert!(parts.next().await.is_some());
            open.push((sender, parts));
        }
        let (sender, mut waiting) = body(&room, worker, 1);
        sender.send(Ok(begun.clone())).await.unwrap();
        let waits = timeout(Duration::from_millis(50), waiting.next()).await;
        assert!(waits.is_err());
        let (other, mut parts) = body(&room, worker, 2);
        other.send(Ok(begun)).await.unwrap();
        assert!(parts.next().await.is_some());
        open.clear();
        assert!(waiting.next().await.is_some());
    }

    #[tokio::test]
    async fn people_take_no_room_from_machines() {
        let room = MessageRoom::default();
        let begun = framed(MAX_LABEL_MESSAGE)[..1000].to_vec();
        let mut open = Vec::new();
        for place in 0..MAX_ARRIVING / 2 / MAX_LABEL_MESSAGE {
            let address = place * MAX_LABEL_MESSAGE / MAX_ARRIVING_PER_PRINCIPAL;
            let (sender, mut parts) = body(&room, Requirement::ANNOTATOR, address as u8);
            sender.send(Ok(begun.clone())).await.unwrap();
            assert!(parts.next().await.is_some());
            open.push((sender, parts));
        }
        let (sender, mut parts) = body(&room, Requirement::ANNOTATOR, 100);
        sender.send(Ok(begun)).await.unwrap();
        assert!(timeout(Duration::from_millis(50), parts.next()).await.is_err());
        let (sender, mut parts) = body(&room, Requirement::Machine(MachineKind::Worker), 101);
        let begun = framed(MAX_WORKER_MESSAGE)[..1000].to_vec();
        sender.send(Ok(begun)).await.unwrap();
        assert!(parts.next().await.is_some());
    }

    #[tokio::test(start_paused = true)]
    async fn a_long_message_that_comes_byte_by_byte_fails() {
        let room = MessageRoom::default();
        let (sender, parts) = body(&room, Requirement::ANNOTATOR, 1);
        let message = framed(LONG_MESSAGE + 1);
        let trickle = tokio::spawn(async move {
            for byte in message {
                if sender.send(Ok(vec![byte])).await.is_err() {
                    return;
                }
                tokio::time::sleep(PART_LIMIT / 2).await;
            }
        });
        assert_eq!(all(parts).await, Err(Code::DeadlineExceeded));
        trickle.await.unwrap();
    }
}
