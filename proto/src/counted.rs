//! Numbers, and the nouns that they count, as people read them.

/// A number with a comma between thousands: `12,345,678`.
#[must_use]
pub fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::with_capacity(digits.len() + digits.len() / 3);
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// The form of an English noun that goes with a count: of `worker`, `worker` for one and `workers` for any other number.
/// Nouns with a plural of their own, such as `man`, are not known.
#[must_use]
pub fn noun(count: u64, singular: &str) -> String {
    if count == 1 {
        return singular.to_owned();
    }
    let is_consonant = |letter: char| !"aeiou".contains(letter);
    match singular.strip_suffix('y') {
        Some(stem) if stem.ends_with(is_consonant) => format!("{stem}ies"),
        // An epoch ends like a stomach.
        _ if singular.ends_with("och") => format!("{singular}s"),
        _ if ["s", "x", "ch", "sh"].iter().any(|end| singular.ends_with(end)) => format!("{singular}es"),
        _ => format!("{singular}s"),
    }
}

/// A number and what it counts: `1 worker`, `12,345 workers`.
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
