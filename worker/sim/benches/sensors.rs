//! Benchmark: CPU time of evaluations of described robots, with vectors of swarms. Robots with 1 to 6 rays or cones are compared
//! with the paper's two-sensor model. Items take turns; each figure is the best of its rounds.
//!
//! `ROUNDS=20 cargo bench --workspace --bench sensors` sets the number of rounds; the default is 7.
#![expect(clippy::unwrap_used, reason = "a benchmark that cannot start should stop")]
#![expect(clippy::print_stdout, reason = "what it prints is what it is for")]

mod cpu_time;

use cpu_time::timed;
use murmuration_sim::{evaluate::Evaluator, simulate::Start};
use murmuration_swarm::{
    CapabilityModel, Controller, Drive, ImageFormat, Preset, Robot, Sensor, SensorAngle, SensorDescription,
    World,
};
use std::{env, f64::consts::FRAC_PI_3, hint::black_box};

/// A measured item: a name, and evaluations to run at once.
struct Item {
    name: String,
    sensors: usize,
    tasks: Vec<(Controller, Start)>,
    best: f64,
}

/// The wheel speeds of all robots in every sensor state, so that all items have the same motion and collisions.
const MOTION: [f64; 2] = [0.9, 0.8];
/// Number of evaluations at once: a few vectors.
const TASKS: u64 = 32;

fn main() {
    let rounds = env::var("ROUNDS").map_or(7, |rounds| rounds.parse().unwrap());
    let mut items = vec![paper()];
    for sensors in 1..=Robot::MAX_SENSORS {
        items.push(described("rays", sensors, 0.0, None));
        items.push(described("cones 0.3, range 150", sensors, 0.3, Some(150.0)));
        items.push(described("cones 2.0", sensors, 2.0, None));
    }
    let mut evaluator = Evaluator::new(&World::default(), &ImageFormat::default()).unwrap();
    for _ in 0..rounds {
        for item in &mut items {
            let seconds = timed(|| drop(black_box(evaluator.evaluate_all(&item.tasks).unwrap())));
            item.best = item.best.min(seconds * 1e6 / TASKS as f64);
        }
    }
    report(&items);
}

fn report(items: &[Item]) {
    println!(
        "{:<24} {:>7} {:>14} {:>16} {:>14}",
        "SENSORS", "NUMBER", "MICROSECONDS", "A SENSOR, TO TWO", "TO RAYS"
    );
    let two = items[0].best / 2.0;
    for item in items {
        let mut alike = items[1..].iter();
        let rays = alike.find(|rays| rays.name == "rays" && rays.sensors == item.sensors);
        println!(
            "{:<24} {:>7} {:>14.0} {:>16.2} {:>14.2}",
            item.name,
            item.sensors,
            item.best,
            item.best / item.sensors as f64 / two,
            item.best / rays.unwrap().best
        );
    }
}

fn paper() -> Item {
    let genes = [MOTION.repeat(4), vec![-FRAC_PI_3]].concat();
    Item {
        name: "two-sensor model".to_owned(),
        sensors: 2,
        tasks: tasks(&Controller::new(Preset::TwoSensor, &genes).unwrap()),
        best: f64::INFINITY,
    }
}

fn tasks(controller: &Controller) -> Vec<(Controller, Start)> {
    let starts = (0..TASKS).map(Start::seeded);
    starts.map(|start| (controller.clone(), start)).collect()
}

/// Robots with this number of sensors in different directions.
fn described(name: &str, sensors: usize, half_angle: f64, range: Option<f64>) -> Item {
    let eyes = (0..sensors).map(|s| {
        Sensor::try_from(SensorDescription {
            angle: SensorAngle::fixed(0.9 * s as f64).unwrap(),
            half_angle,
            range,
            ..SensorDescription::default()
        })
        .unwrap()
    });
    let robot = Robot::new(eyes.collect(), 5.0, Drive::differential(2.0, 1.0).unwrap()).unwrap();
    let model = CapabilityModel::of_one(robot).unwrap();
    let genes = MOTION.repeat(model.genes() / 2);
    Item {
        name: name.to_owned(),
        sensors,
        tasks: tasks(&Controller::new(model, &genes).unwrap()),
        best: f64::INFINITY,
    }
}
