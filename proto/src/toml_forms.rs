//! Serde forms of fields that campaign files write in another form than messages.

/// `angle = 0.5` or `angle = "free"`.
pub(crate) mod angle {
    use crate::v1::SensorAngle;
    use serde::{
        Deserializer, Serializer,
        de::{Error, Unexpected, Visitor},
    };
    use std::fmt;

    const FREE: &str = "free";

    pub(crate) fn serialize<S: Serializer>(
        angle: &Option<SensorAngle>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        match angle.as_ref().and_then(|angle| angle.fixed) {
            Some(fixed) => serializer.serialize_f64(fixed),
            None => serializer.serialize_str(FREE),
        }
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Option<SensorAngle>, D::Error> {
        deserializer.deserialize_any(Angle).map(Some)
    }

    struct Angle;

    impl Visitor<'_> for Angle {
        type Value = SensorAngle;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("a number of radians, or \"free\"")
        }

        fn visit_f64<E: Error>(self, fixed: f64) -> Result<SensorAngle, E> {
            Ok(SensorAngle { fixed: Some(fixed) })
        }

        fn visit_i64<E: Error>(self, fixed: i64) -> Result<SensorAngle, E> {
            self.visit_f64(fixed as f64)
        }

        fn visit_str<E: Error>(self, text: &str) -> Result<SensorAngle, E> {
            match text {
                FREE => Ok(SensorAngle { fixed: None }),
                _ => Err(E::invalid_value(Unexpected::Str(text), &self)),
            }
        }
    }
}

/// `ratios = [[12, 12], [8, 16]]`.
pub mod ratios {
    use crate::v1::Ratio;
    use serde::{Deserialize as _, Deserializer, Serializer};

    pub fn serialize<S: Serializer>(ratios: &[Ratio], serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(ratios.iter().map(|ratio| &ratio.counts))
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<Ratio>, D::Error> {
        let ratios = Vec::<Vec<u32>>::deserialize(deserializer)?;
        Ok(ratios.into_iter().map(|counts| Ratio { counts }).collect())
    }
}

/// `poses = [[100.0, 250.0, 0.0], [400.0, 250.0, 3.14]]`.
pub(crate) mod poses {
    use serde::{Deserialize as _, Deserializer, Serializer};

    pub(crate) fn serialize<S: Serializer>(numbers: &[f64], serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(numbers.chunks(3))
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<f64>, D::Error> {
        let poses = Vec::<[f64; 3]>::deserialize(deserializer)?;
        Ok(poses.into_flattened())
    }
}

/// `initial = [[-0.7, 0.3, 1.0, 1.0]]`.
pub(crate) mod genes {
    use crate::v1::Genes;
    use serde::{Deserialize as _, Deserializer, Serializer};

    pub(crate) fn serialize<S: Serializer>(controllers: &[Genes], serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(controllers.iter().map(|genes| &genes.values))
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<Genes>, D::Error> {
        let controllers = Vec::<Vec<f64>>::deserialize(deserializer)?;
        Ok(controllers.into_iter().map(|values| Genes { values }).collect())
    }
}

/// `method = "hand-crafted"`.
pub(crate) mod method {
    use serde::{Deserialize as _, Deserializer, Serializer, de::Error as _};

    /// Names of the values of the contract's enum `Method`, without the prefix, in small letters and with hyphens.
    const NAMES: &[&str] = include!(concat!(env!("OUT_DIR"), "/methods.rs"));

    pub(crate) fn serialize<S: Serializer>(number: &i32, serializer: S) -> Result<S::Ok, S::Error> {
        let place = usize::try_from(*number - 1).ok();
        serializer.serialize_str(place.and_then(|place| NAMES.get(place)).unwrap_or(&""))
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<i32, D::Error> {
        let name = String::deserialize(deserializer)?;
        let place = NAMES.iter().position(|known| *known == name);
        let number = place.and_then(|place| i32::try_from(place + 1).ok());
        number.ok_or_else(|| D::Error::unknown_variant(&name, NAMES))
    }
}

/// `sees = ["robots", "walls"]`, or `sees = "predator"` for one kind.
pub(crate) mod sees {
    use serde::{
        Deserializer, Serialize as _, Serializer,
        de::{SeqAccess, Visitor, value::SeqAccessDeserializer},
    };
    use std::fmt;

    struct OneOrMore;

    impl<'de> Visitor<'de> for OneOrMore {
        type Value = Vec<String>;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("what the sensor sees, such as \"robots\", or a list of such texts")
        }

        fn visit_str<E>(self, name: &str) -> Result<Vec<String>, E> {
            Ok(vec![name.to_owned()])
        }

        fn visit_seq<A: SeqAccess<'de>>(self, names: A) -> Result<Vec<String>, A::Error> {
            serde::Deserialize::deserialize(SeqAccessDeserializer::new(names))
        }
    }

    pub(crate) fn serialize<S: Serializer>(names: &[String], serializer: S) -> Result<S::Ok, S::Error> {
        names.serialize(serializer)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<String>, D::Error> {
        deserializer.deserialize_any(OneOrMore)
    }
}

/// `crop = [0.7, 1.3]`.
pub(crate) mod pair {
    use serde::{Deserialize as _, Deserializer, Serialize as _, Serializer};

    pub(crate) fn serialize<S: Serializer>(numbers: &[f64], serializer: S) -> Result<S::Ok, S::Error> {
        numbers.serialize(serializer)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<f64>, D::Error> {
        <[f64; 2]>::deserialize(deserializer).map(Vec::from)
    }
}

/// `layers = [{ dense = { units = 5 } }]`. An empty list is refused, because a message cannot tell it from an absent list.
pub(crate) mod layers {
    use crate::v1::Layer;
    use serde::{
        Deserialize as _, Deserializer, Serialize as _, Serializer,
        de::{Error as _, Unexpected},
    };

    pub(crate) fn serialize<S: Serializer>(layers: &[Layer], serializer: S) -> Result<S::Ok, S::Error> {
        layers.serialize(serializer)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<Layer>, D::Error> {
        let layers = Vec::<Layer>::deserialize(deserializer)?;
        match layers.is_empty() {
            true => Err(D::Error::invalid_value(
                Unexpected::Other("an empty list"),
                &"a list of 1 to 100 layers",
            )),
            false => Ok(layers),
        }
    }
}

/// `[training]`.
pub(crate) mod training {
    use serde::{Deserializer, Serializer};

    pub(crate) fn serialize<S: Serializer>(text: &Option<String>, serializer: S) -> Result<S::Ok, S::Error> {
        super::table::serialize(text, serializer)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Option<String>, D::Error> {
        super::table::deserialize::<crate::v1::Training, D>(deserializer)
    }
}

/// `[feedback.recipe]`.
pub(crate) mod recipe {
    use serde::{Deserializer, Serializer};

    pub(crate) fn serialize<S: Serializer>(text: &Option<String>, serializer: S) -> Result<S::Ok, S::Error> {
        super::table::serialize(text, serializer)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Option<String>, D::Error> {
        super::table::deserialize::<crate::v1::Recipe, D>(deserializer)
    }
}

/// A table in a campaign file, which a message holds as TOML text.
mod table {
    use serde::{
        Deserialize, Deserializer, Serialize, Serializer,
        de::{Error as _, Unexpected},
        ser::Error as _,
    };
    use toml::{Table, Value};

    pub(super) fn serialize<S: Serializer>(text: &Option<String>, serializer: S) -> Result<S::Ok, S::Error> {
        let table = text.as_deref().map(str::parse::<Table>).transpose();
        table.map_err(S::Error::custom)?.serialize(serializer)
    }

    /// Reads the fields of a table into `Message`, so that errors have their places in the file, and writes the text of the
    /// table.
    pub(super) fn deserialize<'de, Message, D>(deserializer: D) -> Result<Option<String>, D::Error>
    where
        Message: Deserialize<'de> + Serialize,
        D: Deserializer<'de>,
    {
        let message = Message::deserialize(deserializer)?;
        match Value::try_from(message).map_err(D::Error::custom)? {
            Value::Table(table) => Ok(Some(table.to_string())),
            Value::String(name) => Err(D::Error::invalid_value(Unexpected::Str(&name), &"a table")),
            _ => Err(D::Error::invalid_value(Unexpected::Other("a value"), &"a table")),
        }
    }
}

// How choices are written.
include!(concat!(env!("OUT_DIR"), "/choices.rs"));
