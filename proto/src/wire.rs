//! Counts the parts of a message before it is decoded, because a small message must not become a large one in memory.
//!
//! An empty result takes two bytes in an encoded message and seventy in memory.

use crate::FILE_DESCRIPTORS;
use prost::{
    Message as _, Name,
    bytes::Buf,
    encoding::{DecodeContext, WireType, decode_key, decode_varint, skip_field},
};
use prost_types::{DescriptorProto, FileDescriptorSet};
use std::{
    collections::{BTreeMap, BTreeSet},
    sync::LazyLock,
};
use thiserror::Error;

/// The messages of the contract.
static CONTRACT: LazyLock<MessageShapes> = LazyLock::new(|| MessageShapes::read(FILE_DESCRIPTORS));

/// Messages by full name, each with its fields that are messages.
#[derive(Debug, Default)]
pub struct MessageShapes {
    messages: BTreeMap<String, MessageShape>,
    /// Full names of the messages that are requests of a method.
    requests: BTreeSet<String>,
}

/// For each field whose type is a message or an enum: its number, and the full name of the type.
type MessageShape = BTreeMap<u32, String>;

/// Why a message is not decoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum Refused {
    #[error("it has over {0} parts")]
    TooManyParts(usize),
    #[error("its bytes are no such message")]
    NotAMessage,
}

/// Number of messages, texts and lists that were found in a message.
#[derive(Debug)]
struct Parts {
    count: usize,
    limit: usize,
}

impl Parts {
    fn add(&mut self) -> Result<(), Refused> {
        self.count += 1;
        match self.count > self.limit {
            true => Err(Refused::TooManyParts(self.limit)),
            false => Ok(()),
        }
    }
}

impl MessageShapes {
    /// The messages of an encoded `FileDescriptorSet`; none if it cannot be decoded.
    #[must_use]
    pub fn read(descriptors: &[u8]) -> Self {
        let files = FileDescriptorSet::decode(descriptors).unwrap_or_default();
        let mut shapes = Self::default();
        for file in &files.file {
            for message in &file.message_type {
                shapes.add(file.package(), message);
            }
            let methods = file.service.iter().flat_map(|service| &service.method);
            let requests = methods.map(|method| without_dot(method.input_type()));
            shapes.requests.extend(requests);
        }
        shapes
    }

    fn add(&mut self, scope: &str, message: &DescriptorProto) {
        let name = format!("{scope}.{}", message.name());
        let nested = message.field.iter().filter(|field| !field.type_name().is_empty());
        let nested = nested.map(|field| (field.number().unsigned_abs(), without_dot(field.type_name())));
        self.messages.insert(name.clone(), nested.collect());
        for inner in &message.nested_type {
            self.add(&name, inner);
        }
    }

    /// Checks an encoded message of type `M`: it can have at most `limit` messages, texts and lists, at any depth.
    ///
    /// # Errors
    /// If the message has more parts, or the bytes are not a message.
    pub fn check<M: Name>(&self, message: &[u8], limit: usize) -> Result<(), Refused> {
        let mut parts = Parts { count: 0, limit };
        self.count(message, self.messages.get(&M::full_name()), &mut parts)
    }

    /// Adds the parts of `message` to `parts`. Enums have no shape, and no parts.
    fn count(
        &self,
        mut message: &[u8],
        shape: Option<&MessageShape>,
        parts: &mut Parts,
    ) -> Result<(), Refused> {
        while message.has_remaining() {
            let (tag, wire_type) = decode_key(&mut message).map_err(|_| Refused::NotAMessage)?;
            if wire_type != WireType::LengthDelimited {
                let skipped = skip_field(wire_type, tag, &mut message, DecodeContext::default());
                skipped.map_err(|_| Refused::NotAMessage)?;
                continue;
            }
            parts.add()?;
            let length = decode_varint(&mut message).map(usize::try_from);
            let inner = match length {
                Ok(Ok(length)) => message.split_at_checked(length),
                _ => None,
            };
            let (inner, rest) = inner.ok_or(Refused::NotAMessage)?;
            let name = shape.and_then(|shape| shape.get(&tag));
            if let Some(shape) = name.and_then(|name| self.messages.get(name)) {
                self.count(inner, Some(shape), parts)?;
            }
            message = rest;
        }
        Ok(())
    }
}

/// Whether `M` is the request of a method of the contract.
#[must_use]
pub fn is_request<M: Name>() -> bool {
    CONTRACT.requests.contains(&M::full_name())
}

/// Checks an encoded message of the contract.
///
/// # Errors
/// The errors of [`MessageShapes::check`].
pub fn check<M: Name>(message: &[u8], limit: usize) -> Result<(), Refused> {
    CONTRACT.check::<M>(message, limit)
}

/// Removes the dot that descriptors write before the full name of a type.
fn without_dot(name: &str) -> String {
    name.trim_start_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::v1::{self, worker_message::Message};

    fn result(embeddings: usize) -> Vec<u8> {
        let embeddings = v1::Embeddings {
            embeddings: vec![v1::Embedding::default(); embeddings],
        };
        let result = v1::BatchResult {
            outcome: Some(v1::batch_result::Outcome::Embeddings(embeddings)),
            ..Default::default()
        };
        let message = v1::WorkerMessage {
            message: Some(Message::Result(result)),
        };
        message.encode_to_vec()
    }

    #[test]
    fn parts_of_nested_messages_count() {
        let message = result(1000);
        assert_eq!(check::<v1::WorkerMessage>(&message, 1002), Ok(()));
        assert_eq!(
            check::<v1::WorkerMessage>(&message, 1001),
            Err(Refused::TooManyParts(1001))
        );
    }

    #[test]
    fn answers_are_no_requests() {
        assert!(is_request::<v1::WorkerMessage>());
        assert!(!is_request::<v1::CoordinatorMessage>());
    }

    #[test]
    fn what_is_no_message_is_told_from_what_is_too_large() {
        for broken in [
            &b"\x1a\x05ab"[..],
            b"\x1a",
            b"\x07",
            b"\x1a\xff\xff\xff\xff\xff\xff\xff\xff\xff\x01",
        ] {
            let checked = check::<v1::WorkerMessage>(broken, 100);
            assert_eq!(checked, Err(Refused::NotAMessage), "{broken:?}");
        }
    }
}
