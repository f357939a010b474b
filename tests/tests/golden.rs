//! The simulator against vectors of the authors' own.

use murmuration_worker::case::Case;
use serde_json::Value;
use std::{fs, path::Path};

/// Largest difference of a position, heading or displacement from the reference's.
const POSITION_TOLERANCE: f64 = 1e-6;
/// Largest difference of a feature from the reference's.
const FEATURE_TOLERANCE: f64 = 1e-9;

fn vectors() -> impl Iterator<Item = Value> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("vectors");
    let mut paths: Vec<_> = fs::read_dir(folder)
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

fn run(case: &Value) -> Value {
    Case::from_json(&case.to_string()).unwrap().run().unwrap()
}

/// Asserts that all numbers of two equally shaped values are within `tolerance`.
fn close(ours: &Value, theirs: &Value, tolerance: f64, place: &str) {
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
        }
    }
}
