//! Serde's view of a choice: a name, or a table of one name.

use super::{FieldError, Fields, Node};
use serde::{
    Deserializer,
    de::{self, DeserializeSeed, IntoDeserializer, Visitor, value::StrDeserializer},
    forward_to_deserialize_any,
};

/// The variant of an enum: a text, or the only key of a table.
pub(super) struct Variant<'a> {
    pub(super) name: &'a str,
    pub(super) content: Option<Node<'a>>,
    pub(super) place: Node<'a>,
}

impl Variant<'_> {
    /// Adds the name of the variant to the path of an error.
    fn within(&self, error: FieldError) -> FieldError {
        error.within(self.name, self.place.0.span())
    }

    /// The error for a name without its table.
    fn must_have_table(&self) -> FieldError {
        let allowed = format!("a table such as {{ {} = {{}} }}", self.name);
        self.place.must_be(&allowed)
    }
}

impl<'a, 'de> de::EnumAccess<'de> for Variant<'a> {
    type Error = FieldError;
    type Variant = Self;

    fn variant_seed<V: DeserializeSeed<'de>>(self, seed: V) -> Result<(V::Value, Self), FieldError> {
        let name: StrDeserializer<'_, FieldError> = self.name.into_deserializer();
        Ok((seed.deserialize(name)?, self))
    }
}

impl<'de> de::VariantAccess<'de> for Variant<'_> {
    type Error = FieldError;

    fn unit_variant(self) -> Result<(), FieldError> {
        match self.content {
            Some(content) if content.value().as_table().is_none_or(|table| !table.is_empty()) => {
                Err(self.within(content.must_be("an empty table, or its name as a text")))
            }
            _ => Ok(()),
        }
    }

    fn newtype_variant_seed<T: DeserializeSeed<'de>>(self, seed: T) -> Result<T::Value, FieldError> {
        match self.content {
            Some(content) => seed.deserialize(content).map_err(|error| self.within(error)),
            None => seed.deserialize(NameAlone(self)),
        }
    }

    fn tuple_variant<V: Visitor<'de>>(self, _: usize, visitor: V) -> Result<V::Value, FieldError> {
        self.struct_variant(&[], visitor)
    }

    fn struct_variant<V: Visitor<'de>>(
        self,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, FieldError> {
        match self.content {
            Some(content) => content
                .deserialize_any(visitor)
                .map_err(|error| self.within(error)),
            None => Err(self.must_have_table()),
        }
    }
}

/// The contents of a variant that is a name without a table. Only a struct without fields has no contents.
struct NameAlone<'a>(Variant<'a>);

impl<'de> Deserializer<'de> for NameAlone<'_> {
    type Error = FieldError;

    fn deserialize_any<V: Visitor<'de>>(self, _: V) -> Result<V::Value, FieldError> {
        Err(self.0.must_have_table())
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, FieldError> {
        match fields {
            [] => visitor.visit_map(Fields { open: Vec::new() }),
            _ => self.deserialize_any(visitor),
        }
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf option unit unit_struct
        newtype_struct seq tuple tuple_struct map enum identifier ignored_any
    }
}
