//! Verdicts of the judge on a motion: the paper's classes, patterns among random behaviours, and patterns of two species.

use crate::{Boundary, Invalid, World};
use murmuration_proto::v1;
use std::fmt;

/// A class of collective behaviours (paper, Figures 3 and 8).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Class {
    /// One closed convex ring in single file, hollow, off the walls.
    CyclicPursuit,
    /// A swirl whose paths fill a band or a disc.
    Milling,
    /// One or two tight clumps.
    Aggregation,
    /// An even spread in which each agent stays in its own place.
    Dispersal,
    /// A stream along the border, or a ring pressed on walls.
    WallFollowing,
    /// A ring with agents that circle inside it.
    NestedCycle,
    /// One closed loop in single file that is not convex.
    ConcavePath,
    /// A motion of no other class.
    Random,
}

/// A pattern that the paper does not name: seen among behaviours that it calls random, or of two species.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Pattern {
    /// Three or more tight groups.
    SmallClusters,
    /// Single file along an open curve.
    Chain,
    /// Groups that travel together.
    MovingClumps,
    /// Two species: a closed rim of one species around the other.
    Containment,
    /// Two species: one species goes round inside the other, which goes round too.
    EmbeddedCycles,
    /// Two species that turn about a common middle at the same distance.
    TwoColouredMill,
    /// Two species: one species goes round in a loop of its own, and the other species is elsewhere.
    OwnRing,
}

/// The judge's verdict on a motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Verdict {
    /// A class. [`Class::Random`] means a random motion without a pattern.
    Class(Class),
    /// A motion with this pattern, of the class [`Pattern::class`].
    Pattern(Pattern),
}

impl Class {
    pub const ALL: [Self; 8] = [
        Self::CyclicPursuit,
        Self::Milling,
        Self::Aggregation,
        Self::Dispersal,
        Self::WallFollowing,
        Self::NestedCycle,
        Self::ConcavePath,
        Self::Random,
    ];

    /// Name in labelled sets.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::CyclicPursuit => "cyclic_pursuit",
            Self::Milling => "milling",
            Self::Aggregation => "aggregation",
            Self::Dispersal => "dispersal",
            Self::WallFollowing => "wall_following",
            Self::NestedCycle => "nested_cycle",
            Self::ConcavePath => "concave_path",
            Self::Random => "random",
        }
    }

    /// Name for people: `cyclic pursuit`.
    #[must_use]
    pub fn words(self) -> String {
        in_words(self.name())
    }
}

impl Class {
    /// Reason why no motion in `world` can be of this class; `None` if a motion can.
    #[must_use]
    pub fn without_meaning(self, world: &World) -> Option<&'static str> {
        match self {
            Self::WallFollowing => (world.boundary() != Boundary::Walls).then_some("the world has no walls"),
            Self::CyclicPursuit
            | Self::Milling
            | Self::Aggregation
            | Self::Dispersal
            | Self::NestedCycle
            | Self::ConcavePath => (world.agents() == 1).then_some("the swarm is one robot"),
            Self::Random => None,
        }
    }
}

impl Pattern {
    /// Every pattern. The order is that of the numbers in messages and on disk, so new patterns come last.
    pub const ALL: [Self; 7] = [
        Self::SmallClusters,
        Self::Chain,
        Self::MovingClumps,
        Self::Containment,
        Self::EmbeddedCycles,
        Self::TwoColouredMill,
        Self::OwnRing,
    ];

    /// The patterns that a judge sees without the species of the robots.
    pub const OF_ONE_SPECIES: [Self; 3] = [Self::SmallClusters, Self::Chain, Self::MovingClumps];

    /// Whether the pattern is one of two species.
    #[must_use]
    pub fn is_of_two_species(self) -> bool {
        !Self::OF_ONE_SPECIES.contains(&self)
    }

    /// The class of a motion with the pattern.
    #[must_use]
    pub const fn class(self) -> Class {
        match self {
            Self::EmbeddedCycles => Class::NestedCycle,
            Self::TwoColouredMill => Class::Milling,
            Self::SmallClusters | Self::Chain | Self::MovingClumps | Self::Containment | Self::OwnRing => {
                Class::Random
            }
        }
    }

    /// Name in labelled sets.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::SmallClusters => "small_clusters",
            Self::Chain => "chain",
            Self::MovingClumps => "moving_clumps",
            Self::Containment => "containment",
            Self::EmbeddedCycles => "embedded_cycles",
            Self::TwoColouredMill => "two_coloured_mill",
            Self::OwnRing => "own_ring",
        }
    }

    /// Name for people: `small clusters`.
    #[must_use]
    pub fn words(self) -> String {
        in_words(self.name())
    }
}

/// Replaces the underscores of a name by spaces.
fn in_words(name: &str) -> String {
    name.replace('_', " ")
}

impl Verdict {
    /// Name for people: `cyclic pursuit`.
    #[must_use]
    pub fn words(self) -> String {
        in_words(self.name())
    }

    /// Every verdict: the classes, then the patterns.
    pub fn all() -> impl Iterator<Item = Self> {
        let classes = Class::ALL.into_iter().map(Self::Class);
        classes.chain(Pattern::ALL.into_iter().map(Self::Pattern))
    }

    /// Every verdict on a swarm of one species: the classes, then the patterns.
    pub fn of_one_species() -> impl Iterator<Item = Self> {
        Self::all().filter(|verdict| !verdict.pattern().is_some_and(Pattern::is_of_two_species))
    }

    #[must_use]
    pub const fn class(self) -> Class {
        match self {
            Self::Class(class) => class,
            Self::Pattern(pattern) => pattern.class(),
        }
    }

    /// The pattern, if the verdict has a pattern.
    #[must_use]
    pub const fn pattern(self) -> Option<Pattern> {
        match self {
            Self::Class(_) => None,
            Self::Pattern(pattern) => Some(pattern),
        }
    }

    /// The name of the pattern or, without a pattern, of the class, as in labelled sets.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Class(class) => class.name(),
            Self::Pattern(pattern) => pattern.name(),
        }
    }

    /// Number of the verdict in messages and on disk, 1 to 15.
    #[must_use]
    pub fn number(self) -> u8 {
        let place = Self::all().position(|verdict| verdict == self);
        // Every verdict has a number in messages.
        place.map_or(0, |place| place as u8 + 1)
    }
}

impl TryFrom<i32> for Verdict {
    type Error = Invalid;

    /// Converts the value of an enum field of a message.
    fn try_from(number: i32) -> Result<Self, Invalid> {
        let place = usize::try_from(number)
            .ok()
            .and_then(|number| number.checked_sub(1));
        place
            .and_then(|place| Self::all().nth(place))
            .ok_or_else(|| Invalid::new("verdict", number, "the number of a class or pattern, 1 to 15"))
    }
}

impl From<Verdict> for v1::Verdict {
    fn from(verdict: Verdict) -> Self {
        Self::try_from(i32::from(verdict.number())).unwrap_or_default()
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl fmt::Display for Class {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl fmt::Display for Pattern {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_is_of_the_verdict_that_the_message_names() {
        for verdict in Verdict::all() {
            let number = i32::from(verdict.number());
            assert_eq!(Verdict::try_from(number), Ok(verdict));
            let named = v1::Verdict::from(verdict).as_str_name().to_lowercase();
            assert_eq!(named, format!("verdict_{verdict}"));
            assert_eq!(v1::Verdict::from(verdict) as i32, number);
        }
        for number in [-1, 0, 16, i32::MAX] {
            assert!(Verdict::try_from(number).is_err(), "{number}");
        }
    }
}
