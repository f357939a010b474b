//! The rules that derive a class from measures. The first rule that holds decides.
//!
//! The thresholds were chosen on the training parts of the labelled sets: on the motions that annotators saw, and on this
//! simulator's motions from the same starts. The two kinds of motions differ for chaotic swarms. Lengths are in the units of
//! [`Scale`](super::Scale). For the accuracy of the rules see `docs/judge.md`.

use super::{Against, Alone, Arrangement, Body, Measures, Motion, Pair, Walls, window::ratio};
use murmuration_swarm::{Class, Pattern, World};

/// Maximum spread of a clump: the median distance of its agents from its middle, in packed radii. A tight disc has 0.7.
const CLUMP_SPREAD: f64 = 1.78;
/// Minimum number of agents of a cluster: two agents can meet by chance.
const CLUSTER: usize = 3;
/// Minimum number of robots of a species that is a ring of its own, and of each species of a two-coloured mill.
const RING: usize = 5;
/// Minimum ratio of the radii of two species that turn at the same radius.
const SAME_RADIUS: f64 = 0.72;
/// Maximum distance of the middles of two species that turn about a common middle, in radii of the wider species' paths.
const COMMON_MIDDLE: f64 = 0.3;

impl Measures {
    /// The class of a motion with these measures in `world`: [`Class::Random`] if the rules' class has no meaning in that world.
    #[must_use]
    pub fn class(&self, world: &World) -> Class {
        let class = self.class_by_rules();
        match class.without_meaning(world) {
            Some(_) => Class::Random,
            None => class,
        }
    }

    fn class_by_rules(&self) -> Class {
        let Self {
            arrangement,
            motion,
            body,
            walls,
        } = self;
        if follows_walls(body, walls) {
            Class::WallFollowing
        } else if goes_round(body) && is_nested(body) {
            Class::NestedCycle
        } else if goes_round(body) || is_closed_rim(arrangement, body) {
            Class::CyclicPursuit
        } else if is_loop(motion, body) || is_small_loop(arrangement, motion, body) {
            Class::ConcavePath
        } else if is_closed_file(motion, body) {
            Class::CyclicPursuit
        } else if is_clump(arrangement) || are_two_clumps(arrangement, motion) {
            Class::Aggregation
        } else if swirls(arrangement, motion, body, walls)
            || swirls_to_the_middle(body)
            || swirl_apart(motion)
        {
            Class::Milling
        } else if is_even(arrangement, motion, body) || keep_circling(arrangement, motion) {
            Class::Dispersal
        } else {
            Class::Random
        }
    }

    /// The pattern of a motion of the class `random` with these measures.
    #[must_use]
    pub fn pattern(&self) -> Option<Pattern> {
        let Self {
            arrangement,
            motion,
            body,
            walls,
        } = self;
        let clusters = arrangement.clusters.iter().filter(|&&size| size >= CLUSTER);
        let agents: usize = arrangement.clusters.iter().sum();
        let clustered = clusters.clone().sum::<usize>() as f64 / agents.max(1) as f64;
        let clusters = clusters.count();
        // Agents in single file keep their distance; agents in a slowly moving clump do not.
        let in_file = motion.following >= 0.25 && arrangement.contact <= 0.8 && arrangement.packing <= 12.5;
        if in_file && body.round >= 0.1 && arrangement.spread <= 7.5 && walls.near <= 0.32 {
            return Some(Pattern::Chain);
        }
        let touching = arrangement.contact >= 0.55 && arrangement.spread <= 3.8;
        if clusters >= 2 && clustered >= 0.7 && touching && motion.net >= 0.4 {
            return Some(Pattern::MovingClumps);
        }
        let close = arrangement.crowded >= 0.85 && arrangement.spread <= 8.75;
        let apart = clusters >= 3 && clustered >= 0.5 && close;
        // Even two agents that turn about each other are a group.
        let turning = arrangement.homes <= 0.22 && motion.turning >= 2.0;
        (apart || turning).then_some(Pattern::SmallClusters)
    }
}

impl Pair {
    /// The pattern of a motion with these measures, if the class of the whole swarm in `world` is `class`.
    #[must_use]
    pub fn pattern(&self, class: Class, world: &World) -> Option<Pattern> {
        let has_own_ring = || {
            let is_open = matches!(class, Class::Random | Class::Milling | Class::WallFollowing);
            (is_open && self.has_own_ring(world)).then_some(Pattern::OwnRing)
        };
        // A stream along all walls surrounds everything.
        let is_stream = class == Class::WallFollowing && !self.has_no_stray_species();
        let joint = self.joint_pattern().filter(|_| !is_stream);
        joint.or_else(has_own_ring)
    }

    /// The pattern that both species form together, if there is one: they turn together, or one surrounds the other.
    #[must_use]
    pub fn joint_pattern(&self) -> Option<Pattern> {
        let [both_turn, both_mill] =
            [turns, mills].map(|holds| self.alone.iter().all(|species| holds(&species.measures.body)));
        let enough = self.alone.iter().all(|species| species.robots >= RING);
        if both_mill && enough && self.offset <= COMMON_MIDDLE && self.narrower() >= SAME_RADIUS {
            Some(Pattern::TwoColouredMill)
        } else if both_turn && self.against.iter().any(is_loop_around) {
            Some(Pattern::EmbeddedCycles)
        } else if self.against.iter().any(is_closed_rim_around) {
            Some(Pattern::Containment)
        } else {
            None
        }
    }

    /// Whether one species goes round in a loop of its own. Both species have a loop of their own only if they are apart.
    #[must_use]
    pub fn has_own_ring(&self, world: &World) -> bool {
        self.alone.iter().any(|species| species.is_ring(world))
    }

    /// Whether each species is more than the strays of a swarm: a fifth of all robots.
    #[must_use]
    pub fn has_no_stray_species(&self) -> bool {
        let robots = self.alone.each_ref().map(|species| species.robots);
        robots.iter().all(|&own| 5 * own >= robots.iter().sum())
    }

    /// The smaller radius of the two species, divided by the larger.
    fn narrower(&self) -> f64 {
        let [a, b] = self.alone.each_ref().map(|species| species.radius);
        ratio(a.min(b), a.max(b))
    }
}

impl Alone {
    /// At least five robots that go round in a loop, as if they were the whole swarm.
    fn is_ring(&self, world: &World) -> bool {
        let Body {
            tangential, round, ..
        } = self.measures.body;
        let is_loop = matches!(
            self.measures.class(world),
            Class::CyclicPursuit | Class::NestedCycle | Class::ConcavePath
        );
        self.robots >= RING && is_loop && tangential >= 0.92 && round >= 0.3
    }
}

/// Nearly all robots go the same way round, with or without an empty middle.
fn turns(body: &Body) -> bool {
    body.one_way >= 0.8 && body.tangential >= 0.7 && body.round >= 0.25
}

/// Nearly all robots go the same way round, and hardly to and fro.
fn mills(body: &Body) -> bool {
    body.one_way >= 0.8 && body.tangential >= 0.85 && body.round >= 0.4
}

/// Most robots of the other species are inside, and see robots of this species on all sides. This species may fill a wide band.
fn is_loop_around(against: &Against) -> bool {
    against.encloses >= 0.6 && against.gap <= 1.3 && against.rim <= 0.4
}

/// A rim without a wide gap around most robots of the other species. A quarter of the rim's robots can be strays inside.
fn is_closed_rim_around(against: &Against) -> bool {
    against.encloses >= 0.6 && against.gap <= 1.0 && against.rim <= 0.06
}

/// A ring pressed on walls, or a stream along all walls. Agents inside the ring or stream do not matter.
fn follows_walls(body: &Body, walls: &Walls) -> bool {
    // A ring that only grazes a wall is near the wall for less than a quarter of the time.
    let pressed = walls.near >= 0.27 && body.one_way >= 0.95 && body.tangential >= 0.78;
    pressed || walls.along >= 0.69 && walls.circulation >= 0.6 && walls.way >= 0.4
}

/// Nearly all agents go the same way round, on the rim. Up to a fifth of the agents can be strays.
fn goes_round(body: &Body) -> bool {
    body.one_way >= 0.8 && body.tangential >= 0.92 && body.depth <= 0.09
}

/// One agent inside a ring is enough. Annotators disagreed about rings with a single agent inside.
fn is_nested(body: &Body) -> bool {
    body.deepest >= 0.22
}

/// A rim without gaps, at any speed of rotation. The rim has few agents inside, because a tight clump has a rim too. A rim as
/// wide as the arena is a dispersal at the walls.
fn is_closed_rim(arrangement: &Arrangement, body: &Body) -> bool {
    let rim = body.depth <= 0.047 && body.gap <= 0.9 && body.inside <= 0.25;
    rim && arrangement.spread <= 6.4
}

/// Agents in single file around the centre, for at least four tenths of a turn in the window. Agents can leave the rim, because
/// paths can be wavy.
fn is_loop(motion: &Motion, body: &Body) -> bool {
    body.round >= 2.75 && motion.following >= 0.55 && body.deepest <= 0.48
}

/// A loop as small as a clump, but with an empty middle: its agents have fewer neighbours at their sides.
fn is_small_loop(arrangement: &Arrangement, motion: &Motion, body: &Body) -> bool {
    let loose = arrangement.packing >= 2.8 && body.hollow >= 0.25;
    arrangement.spread <= CLUMP_SPREAD && loose && motion.following >= 0.5
}

/// Agents in single file without a gap around an empty middle, at any speed and in any shape.
fn is_closed_file(motion: &Motion, body: &Body) -> bool {
    motion.following >= 0.9 && body.gap <= 1.0 && body.hollow >= 0.4
}

fn is_clump(arrangement: &Arrangement) -> bool {
    arrangement.spread <= CLUMP_SPREAD
}

/// Two tight clumps that do not move. Up to a tenth of the agents can be strays.
fn are_two_clumps(arrangement: &Arrangement, motion: &Motion) -> bool {
    arrangement.in_two_clusters() >= 0.9 && arrangement.packing <= 4.4 && motion.net <= 0.45
}

/// A disc or band that turns as a whole, with each agent on its own curve. Motion along walls does not count.
fn swirls(arrangement: &Arrangement, motion: &Motion, body: &Body, walls: &Walls) -> bool {
    let turns = body.round >= 0.42 && motion.turning >= 1.08;
    turns && arrangement.crowded >= 0.33 && walls.along <= 0.4
}

/// Most agents go the same way round, and some agents go round near the middle.
fn swirls_to_the_middle(body: &Body) -> bool {
    body.one_way >= 0.9 && body.round_by_most >= 0.5 && body.deepest >= 0.4
}

/// Agents on overlapping curves about several centres, which all turn the same way.
fn swirl_apart(motion: &Motion) -> bool {
    motion.crossed >= 1.66 && motion.one_sense >= 0.7 && motion.reach >= 0.24
}

/// Hardly any two agents are close, no agent goes far, and no side is empty.
fn is_even(arrangement: &Arrangement, motion: &Motion, body: &Body) -> bool {
    arrangement.crowded <= 0.23 && motion.net <= 0.46 && body.gap <= 1.23
}

/// Each agent moves on its own small circle. The centres are further apart than random points.
fn keep_circling(arrangement: &Arrangement, motion: &Motion) -> bool {
    arrangement.homes >= 0.55 && motion.far_reach <= 0.55 && motion.turning >= 3.3
}
