//! Formats numbers for people.

use murmuration_swarm::CampaignSpec;
pub(super) use murmuration_swarm::{counted, grouped};

/// A number with about three significant digits: `0.0123`, `1.23`, `1,235`.
pub(super) fn short(number: f64) -> String {
    match number.abs() {
        size if size >= 1e15 || !size.is_finite() => format!("{number:.2e}"),
        size if size >= 1000.0 && number > 0.0 => grouped(number.round() as u64),
        size if size >= 100.0 => format!("{number:.0}"),
        size if size >= 10.0 => format!("{number:.1}"),
        size if size >= 1.0 || size == 0.0 => format!("{number:.2}"),
        size if size >= 0.1 => format!("{number:.3}"),
        size if size >= 0.001 => format!("{number:.4}"),
        _ => format!("{number:.1e}"),
    }
}

/// `part` of `whole` in percent: `12.3 %`; `0 %` if `whole` is 0.
pub(super) fn percent(part: u64, whole: u64) -> String {
    match whole {
        0 => "0 %".to_owned(),
        _ => format!("{:.1} %", 100.0 * part as f64 / whole as f64),
    }
}

/// Sentence about the individuals that a taxonomy covers; `None` if it covers all.
pub fn sample_in_words(spec: &CampaignSpec) -> Option<String> {
    let sample = spec.sample()?;
    // Two standard errors of a share of one half, the share with the largest error, rounded up.
    let error = (1000.0 / f64::from(sample).sqrt()).ceil() / 10.0;
    Some(format!(
        "The taxonomy covers the first {} individuals, an even sample of the controllers: a share of all individuals differs from \
         the share shown by at most {error:.1} percentage points, with 95 % confidence.",
        grouped(sample.into())
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well() {
        assert_eq!(
            [0, 999, 1000, 1_234_567].map(grouped),
            ["0", "999", "1,000", "1,234,567"]
        );
        let texts = [
            0.0, 0.012_346, 0.5, 1.234_56, 12.345, 123.45, 1234.5, -2.5, 1e-9, 1e20,
        ]
        .map(short);
        assert_eq!(
            texts,
            [
                "0.00", "0.0123", "0.500", "1.23", "12.3", "123", "1,235", "-2.50", "1.0e-9", "1.00e20"
            ]
        );
        assert_eq!([percent(1, 8), percent(0, 0)], ["12.5 %", "0 %"]);
    }
}
