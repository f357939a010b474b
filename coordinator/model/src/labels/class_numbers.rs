//! Classes as trainers know them: by number.

use super::ClassKey;
use murmuration_proto::Class;
use murmuration_trainer::labelled_pictures::LabelledPictures;
use std::collections::{BTreeMap, BTreeSet};

/// The number of each of these classes: [`LabelledPictures::RANDOM`] that of [`Class::Random`], however it is spelled, the
/// others from 1 by name.
pub fn class_numbers<'a>(names: impl IntoIterator<Item = &'a str>) -> BTreeMap<&'a str, u32> {
    let (random, named): (BTreeSet<_>, BTreeSet<_>) = names
        .into_iter()
        .partition(|name| ClassKey::from(*name) == ClassKey::from(Class::Random.name()));
    let random = random.into_iter().map(|name| (name, LabelledPictures::RANDOM));
    random.chain(named.into_iter().zip(1..)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    const RANDOM: &str = Class::Random.name();

    #[test]
    fn random_has_a_number_of_its_own_and_no_other_class_has_it() {
        let numbers = class_numbers(["ring", RANDOM, "clump", "ring"]);
        assert_eq!(numbers, BTreeMap::from([("clump", 1), (RANDOM, 0), ("ring", 2)]));
        assert_eq!(class_numbers(["ring"]), BTreeMap::from([("ring", 1)]));
        assert_eq!(
            class_numbers(["Random", "a"]),
            BTreeMap::from([("Random", 0), ("a", 1)])
        );
    }
}
