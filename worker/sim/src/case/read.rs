//! Reads a case from a JSON object, with errors that name the key.

use super::{
    Case,
    keys::{Keys, array, numbers, shown},
    species,
};
use crate::simulate::Start;
use murmuration_proto::v1;
use murmuration_swarm::{
    Boundary, CapabilityModel, Controller, ImageFormat, Invalid, Preset, World, counted,
};
use serde_json::Value;

/// Steps to report if a case names no steps: of this list, the steps before the case's last step, and the last step.
const USUAL_CHECKPOINTS: [u32; 11] = [1, 2, 5, 10, 20, 50, 100, 200, 400, 800, 1200];

pub(super) fn case(document: Value) -> Result<Case, Invalid> {
    let Value::Object(document) = document else {
        return Err(Invalid::new("case", shown(&document), "a JSON object"));
    };
    let keys = Keys::new(&document);
    let poses = poses(keys)?;
    let model = match keys.get("species") {
        Some(_) => None,
        None => Some(model(keys)?),
    };
    let controller = match model {
        None => species::controller(keys)?,
        Some(preset) => {
            let radius = keys.number("agent_radius")?.unwrap_or(World::default().radius());
            let wheel_radius = keys
                .number("wheel_radius")?
                .unwrap_or(World::default().wheel_radius());
            let robot = preset.sized(radius, wheel_radius).map_err(in_case)?;
            let genes = numbers("controller", keys.required("controller")?)?;
            Controller::new(CapabilityModel::of_one(robot)?, &genes)?
        }
    };
    let world = world(keys, poses.len(), controller.model().largest_radius())?;
    Ok(Case {
        image: image(keys, &world, controller.model())?,
        controller,
        start: Start::at(poses)?,
        checkpoints: checkpoints(keys, world.horizon())?,
        world,
        document,
    })
}

/// The preset of a case without species: the named preset, or the paper's model with the controller's number of genes.
fn model(keys: Keys<'_>) -> Result<Preset, Invalid> {
    let Some(value) = keys.get("model") else {
        let genes = array("controller", keys.required("controller")?)?.len();
        let found = MODELS
            .into_iter()
            .find(|(_, preset)| preset.robot().genes() == genes);
        return found.map(|(_, preset)| preset).ok_or_else(|| {
            let allowed = "4 values for the single-sensor model or 9 for the two-sensor model";
            Invalid::new("controller", counted(genes as u64, "value"), allowed)
        });
    };
    let name = value.as_str().unwrap_or_default();
    let named = |(file_name, preset): &(&str, Preset)| name == *file_name || name == preset.name();
    let found = MODELS.into_iter().find(named).map(|(_, preset)| preset);
    found.ok_or_else(|| {
        let allowed = MODELS.map(|(file_name, _)| format!("{file_name:?}")).join(" or ");
        Invalid::new("model", shown(value), allowed)
    })
}

/// The paper's models under their names in case files.
const MODELS: [(&str, Preset); 2] = [
    ("single_sensor", Preset::SingleSensor),
    ("two_sensor", Preset::TwoSensor),
];

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

fn world(keys: Keys<'_>, poses: usize, radius: f64) -> Result<World, Invalid> {
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
        radius: Some(radius),
        wheel_radius: keys.number("wheel_radius")?,
        dt: keys.number("dt")?,
        horizon: keys.whole("steps")?,
        jitter: jitter(keys)?,
        boundary: keys.flag("walls")?.map(|walls| {
            let boundary = if walls { Boundary::Walls } else { Boundary::Open };
            boundary.name().to_owned()
        }),
        ..v1::World::default()
    };
    World::try_from(message).map_err(in_case)
}

/// Renames the field of an error to its key in a case.
fn in_case(error: Invalid) -> Invalid {
    Invalid {
        field: match error.field.as_str() {
            "width" => "world[0]".into(),
            "height" => "world[1]".into(),
            "radius" => "agent_radius".into(),
            "horizon" => "steps".into(),
            _ => error.field,
        },
        ..error
    }
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

/// The picture's format: the paper's format, unless the case gives `resolution` or `window`, or the world is smaller than the
/// picture.
fn image(keys: Keys<'_>, world: &World, model: &CapabilityModel) -> Result<ImageFormat, Invalid> {
    let usual = ImageFormat::default().resolution();
    let smaller_side = world.width().min(world.height()) as u32;
    let message = v1::ImageFormat {
        resolution: Some(keys.whole("resolution")?.unwrap_or(usual.min(smaller_side))),
        window: keys.whole("window")?,
        ..v1::ImageFormat::default()
    };
    ImageFormat::for_swarm(message, world, model)
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
