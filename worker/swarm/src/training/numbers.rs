//! Numbers of recipes in messages.

use crate::{
    Invalid,
    invalid::{positive, real},
};

/// The given count, or the default.
pub(super) fn size(given: Option<u64>, default: usize) -> usize {
    given.map_or(default, |given| given as usize)
}

/// The smallest and the largest share of width and height that a crop keeps; the default if `given` is empty.
pub(super) fn crop(field: &str, given: &[f64], default: [f64; 2]) -> Result<[f64; 2], Invalid> {
    let [least, most] = match *given {
        [] => default,
        [least, most] => [least, most],
        _ => return Err(Invalid::new(field, format!("{given:?}"), "two numbers")),
    };
    positive(&format!("{field}[0]"), least, 2.0)?;
    real(&format!("{field}[1]"), most, least..=2.0)?;
    Ok([least, most])
}
