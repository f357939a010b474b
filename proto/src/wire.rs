//! Counts the parts of a message before it is decoded, because a small message must not become a large one in memory.
//!
//! An empty result takes two bytes on the wire and seventy in memory.

use prost::{
    Name,
    bytes::Buf,
    encoding::{DecodeContext, WireType, decode_key, decode_varint, skip_field},
};
use thiserror::Error;

/// A message of the contract or of the ONNX format, with the fields that are messages.
struct MessageShape {
    /// Name with the package.
    name: &'static str,
    /// Whether a method takes the message.
    is_request: bool,
    /// Number of each field that is a message, and the place of that message in [`SHAPES`].
    nested: &'static [(u32, usize)],
}

/// Sorted by name.
static SHAPES: &[MessageShape] = include!(concat!(env!("OUT_DIR"), "/shapes.rs"));

/// Error in a message before it is decoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub(crate) enum Refused {
    #[error("it has over {0} parts")]
    TooManyParts(usize),
    #[error("its bytes are no such message")]
    NotAMessage,
}

/// Checks the messages of one type.
#[derive(Clone, Copy)]
pub(crate) struct PartLimit {
    shape: &'static MessageShape,
    limit: usize,
}

impl PartLimit {
    /// Allows `limit` messages, texts and lists in a message of type `M`, however deep. `None` for a type without a shape.
    pub(crate) fn of<M: Name>(limit: usize) -> Option<Self> {
        let name = M::full_name();
        let place = SHAPES.binary_search_by(|shape| shape.name.cmp(&name)).ok()?;
        Some(Self {
            shape: SHAPES.get(place)?,
            limit,
        })
    }

    /// [`of`](Self::of), if a method takes such a message.
    pub(crate) fn of_request<M: Name>(limit: usize) -> Option<Self> {
        Self::of::<M>(limit).filter(|parts| parts.shape.is_request)
    }

    /// # Errors
    /// `message` has too many parts, or is not a message.
    pub(crate) fn check(self, message: &[u8]) -> Result<(), Refused> {
        let mut left = self.limit;
        count(message, self.shape, &mut left).map_err(|refused| match refused {
            Refused::TooManyParts(_) => Refused::TooManyParts(self.limit),
            Refused::NotAMessage => refused,
        })
    }
}

/// Subtracts the number of parts of `message` from `left`.
fn count(mut message: &[u8], shape: &MessageShape, left: &mut usize) -> Result<(), Refused> {
    while message.has_remaining() {
        let (tag, wire_type) = decode_key(&mut message).map_err(|_| Refused::NotAMessage)?;
        if wire_type != WireType::LengthDelimited {
            skip_field(wire_type, tag, &mut message, DecodeContext::default())
                .map_err(|_| Refused::NotAMessage)?;
            continue;
        }
        *left = left.checked_sub(1).ok_or(Refused::TooManyParts(0))?;
        let length = decode_varint(&mut message).ok().and_then(|length| usize::try_from(length).ok());
        let inner = length.and_then(|length| message.split_at_checked(length));
        let (inner, rest) = inner.ok_or(Refused::NotAMessage)?;
        let nested = shape.nested.iter().find(|(number, _)| *number == tag);
        if let Some(shape) = nested.and_then(|(_, place)| SHAPES.get(*place)) {
            count(inner, shape, left)?;
        }
        message = rest;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        onnx::{GraphProto, ModelProto, NodeProto},
        v1::{self, worker_message::Message},
    };
    use prost::Message as _;

    #[track_caller]
    fn check<M: Name>(message: &M, limit: usize, expected: Result<(), Refused>) {
        let parts = PartLimit::of::<M>(limit).unwrap();
        assert_eq!(parts.check(&message.encode_to_vec()), expected);
    }

    #[test]
    fn parts_of_nested_messages_count() {
        let node = NodeProto {
            input: vec![String::new(); 2],
            ..Default::default()
        };
        let graph = GraphProto {
            node: vec![node; 10],
            ..Default::default()
        };
        let model = ModelProto {
            graph: Some(graph),
            ..Default::default()
        };
        check(&model, 1 + 10 + 20, Ok(()));
        check(&model, 1 + 10 + 19, Err(Refused::TooManyParts(30)));
    }

    #[test]
    fn empty_results_count() {
        let evaluations = v1::Evaluations {
            evaluations: vec![v1::Evaluation::default(); 1000],
        };
        let result = v1::BatchResult {
            outcome: Some(v1::batch_result::Outcome::Evaluations(evaluations)),
            ..Default::default()
        };
        let message = v1::WorkerMessage {
            message: Some(Message::Result(result)),
        };
        check(&message, 1002, Ok(()));
        check(&message, 1001, Err(Refused::TooManyParts(1001)));
    }

    #[test]
    fn answers_have_no_limit_of_requests() {
        assert!(PartLimit::of_request::<v1::WorkerMessage>(1).is_some());
        assert!(PartLimit::of_request::<v1::CoordinatorMessage>(1).is_none());
    }

    #[test]
    fn what_is_no_message_is_told_from_what_is_too_large() {
        for broken in [
            &b"\x3a\x05ab"[..],
            b"\x3a",
            b"\x07",
            b"\x3a\xff\xff\xff\xff\xff\xff\xff\xff\xff\x01",
        ] {
            let parts = PartLimit::of::<ModelProto>(100).unwrap();
            assert_eq!(parts.check(broken), Err(Refused::NotAMessage), "{broken:?}");
        }
    }
}
