//! Steps swarms of one world together, one swarm in each lane of a vector.
//!
//! A batch does the same arithmetic as [`Swarm`](super::Swarm), in the same order, so the bits are the same. Vectors of agents of
//! one swarm leave lanes empty, and work that is done once per agent (driving, clamping, choosing a gait) uses a single lane. In
//! a batch, every lane works. Collisions cost more: lanes without a collision wait for lanes with a collision.

mod collide;
mod cones;
mod look;
mod settle;
#[cfg(test)]
mod tests;

use super::{RENORMALISE_EVERY, Start, Walls, collide::Collisions, drive, gaze::Group, kinds, sight::Reach};
use crate::lanes::{
    Aligned, Planar, any, dot, gathered, lanes, lanes_mut, magnitude, minus, plus, point, rotate, scaled,
    select, splat, words,
};
use cones::{ConeViewer, Cones};
use look::{Seen, Viewer};
use murmuration_swarm::{CapabilityModel, Controller, Invalid, RobotController, SeenRobots, Sensor, World};
use pulp::Simd;

/// Maximum number of agents per swarm of a batch. The bits of one word list the agents that an agent touches.
pub(crate) const MOST_AGENTS: u32 = u64::BITS;

/// One swarm per lane of a vector. Robots differ only in their controllers, and have `SENSORS` sensors. The sensors are rays
/// without limit, or cones if `CONES`.
pub(crate) struct Batch<S: Simd, const SENSORS: usize, const CONES: bool> {
    walls: Walls,
    reach: Reach,
    /// Gaits by sensor state, of robots with one or two sensors.
    few_gaits: [Gait<S>; 4],
    /// Gaits by sensor state, of robots with more sensors.
    many_gaits: Vec<Gait<S>>,
    /// (cos, sin) of each sensor's angle.
    directions: [Planar<S>; SENSORS],
    /// Whether the first sensor looks straight ahead in all lanes.
    first_is_ahead: bool,
    /// The sensors, if they are cones.
    cones: Option<Cones<S, SENSORS>>,
    /// Diameter of a body.
    diameter: f64,
    collisions: Vec<Collisions>,
    /// Whether a push can draw random numbers.
    jitters: bool,
    /// Positions of all agents, twice in a row, for [`Batch::others`].
    positions: Vec<Aligned<Planar<S>>>,
    /// Positions of all agents at the last call of [`Batch::watch`].
    watched: Vec<Aligned<Planar<S>>>,
    bodies: Vec<Aligned<Body<S, SENSORS>>>,
    /// Upper bound of the magnitudes of all coordinates so far.
    far: S::f64s,
    steps: u32,
}

/// State of an agent besides its position.
#[derive(Debug, Clone, Copy)]
struct Body<S: Simd, const SENSORS: usize> {
    heading: Planar<S>,
    /// Whether each sensor hit an agent.
    sensed: [S::m64s; SENSORS],
    /// Whether the agent touched another agent in its last step, in any lane.
    crowded: bool,
}

/// The controller of one swarm, prepared for its steps.
struct Brain {
    /// Gaits by sensor state.
    gaits: Vec<drive::Gait>,
    /// (cos, sin) of the sensors' angles.
    directions: Vec<[f64; 2]>,
}

/// Whether swarms of this model can be simulated in a batch. The swarms of a batch have one species, few robots, and sensors that
/// see all robots and nothing else. The world of a batch has only robots and walls.
pub(crate) fn is_for(model: &CapabilityModel, world: &World) -> bool {
    let sees_robots = |sensor: &Sensor| *sensor.robots() != SeenRobots::None && sensor.wall_range().is_none();
    match model.species() {
        _ if !super::is_plain(world) => false,
        [alone] => world.agents() <= MOST_AGENTS && alone.robot().sensors().iter().all(sees_robots),
        _ => false,
    }
}

/// The task of each lane; lanes without a task repeat the last task.
fn in_lanes<S: Simd, T>(tasks: &[T]) -> Vec<&T> {
    (0..S::F64_LANES)
        .map(|lane| &tasks[lane.min(tasks.len() - 1)])
        .collect()
}

/// The motion of one step: [`drive::Gait`] without the change of theta, which a batch does not need.
#[derive(Debug, Clone, Copy)]
struct Gait<S: Simd> {
    ahead: S::f64s,
    rotation: Planar<S>,
}

/// State of an agent of each swarm between two steps.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Agents<S: Simd> {
    pub(crate) position: Planar<S>,
    pub(crate) heading: Planar<S>,
    pub(crate) displacement: Planar<S>,
}

impl<S: Simd, const SENSORS: usize, const CONES: bool> Batch<S, SENSORS, CONES> {
    /// Swarms at their starts, one for each of `tasks`. `tasks` has at least one task, and at most one task per lane; further
    /// lanes repeat the last task. Requires a model that [`is_for`] accepts, and robots with `SENSORS` sensors.
    ///
    /// # Errors
    /// The errors of [`Swarm::new`](super::Swarm::new).
    pub(crate) fn new(simd: S, world: &World, tasks: &[(Controller, Start)]) -> Result<Self, Invalid> {
        let lanes = in_lanes::<S, _>(tasks);
        let model = lanes[0].0.model();
        kinds::check_fit(model, world)?;
        let robot = model.species()[0].robot();
        let angles: Vec<Vec<_>> = lanes
            .iter()
            .map(|(controller, _)| controller.robots().flat_map(RobotController::angles).collect())
            .collect();
        let brains = lanes.iter().zip(&angles).map(|((controller, _), angles)| Brain {
            gaits: controller
                .robots()
                .flat_map(|robot| drive::gaits(robot, world.dt()))
                .collect(),
            directions: angles.iter().map(|&angle| drive::direction(angle)).collect(),
        });
        let cones = match robot.sensors().iter().all(Sensor::is_plain_ray) {
            true => None,
            false => Cones::new(simd, robot, &angles),
        };
        let starts = lanes.iter().map(|(_, start)| start).collect();
        Self::at_start(
            simd,
            world,
            Walls::of(robot, world),
            robot.radius(),
            cones,
            brains.collect(),
            starts,
        )
    }

    fn at_start(
        simd: S,
        world: &World,
        walls: Walls,
        radius: f64,
        cones: Option<Cones<S, SENSORS>>,
        brains: Vec<Brain>,
        starts: Vec<&Start>,
    ) -> Result<Self, Invalid> {
        let poses = starts.iter().map(|start| start.poses_for(world));
        let poses = poses.collect::<Result<Vec<_>, _>>()?;
        let none = splat(simd, [0.0; 2]);
        let never = simd.less_than_f64s(none[0], none[0]);
        let position = |i: usize| gathered(simd, poses.iter().map(|poses| [poses[i][0], poses[i][1]]));
        let heading = |i: usize| gathered(simd, poses.iter().map(|poses| drive::direction(poses[i][2])));
        let agents = 0..world.agents() as usize;
        let mut far = none[0];
        for [x, y] in agents.clone().map(position) {
            far = simd.max_f64s(far, simd.max_f64s(magnitude(simd, x), magnitude(simd, y)));
        }
        let gait = |state: usize| Gait {
            ahead: gathered(simd, brains.iter().map(|brain| [brain.gaits[state].ahead, 0.0]))[0],
            rotation: gathered(simd, brains.iter().map(|brain| brain.gaits[state].rotation)),
        };
        let rule = |start: &&Start| Collisions::new(world, vec![Group::whole(world, radius)], start);
        let collisions: Vec<_> = starts.iter().map(rule).collect();
        let direction = |s: usize| gathered(simd, brains.iter().map(|brain| brain.directions[s]));
        Ok(Self {
            walls,
            far,
            reach: Reach::of(radius),
            diameter: 2.0 * radius,
            few_gaits: std::array::from_fn(|state| gait(state % (1 << SENSORS))),
            many_gaits: match SENSORS {
                1 | 2 => Vec::new(),
                _ => (0..1 << SENSORS).map(gait).collect(),
            },
            directions: std::array::from_fn(direction),
            first_is_ahead: brains.iter().all(|brain| brain.directions[0] == [1.0, 0.0]),
            cones,
            jitters: collisions.iter().any(Collisions::jitters),
            collisions,
            watched: agents.clone().map(|i| Aligned(position(i))).collect(),
            positions: agents
                .clone()
                .chain(agents.clone())
                .map(|i| Aligned(position(i)))
                .collect(),
            bodies: agents
                .map(|i| {
                    Aligned(Body {
                        heading: heading(i),
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

    /// Number of steps since the start.
    pub(crate) const fn steps(&self) -> u32 {
        self.steps
    }

    /// Begins to measure the displacements that [`Batch::agents`] returns.
    #[inline(always)]
    pub(crate) fn watch(&mut self) {
        let agents = self.bodies.len();
        self.watched.copy_from_slice(&self.positions[..agents]);
    }

    /// The agents, in index order; displacements are measured since the last call of [`Batch::watch`].
    #[inline(always)]
    pub(crate) fn agents(&self, simd: S) -> impl ExactSizeIterator<Item = Agents<S>> + Clone {
        self.bodies.iter().zip(&self.positions).zip(&self.watched).map(
            #[inline(always)]
            move |((Aligned(body), &Aligned(position)), &Aligned(before))| Agents {
                position,
                heading: body.heading,
                displacement: minus(simd, position, before),
            },
        )
    }

    /// Directions of the sensors of agents with `heading`, as unit vectors.
    #[inline(always)]
    pub(crate) fn sensor_directions(&self, simd: S, heading: Planar<S>) -> [Planar<S>; SENSORS] {
        let mut directions = [heading; SENSORS];
        // Skipping a rotation by 0 saves a hundredth of the time of a step with one sensor. With more sensors, the branch costs
        // more than it saves.
        if SENSORS == 1 && self.first_is_ahead {
            return directions;
        }
        for (ray, &direction) in directions.iter_mut().zip(&self.directions) {
            *ray = rotate(simd, heading, direction);
        }
        directions
    }

    #[inline(always)]
    fn step_agent(&mut self, simd: S, i: usize) {
        let Aligned(body) = self.bodies[i];
        let gait = self.chosen_gait(simd, body.sensed);
        let ahead = scaled(simd, body.heading, gait.ahead);
        let at = self
            .walls
            .clamp_lanes(simd, plus(simd, self.positions[i].0, ahead));
        let heading = rotate(simd, body.heading, gait.rotation);
        self.bodies[i].0.heading = heading;
        self.place(i, at);
        // An agent that was crowded a step ago is probably crowded now, so the glance would be wasted.
        if !body.crowded
            && let Some(Seen { touched, hits }) = self.glance(simd, i, at, heading)
            && !any(simd, touched)
        {
            self.bodies[i].0.sensed = hits;
        } else {
            self.settle_apart(simd, i);
        }
    }

    /// Moves agent `i` to `at`.
    #[inline(always)]
    fn place(&mut self, i: usize, at: Planar<S>) {
        let agents = self.bodies.len();
        self.positions[i].0 = at;
        self.positions[agents + i].0 = at;
    }

    #[inline(always)]
    fn chosen_gait(&self, simd: S, sensed: [S::m64s; SENSORS]) -> Gait<S> {
        if SENSORS <= 2 {
            chosen(simd, &self.few_gaits, sensed)
        } else {
            chosen_by_lane(simd, &self.many_gaits, sensed)
        }
    }

    /// Sensor reading of agent `i`, and whether another agent touches it; `None` if rounding can change the result.
    #[inline(always)]
    fn glance(&mut self, simd: S, i: usize, at: Planar<S>, heading: Planar<S>) -> Option<Seen<S, SENSORS>> {
        let viewer = self.viewer(simd, at, heading);
        self.reach_to(simd, at);
        match &self.cones {
            Some(cones) if CONES => {
                cones.glance(simd, ConeViewer::of(viewer, heading), self.others(i), self.far)
            }
            _ => viewer.glance(simd, self.others(i), self.far),
        }
    }

    /// Raises the bound `far` if an agent at `at` exceeds it.
    #[inline(always)]
    fn reach_to(&mut self, simd: S, at: Planar<S>) {
        let here = simd.max_f64s(magnitude(simd, at[0]), magnitude(simd, at[1]));
        self.far = simd.max_f64s(self.far, here);
    }

    /// A viewer at `at`.
    #[inline(always)]
    fn viewer(&self, simd: S, at: Planar<S>, heading: Planar<S>) -> Viewer<S, SENSORS> {
        Viewer {
            at,
            rays: self.sensor_directions(simd, heading),
            reach: self.reach,
        }
    }

    /// The positions of all agents except `i`. The slice has the same length for every agent, because the CPU mispredicts the end
    /// of a loop of varying length.
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

/// The gait of each lane for its sensor state.
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

/// Like [`chosen`], but for many gaits, because [`chosen`] would need as many selections as there are gaits.
#[inline(always)]
fn chosen_by_lane<S: Simd, const SENSORS: usize>(
    simd: S,
    gaits: &[Gait<S>],
    sensed: [S::m64s; SENSORS],
) -> Gait<S> {
    let (zero, one) = (simd.splat_u64s(0), simd.splat_u64s(1));
    let mut states = zero;
    for sensed in sensed {
        states = simd.add_u64s(states, states);
        states = simd.add_u64s(states, simd.select_u64s(sensed, one, zero));
    }
    let mut gait = gaits[0];
    let [cos, sin] = &mut gait.rotation;
    let slots = lanes_mut::<S>(&mut gait.ahead).iter_mut();
    let slots = slots.zip(lanes_mut::<S>(cos)).zip(lanes_mut::<S>(sin));
    for (lane, (((ahead, cos), sin), &state)) in slots.zip(words::<S>(&states)).enumerate() {
        let chosen = &gaits[state as usize % gaits.len()];
        *ahead = lanes::<S>(&chosen.ahead)[lane];
        [*cos, *sin] = point::<S>(&chosen.rotation, lane);
    }
    gait
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
