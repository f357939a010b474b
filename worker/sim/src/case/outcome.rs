//! The outcome of a case, as JSON.

use super::Case;
use crate::{
    evaluate::Ending,
    rasterise::Rasteriser,
    simulate::{Agent, Swarm},
};
use base64::{Engine as _, prelude::BASE64_STANDARD};
use murmuration_proto::SIMULATOR_VERSION;
use murmuration_swarm::Invalid;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

/// Name that cases use for the rules of motion of this simulator.
const PHYSICS: &str = "feb2023";

/// The case's object with this simulator's values.
pub(super) fn of(case: &Case) -> Result<Value, Invalid> {
    let mut rasteriser = Rasteriser::new(&case.world, &case.image)?;
    let mut ending = Ending::new(&case.world, &case.image, &mut rasteriser);
    let mut swarm = case.swarm()?;
    let mut reported: BTreeMap<u32, Value> = case.checkpoints().map(|step| (step, Value::Null)).collect();
    loop {
        if let Some(report) = reported.get_mut(&swarm.steps()) {
            *report = agents(&swarm)?;
        }
        if swarm.steps() == case.world.horizon() {
            break;
        }
        swarm.step();
        ending.observe(&swarm);
    }
    let features = ending.features.means();
    if let Some(value) = features.iter().find(|value| !value.is_finite()) {
        return Err(Invalid::new("features", value, "finite"));
    }
    let checkpoints = case.checkpoints.iter();
    let checkpoints: Map<String, Value> = checkpoints
        .map(|(key, step)| (key.clone(), reported[step].clone()))
        .collect();

    let mut document = case.document.clone();
    for (key, value) in [
        ("jitter_events", json!(swarm.jitter_events())),
        ("checkpoints", Value::Object(checkpoints)),
        ("features", json!(features)),
        ("image", json!(BASE64_STANDARD.encode(ending.rasteriser.image()))),
        (
            "image_raw",
            json!(BASE64_STANDARD.encode(ending.rasteriser.raw_image())),
        ),
        (
            "reference",
            json!(format!("murmuration, simulator version {SIMULATOR_VERSION}")),
        ),
    ] {
        document.insert(key.into(), value);
    }
    // The numbers come from this simulator's physics, whatever physics the case named.
    if let Some(physics) = document.get_mut("physics") {
        *physics = json!(PHYSICS);
    }
    Ok(Value::Object(document))
}

/// The agents, each as `[x, y, theta, sensor state, dx, dy]`.
fn agents(swarm: &Swarm) -> Result<Value, Invalid> {
    let agent = |(i, agent): (usize, Agent)| {
        let Agent {
            position: [x, y],
            theta,
            displacement: [dx, dy],
            sensed,
            ..
        } = agent;
        if [x, y, theta, dx, dy].iter().all(|value| value.is_finite()) {
            return Ok(json!([x, y, theta, sensed, dx, dy]));
        }
        let step = swarm.steps();
        Err(Invalid::new(
            format!("agent {i} at step {step}"),
            "not finite",
            "finite numbers",
        ))
    };
    swarm.agents().enumerate().map(agent).collect()
}
