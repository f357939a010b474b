//! Axes of numbers: a field of the campaigns, and the numbers that it takes.

use murmuration_swarm::{Invalid, text};
use serde::Deserialize;
use toml::{Table, Value};

/// Most numbers of an axis.
const MOST_NUMBERS: usize = 64;
/// Most characters and parts of a field's path.
const FIELD_CHARS: usize = 64;
const FIELD_PARTS: usize = 4;

/// The numbers of an axis, as `numbers = [6, 12, 24]` or `numbers = { from = 0, to = 0.5, count = 6 }`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(untagged, expecting = "a list of numbers, or a table with from, to and count")]
pub(super) enum NumbersMessage {
    List(Vec<Number>),
    /// `count` numbers, evenly spread, with both ends included.
    Spread(Spread),
}

#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Spread {
    from: Number,
    to: Number,
    /// Count of the numbers, at least two.
    count: usize,
}

/// A number as written in TOML. A field for whole numbers accepts only whole numbers.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(untagged, expecting = "a number")]
pub(super) enum Number {
    Whole(i64),
    Decimal(f64),
}

impl Number {
    fn value(self) -> f64 {
        match self {
            Self::Whole(number) => number as f64,
            Self::Decimal(number) => number,
        }
    }

    fn toml(self) -> Value {
        match self {
            Self::Whole(number) => Value::Integer(number),
            Self::Decimal(number) => Value::Float(number),
        }
    }

    fn text(self) -> String {
        match self {
            Self::Whole(number) => number.to_string(),
            Self::Decimal(number) => number.to_string(),
        }
    }
}

impl Spread {
    fn numbers(self, axis: &str) -> Result<Vec<Number>, Invalid> {
        let Self { from, to, count } = self;
        if !(2..=MOST_NUMBERS).contains(&count) {
            let allowed = format!("2 to {MOST_NUMBERS}");
            return Err(Invalid::new(
                format!("axes.numbers.count of {axis}"),
                count,
                allowed,
            ));
        }
        let steps = count as i64 - 1;
        let whole = match (from, to) {
            (Number::Whole(from), Number::Whole(to)) => to
                .checked_sub(from)
                .filter(|span| span % steps == 0)
                .map(|span| (from, span / steps)),
            _ => None,
        };
        let number = |place: i64| match whole {
            Some((from, step)) => Number::Whole(from + place * step),
            None => {
                let part = place as f64 / steps as f64;
                Number::Decimal(short(from.value() + part * (to.value() - from.value())))
            }
        };
        Ok((0..=steps).map(number).collect())
    }
}

/// The number rounded to twelve digits, which removes the rounding error of its sum.
fn short(number: f64) -> f64 {
    format!("{number:.11e}").parse().unwrap_or(number)
}

/// The field of an axis of numbers, and its numbers, all different.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct NumberAxis {
    field: String,
    numbers: Vec<Number>,
}

impl NumberAxis {
    /// The numbers of the axis `name` for `field`.
    pub(super) fn new(name: &str, field: &str, given: &NumbersMessage) -> Result<Self, Invalid> {
        let numbers = match given {
            NumbersMessage::List(numbers) => numbers.clone(),
            NumbersMessage::Spread(spread) => spread.numbers(name)?,
        };
        let values: Vec<f64> = numbers.iter().map(|number| number.value()).collect();
        let is_repeated = |(place, value): (usize, &f64)| values[..place].contains(value);
        if values.iter().any(|value| !value.is_finite()) || values.iter().enumerate().any(is_repeated) {
            let message: Vec<String> = numbers.iter().map(|number| number.text()).collect();
            let allowed = "different finite numbers";
            return Err(Invalid::new(
                format!("axes.numbers of {name}"),
                message.join(", "),
                allowed,
            ));
        }
        check_path(field)?;
        Ok(Self {
            field: field.to_owned(),
            numbers,
        })
    }

    /// The name of each number, and a campaign table that sets the field to it.
    pub(super) fn values(&self) -> impl Iterator<Item = (String, Table)> {
        let path: Vec<&str> = self.field.split('.').collect();
        let value = move |number: &Number| (number.text(), nested(&path, number.toml()));
        self.numbers.iter().map(value)
    }

    /// The path of the field, such as `world.agents`.
    pub(super) fn field(&self) -> &str {
        &self.field
    }

    /// The numbers, in the order of the file, all different.
    pub(super) fn numbers(&self) -> Vec<f64> {
        self.numbers.iter().map(|number| number.value()).collect()
    }
}

/// Refuses a text that is not the path of a field.
fn check_path(field: &str) -> Result<(), Invalid> {
    let parts: Vec<&str> = field.split('.').collect();
    let fits = |part: &&str| {
        let is_part = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_' || c == '-';
        !part.is_empty() && part.chars().all(is_part)
    };
    if field.len() <= FIELD_CHARS && parts.len() <= FIELD_PARTS && parts.iter().all(fits) {
        return Ok(());
    }
    let allowed = "the name of a field of a campaign, such as \"world.agents\"";
    Err(Invalid::new("axes.field", text::quoted(field), allowed))
}

/// A table that sets the field at `path` to this value.
fn nested(path: &[&str], value: Value) -> Table {
    let Some((first, rest)) = path.split_first() else {
        return Table::new();
    };
    let inner = match rest.is_empty() {
        true => value,
        false => Value::Table(nested(rest, value)),
    };
    Table::from_iter([((*first).to_owned(), inner)])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(numbers: &str) -> Result<NumberAxis, String> {
        let table: Table = format!("numbers = {numbers}").parse().unwrap();
        let numbers = table["numbers"].clone().try_into().unwrap();
        let axis = NumberAxis::new("noise", "world.noise.slip", &numbers);
        axis.map_err(|error| error.to_string())
    }

    fn names(numbers: &str) -> Vec<String> {
        axis(numbers).unwrap().values().map(|(name, _)| name).collect()
    }

    #[track_caller]
    fn refused(numbers: &str, expected: &str) {
        let error = axis(numbers).unwrap_err();
        assert!(error.contains(expected), "{error:?} does not say {expected:?}");
    }

    #[test]
    fn each_number_has_a_table_that_sets_the_field() {
        let axis = axis("[0, 0.25]").unwrap();
        assert_eq!(axis.numbers(), [0.0, 0.25]);
        let (name, table) = axis.values().nth(1).unwrap();
        assert_eq!(
            (name.as_str(), table.to_string().as_str()),
            ("0.25", "[world.noise]\nslip = 0.25\n")
        );
    }

    #[test]
    fn spread_numbers_are_short_and_stay_whole_where_they_can() {
        let spread = |from, to, count| names(&format!("{{ from = {from}, to = {to}, count = {count} }}"));
        assert_eq!(spread("0", "0.3", 4), ["0", "0.1", "0.2", "0.3"]);
        assert_eq!(spread("6", "24", 4), ["6", "12", "18", "24"]);
        assert_eq!(spread("0", "1", 3), ["0", "0.5", "1"]);
        assert_eq!(spread("1", "-1", 3), ["1", "0", "-1"]);
    }

    #[test]
    fn numbers_that_make_no_axis_are_refused() {
        refused("[1, 1.0]", "different finite numbers");
        refused("[nan]", "different finite numbers");
        refused("{ from = 1, to = 1, count = 3 }", "different finite numbers");
        refused("{ from = 0, to = 1, count = 1 }", "axes.numbers.count of noise");
        let numbers = NumbersMessage::List(vec![Number::Whole(1)]);
        for field in ["", "world..agents", "World", "a.b.c.d.e"] {
            assert!(NumberAxis::new("noise", field, &numbers).is_err(), "{field}");
        }
    }
}
