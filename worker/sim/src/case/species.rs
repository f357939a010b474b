//! Reads the species of a case, which replace model and controller.

use super::keys::{Keys, array, number, numbers, shown};
use murmuration_swarm::{
    CapabilityModel, Controller, Drive, Invalid, Robot, Seen, Sensor, SensorAngle, SensorDescription,
    Species, SpeciesName, World, counted,
};
use serde_json::Value;

/// The controller of a case with species.
pub(super) fn controller(keys: Keys<'_>) -> Result<Controller, Invalid> {
    if keys.get("goal").is_some() {
        return Err(Invalid::new("goal", "given", "absent: goals are not simulated"));
    }
    let listed = array("species", keys.required("species")?)?;
    let mut species = Vec::with_capacity(listed.len());
    let (mut counts, mut genes) = (Vec::new(), Vec::new());
    for (i, described) in listed.iter().enumerate() {
        let (of, count, own) = one(described).map_err(|error| error.within(&format!("species[{i}]")))?;
        species.push(of);
        counts.push(count);
        genes.extend(own);
    }
    let model = CapabilityModel::new(species, vec![counts])?;
    check_order(keys, &model)?;
    Controller::new(model, &genes)
}

/// A species, the number of its robots, and the genes of its controller.
fn one(described: &Value) -> Result<(Species, u32, Vec<f64>), Invalid> {
    let keys = Keys::of("species", described)?;
    let radius = keys.number("radius")?.unwrap_or(World::default().radius());
    let sensors = array("sensors", keys.required("sensors")?)?.iter().enumerate();
    let sensors = sensors.map(|(i, described)| {
        let read = sensor(described);
        read.map_err(|error| error.within(&format!("sensors[{i}]")))
    });
    let robot = Robot::new(sensors.collect::<Result<_, _>>()?, radius, drive(keys)?)?;
    let genes = numbers("controller", keys.required("controller")?)?;
    if genes.len() != robot.genes() {
        let [given, needed] = [genes.len(), robot.genes()].map(|count| counted(count as u64, "value"));
        let allowed = format!(
            "{needed}, two for each state of {}",
            counted(robot.sensors().len() as u64, "sensor")
        );
        return Err(Invalid::new("controller", given, allowed));
    }
    let name = keys.required("name")?;
    let name = SpeciesName::parse("name", name.as_str().unwrap_or(&shown(name)))?;
    let count = keys.whole("count")?;
    let count = count.ok_or_else(|| Invalid::missing("count", "given"))?;
    Ok((Species::new(name, robot), count, genes))
}

/// The drive of a species. The drive's speeds can be as large as [`Drive::MAX`], because a case is only simulated.
fn drive(keys: Keys<'_>) -> Result<Drive, Invalid> {
    let described = keys.required("drive")?;
    let keys = Keys::of("drive", described)?;
    let kind = keys.required("kind").map_err(|error| error.within("drive"))?;
    match kind.as_str() {
        Some("differential") => {
            let wheel_radius = keys.number("wheel_radius")?;
            Drive::differential(
                wheel_radius.unwrap_or(World::default().wheel_radius()),
                Drive::MAX,
            )
        }
        Some("unicycle") => Drive::unicycle(Drive::MAX, Drive::MAX),
        _ => Err(Invalid::new(
            "kind",
            shown(kind),
            "\"differential\" or \"unicycle\"",
        )),
    }
    .map_err(|error| error.within("drive"))
}

fn sensor(described: &Value) -> Result<Sensor, Invalid> {
    let keys = Keys::of("sensors", described)?;
    for key in ["false_positive", "false_negative"] {
        if let Some(rate) = keys.number(key)?.filter(|&rate| rate != 0.0) {
            return Err(Invalid::new(key, rate, "0: false readings are not simulated"));
        }
    }
    if keys.get("goal_range").is_some() {
        return Err(Invalid::new(
            "goal_range",
            "given",
            "absent: goals are not simulated",
        ));
    }
    let mut sees = match keys.get("sees_species") {
        None => vec![Seen::Robots],
        Some(Value::String(all)) if all == "all" => vec![Seen::Robots],
        Some(Value::String(none)) if none == "none" => Vec::new(),
        Some(name) => {
            let name = name.as_str().map_or_else(|| shown(name), str::to_owned);
            vec![Seen::Species(SpeciesName::parse("sees_species", &name)?)]
        }
    };
    let wall_range = keys.number("wall_range")?;
    if keys.flag("sees_walls")?.unwrap_or(wall_range.is_some()) {
        sees.push(Seen::Walls);
    }
    let angle = keys
        .get("angle")
        .map_or(Ok(0.0), |angle| number("angle", angle))?;
    Sensor::try_from(SensorDescription {
        angle: SensorAngle::fixed(angle)?,
        half_angle: keys.number("half_angle")?.unwrap_or(0.0),
        range: keys.number("range")?,
        sees,
        wall_range,
    })
}

/// Checks that agents are ordered by species, as the simulator requires.
fn check_order(keys: Keys<'_>, model: &CapabilityModel) -> Result<(), Invalid> {
    let Some(value) = keys.get("species_of_agent") else {
        return Ok(());
    };
    let given = array("species_of_agent", value)?;
    let species = model.species();
    let counts = model.ratios().iter().flatten().enumerate();
    let ours = counts.flat_map(|(place, &count)| std::iter::repeat_n(place, count as usize));
    let named = |given: &Value, place: usize| match given {
        Value::String(name) => name == species[place].name().as_str(),
        other => other.as_u64() == Some(place as u64),
    };
    let agree = given
        .iter()
        .zip(ours.clone())
        .all(|(given, place)| named(given, place));
    if agree && given.len() == ours.count() {
        return Ok(());
    }
    let allowed = "the species of each agent, in the order of the species, `count` agents each";
    Err(Invalid::new("species_of_agent", shown(value), allowed))
}
