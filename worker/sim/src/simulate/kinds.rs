//! Swarms of described robots: several species, each with its own sensors, body and drive.
//!
//! A robot with the paper's sensors, among robots of its size, takes the same code path as the paper's robots and has the same
//! bits.

use super::{
    Walls,
    collide::Collisions,
    drive::{self, Drivetrain, Gait, rotate},
    gaze::{Eye, Group},
    mind::{Bound, Driven, Mind, settle_rays},
    obstacles::Obstacles,
    others::{Everyone, Others},
    sight::Observer,
};
use murmuration_swarm::{
    Boundary, CapabilityModel, Controller, Invalid, RobotController, SeenRobots, Sensor, Species, World,
};
use pulp::Simd;

/// The species of a swarm, prepared for stepping.
#[derive(Debug, Clone)]
pub(super) struct Kinds {
    kinds: Vec<Kind>,
    /// Index of each robot's kind.
    kind_of: Vec<u8>,
    /// Sides of the rectangle that sensors see, as (normal, distance from the origin); empty without walls.
    sides: Vec<([f64; 2], f64)>,
    obstacles: Obstacles,
}

/// One species, prepared for stepping.
#[derive(Debug, Clone)]
struct Kind {
    radius: f64,
    walls: Walls,
    /// Gaits by sensor state; their number is a power of two.
    gaits: Vec<Gait>,
    /// Pairs of the controller's numbers by sensor state, from which the gaits are computed.
    pairs: Vec<[f64; 2]>,
    drive: Drivetrain,
    sensors: Vec<Sensing>,
    /// Whether all sensors are the paper's and all robots of the swarm have the same size.
    plain: bool,
    /// Directions of the sensors as unit vectors, for a robot that heads along x.
    directions: Vec<[f64; 2]>,
}

/// One sensor of a species.
#[derive(Debug, Clone)]
struct Sensing {
    eye: Eye,
    /// The robots that the sensor sees.
    seen: Vec<Group>,
    wall_range: Option<f64>,
    sees_obstacles: bool,
}

impl Kinds {
    /// The species of a swarm; `groups` are its robots by size.
    pub(super) fn new(controller: &Controller, groups: &[Group], world: &World) -> Self {
        let model = controller.model();
        let by_species = by_species(controller, world);
        let kind = |controller: RobotController<'_>| {
            let robot = controller.robot();
            let sensors = robot.sensors().iter().zip(controller.angles());
            let sensors: Vec<_> = sensors
                .map(|(sensor, angle)| Sensing {
                    eye: Eye::new(sensor, angle),
                    seen: seen(sensor, model, &by_species, groups),
                    wall_range: sensor.wall_range(),
                    sees_obstacles: sensor.sees_obstacles(),
                })
                .collect();
            Kind {
                radius: robot.radius(),
                walls: Walls::of(robot, world),
                gaits: drive::gaits(controller, world.dt()).collect(),
                pairs: controller.pairs().to_vec(),
                drive: Drivetrain::of(robot, world.dt()),
                plain: groups.len() == 1 && robot.sensors().iter().all(Sensor::is_plain_ray),
                directions: sensors.iter().map(|sensor| sensor.eye.direction()).collect(),
                sensors,
            }
        };
        let places = by_species.iter().enumerate();
        let kind_of =
            places.flat_map(|(place, group)| std::iter::repeat_n(place as u8, group.end - group.first));
        Self {
            kinds: controller.robots().map(kind).collect(),
            kind_of: kind_of.collect(),
            sides: match world.boundary() {
                Boundary::Walls => sides(world),
                Boundary::Open | Boundary::Torus => Vec::new(),
            },
            obstacles: Obstacles::new(world),
        }
    }

    /// Index of the species of robot `i`.
    pub(super) fn species(&self, i: usize) -> usize {
        usize::from(self.kind_of[i])
    }

    /// Radius of robot `i`.
    pub(super) fn radius(&self, i: usize) -> f64 {
        self.kind(i).radius
    }

    /// Directions of the sensors of robot `i` as unit vectors, when it heads along x.
    pub(super) fn directions(&self, i: usize) -> &[[f64; 2]] {
        &self.kind(i).directions
    }

    #[inline(always)]
    fn kind(&self, i: usize) -> &Kind {
        &self.kinds[usize::from(self.kind_of[i])]
    }

    /// Reads a robot's sensors without moving the robot.
    #[inline(always)]
    pub(super) fn sense<S: Simd>(&self, simd: S, others: &impl Others, robot: Driven) -> u8 {
        let mut state = 0;
        for sensor in &self.kind(robot.index).sensors {
            let gaze = sensor.eye.turned(robot.heading);
            let mut on = false;
            for group in &sensor.seen {
                on = on || others.sees(simd, &gaze, group, robot.index, robot.at);
            }
            if let Some(range) = sensor.wall_range {
                for &(normal, distance) in &self.sides {
                    let ahead = distance - (normal[0] * robot.at[0] + normal[1] * robot.at[1]);
                    on = on || range * gaze.reach(normal) >= ahead;
                }
            }
            on = on || sensor.sees_obstacles && self.obstacles.seen(&gaze, robot.at);
            state = 2 * state + u8::from(on);
        }
        state
    }
}

impl Kinds {
    /// The gait of robot `i` in the sensor state `sensed`.
    #[inline(always)]
    pub(super) fn gait(&self, i: usize, sensed: u8) -> Gait {
        let gaits = &self.kind(i).gaits;
        gaits[usize::from(sensed) % gaits.len()]
    }

    /// The drivetrain of robot `i`, and the pair of numbers that drives it in the sensor state `sensed`.
    #[inline(always)]
    pub(super) fn driven_by(&self, i: usize, sensed: u8) -> (Drivetrain, [f64; 2]) {
        let Kind { pairs, drive, .. } = self.kind(i);
        (*drive, pairs[usize::from(sensed) % pairs.len()])
    }

    /// Obstacles of the world.
    pub(super) const fn obstacles(&self) -> &Obstacles {
        &self.obstacles
    }

    /// The bounds that the walls set for the centre of robot `i`.
    #[inline(always)]
    pub(super) fn walls(&self, i: usize) -> &Walls {
        &self.kind(i).walls
    }

    /// Implements [`Mind::settle`].
    #[inline(always)]
    pub(super) fn settle<S: Simd>(
        &self,
        simd: S,
        others: &impl Others,
        collisions: &mut Collisions,
        robot: Driven,
    ) -> ([f64; 2], u8) {
        let kind = self.kind(robot.index);
        if kind.plain {
            let directions = kind.directions.as_slice();
            return match directions.len() {
                1 => settle_rays(simd, others, collisions, turned::<1>(robot, directions)),
                2 => settle_rays(simd, others, collisions, turned::<2>(robot, directions)),
                3 => settle_rays(simd, others, collisions, turned::<3>(robot, directions)),
                4 => settle_rays(simd, others, collisions, turned::<4>(robot, directions)),
                5 => settle_rays(simd, others, collisions, turned::<5>(robot, directions)),
                _ => settle_rays(simd, others, collisions, turned::<6>(robot, directions)),
            };
        }
        let at = collisions.push_out(simd, others, robot.index, kind.radius, robot.at);
        (at, self.sense(simd, others, Driven { at, ..robot }))
    }
}

impl Mind for &Kinds {
    #[inline(always)]
    fn gait(&mut self, i: usize, sensed: u8) -> Gait {
        Kinds::gait(self, i, sensed)
    }

    #[inline(always)]
    fn bound(&self, i: usize, before: [f64; 2], driven: [f64; 2]) -> Bound {
        Bound {
            at: self.walls(i).clamp(driven),
            from: before,
        }
    }

    #[inline(always)]
    fn settle<S: Simd>(
        &mut self,
        simd: S,
        others: &impl Everyone,
        collisions: &mut Collisions,
        robot: Driven,
    ) -> ([f64; 2], u8) {
        Kinds::settle(self, simd, others, collisions, robot)
    }
}

/// Checks that `world` has the model's number of robots, and the radius of the model's largest body.
pub(super) fn check_fit(model: &CapabilityModel, world: &World) -> Result<(), Invalid> {
    if let Some(robots) = model.robots().filter(|&robots| robots != world.agents()) {
        let allowed = format!("{robots}, the number of robots of all species");
        return Err(Invalid::new("agents", world.agents(), allowed));
    }
    let largest = model.largest_radius();
    if world.radius() != largest {
        let allowed = format!("{largest}, the radius of the largest robot");
        return Err(Invalid::new("radius", world.radius(), allowed));
    }
    Ok(())
}

/// An observer with `SENSORS` rays, turned to the robot's heading.
#[inline(always)]
fn turned<const SENSORS: usize>(robot: Driven, directions: &[[f64; 2]]) -> Observer<SENSORS> {
    let mut rays = [robot.heading; SENSORS];
    for (ray, &direction) in rays.iter_mut().zip(directions) {
        *ray = rotate(robot.heading, direction);
    }
    robot.observer(rays)
}

/// The robots of each species.
pub(super) fn by_species(controller: &Controller, world: &World) -> Vec<Group> {
    let mut end = 0;
    let group = |(species, count): (&Species, u32)| {
        let first = end;
        end += count as usize;
        Group {
            first,
            end,
            radius: species.robot().radius(),
        }
    };
    let counts = controller.counts(world.agents());
    controller
        .model()
        .species()
        .iter()
        .zip(counts)
        .map(group)
        .collect()
}

/// Merges the groups of neighbouring species of one size.
pub(super) fn by_size(by_species: &[Group]) -> Vec<Group> {
    let of_one_size = by_species.chunk_by(|a, b| a.radius == b.radius);
    let whole = |groups: &[Group]| Group {
        end: groups[groups.len() - 1].end,
        ..groups[0]
    };
    of_one_size.map(whole).collect()
}

/// The robots that a sensor sees.
fn seen(sensor: &Sensor, model: &CapabilityModel, by_species: &[Group], by_size: &[Group]) -> Vec<Group> {
    match sensor.robots() {
        SeenRobots::None => Vec::new(),
        SeenRobots::All => by_size.to_vec(),
        SeenRobots::Species(name) => model
            .place(name)
            .map(|place| by_species[place])
            .into_iter()
            .collect(),
    }
}

/// The sides of the rectangle at the world's padding, with outward normals.
fn sides(world: &World) -> Vec<([f64; 2], f64)> {
    let (low, width, height) = (world.padding(), world.width(), world.height());
    vec![
        ([-1.0, 0.0], -low),
        ([1.0, 0.0], width - low),
        ([0.0, -1.0], -low),
        ([0.0, 1.0], height - low),
    ]
}
