//! Motion of a robot in one step, from a pair of its controller's numbers. For wheel speeds see the paper, appendix "Swarm
//! Kinematics".

use murmuration_swarm::{DriveKind, Robot, RobotController};

/// The motion of one step under one sensor state.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Gait {
    /// Distance that the robot drives along its old heading.
    pub(super) ahead: f64,
    /// Change of heading, radians.
    pub(super) turn: f64,
    /// (cos, sin) of `turn`.
    pub(super) rotation: [f64; 2],
}

/// Turns a pair of numbers into a gait.
#[derive(Debug, Clone, Copy)]
pub(super) struct Drivetrain {
    kind: DriveKind,
    radius: f64,
    dt: f64,
}

/// The gaits of a controller, in the order of sensor states.
///
/// In the paper's equation, the two middle rows are exchanged; the paper's pictures follow the order of this function.
pub(super) fn gaits(controller: RobotController<'_>, dt: f64) -> impl Iterator<Item = Gait> {
    let drive = Drivetrain::of(controller.robot(), dt);
    controller.pairs().iter().map(move |&pair| drive.gait(pair))
}

impl Drivetrain {
    /// The drivetrain of a robot, for steps of `dt`.
    pub(super) fn of(robot: &Robot, dt: f64) -> Self {
        Self {
            kind: robot.drive().kind(),
            radius: robot.radius(),
            dt,
        }
    }

    /// The gait of the pair (a, b).
    pub(super) fn gait(&self, [a, b]: [f64; 2]) -> Gait {
        let (ahead, turn) = match self.kind {
            DriveKind::Differential { wheel_radius } => (
                wheel_radius / 2.0 * (a + b) * self.dt,
                (a - b) / (2.0 * self.radius) * self.dt,
            ),
            DriveKind::Unicycle => (a * self.dt, b * self.dt),
        };
        Gait {
            ahead,
            turn,
            rotation: direction(turn),
        }
    }
}

impl Gait {
    /// The position to which an agent at `from` drives, with the unit vector `heading`.
    #[inline(always)]
    pub(super) fn drive(&self, from: [f64; 2], heading: [f64; 2]) -> [f64; 2] {
        [
            from[0] + self.ahead * heading[0],
            from[1] + self.ahead * heading[1],
        ]
    }
}

/// The unit vector at `angle` radians.
pub(super) fn direction(angle: f64) -> [f64; 2] {
    [libm::cos(angle), libm::sin(angle)]
}

/// A vector rotated by an angle, which is given as (cos, sin).
#[inline(always)]
pub(super) fn rotate([x, y]: [f64; 2], [cos, sin]: [f64; 2]) -> [f64; 2] {
    [x * cos - y * sin, x * sin + y * cos]
}

/// Brings the length of a vector nearer to 1 by one Newton step of the inverse square root. The length must be nearly 1.
#[inline(always)]
pub(super) fn renormalised([x, y]: [f64; 2]) -> [f64; 2] {
    let factor = 1.5 - 0.5 * (x * x + y * y);
    [x * factor, y * factor]
}
