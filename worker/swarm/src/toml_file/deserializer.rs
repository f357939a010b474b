//! Serde's view of a parsed TOML file, with typed errors that name their field.

mod variant;

use serde::{
    Deserializer,
    de::{self, DeserializeSeed, Expected, IntoDeserializer, Unexpected, Visitor, value::StrDeserializer},
    forward_to_deserialize_any,
};
use std::{fmt, ops::Range};
use toml::{
    Spanned,
    de::{DeTable, DeValue},
};
use variant::Variant;

/// An error about a field: its path, its place in the text, and what is wrong.
#[derive(Debug)]
pub(super) struct FieldError {
    /// The names of the tables around the field, then its own name; `sensors[1]` is an item of a list.
    pub(super) path: Vec<String>,
    /// Byte range in the text; `None` until the error passes a value with a byte range.
    pub(super) span: Option<Range<usize>>,
    pub(super) kind: ErrorKind,
}

#[derive(Debug)]
pub(super) enum ErrorKind {
    UnknownField {
        /// The fields in the unknown field, if it is a table.
        inner: Vec<String>,
        known: &'static [&'static str],
    },
    UnknownValue {
        value: String,
        known: &'static [&'static str],
    },
    MissingField {
        name: &'static str,
    },
    WrongType {
        found: String,
        allowed: String,
    },
    /// The message of a domain type.
    Other(String),
}

impl FieldError {
    fn of(kind: ErrorKind) -> Self {
        Self {
            path: Vec::new(),
            span: None,
            kind,
        }
    }

    fn wrong_type(found: impl Into<String>, allowed: impl Into<String>) -> Self {
        Self::of(ErrorKind::WrongType {
            found: found.into(),
            allowed: allowed.into(),
        })
    }

    /// Adds to the path the `name` of the field or item with the error; `span` is its place in the text.
    fn within(mut self, name: &str, span: Range<usize>) -> Self {
        match self.path.first_mut() {
            // `sensors` and `[1]` become `sensors[1]`.
            Some(first) if first.starts_with('[') => first.insert_str(0, name),
            _ => self.path.insert(0, name.to_owned()),
        }
        self.span.get_or_insert(span);
        self
    }
}

impl fmt::Display for FieldError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {:?}", self.path.join("."), self.kind)
    }
}

impl std::error::Error for FieldError {}

impl de::Error for FieldError {
    fn custom<T: fmt::Display>(words: T) -> Self {
        Self::of(ErrorKind::Other(words.to_string()))
    }

    fn invalid_type(found: Unexpected<'_>, allowed: &dyn Expected) -> Self {
        Self::invalid_value(found, allowed)
    }

    fn invalid_value(found: Unexpected<'_>, allowed: &dyn Expected) -> Self {
        let found = match found {
            Unexpected::Str(text) => format!("{text:?}"),
            Unexpected::Bool(value) => value.to_string(),
            Unexpected::Unsigned(value) => value.to_string(),
            Unexpected::Signed(value) => value.to_string(),
            Unexpected::Float(value) => value.to_string(),
            Unexpected::Map => A_TABLE.to_owned(),
            Unexpected::Seq => "a list".to_owned(),
            other => other.to_string(),
        };
        Self::wrong_type(found, allowed.to_string())
    }

    fn unknown_variant(value: &str, known: &'static [&'static str]) -> Self {
        Self::of(ErrorKind::UnknownValue {
            value: value.to_owned(),
            known,
        })
    }

    fn unknown_field(_: &str, known: &'static [&'static str]) -> Self {
        let inner = Vec::new();
        Self::of(ErrorKind::UnknownField { inner, known })
    }

    fn missing_field(name: &'static str) -> Self {
        Self::of(ErrorKind::MissingField { name })
    }
}

const A_TABLE: &str = "a table";
const A_TEXT: &str = "a text in quotes";

/// A value of a file with its place.
#[derive(Clone, Copy)]
pub(super) struct Node<'a>(pub(super) &'a Spanned<DeValue<'a>>);

impl<'a> Node<'a> {
    fn value(self) -> &'a DeValue<'a> {
        self.0.get_ref()
    }

    /// The error for a value that is not `allowed`.
    fn must_be(self, allowed: &str) -> FieldError {
        let found = match self.value() {
            DeValue::Table(_) => A_TABLE.to_owned(),
            DeValue::Array(_) => "a list".to_owned(),
            DeValue::String(text) => format!("{text:?}"),
            DeValue::Integer(number) => number.to_string(),
            DeValue::Float(number) => number.to_string(),
            DeValue::Boolean(value) => value.to_string(),
            DeValue::Datetime(time) => time.to_string(),
        };
        FieldError {
            span: Some(self.0.span()),
            ..FieldError::wrong_type(found, allowed)
        }
    }

    /// The value as a whole number; `None` if the value is not whole, or has more than 128 bits.
    fn integer(self) -> Option<i128> {
        let number = self.value().as_integer()?;
        i128::from_str_radix(number.as_str(), number.radix()).ok()
    }

    fn whole<T: TryFrom<i128>>(self) -> Result<T, FieldError> {
        let any = match T::try_from(-1) {
            Ok(_) => "a whole number",
            Err(_) => "a whole number, 0 or more",
        };
        let number = self.integer().ok_or_else(|| self.must_be(any))?;
        T::try_from(number).map_err(|_| match number {
            ..0 => self.must_be(any),
            0.. => self.must_be("a smaller whole number"),
        })
    }

    fn real(self) -> Result<f64, FieldError> {
        let number = match self.value() {
            DeValue::Float(number) => number.as_str().parse().ok(),
            _ => self.integer().map(|number| number as f64),
        };
        number.ok_or_else(|| self.must_be("a number"))
    }

    fn text(self) -> Result<&'a str, FieldError> {
        self.value().as_str().ok_or_else(|| self.must_be(A_TEXT))
    }

    fn table(self) -> Result<&'a DeTable<'a>, FieldError> {
        self.value().as_table().ok_or_else(|| self.must_be(A_TABLE))
    }

    fn list(self) -> Result<List<'a>, FieldError> {
        match self.value() {
            DeValue::Array(items) => Ok(List {
                items: items.iter(),
                place: 0,
            }),
            DeValue::Table(_) => {
                Err(self.must_be("a list of tables: [{ ... }], or tables with two brackets around the name"))
            }
            DeValue::String(text) => Err(self.must_be(&format!("a list such as [{text:?}]"))),
            _ => Err(self.must_be("a list such as [1, 2]")),
        }
    }
}

macro_rules! whole {
    ($($method:ident $visit:ident)*) => {
        $(fn $method<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, FieldError> {
            visitor.$visit(self.whole()?)
        })*
    };
}

impl<'de> Deserializer<'de> for Node<'_> {
    type Error = FieldError;

    whole! {
        deserialize_i8 visit_i8
        deserialize_i16 visit_i16
        deserialize_i32 visit_i32
        deserialize_i64 visit_i64
        deserialize_u8 visit_u8
        deserialize_u16 visit_u16
        deserialize_u32 visit_u32
        deserialize_u64 visit_u64
    }

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, FieldError> {
        match self.value() {
            DeValue::String(text) => visitor.visit_str(text),
            DeValue::Integer(_) => match self.integer().map(u64::try_from) {
                Some(Ok(number)) if i64::try_from(number).is_err() => visitor.visit_u64(number),
                _ => visitor.visit_i64(self.whole()?),
            },
            DeValue::Float(_) => visitor.visit_f64(self.real()?),
            DeValue::Boolean(value) => visitor.visit_bool(*value),
            DeValue::Datetime(time) => visitor.visit_string(time.to_string()),
            DeValue::Array(_) => visitor.visit_seq(self.list()?),
            DeValue::Table(table) => visitor.visit_map(Fields::of(table)),
        }
    }

    fn deserialize_bool<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, FieldError> {
        let value = self.value().as_bool();
        visitor.visit_bool(value.ok_or_else(|| self.must_be("true or false"))?)
    }

    fn deserialize_f32<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, FieldError> {
        self.deserialize_f64(visitor)
    }

    fn deserialize_f64<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, FieldError> {
        visitor.visit_f64(self.real()?)
    }

    fn deserialize_str<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, FieldError> {
        visitor.visit_str(self.text()?)
    }

    fn deserialize_string<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, FieldError> {
        self.deserialize_str(visitor)
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, FieldError> {
        visitor.visit_some(self)
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        visitor: V,
    ) -> Result<V::Value, FieldError> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, FieldError> {
        visitor.visit_seq(self.list()?)
    }

    fn deserialize_tuple<V: Visitor<'de>>(self, len: usize, visitor: V) -> Result<V::Value, FieldError> {
        let list = self.list()?;
        let found = list.items.len();
        if found != len {
            let wrong = FieldError::wrong_type(format!("of {found}"), format!("a list of {len}"));
            return Err(FieldError {
                span: Some(self.0.span()),
                ..wrong
            });
        }
        visitor.visit_seq(list)
    }

    fn deserialize_map<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, FieldError> {
        visitor.visit_map(Fields::of(self.table()?))
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, FieldError> {
        self.deserialize_map(visitor)
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, FieldError> {
        let of_name = |name, content| Variant {
            name,
            content,
            place: self,
        };
        let variant = match self.value() {
            DeValue::String(name) => of_name(name, None),
            DeValue::Table(table) => match table.iter().next() {
                Some((name, content)) if table.len() == 1 => of_name(name.get_ref(), Some(Node(content))),
                _ => return Err(self.must_be("a name, or a table of one name")),
            },
            _ => return Err(self.must_be("a text in quotes, or a table")),
        };
        let error_of = |error: FieldError| FieldError {
            span: error.span.or_else(|| Some(self.0.span())),
            ..error
        };
        visitor.visit_enum(variant).map_err(error_of)
    }

    forward_to_deserialize_any! {
        i128 u128 char bytes byte_buf unit unit_struct tuple_struct identifier ignored_any
    }
}

/// The fields of a table, one after the other.
struct Fields<'a> {
    open: Vec<(&'a Spanned<std::borrow::Cow<'a, str>>, Node<'a>)>,
}

impl<'a> Fields<'a> {
    fn of(table: &'a DeTable<'a>) -> Self {
        let fields = table.iter().map(|(name, value)| (name, Node(value)));
        let mut open: Vec<_> = fields.collect();
        open.reverse();
        Self { open }
    }
}

impl<'de> de::MapAccess<'de> for Fields<'_> {
    type Error = FieldError;

    fn next_key_seed<K: DeserializeSeed<'de>>(&mut self, seed: K) -> Result<Option<K::Value>, FieldError> {
        let Some((name, value)) = self.open.last() else {
            return Ok(None);
        };
        let text: StrDeserializer<'_, FieldError> = name.get_ref().as_ref().into_deserializer();
        let key = seed.deserialize(text).map_err(|error| {
            let mut error = error.within(name.get_ref(), name.span());
            if let (ErrorKind::UnknownField { inner, .. }, Some(table)) =
                (&mut error.kind, value.value().as_table())
            {
                *inner = table.keys().map(|name| name.get_ref().to_string()).collect();
            }
            error
        })?;
        Ok(Some(key))
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, FieldError> {
        let (name, value) = self
            .open
            .pop()
            .ok_or_else(|| de::Error::custom("no field is open"))?;
        let read = seed.deserialize(value);
        read.map_err(|error| error.within(name.get_ref(), value.0.span()))
    }
}

/// The items of a list, one after the other.
struct List<'a> {
    items: std::slice::Iter<'a, Spanned<DeValue<'a>>>,
    place: usize,
}

impl<'de> de::SeqAccess<'de> for List<'_> {
    type Error = FieldError;

    fn next_element_seed<T: DeserializeSeed<'de>>(
        &mut self,
        seed: T,
    ) -> Result<Option<T::Value>, FieldError> {
        let Some(item) = self.items.next() else {
            return Ok(None);
        };
        let place = self.place;
        self.place += 1;
        let read = seed.deserialize(Node(item));
        read.map(Some)
            .map_err(|error| error.within(&format!("[{place}]"), item.span()))
    }
}
