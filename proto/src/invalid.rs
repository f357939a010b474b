//! The one error of validation: which field, what it held, what it may hold.

use crate::Text;
use std::{fmt::Display, ops::RangeInclusive};

/// A value from outside that cannot be taken in.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{field} = {value}: must be {allowed}")]
pub struct Invalid {
    /// Path of the field from the outermost message, as in a campaign file (`search.population`).
    pub field: String,
    /// What it held, or `nothing`.
    pub value: String,
    /// What it may hold.
    pub allowed: String,
}

impl Invalid {
    /// An error about `field`.
    pub fn new(field: impl Into<String>, value: impl Display, allowed: impl Into<String>) -> Self {
        Self {
            field: field.into(),
            value: value.to_string(),
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

impl From<Invalid> for tonic::Status {
    fn from(invalid: Invalid) -> Self {
        // A value from outside may be of any length.
        Self::invalid_argument(Text::line(&invalid.to_string()))
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
    Err(Invalid::new(field, value, allowed))
}

/// `value` if it is over 0 and at most `most`.
pub(crate) fn positive(field: &str, value: f64, most: f64) -> Result<f64, Invalid> {
    if value > 0.0 && value <= most {
        return Ok(value);
    }
    Err(Invalid::new(
        field,
        value,
        format!("a number over 0 and at most {most}"),
    ))
}
