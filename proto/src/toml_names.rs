//! Fields whose form in campaign files differs from the messages', and messages on one line for the cells of tables.

use crate::{Invalid, text, toml_file};
use serde::{Serialize, de::DeserializeOwned};

/// The fields of a message that differ from those of `other`, as an inline table of TOML; `None` if none differs.
/// [`of_toml_line`] reads it.
#[must_use]
pub fn to_differing_line<T: Serialize>(message: &T, other: &T) -> Option<String> {
    let mut fields = toml::Table::try_from(message).unwrap_or_default();
    let others = toml::Table::try_from(other).unwrap_or_default();
    fields.retain(|name, value| others.get(name) != Some(value));
    (!fields.is_empty()).then(|| toml::Value::from(fields).to_string())
}

/// Reads a table of a campaign file that is written on one line, such as `example`, into a message.
///
/// # Errors
/// Names `field` if the line is not such a table; otherwise names the field in it that is wrong.
pub fn of_toml_line<T: DeserializeOwned>(field: &str, line: &str, example: &str) -> Result<T, Invalid> {
    let refused = |why: &str| {
        let allowed = format!("a table of a campaign file on one line, such as {example}{why}");
        Invalid::new(field, text::quoted(line), allowed)
    };
    let file: toml::Table = format!("line = {line}").parse().map_err(|_| refused(""))?;
    // A line break would begin a second field.
    let mut values = file.into_iter().map(|(_, value)| value);
    match (values.next(), values.next()) {
        (Some(toml::Value::Table(table)), None) => {
            toml_file::read_section(field, &table.to_string()).map_err(|error| refused(&format!("; {error}")))
        }
        _ => Err(refused("")),
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
        let name = String::deserialize(deserializer)?;
        let method: Result<Method, _> = name.parse();
        let method = method.map_err(|_| D::Error::unknown_variant(&name, &Method::NAMES))?;
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
