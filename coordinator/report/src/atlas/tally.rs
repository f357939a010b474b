//! What the trials of a controller come to.

use murmuration_proto::{Class, Verdict};

/// What the judge said of the trials of a controller.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tally {
    /// The most frequent class; of several, that of the earliest trial.
    pub class: Class,
    /// The share of trials that are of it, over 0 to 1.
    pub share: f64,
}

impl Tally {
    /// That of at least one trial.
    #[must_use]
    pub fn of(verdicts: &[Verdict]) -> Self {
        let of = |class: Class| verdicts.iter().filter(|verdict| verdict.class() == class).count();
        let mut most = (Class::Random, 0);
        for class in verdicts.iter().map(|verdict| verdict.class()) {
            if of(class) > most.1 {
                most = (class, of(class));
            }
        }
        Self {
            class: most.0,
            share: most.1 as f64 / verdicts.len().max(1) as f64,
        }
    }

    /// How sure the class is, over 0 to under 1: the share of trials that are of it, times how likely people are to
    /// call them so too.
    #[must_use]
    pub fn sureness(&self) -> f64 {
        self.share * precision(self.class)
    }
}

/// Of how many motions that the judge calls by this class people call them so too, and how many it calls so: on the
/// validation parts of all labelled sets (`docs/judge.md`).
#[must_use]
pub const fn agreed(class: Class) -> [u32; 2] {
    match class {
        Class::CyclicPursuit => [43, 44],
        Class::Milling => [15, 21],
        Class::Aggregation => [17, 20],
        Class::Dispersal => [76, 80],
        Class::WallFollowing => [14, 18],
        Class::NestedCycle => [14, 17],
        Class::ConcavePath => [14, 18],
        Class::Random => [205, 223],
    }
}

/// How likely people are to call a motion by the class that the judge gives it, over 0 to under 1: by the rule of
/// succession, since some classes were seldom met.
#[must_use]
pub fn precision(class: Class) -> f64 {
    let [agreed, all] = agreed(class);
    f64::from(agreed + 1) / f64::from(all + 2)
}
