//! Compares the simulator with vectors from the authors' simulator.
#![expect(
    clippy::unwrap_used,
    reason = "a test that cannot read its vectors should fail"
)]

use murmuration_sim::{case::Case, evaluate::Evaluator, simulate::Start};
use murmuration_swarm::{Controller, ImageFormat, Preset, World};
use serde_json::Value;
use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

/// Largest permitted difference of a position, heading or displacement from the reference.
pub(crate) const POSITION_TOLERANCE: f64 = 1e-6;
/// Largest permitted difference of a feature from the reference.
const FEATURE_TOLERANCE: f64 = 1e-9;

pub(crate) fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("vectors")
}

fn vectors() -> impl Iterator<Item = Value> {
    let mut paths: Vec<_> = fs::read_dir(folder())
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "json"));
    paths.sort();
    assert_eq!(paths.len(), 20);
    paths
        .into_iter()
        .map(|path| serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap())
}

pub(crate) fn run(case: &Value) -> Value {
    Case::from_json(&case.to_string()).unwrap().run().unwrap()
}

/// Asserts that no two corresponding numbers of two equally shaped values differ by more than `tolerance`.
pub(crate) fn close(ours: &Value, theirs: &Value, tolerance: f64, place: &str) {
    match (ours, theirs) {
        (Value::Array(ours), Value::Array(theirs)) => {
            assert_eq!(ours.len(), theirs.len(), "{place}");
            for (i, (ours, theirs)) in ours.iter().zip(theirs).enumerate() {
                close(ours, theirs, tolerance, &format!("{place}[{i}]"));
            }
        }
        _ => {
            let (ours, theirs) = (ours.as_f64().unwrap(), theirs.as_f64().unwrap());
            assert!((ours - theirs).abs() <= tolerance, "{place}: {ours} for {theirs}");
        }
    }
}

#[test]
fn every_vector_is_reproduced_as_far_as_it_is_comparable() {
    let (mut steps, mut whole) = (0, 0);
    for case in vectors() {
        let name = case["name"].as_str().unwrap();
        let ours = run(&case);
        let comparable_until = case["comparable_until"].as_u64().unwrap();
        for (step, agents) in case["checkpoints"].as_object().unwrap() {
            if step.parse::<u64>().unwrap() <= comparable_until {
                close(
                    &ours["checkpoints"][step],
                    agents,
                    POSITION_TOLERANCE,
                    &format!("{name} step {step}"),
                );
                steps += 1;
            }
        }
        if comparable_until == case["steps"].as_u64().unwrap() {
            close(
                &ours["features"],
                &case["features"],
                FEATURE_TOLERANCE,
                &format!("{name} features"),
            );
            for key in ["image", "image_raw", "jitter_events"] {
                assert_eq!(ours[key], case[key], "{name} {key}");
            }
            whole += 1;
        }
    }
    assert_eq!(
        (steps, whole),
        (204, 14),
        "as many as the vectors say are comparable"
    );
}

/// The rows of a table, without its header.
fn rows(path: &str) -> Vec<Vec<String>> {
    let text = fs::read_to_string(folder().join(path)).unwrap();
    let rows = text.lines().skip(1);
    rows.map(|row| row.split(',').map(str::to_owned).collect())
        .collect()
}

fn numbers(cells: &[String]) -> Vec<f64> {
    cells.iter().map(|cell| cell.parse().unwrap()).collect()
}

/// Checks the images of labelled swarms, byte for byte (as digests).
///
/// This simulator reproduces 1,664 of all 2,064 labelled swarms; the test uses the first forty of these in each set, by id. The
/// motions of the other swarms are chaotic: a difference in the last bit of a heading grows until robots are elsewhere. With the
/// authors' sines and norms in place of ours, this simulator reproduces all swarms but four. In these four swarms, robots start
/// in the same corner, and this simulator separates the robots.
fn check_labelled(set: &str, model: Preset) {
    let mut starts = BTreeMap::<String, Vec<[f64; 3]>>::new();
    for row in rows(&format!("labelled/{set}_starts.csv")) {
        let pose = numbers(&row[2..]).try_into().unwrap();
        starts.entry(row[0].clone()).or_default().push(pose);
    }
    let mut evaluator = Evaluator::new(&World::default(), &ImageFormat::default()).unwrap();
    let swarms = rows(&format!("labelled/{set}.csv"));
    assert_eq!(swarms.len(), 40);
    let task = |row: &Vec<String>| {
        let controller = Controller::new(model, &numbers(&row[2..])).unwrap();
        (controller, Start::at(starts[&row[0]].clone()).unwrap())
    };
    let tasks: Vec<_> = swarms.iter().map(task).collect();
    let together = evaluator.evaluate_all(&tasks).unwrap();
    for ((row, (controller, start)), of_many) in swarms.iter().zip(&tasks).zip(together) {
        let (id, digest) = (&row[0], &row[1]);
        let alone = evaluator.evaluate(controller, start).unwrap();
        for evaluation in [&alone, &of_many] {
            assert_eq!(
                blake3::hash(evaluation.image()).to_hex().as_str(),
                digest,
                "{set} {id}"
            );
        }
    }
}

#[test]
fn labelled_single_sensor_images_are_reproduced() {
    check_labelled("single_sensor", Preset::SingleSensor);
}

#[test]
fn labelled_two_sensor_images_are_reproduced() {
    check_labelled("two_sensor", Preset::TwoSensor);
}

#[test]
fn labelled_rare_images_are_reproduced() {
    check_labelled("rare", Preset::TwoSensor);
}
