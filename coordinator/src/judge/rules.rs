//! From measures to a class: a list of rules, of which the first that holds decides.
//!
//! Thresholds were chosen on the training parts of the labelled sets and rounded. The validation parts were looked at on
//! the way, and errors there prompted the rule for small loops: agreement with them is a little flattered. Lengths are in the units that
//! [`Scale`](super::Scale) gives.

use super::{Arrangement, Body, Class, Measures, Motion, Pattern, Walls};

/// A clump's median distance from its middle, in packed radii (a tight disc has 0.7).
const CLUMP_SPREAD: f64 = 1.78;
/// A cluster has at least so many agents: two may meet by chance.
const CLUSTER: usize = 3;

impl Class {
    /// The class of a motion with these measures.
    #[must_use]
    pub fn of(measures: &Measures) -> Self {
        let Measures {
            arrangement,
            motion,
            body,
            walls,
        } = measures;
        if follows_walls(body, walls) {
            Self::WallFollowing
        } else if goes_round(body) && is_nested(body) {
            Self::NestedCycle
        } else if goes_round(body) || is_closed_rim(arrangement, body) {
            Self::CyclicPursuit
        } else if is_loop(motion, body) || is_small_loop(arrangement, motion, body) {
            Self::ConcavePath
        } else if is_clump(arrangement) || are_two_clumps(arrangement, motion) {
            Self::Aggregation
        } else if swirls(arrangement, motion, body) || swirl_apart(motion) {
            Self::Milling
        } else if is_even(arrangement, motion, body) || keep_circling(arrangement, motion, body) {
            Self::Dispersal
        } else {
            Self::Random
        }
    }
}

impl Pattern {
    /// The pattern of a motion with these measures, of the class random.
    #[must_use]
    pub fn of(measures: &Measures) -> Option<Self> {
        let Measures {
            arrangement,
            motion,
            body,
            walls,
        } = measures;
        let clusters = arrangement.clusters.iter().filter(|&&size| size >= CLUSTER);
        let agents: usize = arrangement.clusters.iter().sum();
        let clustered = clusters.clone().sum::<usize>() as f64 / agents.max(1) as f64;
        let clusters = clusters.count();
        // Single file keeps its distance, which clumps that creep along do not.
        let in_file = motion.following >= 0.25 && arrangement.contact <= 0.8 && arrangement.packing <= 12.5;
        if in_file && body.round >= 0.1 && arrangement.spread <= 7.5 && walls.near <= 0.32 {
            return Some(Self::Chain);
        }
        let touching = arrangement.contact >= 0.55 && arrangement.spread <= 3.8;
        if clusters >= 2 && clustered >= 0.7 && touching && motion.net >= 0.4 {
            return Some(Self::MovingClumps);
        }
        let close = arrangement.crowded >= 0.85 && arrangement.spread <= 8.75;
        (clusters >= 3 && clustered >= 0.5 && close).then_some(Self::SmallClusters)
    }
}

/// A ring that leans on walls, or a stream along them all: agents inside do not matter to the second.
fn follows_walls(body: &Body, walls: &Walls) -> bool {
    // A quarter of the time at a wall is more than where a ring off the walls grazes one.
    let pressed = walls.near >= 0.27 && body.one_way >= 0.95 && body.tangential >= 0.78;
    pressed || walls.along >= 0.69 && walls.circulation >= 0.6 && walls.way >= 0.4
}

/// Nearly all agents go the same way round on the rim; a fifth may be strays.
fn goes_round(body: &Body) -> bool {
    body.one_way >= 0.8 && body.tangential >= 0.92 && body.depth <= 0.11
}

/// One agent inside is enough: the annotators were divided on it.
fn is_nested(body: &Body) -> bool {
    body.inside > 0.0 && body.deepest >= 0.22
}

/// A rim without gaps, however slowly it turns, with few agents inside: a tight clump has a rim too. One as wide as the
/// arena is a dispersal at the walls.
fn is_closed_rim(arrangement: &Arrangement, body: &Body) -> bool {
    let rim = body.depth <= 0.047 && body.gap <= 0.9 && body.inside <= 0.25;
    rim && arrangement.spread <= 6.4
}

/// Single file around an empty middle, at least four tenths of a turn in the window: paths that wave leave the rim.
fn is_loop(motion: &Motion, body: &Body) -> bool {
    body.round >= 2.75 && motion.following >= 0.55 && body.deepest <= 0.48 && body.hollow >= 0.2
}

/// A loop so small that bodies fill it: what is left of the middle shows in the motion around it.
fn is_small_loop(arrangement: &Arrangement, motion: &Motion, body: &Body) -> bool {
    let loose = motion.following >= 0.16 && body.tangential >= 0.78;
    arrangement.spread <= CLUMP_SPREAD && loose && body.gap <= 1.0 && body.hollow >= 0.2
}

fn is_clump(arrangement: &Arrangement) -> bool {
    arrangement.spread <= CLUMP_SPREAD
}

/// Two tight clumps that stay where they are.
fn are_two_clumps(arrangement: &Arrangement, motion: &Motion) -> bool {
    arrangement.in_two_clusters() >= 0.98 && arrangement.packing <= 4.4 && motion.net <= 0.35
}

/// A disc or band that turns as a whole, its agents on curves of their own.
fn swirls(arrangement: &Arrangement, motion: &Motion, body: &Body) -> bool {
    body.round >= 0.42 && motion.turning >= 1.08 && arrangement.crowded >= 0.33
}

/// Agents on circles of one sense that overlap, about several centres.
fn swirl_apart(motion: &Motion) -> bool {
    motion.crossed >= 1.66 && motion.turning >= 2.0 && motion.one_sense >= 0.7 && motion.reach >= 0.24
}

/// Hardly any two agents are close, none goes far, and no side is empty.
fn is_even(arrangement: &Arrangement, motion: &Motion, body: &Body) -> bool {
    let apart = arrangement.crowded <= 0.23 && arrangement.contact <= 0.3;
    apart && motion.net <= 0.46 && body.gap <= 1.23
}

/// Agents on small circles of their own, whose centres are spread out.
fn keep_circling(arrangement: &Arrangement, motion: &Motion, body: &Body) -> bool {
    let apart = arrangement.crowded_homes <= 0.4 && motion.far_reach <= 0.55;
    apart && motion.turning >= 3.3 && body.gap <= 1.23
}
