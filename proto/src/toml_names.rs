//! Fields that campaign files write otherwise than the messages, and messages on one line for the cells of tables.

use crate::{Invalid, text};
use serde::{Serialize, de::DeserializeOwned};
use std::collections::BTreeMap;

/// A message that people write in campaign files, as an inline table or list of TOML: `{ slip = 0.05 }`. [`of_toml_line`] reads
/// it.
#[must_use]
pub fn to_toml_line(message: &impl Serialize) -> String {
    toml::Value::try_from(message).map_or_else(|_| String::new(), |value| value.to_string())
}

/// Reads what [`to_toml_line`] wrote.
///
/// # Errors
/// Names `field` if the line is no such table or list; `example` is one.
pub fn of_toml_line<T: DeserializeOwned>(field: &str, line: &str, example: &str) -> Result<T, Invalid> {
    let refused = || {
        let allowed = format!("as in a campaign file, on one line, such as {example}");
        Invalid::new(field, text::quoted(line), allowed)
    };
    let table = toml::from_str::<BTreeMap<String, T>>(&format!("line = {line}"));
    // A line break would begin a second field.
    let lines = table.map_err(|_| refused())?;
    let mut values = lines.into_values();
    match (values.next(), values.next()) {
        (Some(value), None) => Ok(value),
        _ => Err(refused()),
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
    use crate::{Method, v1};
    use serde::{Deserialize as _, Deserializer, Serializer, de::Error as _};

    pub(crate) fn serialize<S: Serializer>(number: &i32, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(Method::try_from(*number).map_or("", Method::name))
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<i32, D::Error> {
        let method: Method = String::deserialize(deserializer)?
            .parse()
            .map_err(D::Error::custom)?;
        Ok(v1::Method::from(method) as i32)
    }
}

/// A table of its own: TOML text in the message.
pub(crate) mod table {
    use serde::{
        Deserialize as _, Deserializer, Serialize as _, Serializer, de::Error as _, ser::Error as _,
    };

    pub(crate) fn serialize<S: Serializer>(text: &Option<String>, serializer: S) -> Result<S::Ok, S::Error> {
        let table = text.as_deref().map(str::parse::<toml::Table>).transpose();
        table.map_err(S::Error::custom)?.serialize(serializer)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Option<String>, D::Error> {
        let table = Option::<toml::Table>::deserialize(deserializer)?;
        table
            .map(|table| toml::to_string(&table).map_err(D::Error::custom))
            .transpose()
    }
}
