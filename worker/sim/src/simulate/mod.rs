//! The swarm: agents step one after the other, and each agent sees the current positions of the other agents.
//!
//! In a step, an agent drives with the wheel speeds of its last sensor state, and is clamped to the walls. Next, the agent is
//! pushed out of obstacles, and then out of other agents. Finally, the agent reads its sensors. The authors' simulator has the
//! same order of a step. A step longer than an obstacle's thickness can pass through the obstacle.

mod batch;
mod collide;
mod drive;
mod gaze;
mod grid;
mod kinds;
mod mind;
mod noise;
mod obstacles;
mod others;
mod placed;
mod positions;
mod sight;
mod situated;
mod start;
mod torus;

pub use start::Start;

pub(crate) use batch::{Agents, Batch, MOST_AGENTS, is_for as batch_is_for};
use collide::Collisions;
pub(crate) use collide::{GAP, JITTER, PASSES};
use drive::rotate;
use gaze::Group;
use grid::Grid;
use kinds::Kinds;
use mind::{Driven, Mind, Paper, PaperMind};
use murmuration_swarm::{Boundary, Controller, Invalid, Preset, Robot, World};
use others::Everyone;
use positions::Positions;
pub use pulp::Arch;
use pulp::{Simd, WithSimd};
use situated::Situated;
use torus::Torus;

/// Number of steps between renormalisations of the headings.
const RENORMALISE_EVERY: u32 = 256;

/// A swarm in its world.
///
/// The bits of a swarm depend only on controller, world and start, not on the CPU or on how steps are grouped.
#[derive(Debug, Clone)]
pub struct Swarm {
    arch: Arch,
    minds: Minds,
    robots: Robots,
    others: Lookup,
}

/// The kinds of robots in a swarm.
#[derive(Debug, Clone)]
enum Minds {
    Paper(Paper),
    Described(Kinds),
    Situated(Situated),
}

/// State of a swarm's robots, except for the lookup of others.
#[derive(Debug, Clone)]
struct Robots {
    collisions: Collisions,
    bodies: Vec<Body>,
    steps: u32,
}

/// Positions of all agents.
#[derive(Debug, Clone)]
enum Lookup {
    /// Every agent checks every other agent.
    All(Positions),
    Near(Grid),
}

/// State of an agent between two steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Agent {
    /// x and y, in world units; y points down the screen.
    pub position: [f64; 2],
    /// Unit vector straight ahead.
    pub heading: [f64; 2],
    /// Heading in radians, not wrapped.
    pub theta: f64,
    /// Displacement by the last step, walls, obstacles and collisions included; zero at the start. On a torus, the displacement
    /// excludes jumps to the other side.
    pub displacement: [f64; 2],
    /// Last sensor state: a bit for each of the k sensors, S1 the highest. From 0 to 2^k - 1; 0 at the start.
    pub sensed: u8,
}

/// State of an agent between two steps, as the swarm stores it.
#[derive(Debug, Clone, Copy)]
struct Body {
    position: [f64; 2],
    heading: [f64; 2],
    theta: f64,
    displacement: [f64; 2],
    sensed: u8,
}

/// Bounds of an agent's centre before collisions.
#[derive(Debug, Clone, Copy)]
struct Walls {
    low: f64,
    high: [f64; 2],
}

impl Swarm {
    /// A swarm at its start, which uses the fastest instructions of this CPU.
    ///
    /// # Errors
    /// Fails if the controller's number of robots or largest radius differs from the world's, or `start` does not have one pose
    /// per agent.
    pub fn new(controller: &Controller, world: &World, start: &Start) -> Result<Self, Invalid> {
        Self::on(Arch::new(), controller, world, start)
    }

    /// Like [`Swarm::new`], but with the instructions of `arch`. The swarm has the same bits.
    ///
    /// # Errors
    /// The errors of [`Swarm::new`].
    pub fn on(arch: Arch, controller: &Controller, world: &World, start: &Start) -> Result<Self, Invalid> {
        let swarm = Self::pairwise(arch, controller, world, start)?;
        let is_large = world.agents() >= grid::WORTH && world.boundary() != Boundary::Torus;
        Ok(if is_large { swarm.with_grid(world) } else { swarm })
    }

    /// Like [`Swarm::on`], but never uses a grid: every agent checks every other agent. The swarm has the same bits. Use this
    /// function for comparisons.
    ///
    /// # Errors
    /// The errors of [`Swarm::new`].
    pub fn pairwise(
        arch: Arch,
        controller: &Controller,
        world: &World,
        start: &Start,
    ) -> Result<Self, Invalid> {
        kinds::check_fit(controller.model(), world)?;
        let groups = kinds::by_size(&kinds::by_species(controller, world));
        let mut poses = start.poses_for(world)?;
        if world.boundary() == Boundary::Torus {
            let torus = Torus::new(world);
            for pose in poses.to_mut() {
                let [x, y] = torus.wrap([pose[0], pose[1]]);
                *pose = [x, y, pose[2]];
            }
        }
        Ok(Self {
            arch,
            minds: Minds::new(controller, &groups, world, start),
            robots: Robots {
                collisions: Collisions::new(world, groups, start),
                bodies: poses.iter().map(Body::at).collect(),
                steps: 0,
            },
            others: Lookup::All(poses.iter().map(|&[x, y, _]| [x, y]).collect()),
        })
    }

    /// Makes the swarm use a grid, as large swarms do. The swarm has the same bits. Cells do not wrap, so the world must not be a
    /// torus.
    #[must_use]
    pub fn with_grid(mut self, world: &World) -> Self {
        let positions: Vec<_> = self.agents().map(|agent| agent.position).collect();
        let largest = self.robots.collisions.diameter() / 2.0;
        self.others = Lookup::Near(Grid::new(world, largest, &positions));
        self
    }

    /// Steps every agent once.
    pub fn step(&mut self) {
        self.advance(1);
    }

    /// Steps every agent `steps` times.
    pub fn advance(&mut self, steps: u32) {
        match &mut self.others {
            Lookup::All(others) => self.robots.advance(self.arch, &mut self.minds, others, steps),
            Lookup::Near(others) => self.robots.advance(self.arch, &mut self.minds, others, steps),
        }
    }

    /// Number of steps since the start.
    #[must_use]
    pub const fn steps(&self) -> u32 {
        self.robots.steps
    }

    /// The agents, in index order.
    #[inline]
    pub fn agents(&self) -> impl ExactSizeIterator<Item = Agent> + Clone {
        self.robots.bodies.iter().map(|body| Agent {
            position: body.position,
            heading: body.heading,
            theta: body.theta,
            displacement: body.displacement,
            sensed: body.sensed,
        })
    }

    /// Directions of the sensors of agent `i` when it has this heading: unit vectors along the middles of their cones, S1 first.
    #[inline]
    pub fn sensor_directions(&self, i: usize, heading: [f64; 2]) -> impl Iterator<Item = [f64; 2]> {
        let (first, others) = match &self.minds {
            Minds::Paper(paper) => (Some(heading), paper.second_sensor.as_slice()),
            Minds::Described(kinds) => (None, kinds.directions(i)),
            Minds::Situated(situated) => (None, situated.kinds().directions(i)),
        };
        let others = others.iter().map(move |&direction| rotate(heading, direction));
        first.into_iter().chain(others)
    }

    /// Index of the species of agent `i` among the species of its model.
    #[must_use]
    pub fn species(&self, i: usize) -> usize {
        match &self.minds {
            Minds::Paper(_) => 0,
            Minds::Described(kinds) => kinds.species(i),
            Minds::Situated(situated) => situated.kinds().species(i),
        }
    }

    /// Radius of the body of agent `i`, world units.
    #[must_use]
    pub fn radius(&self, i: usize) -> f64 {
        match &self.minds {
            Minds::Paper(_) => self.robots.collisions.diameter() / 2.0,
            Minds::Described(kinds) => kinds.radius(i),
            Minds::Situated(situated) => situated.kinds().radius(i),
        }
    }

    /// The radii of bodies, world units; neighbouring species of one size share one entry.
    pub(crate) fn radii(&self) -> impl Iterator<Item = f64> {
        self.robots.collisions.groups().iter().map(|group| group.radius)
    }

    /// Current sensor states of all agents in index order, read without moving the agents and without noise. The states have the
    /// format of [`Agent::sensed`].
    #[must_use]
    pub fn readings(&self) -> Vec<u8> {
        let looking = |(index, body): (usize, &Body)| {
            let robot = Driven {
                index,
                at: body.position,
                heading: body.heading,
            };
            match &self.others {
                Lookup::All(others) => self.reading(others, robot),
                Lookup::Near(others) => self.reading(others, robot),
            }
        };
        self.robots.bodies.iter().enumerate().map(looking).collect()
    }

    fn reading(&self, others: &impl Everyone, robot: Driven) -> u8 {
        let simd = pulp::Scalar::new();
        match &self.minds {
            Minds::Paper(paper) => paper.sense(simd, others, robot, self.robots.collisions.reach()),
            Minds::Described(kinds) => kinds.sense(simd, others, robot),
            Minds::Situated(situated) => situated.sense(simd, others, robot),
        }
    }

    /// Number of pushes to which the authors' simulator adds jitter, whether or not this world has jitter.
    #[must_use]
    pub const fn jitter_events(&self) -> u64 {
        self.robots.collisions.jitter_events()
    }
}

impl Minds {
    fn new(controller: &Controller, groups: &[Group], world: &World, start: &Start) -> Self {
        let papers = match (controller.model().preset(), controller.robots().next()) {
            (Some(Preset::SingleSensor | Preset::TwoSensor), robot) => robot,
            _ => None,
        };
        let kinds = || Kinds::new(controller, groups, world);
        match papers {
            _ if !is_plain(world) => Self::Situated(Situated::new(kinds(), world, start)),
            Some(robot) => Self::Paper(Paper::new(robot, world)),
            None => Self::Described(kinds()),
        }
    }
}

/// Whether a world has only robots and walls: no noise, no obstacles, no torus.
fn is_plain(world: &World) -> bool {
    world.noise().is_off() && world.obstacles().is_empty() && world.boundary() != Boundary::Torus
}

impl Robots {
    fn advance(&mut self, arch: Arch, minds: &mut Minds, others: &mut impl Everyone, steps: u32) {
        match minds {
            &mut Minds::Paper(paper) => match paper.second_sensor {
                None => {
                    let rays = |heading| [heading];
                    self.dispatch(arch, PaperMind { paper, rays }, others, steps);
                }
                Some(angle) => {
                    let rays = |heading| [heading, rotate(heading, angle)];
                    self.dispatch(arch, PaperMind { paper, rays }, others, steps);
                }
            },
            Minds::Described(kinds) => self.dispatch(arch, &*kinds, others, steps),
            Minds::Situated(situated) => self.dispatch(arch, situated, others, steps),
        }
    }

    fn dispatch(&mut self, arch: Arch, mind: impl Mind, others: &mut impl Everyone, steps: u32) {
        arch.dispatch(Run {
            robots: self,
            others,
            steps,
            mind,
        });
    }

    #[inline(always)]
    fn run<S: Simd>(&mut self, simd: S, mind: &mut impl Mind, others: &mut impl Everyone, steps: u32) {
        for _ in 0..steps {
            for i in 0..self.bodies.len() {
                self.step_agent(simd, mind, others, i);
            }
            self.steps += 1;
            if self.steps.is_multiple_of(RENORMALISE_EVERY) {
                for body in &mut self.bodies {
                    body.heading = drive::renormalised(body.heading);
                }
            }
        }
    }

    #[inline(always)]
    fn step_agent<S: Simd>(&mut self, simd: S, mind: &mut impl Mind, others: &mut impl Everyone, i: usize) {
        let body = &mut self.bodies[i];
        let gait = mind.gait(i, body.sensed);
        let before = body.position;
        let bound = mind.bound(i, before, gait.drive(before, body.heading));
        body.heading = rotate(body.heading, gait.rotation);
        body.theta += gait.turn;

        let robot = Driven {
            index: i,
            at: bound.at,
            heading: body.heading,
        };
        let (at, sensed) = mind.settle(simd, others, &mut self.collisions, robot);
        body.sensed = sensed;
        body.displacement = [at[0] - bound.from[0], at[1] - bound.from[1]];
        let at = mind.home(at);
        body.position = at;
        others.set(simd, i, at);
    }
}

/// Some steps of a swarm. As a type, this code is compiled for several kinds of CPU.
///
/// All functions that this code calls must be inlined, because only inlined code is compiled for this machine's CPU.
struct Run<'a, O, M> {
    robots: &'a mut Robots,
    others: &'a mut O,
    steps: u32,
    mind: M,
}

impl<O: Everyone, M: Mind> WithSimd for Run<'_, O, M> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        self.robots.run(simd, &mut self.mind, self.others, self.steps);
    }
}

impl Body {
    fn at(&[x, y, theta]: &[f64; 3]) -> Self {
        Self {
            position: [x, y],
            heading: drive::direction(theta),
            theta,
            displacement: [0.0; 2],
            sensed: 0,
        }
    }
}

impl Walls {
    /// Bounds of a world without walls.
    const NONE: Self = Self {
        low: f64::NEG_INFINITY,
        high: [f64::INFINITY; 2],
    };

    /// The bounds that the walls set for the centre of this robot.
    fn of(robot: &Robot, world: &World) -> Self {
        match world.boundary() {
            Boundary::Walls => Self::within(world, robot.radius() + world.padding()),
            Boundary::Open | Boundary::Torus => Self::NONE,
        }
    }

    /// Walls that keep a centre `margin` from each edge of the world.
    fn within(world: &World, margin: f64) -> Self {
        Self {
            low: margin,
            high: [world.width() - margin, world.height() - margin],
        }
    }

    #[inline(always)]
    fn clamp(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let clamp = |value: f64, high: f64| {
            let value = if value < self.low { self.low } else { value };
            if value > high { high } else { value }
        };
        [clamp(x, self.high[0]), clamp(y, self.high[1])]
    }
}
