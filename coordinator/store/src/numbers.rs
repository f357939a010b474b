//! Conversions of numbers to and from the values of columns.

use std::time::{SystemTime, UNIX_EPOCH};

/// The index as an integer of SQLite, which is at most 2^63 - 1.
pub(super) fn clamped(index: u64) -> i64 {
    i64::try_from(index).unwrap_or(i64::MAX)
}

pub(super) fn floats_to_blob(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

pub(super) fn blob_to_floats(blob: &[u8]) -> Vec<f64> {
    blob.as_chunks()
        .0
        .iter()
        .map(|bytes| f64::from_le_bytes(*bytes))
        .collect()
}

pub(super) fn numbers_to_blob(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

pub(super) fn blob_to_numbers(blob: &[u8]) -> Vec<f32> {
    blob.as_chunks()
        .0
        .iter()
        .map(|bytes| f32::from_le_bytes(*bytes))
        .collect()
}

/// The current time, milliseconds since 1970-01-01 UTC.
pub(super) fn now_ms() -> i64 {
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0, |age| age.as_millis() as i64)
}
