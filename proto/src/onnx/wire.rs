//! Counts the fields of a model file before it is decoded, because a small file must not become a large message.
//!
//! An empty node takes two bytes in the file and two hundred in memory.

use prost::{
    bytes::Buf,
    encoding::{DecodeContext, WireType, decode_key, decode_varint, skip_field},
};

/// Maximum number of fields in all messages of a file; each of 1024 nodes can have 90.
const MAX_FIELDS: usize = 100_000;

/// The fields of a kind of message that are messages themselves, by number.
struct Kind(&'static [(u32, &'static Kind)]);

static FLAT: Kind = Kind(&[]);
static TENSOR: Kind = Kind(&[(13, &FLAT)]);
static SHAPE: Kind = Kind(&[(1, &FLAT)]);
static TENSOR_TYPE: Kind = Kind(&[(2, &SHAPE)]);
static TYPE: Kind = Kind(&[(1, &TENSOR_TYPE)]);
static VALUE_INFO: Kind = Kind(&[(2, &TYPE)]);
static ATTRIBUTE: Kind = Kind(&[(5, &TENSOR)]);
static NODE: Kind = Kind(&[(5, &ATTRIBUTE)]);
static GRAPH: Kind = Kind(&[
    (1, &NODE),
    (5, &TENSOR),
    (11, &VALUE_INFO),
    (12, &VALUE_INFO),
    (13, &VALUE_INFO),
]);
static MODEL: Kind = Kind(&[(7, &GRAPH), (8, &FLAT), (14, &FLAT)]);

/// Goes through the fields of a model file; returns an error if it is not a protobuf message or has too many fields.
pub(super) fn check_fields(file: &[u8]) -> Result<(), &'static str> {
    let mut left = MAX_FIELDS;
    match count(file, &MODEL, &mut left) {
        Some(()) if left == 0 => Err("it has too many parts"),
        Some(()) => Ok(()),
        None => Err("its bytes are no such message"),
    }
}

/// Subtracts the number of fields of `message` from `left`, at most until nothing is left; `None` if it is not a message.
fn count(mut message: &[u8], kind: &Kind, left: &mut usize) -> Option<()> {
    while message.has_remaining() && *left > 0 {
        *left -= 1;
        let (tag, wire_type) = decode_key(&mut message).ok()?;
        let nested = kind.0.iter().find(|(number, _)| *number == tag);
        match nested.filter(|_| wire_type == WireType::LengthDelimited) {
            None => skip_field(wire_type, tag, &mut message, DecodeContext::default()).ok()?,
            Some((_, nested)) => {
                let length = usize::try_from(decode_varint(&mut message).ok()?).ok()?;
                let (inner, rest) = message.split_at_checked(length)?;
                count(inner, nested, left)?;
                message = rest;
            }
        }
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::onnx::{GraphProto, ModelProto, NodeProto};
    use prost::Message as _;

    #[track_caller]
    fn check(nodes: usize, expected: Result<(), &str>) {
        let graph = GraphProto {
            node: vec![NodeProto::default(); nodes],
            ..Default::default()
        };
        let model = ModelProto {
            graph: Some(graph),
            ..Default::default()
        };
        assert_eq!(check_fields(&model.encode_to_vec()), expected);
    }

    #[test]
    fn fields_of_nested_messages_count() {
        check(0, Ok(()));
        check(MAX_FIELDS - 2, Ok(()));
        check(MAX_FIELDS - 1, Err("it has too many parts"));
    }

    #[test]
    fn what_is_no_message_is_told_from_what_is_too_large() {
        for broken in [
            &b"\x3a\x05ab"[..],
            b"\x3a",
            b"\x07",
            b"\x3a\xff\xff\xff\xff\xff\xff\xff\xff\xff\x01",
        ] {
            assert_eq!(
                check_fields(broken),
                Err("its bytes are no such message"),
                "{broken:?}"
            );
        }
    }
}
