//! Names of classes that are nearly the same, perhaps by a typing error.

use super::ClassKey;

impl ClassKey {
    /// Whether two keys are so similar that one can be a typing error. Similar keys differ by at most one letter if the shorter
    /// key has four to seven letters, or by two letters if it is longer. Names that differ only in their numbers are not near.
    pub fn is_near(&self, other: &Self) -> bool {
        let (one, other) = (self.as_str(), other.as_str());
        let lengths = [one, other].map(|key| key.chars().count());
        let allowed = match lengths[0].min(lengths[1]) {
            0..=3 => 0,
            4..=7 => 1,
            _ => 2,
        };
        let without_digits = |key: &str| {
            key.chars()
                .filter(|letter| !letter.is_numeric())
                .collect::<String>()
        };
        // The cheap test comes first.
        lengths[0].abs_diff(lengths[1]) <= allowed
            && strsim::osa_distance(one, other) <= allowed
            && without_digits(one) != without_digits(other)
    }
}

#[cfg(test)]
mod tests {
    use crate::labels::ClassName;

    #[track_caller]
    fn check(one: &str, other: &str, expected: bool) {
        let [one, other] = [one, other].map(|name| name.parse::<ClassName>().unwrap().key());
        assert_eq!((one.is_near(&other), other.is_near(&one)), (expected, expected));
    }

    #[test]
    fn slips_of_the_keyboard_are_near() {
        check("milling", "miling", true);
        check("dispersal", "dispresal", true);
        check("Wall-Following", "wallfollowing", true);
    }

    #[test]
    fn other_words_and_numbered_names_are_not() {
        check("ring", "wall", false);
        check("two", "too", false);
        check("ring 1", "ring 2", false);
        check("cluster 9", "cluster 10", false);
        check("milling", "dispersal", false);
    }
}
