//! The synthetic annotator against people, on swarms that it was not tuned on.

use murmuration_coordinator::{accuracy::Labels, judge::judge, labels::ConfusionMatrix};
use murmuration_proto::World;
use murmuration_tests::Murmuration;
use murmuration_worker::replay::replay;
use serde_json::Value;
use std::{num::NonZeroU32, path::PathBuf};

fn file(set: &str, name: &str) -> PathBuf {
    PathBuf::from(format!("{}/labelled/{set}/{name}", env!("CARGO_MANIFEST_DIR")))
}

/// The judge agrees with the annotators at least this often, of so many.
#[track_caller]
fn check(set: &str, agreed: u64, of: u64) {
    let labels = Labels::read(file(set, "validation.csv")).unwrap();
    let world = World::default();
    let swarms = labels.swarms(&file(set, "starts.csv")).unwrap();
    let judged = swarms.iter().map(|(controller, start)| {
        let motion = replay(controller, &world, start, NonZeroU32::new(4).unwrap()).unwrap();
        judge(&motion, &world).class.name()
    });
    let matrix: ConfusionMatrix<&str> = labels.classes().zip(judged).collect();
    for class in matrix.answers() {
        let row: Vec<u64> = matrix
            .answers()
            .iter()
            .map(|judge| matrix.count(class, judge))
            .collect();
        println!("{set:<16}{class:<16}{row:?}");
    }
    println!(
        "{set}: {} of {}, kappa {:.3}",
        matrix.same(),
        matrix.total(),
        matrix.kappa().unwrap()
    );
    assert_eq!(matrix.total(), of);
    assert!(matrix.same() >= agreed, "{}", matrix.same());
}

#[test]
fn it_agrees_with_people_on_one_sensor() {
    check("single_sensor", 186, 200);
}

#[test]
fn it_agrees_with_people_on_two_sensors() {
    check("two_sensor", 178, 200);
}

#[test]
fn it_agrees_with_people_on_rare_classes() {
    check("rare", 34, 41);
}

#[test]
fn the_command_says_the_same_and_counts_patterns() {
    let murmuration = Murmuration::over(&std::env::temp_dir());
    let labels =
        ["single_sensor", "two_sensor", "rare"].map(|set| file(set, "validation.csv").display().to_string());
    let [single, two, rare] = labels.each_ref().map(String::as_str);
    let finished = murmuration.run(&[
        "judge", "--labels", single, "--labels", two, "--labels", rare, "--json",
    ]);
    assert_eq!(finished.code, Some(0), "{}", finished.stderr);
    let said: Value = serde_json::from_str(&finished.stdout).unwrap();
    assert_eq!(said["behaviours"], 441);
    assert!(said["agreed"].as_u64().unwrap() >= 398, "{said}");
    for (pattern, agreed, given) in [
        ("small_clusters", 17, 27),
        ("chain", 1, 5),
        ("moving_clumps", 0, 1),
    ] {
        let counts = &said["patterns"][pattern];
        assert_eq!(counts["given"], given, "{pattern}");
        assert!(
            counts["agreed"].as_u64().unwrap() >= agreed,
            "{pattern}: {counts}"
        );
    }
}

#[test]
fn the_command_names_a_file_of_starts_that_is_not_there() {
    let murmuration = Murmuration::over(&std::env::temp_dir());
    let labels = file("rare", "validation.csv").display().to_string();
    let missing = murmuration.run(&["judge", "--labels", &labels, "--starts", "nowhere.csv"]);
    assert!(
        missing.code == Some(2) && missing.stderr.contains("nowhere.csv"),
        "{}",
        missing.stderr
    );
}
