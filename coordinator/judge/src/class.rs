//! The paper's classes, and patterns among random behaviours.

use murmuration_proto::{Boundary, World};
use std::fmt;

/// A class of collective behaviours (paper, Figures 3 and 8).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Class {
    /// One closed convex ring in single file, hollow, off the walls.
    CyclicPursuit,
    /// A swirl whose paths fill a band or a disc.
    Milling,
    /// One tight clump, or two.
    Aggregation,
    /// An even spread in which each agent stays in its own place.
    Dispersal,
    /// A stream along the border, or a ring pressed on walls.
    WallFollowing,
    /// A ring with agents that circle inside it.
    NestedCycle,
    /// One closed loop in single file that is not convex.
    ConcavePath,
    /// None of these.
    Random,
}

/// A pattern that the paper does not name, seen among behaviours that it calls random.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Pattern {
    /// Three or more tight groups.
    SmallClusters,
    /// Single file along an open curve.
    Chain,
    /// Groups that travel together.
    MovingClumps,
}

impl Class {
    /// Every class.
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

    /// Its name in labelled sets.
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
}

impl Class {
    /// Why no motion in `world` can be of this class; `None` if one can.
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
    /// Every pattern.
    pub const ALL: [Self; 3] = [Self::SmallClusters, Self::Chain, Self::MovingClumps];

    /// Its name in labelled sets.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::SmallClusters => "small_clusters",
            Self::Chain => "chain",
            Self::MovingClumps => "moving_clumps",
        }
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
