//! The values of JSON objects by key, with errors that name the key.

use murmuration_swarm::Invalid;
use serde_json::{Map, Value};

/// The values of an object by key; `null` counts as missing.
#[derive(Clone, Copy)]
pub(super) struct Keys<'a>(&'a Map<String, Value>);

impl<'a> Keys<'a> {
    pub(super) const fn new(object: &'a Map<String, Value>) -> Self {
        Self(object)
    }

    /// The values of `value`, which must be an object.
    pub(super) fn of(key: &str, value: &'a Value) -> Result<Self, Invalid> {
        let object = value.as_object();
        object
            .map(Self)
            .ok_or_else(|| Invalid::new(key, shown(value), "an object"))
    }

    pub(super) fn get(self, key: &str) -> Option<&'a Value> {
        self.0.get(key).filter(|value| !value.is_null())
    }

    pub(super) fn required(self, key: &str) -> Result<&'a Value, Invalid> {
        self.get(key).ok_or_else(|| Invalid::missing(key, "given"))
    }

    pub(super) fn number(self, key: &str) -> Result<Option<f64>, Invalid> {
        self.get(key).map(|value| number(key, value)).transpose()
    }

    pub(super) fn whole(self, key: &str) -> Result<Option<u32>, Invalid> {
        self.get(key).map(|value| whole(key, value)).transpose()
    }

    pub(super) fn flag(self, key: &str) -> Result<Option<bool>, Invalid> {
        let flag = |value: &Value| {
            let flag = value.as_bool();
            flag.ok_or_else(|| Invalid::new(key, shown(value), "true or false"))
        };
        self.get(key).map(flag).transpose()
    }
}

pub(super) fn array<'a>(key: &str, value: &'a Value) -> Result<&'a [Value], Invalid> {
    let array = value.as_array().map(Vec::as_slice);
    array.ok_or_else(|| Invalid::new(key, shown(value), "an array"))
}

pub(super) fn numbers(key: &str, value: &Value) -> Result<Vec<f64>, Invalid> {
    let numbers = array(key, value)?.iter().enumerate();
    numbers
        .map(|(i, value)| number(&format!("{key}[{i}]"), value))
        .collect()
}

pub(super) fn number(key: &str, value: &Value) -> Result<f64, Invalid> {
    let number = value.as_f64();
    number.ok_or_else(|| Invalid::new(key, shown(value), "a number"))
}

/// An integer, which other programs may have written as `1200.0`.
fn whole(key: &str, value: &Value) -> Result<u32, Invalid> {
    let number = value.as_f64().filter(|number| number.fract() == 0.0);
    let range = 0.0..=f64::from(u32::MAX);
    let whole = number
        .filter(|number| range.contains(number))
        .map(|number| number as u32);
    whole.ok_or_else(|| Invalid::new(key, shown(value), "a whole number"))
}

/// A value as text for an error, shortened.
pub(super) fn shown(value: &Value) -> String {
    let text = value.to_string();
    if text.len() <= 60 {
        return text;
    }
    let start: String = text.chars().take(57).collect();
    format!("{start}...")
}
