//! The error of validation: the field, its value, and the allowed values.

use crate::beginning::beginning;
use std::{fmt::Display, ops::RangeInclusive};

/// Maximum number of characters shown of a value: enough for several numbers in full.
const SHOWN_CHARS: usize = 240;

/// A value from outside that is not allowed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{field} = {value}: must be {allowed}")]
pub struct Invalid {
    /// Path of the field from the outermost message, as in a campaign file (`search.population`).
    pub field: String,
    /// The value (the beginning of a long one), or `nothing`.
    pub value: String,
    /// The allowed values.
    pub allowed: String,
}

impl Invalid {
    /// An error about `field`.
    pub fn new(field: impl Into<String>, value: impl Display, allowed: impl Into<String>) -> Self {
        Self {
            field: field.into(),
            value: beginning(&value.to_string(), SHOWN_CHARS).into_owned(),
            allowed: allowed.into(),
        }
    }

    /// The same error, seen from the message that holds `outer`.
    #[must_use]
    pub fn within(mut self, outer: &str) -> Self {
        self.field = format!("{outer}.{}", self.field);
        self
    }
}

/// `value` if it is in `range`.
pub(crate) fn whole<T>(field: &str, value: T, range: RangeInclusive<T>) -> Result<T, Invalid>
where
    T: PartialOrd + Display,
{
    if range.contains(&value) {
        return Ok(value);
    }
    let allowed = format!("a whole number from {} to {}", range.start(), range.end());
    Err(Invalid::new(field, value, allowed))
}

/// `value` if it is in `range` (NaN never is).
pub(crate) fn real(field: &str, value: f64, range: RangeInclusive<f64>) -> Result<f64, Invalid> {
    if range.contains(&value) {
        return Ok(value);
    }
    let allowed = format!("a number from {} to {}", range.start(), range.end());
    Err(Invalid::new(field, short(value), allowed))
}

/// `value` if it is over 0 and at most `most`.
pub(crate) fn positive(field: &str, value: f64, most: f64) -> Result<f64, Invalid> {
    if value > 0.0 && value <= most {
        return Ok(value);
    }
    Err(Invalid::new(
        field,
        short(value),
        format!("a number over 0 and at most {most}"),
    ))
}

/// A number as people write it, with an exponent if it has many digits otherwise.
fn short(value: f64) -> String {
    let size = value.abs();
    match size >= 1e16 || (size > 0.0 && size < 1e-5) {
        true => format!("{value:e}"),
        false => value.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_never_shown_with_hundreds_of_digits() {
        let said = |value: f64| real("x", value, -1.0..=1.0).unwrap_err().to_string();
        assert_eq!(said(-1e300), "x = -1e300: must be a number from -1 to 1");
        assert_eq!(said(1.5), "x = 1.5: must be a number from -1 to 1");
        assert_eq!(said(f64::NAN), "x = NaN: must be a number from -1 to 1");
        assert_eq!(said(f64::INFINITY), "x = inf: must be a number from -1 to 1");
        let tiny = positive("x", -f64::MIN_POSITIVE, 1.0).unwrap_err();
        assert_eq!(tiny.value, "-2.2250738585072014e-308");
        let long = Invalid::new("x", "9".repeat(300), "short");
        assert_eq!(long.value, format!("{}…", "9".repeat(240)));
    }
}
