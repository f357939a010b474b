//! Numbers and counted nouns for people.

use indicatif::HumanCount;

/// A number with a comma between thousands: `12,345,678`.
#[must_use]
pub fn grouped(number: u64) -> String {
    HumanCount(number).to_string()
}

/// A measured figure: four decimals, `0.1235`, or an exponent where its whole part would be long, `1.2345e308`.
#[must_use]
pub fn figure(value: f64) -> String {
    rounded(value, 4)
}

/// A figure with this number of decimals, and with an exponent where its whole part would be long.
#[must_use]
pub fn rounded(value: f64, decimals: usize) -> String {
    match value.abs() < 1e6 {
        true => format!("{value:.decimals$}"),
        false => format!("{value:.decimals$e}"),
    }
}

/// A number in full precision, with an exponent if it would otherwise have many digits.
#[must_use]
pub fn in_full(value: f64) -> String {
    let size = value.abs();
    match size >= 1e16 || (size > 0.0 && size < 1e-5) {
        true => format!("{value:e}"),
        false => value.to_string(),
    }
}

/// The form of an English noun for a count: `worker` for one, `workers` for any other number. Irregular plurals, such as
/// `men`, are not supported.
#[must_use]
pub fn noun(count: u64, singular: &str) -> String {
    if count == 1 {
        return singular.to_owned();
    }
    let is_consonant = |letter: char| !"aeiou".contains(letter);
    match singular.strip_suffix('y') {
        Some(stem) if stem.ends_with(is_consonant) => format!("{stem}ies"),
        // The `ch` of `epoch` is spoken like a k.
        _ if singular.ends_with("och") => format!("{singular}s"),
        _ if ["s", "x", "ch", "sh"].iter().any(|end| singular.ends_with(end)) => format!("{singular}es"),
        _ => format!("{singular}s"),
    }
}

/// A number with its noun: `1 worker`, `12,345 workers`.
#[must_use]
pub fn counted(count: u64, singular: &str) -> String {
    format!("{} {}", grouped(count), noun(count, singular))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_is_singular_and_every_other_number_is_not() {
        let texts = [0, 1, 2, 1_234_567].map(|count| counted(count, "worker"));
        assert_eq!(texts, ["0 workers", "1 worker", "2 workers", "1,234,567 workers"]);
    }

    #[test]
    fn no_figure_has_hundreds_of_digits() {
        let texts = [0.123_45, -12.0, 999_999.0, 1e308, f64::NAN].map(figure);
        assert_eq!(texts, ["0.1235", "-12.0000", "999999.0000", "1.0000e308", "NaN"]);
        assert_eq!([1.25, -1e301].map(|value| rounded(value, 1)), ["1.2", "-1.0e301"]);
        let texts = [0.0, 7.0, -0.123_456_789, 1e15, 1e301, -5e-324].map(in_full);
        assert_eq!(
            texts,
            ["0", "7", "-0.123456789", "1000000000000000", "1e301", "-5e-324"]
        );
    }

    #[test]
    fn plurals_are_spelled_as_in_english() {
        let plurals =
            ["class", "entry", "day", "box", "branch", "pass", "epoch"].map(|singular| noun(2, singular));
        assert_eq!(
            plurals,
            [
                "classes", "entries", "days", "boxes", "branches", "passes", "epochs"
            ]
        );
    }
}
