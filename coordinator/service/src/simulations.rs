//! Motions of any controllers, which the coordinator itself simulates, without a worker.
//!
//! The number of poses is limited before any computation. A motion is simulated part by part, as its client takes the parts.

use crate::status::OrStatus as _;
use murmuration_engine::blocking::in_background;
use murmuration_proto::{
    PART_BYTES,
    v1::{self, evaluation_description::Campaign},
};
use murmuration_sim::{replay::motion, simulate::Start};
use murmuration_swarm::{CampaignSpec, Controller, Frames, Invalid, World};
use std::iter;
use tokio::sync::mpsc;
use tonic::Status;

/// Number of poses in a part of a motion: more than the number of robots of any swarm.
const PART_POSES: usize = PART_BYTES / size_of::<Pose>();

/// x, y (world units, y points down the screen) and heading (radians) of a robot.
type Pose = [f64; 3];

/// A swarm to simulate, whose motion is within the limit.
#[derive(Debug)]
pub(super) struct Simulation {
    controller: Controller,
    world: World,
    seed: u64,
    steps: u32,
}

impl TryFrom<v1::SimulateRequest> for Simulation {
    type Error = Status;

    fn try_from(request: v1::SimulateRequest) -> Result<Self, Status> {
        let spec = spec_of(request.description.unwrap_or_default().campaign)?;
        let world = spec.world().clone();
        Ok(Self {
            controller: Controller::new(spec.model().clone(), &request.controller)?,
            steps: steps(request.steps, &world)?,
            seed: request.seed,
            world,
        })
    }
}

impl Simulation {
    /// The poses before the first step and after every step, simulated on demand.
    fn frames(&self) -> Result<impl Iterator<Item = Vec<Pose>> + Send + use<>, Invalid> {
        let motion = motion(&self.controller, &self.world, &Start::seeded(self.seed))?;
        Ok(motion.take(self.steps as usize + 1))
    }
}

/// Number of steps to simulate: as requested, or else the world's horizon.
fn steps(asked: Option<u32>, world: &World) -> Result<u32, Invalid> {
    let agents = world.agents();
    // The start has a frame too.
    let most = Frames::MAX_POSES / u64::from(agents) - 1;
    let (field, steps) = match asked {
        Some(steps) => ("steps", steps),
        None => ("world.horizon", world.horizon()),
    };
    if (1..=most).contains(&u64::from(steps)) {
        return Ok(steps);
    }
    let allowed = format!(
        "a whole number from 1 to {most} for {agents} robots: a motion has at most {} poses",
        Frames::MAX_POSES
    );
    Err(Invalid::new(field, steps, allowed))
}

/// The campaign whose robots and world are simulated.
pub(super) fn spec_of(campaign: Option<Campaign>) -> Result<CampaignSpec, Status> {
    match campaign {
        Some(Campaign::Spec(spec)) => Ok(CampaignSpec::try_from(spec)?),
        Some(Campaign::Toml(text)) => Ok(CampaignSpec::from_toml(&text)?),
        None => Err(Invalid::missing("campaign", "a campaign").into()),
    }
}

/// Sends the motion of a swarm, or an error, while the client takes the parts.
pub(super) async fn send_motion(simulation: Simulation, parts: &mpsc::Sender<Result<v1::Motion, Status>>) {
    if let Err(status) = simulated(simulation, parts).await {
        // The client may have disconnected.
        let _ = parts.send(Err(status)).await;
    }
}

async fn simulated(
    simulation: Simulation,
    parts: &mpsc::Sender<Result<v1::Motion, Status>>,
) -> Result<(), Status> {
    let mut frames = simulation.frames()?;
    loop {
        // A part is simulated once the client has room for it.
        let Ok(room) = parts.reserve().await else {
            return Ok(());
        };
        let (rest, part) = in_background(move |_| {
            let part = next_part(&mut frames);
            (frames, part)
        })
        .await
        .or_status()?;
        frames = rest;
        match part? {
            Some(part) => room.send(Ok(part)),
            None => return Ok(()),
        }
    }
}

/// The next part of a motion; `None` after its end.
fn next_part(frames: &mut impl Iterator<Item = Vec<Pose>>) -> Result<Option<v1::Motion>, Invalid> {
    let Some(first) = frames.next() else {
        return Ok(None);
    };
    let agents = first.len();
    let more = (PART_POSES / agents.max(1)).saturating_sub(1);
    let poses = iter::once(first).chain(frames.take(more));
    let poses: Vec<f64> = poses.flatten().flatten().collect();
    if !poses.iter().all(|value| value.is_finite()) {
        return Err(Invalid::new("poses", "not finite", "finite numbers"));
    }
    Ok(Some(v1::Motion {
        agents: agents as u32,
        poses,
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_sim::replay::poses;
    use tonic::Code;

    /// The default world with `robots` robots, and one of the paper's controllers.
    fn asked(robots: u32, steps: Option<u32>) -> v1::SimulateRequest {
        let toml = format!(
            "name = \"x\"\nmodel = \"single-sensor\"\nmethod = \"latent\"\n[world]\nagents = {robots}\nhorizon = 5000\n"
        );
        v1::SimulateRequest {
            description: Some(v1::EvaluationDescription {
                campaign: Some(Campaign::Toml(toml)),
                pictures: false,
                seed: None,
            }),
            controller: vec![-0.7, 0.3, 1.0, 1.0],
            seed: 3,
            steps,
        }
    }

    fn simulation(robots: u32, steps: Option<u32>) -> Simulation {
        Simulation::try_from(asked(robots, steps)).unwrap()
    }

    #[test]
    fn a_motion_that_would_be_too_long_is_refused_with_the_numbers() {
        let refused = |robots, steps| {
            let status = Simulation::try_from(asked(robots, steps)).unwrap_err();
            assert_eq!(status.code(), Code::InvalidArgument);
            status.message().to_owned()
        };
        assert_eq!(simulation(24, None).steps, 5000);
        assert_eq!(simulation(24, Some(166_665)).steps, 166_665);
        assert_eq!(
            refused(24, Some(166_666)),
            "steps = 166666: must be a whole number from 1 to 166665 for 24 robots: a motion has at most 4000000 poses"
        );
        assert!(refused(24, Some(0)).starts_with("steps = 0: must be a whole number from 1 to"));
        assert!(
            refused(1000, None).starts_with("world.horizon = 5000: must be a whole number from 1 to 3999")
        );
    }

    #[tokio::test]
    async fn parts_are_the_motion_that_the_simulator_makes() {
        let asked = simulation(24, None);
        let expected = poses(&asked.controller, &asked.world, &Start::seeded(3)).unwrap();
        let (parts, mut received) = mpsc::channel(1);
        let sending = tokio::spawn(async move { send_motion(asked, &parts).await });
        let mut got = Vec::new();
        let mut count = 0;
        while let Some(part) = received.recv().await {
            let part = part.unwrap();
            assert_eq!(part.agents, 24);
            assert!(part.poses.len() <= PART_BYTES / size_of::<f64>());
            got.extend(part.poses);
            count += 1;
        }
        sending.await.unwrap();
        assert!(count > 1);
        let expected: Vec<f64> = expected.into_iter().flatten().flatten().collect();
        assert_eq!(got, expected);
    }

    #[tokio::test]
    async fn a_motion_whose_client_is_gone_ends() {
        let (parts, mut received) = mpsc::channel(1);
        let asked = simulation(24, None);
        let sending = tokio::spawn(async move { send_motion(asked, &parts).await });
        received.recv().await.unwrap().unwrap();
        drop(received);
        sending.await.unwrap();
    }
}
