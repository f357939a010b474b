//! The error of validation: the field, its value, and the allowed values.

use crate::in_full;
use std::{borrow::Cow, f64::consts::TAU, fmt::Display, ops::RangeInclusive};

/// Maximum number of characters of a value that an error shows: enough for several numbers in full.
const SHOWN_CHARS: usize = 240;

/// A value from outside that is not allowed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{field}{}: must be {allowed}", assigned(value.as_deref()))]
pub struct Invalid {
    /// Path of the field from the outermost message, as in a campaign file (`search.population`).
    pub field: String,
    /// The beginning of the value; `None` if the field has no value.
    pub value: Option<String>,
    pub allowed: String,
}

fn assigned(value: Option<&str>) -> String {
    value.map_or(" is missing".to_owned(), |value| format!(" = {value}"))
}

impl Invalid {
    /// An error about `field`.
    pub fn new(field: impl Into<String>, value: impl Display, allowed: impl Into<String>) -> Self {
        Self {
            field: field.into(),
            value: Some(beginning(&value.to_string(), SHOWN_CHARS).into_owned()),
            allowed: allowed.into(),
        }
    }

    /// An error about `field`, which has no value.
    pub fn missing(field: impl Into<String>, allowed: impl Into<String>) -> Self {
        Self {
            field: field.into(),
            value: None,
            allowed: allowed.into(),
        }
    }

    /// The same error, with `outer` before its path.
    #[must_use]
    pub fn within(mut self, outer: &str) -> Self {
        self.field = format!("{outer}.{}", self.field);
        self
    }
}

/// Returns a text of at most `most` characters; a longer text is cut there and gets an ellipsis.
#[must_use]
pub fn beginning(text: &str, most: usize) -> Cow<'_, str> {
    match text.char_indices().nth(most) {
        None => text.into(),
        Some((end, _)) => format!("{}…", &text[..end]).into(),
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
    Err(Invalid::new(field, in_full(value), allowed))
}

/// An angle in radians if it is in `range`. The error about a number that can only be degrees says what it is in radians.
pub(crate) fn angle(field: &str, value: f64, range: RangeInclusive<f64>) -> Result<f64, Invalid> {
    let looks_like_degrees = (TAU..=360.0).contains(&value.abs());
    real(field, value, range).map_err(|mut refused| {
        if looks_like_degrees {
            refused.allowed += &format!(", in radians: {value} degrees are {:.4}", value.to_radians());
        }
        refused
    })
}

/// `value` if it is over 0 and at most `most`.
pub(crate) fn positive(field: &str, value: f64, most: f64) -> Result<f64, Invalid> {
    if value > 0.0 && value <= most {
        return Ok(value);
    }
    Err(Invalid::new(
        field,
        in_full(value),
        format!("a number over 0 and at most {most}"),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_shown_briefly_and_none_is_said_to_be_missing() {
        let message = |value: f64| real("x", value, -1.0..=1.0).unwrap_err().to_string();
        assert_eq!(message(-1e300), "x = -1e300: must be a number from -1 to 1");
        assert_eq!(message(1.5), "x = 1.5: must be a number from -1 to 1");
        assert_eq!(message(f64::NAN), "x = NaN: must be a number from -1 to 1");
        assert_eq!(message(f64::INFINITY), "x = inf: must be a number from -1 to 1");
        let tiny = positive("x", -f64::MIN_POSITIVE, 1.0).unwrap_err();
        assert_eq!(tiny.value.as_deref(), Some("-2.2250738585072014e-308"));
        let long = Invalid::new("x", "9".repeat(300), "short");
        assert_eq!(long.value, Some(format!("{}…", "9".repeat(240))));
        let message = |invalid: Invalid| invalid.to_string();
        assert_eq!(
            message(Invalid::missing("x", "given")),
            "x is missing: must be given"
        );
        assert_eq!(
            message(Invalid::new("x", "nothing", "given")),
            "x = nothing: must be given"
        );
    }
}
