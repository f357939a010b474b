//! Comparisons: which of two behaviours is more like a third.

use super::{Annotator, ClassKey};
use murmuration_proto::{Class, Invalid};
use std::{
    collections::{BTreeMap, BTreeSet},
    fmt,
    str::FromStr,
};

/// A question of comparison: is the behaviour on the left more like the reference, or the one on the right? Three different
/// individuals.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Triple {
    reference: u64,
    left: u64,
    right: u64,
}

/// The answer to a question of comparison.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Preference {
    /// The behaviour on the left is more like the reference.
    Left,
    /// The behaviour on the right is more like the reference.
    Right,
    /// Neither is, or both are: nothing is learned from it.
    Neither,
}

/// A comparison that stands.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Comparison {
    /// Its entry in the log.
    pub entry: u64,
    /// What was asked.
    pub triple: Triple,
    /// The answer.
    pub preference: Preference,
    /// Who answered.
    pub annotator: Annotator,
    /// When, milliseconds since 1970-01-01 UTC.
    pub time_ms: u64,
}

/// What a comparison says: `nearer` is more like `anchor` than `farther` is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct ComparedTriplet {
    /// The reference of the question.
    pub anchor: u64,
    /// The individual that is more like it.
    pub nearer: u64,
    /// The other individual.
    pub farther: u64,
}

impl Triple {
    /// A question about these three individuals.
    ///
    /// # Errors
    /// If two of them are the same.
    pub fn new(reference: u64, left: u64, right: u64) -> Result<Self, Invalid> {
        if left == reference {
            return Err(Invalid::new(
                "left",
                left,
                "another individual than the reference",
            ));
        }
        if right == reference || right == left {
            let allowed = "another individual than the reference and the left one";
            return Err(Invalid::new("right", right, allowed));
        }
        Ok(Self {
            reference,
            left,
            right,
        })
    }

    /// Index of the individual that the others are compared with.
    #[must_use]
    pub const fn reference(&self) -> u64 {
        self.reference
    }

    /// Index of the individual on the left.
    #[must_use]
    pub const fn left(&self) -> u64 {
        self.left
    }

    /// Index of the individual on the right.
    #[must_use]
    pub const fn right(&self) -> u64 {
        self.right
    }

    /// All three: reference, left, right.
    #[must_use]
    pub const fn individuals(&self) -> [u64; 3] {
        [self.reference, self.left, self.right]
    }

    /// The same question with the lower index on the left: questions that differ in sides alone are one.
    #[must_use]
    pub fn in_order(self) -> Self {
        let (left, right) = (self.left.min(self.right), self.left.max(self.right));
        Self { left, right, ..self }
    }

    /// What an answer to this question says; nothing if it is [`Preference::Neither`].
    #[must_use]
    pub const fn triplet(&self, preference: Preference) -> Option<ComparedTriplet> {
        let (nearer, farther) = match preference {
            Preference::Left => (self.left, self.right),
            Preference::Right => (self.right, self.left),
            Preference::Neither => return None,
        };
        Some(ComparedTriplet {
            anchor: self.reference,
            nearer,
            farther,
        })
    }
}

impl Preference {
    /// Every answer.
    pub const ALL: [Self; 3] = [Self::Left, Self::Right, Self::Neither];

    /// Its name in messages and on disk: `left`, `right` or `neither`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Left => "left",
            Self::Right => "right",
            Self::Neither => "neither",
        }
    }

    /// The answer of somebody who goes by classes: the side that alone has the class of the reference. Behaviours of the class
    /// `random` need not be alike, so nothing is like one of them.
    #[must_use]
    pub fn of_classes(reference: &str, left: &str, right: &str) -> Self {
        let class = ClassKey::from(reference);
        if class == ClassKey::from(Class::Random.name()) {
            return Self::Neither;
        }
        match [left, right].map(|other| ClassKey::from(other) == class) {
            [true, false] => Self::Left,
            [false, true] => Self::Right,
            [true, true] | [false, false] => Self::Neither,
        }
    }
}

impl fmt::Display for Preference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Preference {
    type Err = Invalid;

    fn from_str(name: &str) -> Result<Self, Invalid> {
        let named = Self::ALL.into_iter().find(|answer| answer.name() == name);
        named.ok_or_else(|| {
            let given = murmuration_proto::text::quoted(name);
            Invalid::new("preference", given, "\"left\", \"right\" or \"neither\"")
        })
    }
}

impl Comparison {
    /// What it says; nothing if neither was more like the reference.
    #[must_use]
    pub const fn triplet(&self) -> Option<ComparedTriplet> {
        self.triple.triplet(self.preference)
    }
}

/// The comparisons of a log, as far as they stand. An annotator has at most one about a question.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Comparisons {
    /// By entry.
    standing: BTreeMap<u64, Comparison>,
    /// The entry of each, by annotator and question.
    own: BTreeMap<Annotator, BTreeMap<Triple, u64>>,
}

impl Comparisons {
    /// A comparison stands; the entry of the annotator's former answer to the same question, which does not any more.
    pub(super) fn add(&mut self, comparison: Comparison) -> Option<u64> {
        let own = self.own.entry(comparison.annotator.clone()).or_default();
        let former = own.insert(comparison.triple.in_order(), comparison.entry);
        if let Some(former) = former {
            self.standing.remove(&former);
        }
        self.standing.insert(comparison.entry, comparison);
        former
    }

    /// The annotator's comparison of this entry stands no more; whether it did.
    pub(super) fn withdraw(&mut self, entry: u64, annotator: &Annotator) -> bool {
        let is_own = |comparison: &Comparison| comparison.annotator == *annotator;
        if !self.standing.get(&entry).is_some_and(is_own) {
            return false;
        }
        if let Some(comparison) = self.standing.remove(&entry)
            && let Some(own) = self.own.get_mut(annotator)
        {
            own.remove(&comparison.triple.in_order());
        }
        true
    }

    pub(super) fn standing(&self) -> impl Iterator<Item = &Comparison> {
        self.standing.values()
    }

    /// The entry of an annotator's newest comparison.
    pub(super) fn newest(&self, annotator: &Annotator) -> Option<u64> {
        self.own.get(annotator)?.values().max().copied()
    }

    /// Number of comparisons of an annotator.
    pub(super) fn count_of(&self, annotator: &Annotator) -> usize {
        self.own.get(annotator).map_or(0, BTreeMap::len)
    }

    /// The questions that somebody has answered, with the lower index on the left.
    pub(super) fn questions(&self) -> BTreeSet<Triple> {
        let asked = self.standing.values();
        asked.map(|comparison| comparison.triple.in_order()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triple(reference: u64, left: u64, right: u64) -> Triple {
        Triple::new(reference, left, right).unwrap()
    }

    fn comparison(entry: u64, annotator: &str, triple: Triple, preference: Preference) -> Comparison {
        Comparison {
            entry,
            triple,
            preference,
            annotator: annotator.parse().unwrap(),
            time_ms: 0,
        }
    }

    #[test]
    fn a_question_is_about_three_individuals_and_the_field_that_repeats_one_is_named() {
        assert_eq!(triple(1, 2, 3).individuals(), [1, 2, 3]);
        assert_eq!(Triple::new(1, 1, 3).unwrap_err().field, "left");
        assert_eq!(Triple::new(1, 2, 1).unwrap_err().field, "right");
        assert_eq!(Triple::new(1, 2, 2).unwrap_err().field, "right");
        assert_eq!(triple(1, 3, 2).in_order(), triple(1, 2, 3));
        assert_ne!(triple(2, 1, 3).in_order(), triple(1, 2, 3).in_order());
    }

    #[test]
    fn what_is_more_alike_is_nearer_and_neither_says_nothing() {
        let question = triple(7, 4, 9);
        let says = |preference| {
            let triplet = question.triplet(preference)?;
            Some([triplet.anchor, triplet.nearer, triplet.farther])
        };
        assert_eq!(says(Preference::Left), Some([7, 4, 9]));
        assert_eq!(says(Preference::Right), Some([7, 9, 4]));
        assert_eq!(says(Preference::Neither), None);
    }

    #[test]
    fn who_goes_by_classes_chooses_the_side_that_alone_has_the_class_of_the_reference() {
        let of = Preference::of_classes;
        assert_eq!(of("ring", "Ring", "wall"), Preference::Left);
        assert_eq!(of("ring", "wall", "ring"), Preference::Right);
        assert_eq!(of("ring", "ring", "ring"), Preference::Neither);
        assert_eq!(of("ring", "wall", "clump"), Preference::Neither);
        assert_eq!(of("random", "random", "ring"), Preference::Neither);
        for preference in Preference::ALL {
            assert_eq!(preference.name().parse(), Ok(preference));
        }
        assert_eq!("up".parse::<Preference>().unwrap_err().field, "preference");
    }

    #[test]
    fn an_annotator_has_one_answer_to_a_question_and_withdraws_only_their_own() {
        let mut comparisons = Comparisons::default();
        let ana: Annotator = "ana".parse().unwrap();
        let first = comparison(0, "ana", triple(1, 2, 3), Preference::Left);
        assert_eq!(comparisons.add(first), None);
        let ben = comparison(1, "ben", triple(1, 2, 3), Preference::Right);
        assert_eq!(comparisons.add(ben), None);
        // The sides do not matter.
        let again = comparison(2, "ana", triple(1, 3, 2), Preference::Left);
        assert_eq!(comparisons.add(again), Some(0));
        let other = comparison(3, "ana", triple(2, 1, 3), Preference::Neither);
        assert_eq!(comparisons.add(other), None);
        assert_eq!(
            (comparisons.newest(&ana), comparisons.count_of(&ana)),
            (Some(3), 2)
        );
        assert!(!comparisons.withdraw(1, &ana) && !comparisons.withdraw(0, &ana));
        assert!(comparisons.withdraw(3, &ana) && !comparisons.withdraw(3, &ana));
        assert_eq!(
            (comparisons.newest(&ana), comparisons.count_of(&ana)),
            (Some(2), 1)
        );
        let left: Vec<u64> = comparisons.standing().map(|one| one.entry).collect();
        assert_eq!(left, [1, 2]);
        assert_eq!(comparisons.questions(), BTreeSet::from([triple(1, 2, 3)]));
    }
}
