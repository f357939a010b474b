//! Numbers from outside, checked.

use murmuration_proto::Invalid;
use std::{fmt::Display, ops::RangeInclusive};

pub(crate) fn whole<T: PartialOrd + Display>(
    field: &str,
    value: T,
    range: RangeInclusive<T>,
) -> Result<(), Invalid> {
    let allowed = || format!("a whole number from {} to {}", range.start(), range.end());
    checked(range.contains(&value), field, &value, allowed)
}

/// NaN is in no range.
pub(crate) fn real(field: &str, value: f64, range: RangeInclusive<f64>) -> Result<(), Invalid> {
    let allowed = || format!("a number from {} to {}", range.start(), range.end());
    checked(range.contains(&value), field, &value, allowed)
}

pub(crate) fn over_zero(field: &str, value: f64, most: f64) -> Result<(), Invalid> {
    let allowed = || format!("a number over 0 and at most {most}");
    checked(value > 0.0 && value <= most, field, &value, allowed)
}

fn checked(
    fits: bool,
    field: &str,
    value: &impl Display,
    allowed: impl FnOnce() -> String,
) -> Result<(), Invalid> {
    if fits {
        Ok(())
    } else {
        Err(Invalid::new(field, value, allowed()))
    }
}
