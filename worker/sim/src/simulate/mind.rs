//! The parts of a step that differ by kind of robot: the gait, the boundary, and pushing and sensing after the drive.

use super::{
    Walls,
    collide::Collisions,
    drive::{self, Gait, rotate},
    others::{Everyone, Others},
    sight::{Observer, Reach},
};
use murmuration_swarm::{RobotController, World};
use pulp::Simd;

/// The kinds of robots of a swarm.
pub(super) trait Mind {
    /// The gait of robot `i` in the sensor state `sensed`.
    fn gait(&mut self, i: usize, sensed: u8) -> Gait;

    /// Keeps robot `i`, which has driven from `before` to `driven`, inside the edges and outside of obstacles.
    fn bound(&self, i: usize, before: [f64; 2], driven: [f64; 2]) -> Bound;

    /// Moves a robot that others have pushed to `at` back into the world, if the world is a torus.
    #[inline(always)]
    fn home(&self, at: [f64; 2]) -> [f64; 2] {
        at
    }

    /// Pushes a robot out of the other robots after its drive, and then reads its sensors. Returns its position and its sensor
    /// state.
    fn settle<S: Simd>(
        &mut self,
        simd: S,
        others: &impl Everyone,
        collisions: &mut Collisions,
        robot: Driven,
    ) -> ([f64; 2], u8);
}

/// Position of a robot before it is pushed out of other robots.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bound {
    pub(super) at: [f64; 2],
    /// Position before the step, in the coordinates of `at`. The robot's displacement is measured from this position.
    pub(super) from: [f64; 2],
}

/// A robot that has driven in this step, and has not read its sensors yet.
#[derive(Debug, Clone, Copy)]
pub(super) struct Driven {
    pub(super) index: usize,
    pub(super) at: [f64; 2],
    pub(super) heading: [f64; 2],
}

/// The robots of the paper's two models: all alike, with rays without limit.
#[derive(Debug, Clone, Copy)]
pub(super) struct Paper {
    pub(super) walls: Walls,
    pub(super) gaits: [Gait; 4],
    /// (cos, sin) of the second sensor's angle.
    pub(super) second_sensor: Option<[f64; 2]>,
}

/// [`Paper`] robots, with the function that turns a heading into rays.
pub(super) struct PaperMind<R> {
    pub(super) paper: Paper,
    pub(super) rays: R,
}

impl Paper {
    /// Robots of one of the paper's presets.
    pub(super) fn new(controller: RobotController<'_>, world: &World) -> Self {
        let mut gaits = [Gait::default(); 4];
        for (gait, of_state) in gaits.iter_mut().zip(drive::gaits(controller, world.dt())) {
            *gait = of_state;
        }
        Self {
            walls: Walls::of(controller.robot(), world),
            gaits,
            second_sensor: controller.angles().nth(1).map(drive::direction),
        }
    }

    /// Reads an agent's sensors without moving the agent.
    pub(super) fn sense<S: Simd>(&self, simd: S, others: &impl Others, robot: Driven, reach: Reach) -> u8 {
        match self.second_sensor {
            None => others.sense(simd, robot.observer([robot.heading]), reach),
            Some(angle) => {
                let rays = [robot.heading, rotate(robot.heading, angle)];
                others.sense(simd, robot.observer(rays), reach)
            }
        }
    }
}

impl Driven {
    #[inline(always)]
    pub(super) const fn observer<const SENSORS: usize>(self, rays: [[f64; 2]; SENSORS]) -> Observer<SENSORS> {
        Observer {
            index: self.index,
            at: self.at,
            rays,
        }
    }
}

impl<const SENSORS: usize, R> Mind for PaperMind<R>
where
    R: Fn([f64; 2]) -> [[f64; 2]; SENSORS],
{
    #[inline(always)]
    fn gait(&mut self, _: usize, sensed: u8) -> Gait {
        self.paper.gaits[usize::from(sensed % 4)]
    }

    #[inline(always)]
    fn bound(&self, _: usize, before: [f64; 2], driven: [f64; 2]) -> Bound {
        Bound {
            at: self.paper.walls.clamp(driven),
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
        settle_rays(
            simd,
            others,
            collisions,
            robot.observer((self.rays)(robot.heading)),
        )
    }
}

/// [`Mind::settle`] for a robot whose sensors are rays without limit, among robots of the same size.
#[inline(always)]
pub(super) fn settle_rays<S: Simd, const SENSORS: usize>(
    simd: S,
    others: &impl Others,
    collisions: &mut Collisions,
    mut observer: Observer<SENSORS>,
) -> ([f64; 2], u8) {
    let reach = collisions.reach();
    let mut at = observer.at;
    let sensed = match others.sense_unless_touched(simd, observer, reach) {
        Some(sensed) => sensed,
        None => {
            let radius = collisions.diameter() / 2.0;
            at = collisions.push_out(simd, others, observer.index, radius, at);
            observer.at = at;
            others.sense(simd, observer, reach)
        }
    };
    (at, sensed)
}
