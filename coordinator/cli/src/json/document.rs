//! Messages of the contract as documents: each field of a message keeps its name, and the field's comment describes it in the
//! schema.
//!
//! Every field is present, in the order of its number; an absent value is null. An enum's value is written as its name without
//! the enum's prefix, in lower case and with hyphens (`fine-tune`). Bytes are base64.

use super::{MAX_EXACT, Whole};
use base64::{Engine as _, engine::general_purpose::STANDARD};
use murmuration_proto::FILE_DESCRIPTORS;
use prost::Name;
use prost_reflect::{
    DescriptorPool, DynamicMessage, EnumDescriptor, FieldDescriptor, Kind, MapKey, MessageDescriptor,
    ReflectMessage as _, Value, prost_types::FileDescriptorProto,
};
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{
    Serialize, Serializer,
    ser::{Error as _, SerializeMap as _},
};
use serde_json::json;
use std::{borrow::Cow, collections::BTreeMap, sync::LazyLock};

static CONTRACT: LazyLock<DescriptorPool> = LazyLock::new(|| {
    // The build wrote the descriptors, so that decoding them cannot fail.
    DescriptorPool::decode(FILE_DESCRIPTORS).unwrap_or_default()
});

/// A message as a document.
#[derive(Debug)]
pub(crate) struct Document<'a, M>(pub(crate) &'a M);

impl<M: Name> Document<'_, M> {
    fn descriptor() -> Option<MessageDescriptor> {
        CONTRACT.get_message_by_name(&M::full_name())
    }
}

impl<M: Name> Serialize for Document<'_, M> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let descriptor = Self::descriptor().ok_or_else(|| S::Error::custom(M::full_name()))?;
        let bytes = self.0.encode_to_vec();
        let message = DynamicMessage::decode(descriptor, bytes.as_slice()).map_err(S::Error::custom)?;
        Fields(&message).serialize(serializer)
    }
}

impl<M: Name> JsonSchema for Document<'_, M> {
    fn schema_name() -> Cow<'static, str> {
        M::NAME.into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let schema = Self::descriptor().and_then(|message| schema_of(&message).try_into().ok());
        schema.unwrap_or_default()
    }
}

struct Fields<'a>(&'a DynamicMessage);

impl Serialize for Fields<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let descriptor = self.0.descriptor();
        let fields = descriptor.fields();
        let mut map = serializer.serialize_map(Some(fields.len()))?;
        for field in fields {
            let is_absent = field.supports_presence() && !self.0.has_field(&field);
            let (kind, value) = (field.kind(), self.0.get_field(&field));
            let part = (!is_absent).then_some(Part(&kind, &value));
            map.serialize_entry(field.name(), &part)?;
        }
        map.end()
    }
}

/// A value, and the kind of its content.
struct Part<'a>(&'a Kind, &'a Value);

impl Serialize for Part<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Self(kind, value) = *self;
        match value {
            Value::Bool(value) => serializer.serialize_bool(*value),
            Value::I32(value) => serializer.serialize_i32(*value),
            Value::U32(value) => serializer.serialize_u32(*value),
            Value::I64(value) if value.unsigned_abs() <= MAX_EXACT => serializer.serialize_i64(*value),
            Value::I64(value) => serializer.collect_str(value),
            Value::U64(value) => Whole(*value).serialize(serializer),
            Value::F32(value) => serializer.serialize_f32(*value),
            Value::F64(value) => serializer.serialize_f64(*value),
            Value::String(value) => serializer.serialize_str(value),
            Value::Bytes(value) => serializer.serialize_str(&STANDARD.encode(value)),
            Value::EnumNumber(number) => {
                let choice = kind
                    .as_enum()
                    .and_then(|choices| Some((choices, choices.get_value(*number)?)));
                // A newer coordinator can send values that this command does not have.
                choice
                    .map_or_else(
                        || number.to_string(),
                        |(choices, value)| choice_name(choices, value.name()),
                    )
                    .serialize(serializer)
            }
            Value::Message(message) => Fields(message).serialize(serializer),
            Value::List(values) => serializer.collect_seq(values.iter().map(|value| Part(kind, value))),
            Value::Map(values) => {
                let kind = kind
                    .as_message()
                    .map(|entry| entry.map_entry_value_field().kind());
                let kind = kind.as_ref().unwrap_or(&Kind::Double);
                let values: BTreeMap<&MapKey, &Value> = values.iter().collect();
                let entries = values
                    .into_iter()
                    .filter_map(|(key, value)| Some((key.as_str()?, Part(kind, value))));
                serializer.collect_map(entries)
            }
        }
    }
}

/// The name of an enum value without the prefix of the enum. The prefix is the beginning of the name `..._UNSPECIFIED`.
fn choice_name(choices: &EnumDescriptor, name: &str) -> String {
    let unspecified = choices.default_value();
    let prefix = unspecified.name().strip_suffix("UNSPECIFIED").unwrap_or_default();
    name.strip_prefix(prefix)
        .unwrap_or(name)
        .to_lowercase()
        .replace('_', "-")
}

/// The JSON Schema of the documents of a message.
fn schema_of(message: &MessageDescriptor) -> serde_json::Value {
    let file = message.parent_file_descriptor_proto();
    let fields: Vec<FieldDescriptor> = message.fields().collect();
    let properties = fields.iter().map(|field| {
        let mut schema = schema_of_field(field);
        schema["description"] = comment(file, field.path()).into();
        (field.name().to_owned(), schema)
    });
    json!({
        "type": "object",
        "description": comment(file, message.path()),
        "properties": properties.collect::<serde_json::Map<_, _>>(),
        "required": fields.iter().map(FieldDescriptor::name).collect::<Vec<_>>(),
    })
}

fn schema_of_field(field: &FieldDescriptor) -> serde_json::Value {
    if field.is_map() {
        let kind = field.kind();
        let value = kind
            .as_message()
            .map(|entry| schema_of_kind(&entry.map_entry_value_field().kind()));
        return json!({ "type": "object", "additionalProperties": value });
    }
    let schema = schema_of_kind(&field.kind());
    match field.kind() {
        _ if field.is_list() => json!({ "type": "array", "items": schema }),
        Kind::Double | Kind::Float => schema,
        _ if field.supports_presence() => json!({ "anyOf": [schema, { "type": "null" }] }),
        _ => schema,
    }
}

fn schema_of_kind(kind: &Kind) -> serde_json::Value {
    match kind {
        Kind::Bool => json!({ "type": "boolean" }),
        Kind::String => json!({ "type": "string" }),
        Kind::Bytes => json!({ "type": "string", "contentEncoding": "base64" }),
        // The value is null if it is absent or not finite.
        Kind::Double | Kind::Float => json!({ "type": ["number", "null"] }),
        Kind::Uint64 | Kind::Int64 | Kind::Fixed64 | Kind::Sfixed64 | Kind::Sint64 => {
            json!({ "type": ["integer", "string"] })
        }
        Kind::Uint32 | Kind::Int32 | Kind::Fixed32 | Kind::Sfixed32 | Kind::Sint32 => {
            json!({ "type": "integer" })
        }
        Kind::Enum(choices) => {
            let names = choices.values().map(|value| choice_name(choices, value.name()));
            json!({ "type": "string", "enum": names.collect::<Vec<_>>() })
        }
        Kind::Message(message) => schema_of(message),
    }
}

/// The comment at a path of a file, on one line.
fn comment(file: &FileDescriptorProto, path: &[i32]) -> String {
    let mut locations = file.source_code_info.iter().flat_map(|info| &info.location);
    let location = locations.find(|location| location.path == path);
    let words = location.and_then(|location| location.leading_comments.as_deref());
    words
        .unwrap_or_default()
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ")
}
