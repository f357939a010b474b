//! Simulations and evaluations of uniform controllers on one thread, compared to the simulation's loop in numba.

use super::{
    super::{ONE_SENSOR, PAIRS, TWO_SENSORS, thread_cpu},
    CliError, Floor, Row, in_turns,
    peer::Peer,
};
use murmuration_proto::v1;
use murmuration_sim::{
    evaluate::Evaluator,
    simulate::{Agent, Start, Swarm},
};
use murmuration_swarm::{
    Controller, ControllerSpace, ImageFormat, Preset, Purpose, RandomStream, RobotController, World,
};
use serde_json::json;
use std::{hint::black_box, time::Duration};

const LOOP: &str = include_str!("../../../../../worker/sim/benches/numba_loop.py");
/// Number of all controllers, and number of controllers evaluated at once.
const CONTROLLERS: usize = 48;
const AT_ONCE: usize = 8;

/// Two rows: the simulation's loop alone, and evaluations with features and picture.
pub(super) fn rows(model: Preset, span: Duration, python: &str) -> Result<[Row; 2], CliError> {
    let world = World::default();
    let tasks = uniform(model)?;
    let mut numba = Peer::start(python, "numba", LOOP, "", &population(&tasks, &world)?);
    // The first step of a window clears the canvas, so the shortest window draws one step.
    let shortest = v1::ImageFormat {
        window: Some(2),
        ..ImageFormat::default().into()
    };
    let bare = ImageFormat::for_swarm(shortest, &world, &model.into())?;
    let (simulation, evaluation, operations_a_pair) = match model {
        Preset::SingleSensor => ("simulation, one sensor", "evaluation, one sensor", ONE_SENSOR),
        _ => ("simulation, two sensors", "evaluation, two sensors", TWO_SENSORS),
    };
    let floor = Floor {
        count: PAIRS * operations_a_pair,
        of: "operations",
    };
    let mut row = |item: &str, format: &ImageFormat| {
        let mut evaluator = Evaluator::new(&world, format)?;
        let (ours, peer) = in_turns(span, || {
            let took = evaluated(&mut evaluator, &tasks)?;
            Ok((took, numba.as_mut().map(simulated).transpose()?))
        })?;
        let rate = |seconds: f64| CONTROLLERS as f64 / seconds;
        Ok::<_, CliError>(Row {
            item: item.to_owned(),
            unit: "evaluations/s",
            ours: rate(ours),
            peer: peer.map(rate),
            peer_name: Some("numba, loop alone"),
            floor,
        })
    };
    Ok([row(simulation, &bare)?, row(evaluation, &ImageFormat::default())?])
}

fn uniform(model: Preset) -> Result<Vec<(Controller, Start)>, CliError> {
    let space = ControllerSpace::for_model(v1::ControllerSpace::default(), &model.into())?;
    let mut stream = RandomStream::derive(1, Purpose::Propose, 0);
    let starts = (0..CONTROLLERS as u64).map(Start::seeded);
    Ok(starts.map(|start| (space.sample(&mut stream), start)).collect())
}

/// CPU time of this thread for the evaluations, seconds.
fn evaluated(evaluator: &mut Evaluator, tasks: &[(Controller, Start)]) -> Result<f64, CliError> {
    let begun = thread_cpu();
    for tasks in tasks.chunks(AT_ONCE) {
        black_box(evaluator.evaluate_all(tasks)?);
    }
    Ok(thread_cpu().saturating_sub(begun).as_secs_f64())
}

/// Time of numba for the swarms of one round, seconds.
fn simulated(numba: &mut Peer) -> Result<f64, CliError> {
    let seconds = numba.round()?;
    seconds.parse().map_err(|_| numba.failed(&seconds))
}

/// The script's first input line: the start of each swarm, and its controller.
fn population(tasks: &[(Controller, Start)], world: &World) -> Result<String, CliError> {
    let pose = |agent: Agent| [agent.position[0], agent.position[1], agent.theta];
    let swarms = tasks.iter().map(|(controller, start)| {
        let swarm = Swarm::new(controller, world, start)?;
        Ok(json!({
            "poses": swarm.agents().map(pose).collect::<Vec<_>>(),
            "speeds": controller.robots().flat_map(|robot| robot.pairs().as_flattened()).collect::<Vec<_>>(),
            "angle": controller.robots().flat_map(RobotController::angles).last(),
            "sensors": controller.model().species()[0].robot().sensors().len(),
        }))
    });
    Ok(json!(swarms.collect::<Result<Vec<_>, CliError>>()?).to_string())
}
