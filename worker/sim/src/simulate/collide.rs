//! Collisions: the agent that has just moved is pushed out of the agents that it touches; the other agents stay.

use super::{Start, gaze::Group, others::Others, sight::Reach};
use murmuration_swarm::{Purpose, RandomStream, World};
use pulp::Simd;

/// Maximum number of passes that push an agent out of all agents that it touches.
pub(crate) const PASSES: usize = 10;
/// Gap between two agents after a push.
pub(crate) const GAP: f64 = 0.001;
/// Largest component of the authors' jitter.
pub(crate) const JITTER: f64 = 0.001;
/// The authors' simulator adds jitter if both components of the offset between two agents are below this number.
const JITTER_BELOW: f64 = 1e-4;

/// The collision rule of one world, and its state.
#[derive(Debug, Clone)]
pub(super) struct Collisions {
    /// Groups of all agents by size, in index order.
    groups: Vec<Group>,
    /// Diameter of the largest body.
    diameter: f64,
    reach: Reach,
    centre: [f64; 2],
    jitter: Option<RandomStream>,
    jitter_events: u64,
    /// Buffer for the touched agents, kept to reuse its memory.
    touched: Vec<usize>,
}

impl Collisions {
    /// The collision rule for all agents of a world; `groups` are these agents by size, in index order.
    pub(super) fn new(world: &World, groups: Vec<Group>, start: &Start) -> Self {
        let radius = groups.iter().map(|group| group.radius).fold(0.0, f64::max);
        Self {
            groups,
            diameter: 2.0 * radius,
            reach: Reach::of(radius),
            centre: [world.width() / 2.0, world.height() / 2.0],
            jitter: world
                .jitter()
                .then(|| RandomStream::derive(start.seed(), Purpose::Jitter, 0)),
            jitter_events: 0,
            touched: Vec::new(),
        }
    }

    pub(super) const fn reach(&self) -> Reach {
        self.reach
    }

    /// Groups of all agents by size, in index order.
    pub(super) fn groups(&self) -> &[Group] {
        &self.groups
    }

    /// Diameter of the largest body.
    pub(super) const fn diameter(&self) -> f64 {
        self.diameter
    }

    /// Whether a push can draw random numbers.
    pub(super) const fn jitters(&self) -> bool {
        self.jitter.is_some()
    }

    pub(super) const fn jitter_events(&self) -> u64 {
        self.jitter_events
    }

    /// Pushes agent `me` of radius `radius` at `at` out of all other agents, and returns its new position.
    #[inline(always)]
    pub(super) fn push_out<S: Simd>(
        &mut self,
        simd: S,
        others: &impl Others,
        me: usize,
        radius: f64,
        mut at: [f64; 2],
    ) -> [f64; 2] {
        let mut touched = std::mem::take(&mut self.touched);
        let groups = std::mem::take(&mut self.groups);
        let alone = match groups.as_slice() {
            [alone] => Some(alone.radius),
            _ => None,
        };
        for _ in 0..PASSES {
            touched.clear();
            for group in &groups {
                others.list_touched(simd, &mut touched, group, me, at, radius + group.radius);
            }
            if touched.is_empty() {
                break;
            }
            for &other in &touched {
                let theirs = match alone {
                    Some(theirs) => theirs,
                    None => {
                        let group = groups.iter().find(|group| group.has(other));
                        group.map_or(radius, |group| group.radius)
                    }
                };
                at = self.pushed_to(radius + theirs, at, others.near(other, at));
            }
        }
        (self.touched, self.groups) = (touched, groups);
        at
    }

    /// Pushes an agent at `at` out of an agent at `other`, if the two touch, and returns the new position of the first agent.
    #[inline(always)]
    pub(super) fn pushed(&mut self, at: [f64; 2], other: [f64; 2]) -> [f64; 2] {
        self.pushed_to(self.diameter, at, other)
    }

    /// Like [`Collisions::pushed`], for agents that touch if their centres are nearer than `touch`.
    #[inline(always)]
    fn pushed_to(&mut self, touch: f64, at: [f64; 2], other: [f64; 2]) -> [f64; 2] {
        let away = [at[0] - other[0], at[1] - other[1]];
        let distance = length(away);
        if distance > touch {
            return at;
        }
        let direction = if distance > 0.0 {
            [away[0] / distance, away[1] / distance]
        } else {
            self.towards_centre(at)
        };
        let push = touch + GAP - distance;
        let mut at = [at[0] + direction[0] * push, at[1] + direction[1] * push];
        if away[0] < JITTER_BELOW && away[1] < JITTER_BELOW {
            self.jitter_events += 1;
            if let Some(stream) = &mut self.jitter {
                at = at.map(|value| value + stream.between(0.0, JITTER));
            }
        }
        at
    }

    /// Direction of the push if both agents are at the same place, a case that the authors' simulator does not resolve.
    fn towards_centre(&self, at: [f64; 2]) -> [f64; 2] {
        let inward = [self.centre[0] - at[0], self.centre[1] - at[1]];
        let distance = length(inward);
        if distance > 0.0 {
            [inward[0] / distance, inward[1] / distance]
        } else {
            [1.0, 0.0]
        }
    }
}

#[inline(always)]
fn length([x, y]: [f64; 2]) -> f64 {
    (x * x + y * y).sqrt()
}
