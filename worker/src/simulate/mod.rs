//! The swarm: agents stepped one after the other, each seeing the positions as they are at that moment.
//!
//! One step of one agent (order as in the authors' simulator): drive with
//! the wheel speeds of what it last sensed, clamp to the walls, be pushed out of others, sense.

mod batch;
mod collide;
mod drive;
mod grid;
mod others;
mod positions;
mod sight;
mod start;
#[cfg(test)]
pub(crate) mod tests;

pub use start::Start;

pub(crate) use batch::{Agents, Batch, MOST_AGENTS};
use collide::Collisions;
pub(crate) use collide::{GAP, JITTER, PASSES};
use drive::{Gait, rotate};
use grid::Grid;
use murmuration_proto::{Controller, Invalid, World};
use others::Others;
use positions::Positions;
pub use pulp::Arch;
use pulp::{Simd, WithSimd};
use sight::Observer;

/// Steps between two renormalisations of the headings.
const RENORMALISE_EVERY: u32 = 256;

/// A swarm of one controller in its world, to be stepped and looked at.
///
/// Its bits depend on controller, world and start alone: not on the CPU, nor on how the steps are grouped.
#[derive(Debug, Clone)]
pub struct Swarm {
    arch: Arch,
    /// (cos, sin) of the second sensor's angle.
    second_sensor: Option<[f64; 2]>,
    robots: Robots,
    others: Lookup,
}

/// What a step needs but for where the others are.
#[derive(Debug, Clone)]
struct Robots {
    walls: Walls,
    gaits: [Gait; 4],
    collisions: Collisions,
    bodies: Vec<Body>,
    steps: u32,
}

/// Where all agents are.
#[derive(Debug, Clone)]
enum Lookup {
    /// To be looked at one and all.
    All(Positions),
    Near(Grid),
}

/// An agent as it is between two steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Agent {
    /// x and y, world units; y points down the screen.
    pub position: [f64; 2],
    /// Unit vector straight ahead.
    pub heading: [f64; 2],
    /// Heading in radians, not wrapped.
    pub theta: f64,
    /// What the last step moved it by, walls and collisions included; zero at the start.
    pub displacement: [f64; 2],
    /// What it sensed last: 0 or 1; with two sensors 2 S1 + S2, where S1 looks straight ahead. 0 at the start.
    pub sensed: u8,
}

/// What an agent carries besides its position.
#[derive(Debug, Clone, Copy)]
struct Body {
    position: [f64; 2],
    heading: [f64; 2],
    theta: f64,
    displacement: [f64; 2],
    sensed: u8,
}

/// Where the centre of an agent may be before collisions.
#[derive(Debug, Clone, Copy)]
struct Walls {
    low: f64,
    high: [f64; 2],
}

impl Swarm {
    /// A swarm at its start, on the fastest instructions that this CPU has.
    ///
    /// # Errors
    /// Where `start` does not have one pose for each of the world's agents.
    pub fn new(controller: &Controller, world: &World, start: &Start) -> Result<Self, Invalid> {
        Self::on(Arch::new(), controller, world, start)
    }

    /// As [`Swarm::new`], on the instructions of `arch`: the bits are the same.
    ///
    /// # Errors
    /// As [`Swarm::new`].
    pub fn on(arch: Arch, controller: &Controller, world: &World, start: &Start) -> Result<Self, Invalid> {
        let mut swarm = Self::pairwise(arch, controller, world, start)?;
        if world.agents() >= grid::WORTH {
            let positions: Vec<_> = swarm.agents().map(|agent| agent.position).collect();
            swarm.others = Lookup::Near(Grid::new(world, &positions));
        }
        Ok(swarm)
    }

    /// As [`Swarm::on`], every agent looking at every other however many there are: the bits are the same. It is there to be
    /// compared with.
    ///
    /// # Errors
    /// As [`Swarm::new`].
    pub fn pairwise(
        arch: Arch,
        controller: &Controller,
        world: &World,
        start: &Start,
    ) -> Result<Self, Invalid> {
        let poses = start.poses_for(world)?;
        Ok(Self {
            arch,
            second_sensor: controller.angle().map(drive::direction),
            robots: Robots {
                walls: Walls::of(world),
                gaits: drive::gaits(controller, world),
                collisions: Collisions::new(world, start),
                bodies: poses.iter().map(Body::at).collect(),
                steps: 0,
            },
            others: Lookup::All(poses.iter().map(|&[x, y, _]| [x, y]).collect()),
        })
    }

    /// Steps every agent once.
    pub fn step(&mut self) {
        self.advance(1);
    }

    /// Steps every agent `steps` times.
    pub fn advance(&mut self, steps: u32) {
        match &mut self.others {
            Lookup::All(others) => self.robots.advance(self.arch, self.second_sensor, others, steps),
            Lookup::Near(others) => self.robots.advance(self.arch, self.second_sensor, others, steps),
        }
    }

    /// Steps done since the start.
    #[must_use]
    pub const fn steps(&self) -> u32 {
        self.robots.steps
    }

    /// The agents, in index order.
    pub fn agents(&self) -> impl ExactSizeIterator<Item = Agent> + Clone {
        self.robots.bodies.iter().map(|body| Agent {
            position: body.position,
            heading: body.heading,
            theta: body.theta,
            displacement: body.displacement,
            sensed: body.sensed,
        })
    }

    /// Where the sensors of an agent with `heading` look, as unit vectors: S1, then S2 if there is one.
    pub fn sensor_directions(&self, heading: [f64; 2]) -> impl Iterator<Item = [f64; 2]> + use<> {
        let second = self.second_sensor.map(|angle| rotate(heading, angle));
        std::iter::once(heading).chain(second)
    }

    /// How often a push was one that the authors' simulator adds its jitter to, whether or not the world has it.
    #[must_use]
    pub const fn jitter_events(&self) -> u64 {
        self.robots.collisions.jitter_events()
    }
}

impl Robots {
    fn advance(&mut self, arch: Arch, second_sensor: Option<[f64; 2]>, others: &mut impl Others, steps: u32) {
        match second_sensor {
            None => arch.dispatch(Run {
                robots: self,
                others,
                steps,
                rays: |heading| [heading],
            }),
            Some(angle) => arch.dispatch(Run {
                robots: self,
                others,
                steps,
                rays: |heading| [heading, rotate(heading, angle)],
            }),
        }
    }

    #[inline(always)]
    fn run<S: Simd, const SENSORS: usize>(
        &mut self,
        simd: S,
        others: &mut impl Others,
        steps: u32,
        rays: impl Fn([f64; 2]) -> [[f64; 2]; SENSORS],
    ) {
        for _ in 0..steps {
            for i in 0..self.bodies.len() {
                self.step_agent(simd, others, i, &rays);
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
    fn step_agent<S: Simd, const SENSORS: usize>(
        &mut self,
        simd: S,
        others: &mut impl Others,
        i: usize,
        rays: &impl Fn([f64; 2]) -> [[f64; 2]; SENSORS],
    ) {
        let body = &mut self.bodies[i];
        let gait = &self.gaits[usize::from(body.sensed % 4)];
        let before = body.position;
        let mut at = self.walls.clamp(gait.drive(before, body.heading));
        body.heading = rotate(body.heading, gait.rotation);
        body.theta += gait.turn;

        let mut observer = Observer {
            index: i,
            at,
            rays: rays(body.heading),
        };
        let reach = self.collisions.reach();
        body.sensed = match others.sense_unless_touched(simd, observer, reach) {
            Some(sensed) => sensed,
            None => {
                at = self.collisions.push_out(simd, others, i, at);
                observer.at = at;
                others.sense(simd, observer, reach)
            }
        };
        body.position = at;
        body.displacement = [at[0] - before[0], at[1] - before[1]];
        others.set(simd, i, at);
    }
}

/// Some steps of a swarm, as something that can be compiled for several kinds of CPU.
///
/// Everything below it is inlined by force: only what is inlined is compiled for the kind at hand.
struct Run<'a, O, R> {
    robots: &'a mut Robots,
    others: &'a mut O,
    steps: u32,
    rays: R,
}

impl<const SENSORS: usize, O, R> WithSimd for Run<'_, O, R>
where
    O: Others,
    R: Fn([f64; 2]) -> [[f64; 2]; SENSORS],
{
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.robots.run(simd, self.others, self.steps, self.rays);
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
    fn of(world: &World) -> Self {
        Self {
            low: world.margin(),
            high: [world.width() - world.margin(), world.height() - world.margin()],
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
