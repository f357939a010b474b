//! Swarms of one world stepped together, one in each lane of a vector.
//!
//! It is the arithmetic of [`Swarm`](super::Swarm), in the same order, so the bits are the same. A vector of agents of one
//! swarm leaves lanes empty, and all that is done once an agent (driving, clamping, choosing a gait) uses one lane; here
//! every lane works. The price is collisions: a lane whose agent touches none waits for those that do.

mod collide;
mod look;

use super::{
    RENORMALISE_EVERY, Start, Walls,
    collide::{Collisions, PASSES},
    drive,
    sight::Reach,
};
use crate::lanes::{Aligned, Planar, any, dot, gathered, minus, plus, rotate, scaled, select, splat};
use collide::Touched;
use look::Viewer;
use murmuration_proto::{Controller, Invalid, World};
use pulp::Simd;

/// Most agents in a swarm of a batch: whom an agent touches is a word of bits.
pub(crate) const MOST_AGENTS: u32 = u64::BITS;

/// As many swarms as a vector has lanes, their controllers of one model, with so many sensors.
pub(crate) struct Batch<S: Simd, const SENSORS: usize> {
    walls: Walls,
    reach: Reach,
    gaits: [Gait<S>; 4],
    /// (cos, sin) of the second sensor's angle.
    second_sensor: Planar<S>,
    collisions: Vec<Collisions>,
    /// Where each agent is, and after the last each once more: [`Batch::others`].
    positions: Vec<Aligned<Planar<S>>>,
    bodies: Vec<Aligned<Body<S, SENSORS>>>,
    /// No agent's x or y was ever larger in magnitude.
    far: S::f64s,
    steps: u32,
}

/// What an agent carries besides its position.
#[derive(Debug, Clone, Copy)]
struct Body<S: Simd, const SENSORS: usize> {
    heading: Planar<S>,
    displacement: Planar<S>,
    /// Whether each sensor hit.
    sensed: [S::m64s; SENSORS],
    /// Whether it touched another in its last step, in any lane.
    crowded: bool,
}

/// The motion of one step: that of [`drive::Gait`] less the change of theta, which nothing reads here.
#[derive(Debug, Clone, Copy)]
struct Gait<S: Simd> {
    ahead: S::f64s,
    rotation: Planar<S>,
}

/// An agent as it is between two steps.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Agents<S: Simd> {
    pub(crate) position: Planar<S>,
    pub(crate) heading: Planar<S>,
    pub(crate) displacement: Planar<S>,
}

impl<S: Simd, const SENSORS: usize> Batch<S, SENSORS> {
    /// Swarms at their starts, one for each of `tasks`, of which there are at least one and at most as many as lanes;
    /// lanes beyond repeat the last.
    ///
    /// # Errors
    /// Where a start does not have one pose for each of the world's agents.
    pub(crate) fn new(simd: S, world: &World, tasks: &[(Controller, Start)]) -> Result<Self, Invalid> {
        let lanes: Vec<_> = (0..S::F64_LANES)
            .map(|lane| &tasks[lane.min(tasks.len() - 1)])
            .collect();
        let poses = lanes
            .iter()
            .map(|(_, start)| start.poses_for(world))
            .collect::<Result<Vec<_>, _>>()?;
        let gaits: Vec<_> = lanes
            .iter()
            .map(|(controller, _)| drive::gaits(controller, world))
            .collect();
        let second = |controller: &Controller| controller.angle().map_or([1.0, 0.0], drive::direction);
        let none = splat(simd, [0.0; 2]);
        let never = simd.less_than_f64s(none[0], none[0]);
        let position = |i: usize| gathered(simd, poses.iter().map(|poses| [poses[i][0], poses[i][1]]));
        let heading = |i: usize| gathered(simd, poses.iter().map(|poses| drive::direction(poses[i][2])));
        let agents = 0..world.agents() as usize;
        let mut far = none[0];
        for [x, y] in agents.clone().map(position) {
            far = simd.max_f64s(far, simd.max_f64s(simd.abs_f64s(x), simd.abs_f64s(y)));
        }
        Ok(Self {
            walls: Walls::of(world),
            far,
            reach: Reach::of(world.radius()),
            gaits: std::array::from_fn(|state| Gait {
                ahead: gathered(simd, gaits.iter().map(|gaits| [gaits[state].ahead, 0.0]))[0],
                rotation: gathered(simd, gaits.iter().map(|gaits| gaits[state].rotation)),
            }),
            second_sensor: gathered(simd, lanes.iter().map(|(controller, _)| second(controller))),
            collisions: lanes
                .iter()
                .map(|(_, start)| Collisions::new(world, world.radius(), start))
                .collect(),
            positions: agents
                .clone()
                .chain(agents.clone())
                .map(|i| Aligned(position(i)))
                .collect(),
            bodies: agents
                .map(|i| {
                    Aligned(Body {
                        heading: heading(i),
                        displacement: none,
                        sensed: [never; SENSORS],
                        crowded: false,
                    })
                })
                .collect(),
            steps: 0,
        })
    }

    /// Steps every agent `steps` times.
    #[inline(always)]
    pub(crate) fn advance(&mut self, simd: S, steps: u32) {
        for _ in 0..steps {
            for i in 0..self.bodies.len() {
                self.step_agent(simd, i);
            }
            self.steps += 1;
            if self.steps.is_multiple_of(RENORMALISE_EVERY) {
                self.renormalise(simd);
            }
        }
    }

    /// Steps done since the start.
    pub(crate) const fn steps(&self) -> u32 {
        self.steps
    }

    /// The agents, in index order.
    #[inline(always)]
    pub(crate) fn agents(&self) -> impl ExactSizeIterator<Item = Agents<S>> + Clone {
        self.bodies.iter().zip(&self.positions).map(
            #[inline(always)]
            |(Aligned(body), &Aligned(position))| Agents {
                position,
                heading: body.heading,
                displacement: body.displacement,
            },
        )
    }

    /// Where the sensors of agents with `heading` look, as unit vectors.
    #[inline(always)]
    pub(crate) fn sensor_directions(&self, simd: S, heading: Planar<S>) -> [Planar<S>; SENSORS] {
        let mut directions = [heading; SENSORS];
        if let Some(second) = directions.get_mut(1) {
            *second = rotate(simd, heading, self.second_sensor);
        }
        directions
    }

    #[inline(always)]
    fn step_agent(&mut self, simd: S, i: usize) {
        let agents = self.bodies.len();
        let mut body = self.bodies[i].0;
        let gait = chosen(simd, &self.gaits, body.sensed);
        let before = self.positions[i].0;
        let ahead = scaled(simd, body.heading, gait.ahead);
        let at = self.walls.clamp_lanes(simd, plus(simd, before, ahead));
        body.heading = rotate(simd, body.heading, gait.rotation);

        let mut viewer = Viewer {
            at,
            rays: self.sensor_directions(simd, body.heading),
            reach: self.reach,
        };
        let touch = simd.splat_f64s(self.reach.touch);
        let mut passes = 0;
        body.sensed = loop {
            // Who was crowded a step ago is likely to be so now, and the look in vain.
            if passes > 0 || !body.crowded {
                let far = self.farther(simd, viewer.at);
                let seen = viewer.look(simd, self.others(i), far);
                if !any(simd, seen.touched) {
                    break seen.hits;
                }
                if passes == PASSES {
                    break viewer.look_among(simd, self.others(i));
                }
            }
            let positions = &self.positions[..agents];
            let touched = Touched::by(simd, positions, i, viewer.at, touch);
            body.crowded = any(simd, touched.lanes(simd));
            if body.crowded {
                viewer.at = collide::pass(simd, &mut self.collisions, positions, touched, viewer.at);
                passes += 1;
            }
        };
        body.crowded = passes > 0;
        let at = viewer.at;
        body.displacement = minus(simd, at, before);
        self.bodies[i].0 = body;
        self.positions[i].0 = at;
        self.positions[agents + i].0 = at;
    }

    /// The largest coordinate so far, `at` included.
    #[inline(always)]
    fn farther(&mut self, simd: S, at: Planar<S>) -> S::f64s {
        let here = simd.max_f64s(simd.abs_f64s(at[0]), simd.abs_f64s(at[1]));
        self.far = simd.max_f64s(self.far, here);
        self.far
    }

    /// The positions of all agents but `i`, as a run of the same length for each: the end of a loop whose length changes
    /// is mispredicted.
    #[inline(always)]
    fn others(&self, i: usize) -> &[Aligned<Planar<S>>] {
        &self.positions[i + 1..i + self.bodies.len()]
    }

    #[inline(always)]
    fn renormalise(&mut self, simd: S) {
        let (half, three_halves) = (simd.splat_f64s(0.5), simd.splat_f64s(1.5));
        for Aligned(body) in &mut self.bodies {
            let squared = dot(simd, body.heading, body.heading);
            let factor = simd.sub_f64s(three_halves, simd.mul_f64s(half, squared));
            body.heading = scaled(simd, body.heading, factor);
        }
    }
}

/// The gait that each lane has for what it sensed.
#[inline(always)]
fn chosen<S: Simd, const SENSORS: usize>(
    simd: S,
    [off, on, s1, both]: &[Gait<S>; 4],
    sensed: [S::m64s; SENSORS],
) -> Gait<S> {
    match sensed.as_slice() {
        [sensed] => either(simd, *sensed, on, off),
        [first, second] => {
            let (without, with) = (either(simd, *second, on, off), either(simd, *second, both, s1));
            either(simd, *first, &with, &without)
        }
        _ => *off,
    }
}

#[inline(always)]
fn either<S: Simd>(simd: S, mask: S::m64s, on: &Gait<S>, off: &Gait<S>) -> Gait<S> {
    Gait {
        ahead: simd.select_f64s(mask, on.ahead, off.ahead),
        rotation: select(simd, mask, on.rotation, off.rotation),
    }
}

impl Walls {
    #[inline(always)]
    fn clamp_lanes<S: Simd>(&self, simd: S, [x, y]: Planar<S>) -> Planar<S> {
        let low = simd.splat_f64s(self.low);
        let high = splat(simd, self.high);
        [
            simd.min_f64s(high[0], simd.max_f64s(low, x)),
            simd.min_f64s(high[1], simd.max_f64s(low, y)),
        ]
    }
}
