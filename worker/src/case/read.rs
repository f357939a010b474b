//! Reads a case from a JSON object, with errors that name the key.

use super::{
    Case, Robots,
    keys::{Keys, array, numbers, shown},
    species,
};
use crate::simulate::Start;
use murmuration_proto::{CapabilityModel, Controller, ImageFormat, Invalid, World, counted, v1};
use serde_json::Value;

/// Steps to report if a case names none (those within its horizon, and its end).
const USUAL_CHECKPOINTS: [u32; 11] = [1, 2, 5, 10, 20, 50, 100, 200, 400, 800, 1200];

pub(super) fn case(document: Value) -> Result<Case, Invalid> {
    let Value::Object(document) = document else {
        return Err(Invalid::new("case", shown(&document), "a JSON object"));
    };
    let keys = Keys::new(&document);
    let (robots, radius) = match keys.get("species") {
        Some(_) => species::robots(keys).map(|(robots, largest)| (robots, Some(largest)))?,
        None => (Robots::Paper(controller(keys)?), keys.number("agent_radius")?),
    };
    let poses = poses(keys)?;
    let world = world(keys, poses.len(), radius)?;
    Ok(Case {
        robots,
        world,
        image: image(keys, &world)?,
        start: Start::at(poses)?,
        checkpoints: checkpoints(keys, world.horizon())?,
        document,
    })
}

fn controller(keys: Keys<'_>) -> Result<Controller, Invalid> {
    let genes = numbers("controller", keys.required("controller")?)?;
    let model = match keys.get("model") {
        None => CapabilityModel::ALL
            .into_iter()
            .find(|model| model.genes() == genes.len()),
        Some(value) => {
            let named = |model: &CapabilityModel| {
                let name = value.as_str().unwrap_or_default();
                name == model.name() || name == file_name(*model)
            };
            let found = CapabilityModel::ALL.into_iter().find(named);
            let allowed = || {
                CapabilityModel::ALL
                    .map(|model| format!("{:?}", file_name(model)))
                    .join(" or ")
            };
            Some(found.ok_or_else(|| Invalid::new("model", shown(value), allowed()))?)
        }
    };
    let model = model.ok_or_else(|| {
        let allowed = "4 values for the single-sensor model or 9 for the two-sensor model";
        Invalid::new("controller", counted(genes.len() as u64, "value"), allowed)
    })?;
    Controller::new(model, &genes)
}

/// A model's name in case files.
const fn file_name(model: CapabilityModel) -> &'static str {
    match model {
        CapabilityModel::SingleSensor => "single_sensor",
        CapabilityModel::TwoSensor => "two_sensor",
    }
}

fn poses(keys: Keys<'_>) -> Result<Vec<[f64; 3]>, Invalid> {
    let value = keys.required("initial")?;
    let poses = array("initial", value)?;
    let pose = |(i, pose): (usize, &Value)| {
        let key = format!("initial[{i}]");
        let values = numbers(&key, pose)?;
        <[f64; 3]>::try_from(values).map_err(|_| Invalid::new(key, shown(pose), "[x, y, theta]"))
    };
    poses.iter().enumerate().map(pose).collect()
}

fn world(keys: Keys<'_>, poses: usize, radius: Option<f64>) -> Result<World, Invalid> {
    let agents = keys.whole("agents")?;
    if let Some(agents) = agents
        && agents as usize != poses
    {
        return Err(Invalid::new(
            "initial",
            counted(poses as u64, "pose"),
            format!("one for each of {agents} agents"),
        ));
    }
    let sides = match keys.get("world") {
        None => [None, None],
        Some(value) => {
            let sides = numbers("world", value)?;
            let sides = <[f64; 2]>::try_from(sides);
            sides
                .map_err(|_| Invalid::new("world", shown(value), "[width, height]"))?
                .map(Some)
        }
    };
    let message = v1::World {
        width: sides[0],
        height: sides[1],
        padding: keys.number("padding")?,
        agents: Some(u32::try_from(poses).unwrap_or(u32::MAX)),
        radius,
        wheel_radius: keys.number("wheel_radius")?,
        dt: keys.number("dt")?,
        horizon: keys.whole("steps")?,
        jitter: jitter(keys)?,
    };
    World::try_from(message).map_err(|error| Invalid {
        field: match error.field.as_str() {
            "width" => "world[0]".into(),
            "height" => "world[1]".into(),
            "radius" => "agent_radius".into(),
            "horizon" => "steps".into(),
            _ => error.field,
        },
        ..error
    })
}

fn jitter(keys: Keys<'_>) -> Result<Option<bool>, Invalid> {
    let Some(value) = keys.get("jitter") else {
        return Ok(None);
    };
    match value {
        Value::Bool(jitter) => Ok(Some(*jitter)),
        Value::String(name) if name == "disabled" => Ok(Some(false)),
        Value::String(name) if name == "enabled" => Ok(Some(true)),
        _ => Err(Invalid::new(
            "jitter",
            shown(value),
            "\"disabled\" or \"enabled\"",
        )),
    }
}

/// The picture's format: the paper's, unless `resolution` or `window` are given or the world is smaller.
fn image(keys: Keys<'_>, world: &World) -> Result<ImageFormat, Invalid> {
    let usual = ImageFormat::default().resolution();
    let smaller_side = world.width().min(world.height()) as u32;
    let message = v1::ImageFormat {
        resolution: Some(keys.whole("resolution")?.unwrap_or(usual.min(smaller_side))),
        window: keys.whole("window")?,
    };
    ImageFormat::for_world(message, world)
}

fn checkpoints(keys: Keys<'_>, horizon: u32) -> Result<Vec<(String, u32)>, Invalid> {
    let Some(value) = keys.get("checkpoints") else {
        let mut steps: Vec<u32> = USUAL_CHECKPOINTS
            .into_iter()
            .filter(|&step| step < horizon)
            .collect();
        steps.push(horizon);
        return Ok(steps.into_iter().map(|step| (step.to_string(), step)).collect());
    };
    let Value::Object(checkpoints) = value else {
        return Err(Invalid::new(
            "checkpoints",
            shown(value),
            "an object with a key for each step",
        ));
    };
    let checkpoint = |key: &String| match key.parse() {
        Ok(step) if step <= horizon => Ok((key.clone(), step)),
        _ => {
            let allowed = format!("a whole number from 0 to {horizon}");
            Err(Invalid::new("checkpoints", format!("\"{key}\""), allowed))
        }
    };
    checkpoints.keys().map(checkpoint).collect()
}
