//! Swarms with a given motion, such as a camera's tracks. The features and pictures of these swarms are computed as for simulated
//! swarms.

use super::{Lookup, Minds, Swarm, drive::direction};
use pulp::Scalar;

impl Swarm {
    /// Takes a step that puts every agent at its pose (x, y, theta), in world units and radians, regardless of its controller. On
    /// a torus, agents move the shorter way around.
    ///
    /// `poses` has one pose of finite numbers per agent.
    pub(crate) fn place(&mut self, poses: &[[f64; 3]]) {
        let torus = match &self.minds {
            Minds::Situated(situated) => situated.torus(),
            Minds::Paper(_) | Minds::Described(_) => None,
        };
        for (i, (body, &[x, y, theta])) in self.robots.bodies.iter_mut().zip(poses).enumerate() {
            let at = torus.map_or([x, y], |torus| torus.wrap([x, y]));
            let nearest = torus.map_or(at, |torus| torus.nearest(at, body.position));
            body.displacement = [nearest[0] - body.position[0], nearest[1] - body.position[1]];
            body.position = at;
            body.heading = direction(theta);
            body.theta = theta;
            match &mut self.others {
                Lookup::All(others) => others.set(Scalar::new(), i, at),
                Lookup::Near(others) => others.set(i, at),
            }
        }
        self.robots.steps += 1;
    }
}
