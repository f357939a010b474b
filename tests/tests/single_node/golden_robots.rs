//! Compares swarms of described robots with trajectories from the authors' simulator, and the sensors of these robots with truth
//! tables.
#![expect(
    clippy::unwrap_used,
    reason = "a test that cannot read its vectors should fail"
)]

use super::golden::{POSITION_TOLERANCE, close, folder, run};
use murmuration_proto::v1;
use murmuration_sim::simulate::{Start, Swarm};
use murmuration_swarm::{
    Boundary, CapabilityModel, Controller, Drive, Robot, Seen, Sensor, SensorAngle, SensorDescription,
    Species, SpeciesName, World,
};
use serde_json::Value;
use std::fs;

/// The reference files whose names have this ending, with their names.
fn vectors(ending: &str) -> Vec<(String, Value)> {
    let mut found: Vec<_> = fs::read_dir(folder().join("robots"))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.to_str().unwrap().ends_with(ending))
        .map(|path| {
            let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
            (
                name,
                serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap(),
            )
        })
        .collect();
    found.sort_by(|(a, _), (b, _)| a.cmp(b));
    found
}

/// Asserts that this simulator reproduces a case up to a step, with exact sensor states. Returns the number of compared
/// checkpoints.
fn check(name: &str, case: &Value, until: u64) -> usize {
    let ours = run(case);
    let mut compared = 0;
    for (step, agents) in case["checkpoints"].as_object().unwrap() {
        if step.parse::<u64>().unwrap() > until {
            continue;
        }
        let ours = &ours["checkpoints"][step];
        close(ours, agents, POSITION_TOLERANCE, &format!("{name} step {step}"));
        let states = |agents: &Value| -> Vec<u64> {
            let agents = agents.as_array().unwrap().iter();
            agents.map(|agent| agent[3].as_u64().unwrap()).collect()
        };
        assert_eq!(states(ours), states(agents), "{name} step {step}");
        compared += 1;
    }
    if until == case["steps"].as_u64().unwrap() && case["physics"] == "feb2023" {
        assert_eq!(ours["jitter_events"], case["jitter_events"], "{name}");
    }
    assert_eq!(ours["physics"], "feb2023");
    compared
}

#[test]
fn swarms_of_two_species_are_reproduced_as_far_as_they_are_comparable() {
    let vectors = vectors(".feb2023.json");
    let until = |case: &Value| case["comparable_until"].as_u64().unwrap();
    let compared = vectors.iter().map(|(name, case)| check(name, case, until(case)));
    assert_eq!((vectors.len(), compared.sum::<usize>()), (19, 195));
}

/// Before two robots touch, the authors' later physics gives the same motion. The test also reads and simulates files without an
/// equal checkpoint. The reference files leave out cases with a goal, because this simulator has no goals.
#[test]
fn later_physics_is_reproduced_as_far_as_it_is_the_same() {
    let vectors = vectors(".head.json");
    let until = |case: &Value| case["equal_to_feb2023_until"].as_u64().unwrap();
    let compared = vectors.iter().map(|(name, case)| check(name, case, until(case)));
    assert_eq!((vectors.len(), compared.sum::<usize>()), (9, 18));
}

/// A configuration of `sensors.json` as a swarm that does not move.
struct Table<'a>(&'a Value);

impl Table<'_> {
    /// The sensor readings of the agents, in the order of the table.
    fn readings(&self) -> Vec<u64> {
        let count = self.0["agents"].as_array().unwrap().len();
        let kinds: Vec<_> = (0..count).map(|i| self.kind(i)).collect();
        let mut names: Vec<_> = kinds.clone();
        names.sort();
        names.dedup();
        // Robots of a species must be consecutive, so the agents are sorted by species.
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by_key(|&i| &kinds[i]);
        let members = |name: &String| (0..count).filter(|&i| kinds[i] == *name).collect::<Vec<_>>();
        let counts = names.iter().map(|name| members(name).len() as u32).collect();
        let species = names.iter().map(|name| {
            let radius = self.radius(members(name)[0]);
            let drive = Drive::differential(2.0, 1.0).unwrap();
            let robot = Robot::new(vec![self.sensor()], radius, drive).unwrap();
            let name = SpeciesName::parse("name", name).unwrap();
            Species::new(name, robot)
        });
        let model = CapabilityModel::new(species.collect(), vec![counts]).unwrap();
        let world = self.world(&model);
        let genes = vec![0.0; model.genes()];
        let controller = Controller::new(model, &genes).unwrap();
        let pose = |&i: &usize| [0, 1, 2].map(|k| self.0["agents"][i][k].as_f64().unwrap());
        let start = Start::at(order.iter().map(pose).collect()).unwrap();
        let swarm = Swarm::new(&controller, &world, &start).unwrap();
        let mut readings = vec![0; count];
        for (&i, reading) in order.iter().zip(swarm.readings()) {
            readings[i] = u64::from(reading);
        }
        readings
    }

    fn radius(&self, i: usize) -> f64 {
        let own = self.0["radii"][i].as_f64().or_else(|| self.0["radius"].as_f64());
        own.unwrap_or(5.0)
    }

    /// The name of an agent's species: from the table or, if the table has none, from the agent's radius.
    fn kind(&self, i: usize) -> String {
        let named = self.0["species"][i].as_str();
        named.map_or_else(|| format!("r{}", self.radius(i)), str::to_owned)
    }

    fn sensor(&self) -> Sensor {
        let sensor = &self.0["sensor"];
        let wall_range = sensor["wall_range"].as_f64();
        let sees = match (self.0["sees_species"].as_str(), wall_range) {
            (Some(species), _) => Seen::Species(SpeciesName::parse("sees", species).unwrap()),
            (None, Some(_)) => Seen::Walls,
            (None, None) => Seen::Robots,
        };
        Sensor::try_from(SensorDescription {
            angle: SensorAngle::fixed(sensor["angle"].as_f64().unwrap()).unwrap(),
            half_angle: sensor["half_angle"].as_f64().unwrap(),
            range: sensor["range"].as_f64(),
            sees: vec![sees],
            wall_range,
        })
        .unwrap()
    }

    /// The world with the table's rectangle as padding; without a rectangle, a world without walls.
    fn world(&self, model: &CapabilityModel) -> World {
        let corner = |i: usize, axis: usize| self.0["rectangle"][i][axis].as_f64();
        let message = v1::World {
            width: corner(1, 0).map(|high| high + corner(0, 0).unwrap()),
            height: corner(1, 1).map(|high| high + corner(0, 1).unwrap()),
            padding: corner(0, 0),
            agents: model.robots(),
            radius: Some(model.largest_radius()),
            boundary: corner(0, 0).is_none().then(|| Boundary::Open.name().to_owned()),
            ..v1::World::default()
        };
        World::try_from(message).unwrap()
    }
}

/// If rounding decides a sensor's reading, the reading must be the table's. Cosines of right angles and of 0 are therefore
/// computed as in the definition.
#[test]
fn sensors_see_what_the_tables_say() {
    let (_, tables) = vectors("sensors.json").pop().unwrap();
    let mut checked = 0;
    for (group, tables) in tables.as_object().unwrap() {
        for table in tables.as_array().unwrap() {
            let readings = Table(table).readings();
            let id = table["id"].as_str().unwrap();
            match table["clean"].as_array() {
                Some(clean) => {
                    let clean: Vec<u64> = clean.iter().map(|on| on.as_u64().unwrap()).collect();
                    assert_eq!(readings, clean, "{group} {id}");
                }
                None => {
                    let observer = table["observer"].as_u64().unwrap() as usize;
                    assert_eq!(
                        readings[observer],
                        table["clean"].as_u64().unwrap(),
                        "{group} {id}"
                    );
                }
            }
            checked += 1;
        }
    }
    assert_eq!(checked, 78);
}
