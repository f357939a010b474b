//! The judge's agreement with people, on swarms that it was not tuned on.

use murmuration_accuracy::{LabelledSet, Swarm};
use murmuration_judge::{Measures, frames, judge};
use murmuration_model::labels::ConfusionMatrix;
use murmuration_proto::{CapabilityModel, Class, Preset};
use murmuration_report::atlas::agreed;
use murmuration_study::JudgeErrors;
use murmuration_tests::Murmuration;
use murmuration_worker::replay::{replay, replay_frames};
use serde_json::{Value, json};
use std::{fs, num::NonZeroU32, path::PathBuf};

fn file(set: &str, name: &str) -> PathBuf {
    PathBuf::from(format!("{}/labelled/{set}/{name}", env!("CARGO_MANIFEST_DIR")))
}

/// The classes in the order of docs/judge.md.
const CLASSES: [&str; 8] = [
    "cyclic_pursuit",
    "milling",
    "aggregation",
    "dispersal",
    "wall_following",
    "nested_cycle",
    "concave_path",
    "random",
];

/// A column of the table in docs/judge.md: for each class how often the judge says so too, of how many; the same for all;
/// kappa; the same where both annotators were sure, and where one was not.
type Column = [String; 12];

fn documented(column: usize) -> Column {
    let page = include_str!("../../../docs/judge.md");
    let rows: Vec<&str> = page
        .lines()
        .filter(|line| line.starts_with('|'))
        .skip(2)
        .collect();
    let cell = |row: &&str| {
        let cell = row.split('|').nth(column + 2).unwrap().replace('*', "");
        // Of the sum there is the share in percent, too.
        cell.split('(').next().unwrap().trim().to_owned()
    };
    let cells: Vec<String> = rows.iter().map(cell).collect();
    cells.try_into().unwrap()
}

/// What the judge says of a set is what docs/judge.md says that it does.
#[track_caller]
fn check(set: &str, column: usize) {
    let labels = LabelledSet::read(file(set, "validation.csv")).unwrap();
    let swarms = labels.swarms(Some(&file(set, "starts.csv"))).unwrap();
    let judged = swarms.iter().map(|swarm| {
        let stride = NonZeroU32::new(4).unwrap();
        let motion = replay(&swarm.controller, &swarm.world, &swarm.start, stride).unwrap();
        judge(&motion, &swarm.world).class().name()
    });
    let pairs: Vec<(&str, &str)> = labels.classes().zip(judged).collect();
    let table = fs::read_to_string(file(set, "validation.csv")).unwrap();
    let (head, rows) = table.split_once('\n').unwrap();
    let place = head.split(',').position(|column| column == "agreement").unwrap();
    let agreement: Vec<&str> = rows
        .lines()
        .map(|row| row.split(',').nth(place).unwrap())
        .collect();
    assert_eq!(agreement.len(), pairs.len());

    let of = |chosen: &dyn Fn(usize) -> bool| {
        let chosen = (0..pairs.len()).filter(|&i| chosen(i));
        let (same, all) = chosen.fold((0, 0), |(same, all), i| {
            (same + u32::from(pairs[i].0 == pairs[i].1), all + 1)
        });
        if all == 0 {
            String::new()
        } else {
            format!("{same} of {all}")
        }
    };
    let matrix: ConfusionMatrix<&str> = pairs.iter().copied().collect();
    let classes = CLASSES.iter().map(|&class| of(&|i| pairs[i].0 == class));
    let rest = [
        of(&|_| true),
        format!("{:.3}", matrix.kappa().unwrap()),
        of(&|i| agreement[i] == "both"),
        of(&|i| agreement[i] == "one unsure"),
    ];
    let measured: Vec<String> = classes.chain(rest).collect();
    assert_eq!(measured, documented(column), "{set}");
}

#[test]
fn atlases_take_classes_as_far_as_people_agree_with_them() {
    let mut pairs = Vec::new();
    for set in ["single_sensor", "two_sensor", "rare"] {
        let labels = LabelledSet::read(file(set, "validation.csv")).unwrap();
        let swarms = labels.swarms(Some(&file(set, "starts.csv"))).unwrap();
        let judged = swarms.iter().map(|swarm| {
            let motion = replay_frames(
                &swarm.controller,
                &swarm.world,
                &swarm.start,
                &frames(&swarm.world),
            );
            judge(&motion.unwrap(), &swarm.world).class()
        });
        pairs.extend(labels.classes().map(str::to_owned).zip(judged));
    }
    let page = include_str!("../../../docs/judge.md");
    for class in Class::ALL {
        let judged = pairs.iter().filter(|(_, judged)| *judged == class);
        let same = judged
            .clone()
            .filter(|(people, _)| people == class.name())
            .count();
        let counts = [same, judged.count()];
        assert_eq!(agreed(class).map(|count| count as usize), counts, "{class}");
        let line = format!(
            "- {}: {} of {}\n",
            class.name().replace('_', " "),
            counts[0],
            counts[1]
        );
        assert!(page.contains(&line), "docs/judge.md does not say {line}");
    }
}

#[test]
fn it_says_the_same_of_the_end_of_a_motion_as_of_the_whole() {
    let labels = LabelledSet::read(file("single_sensor", "validation.csv")).unwrap();
    let swarms = labels.swarms(Some(&file("single_sensor", "starts.csv"))).unwrap();
    for Swarm {
        controller,
        start,
        world,
    } in swarms.iter().take(12)
    {
        let whole = replay(controller, world, start, NonZeroU32::new(4).unwrap()).unwrap();
        let end = replay_frames(controller, world, start, &frames(world)).unwrap();
        assert!(end.steps().len() * 5 < whole.steps().len());
        assert_eq!(Measures::of(&end, world), Measures::of(&whole, world));
    }
}

#[test]
fn it_agrees_with_people_on_one_sensor_as_is_documented() {
    check("single_sensor", 0);
}

#[test]
fn it_agrees_with_people_on_two_sensors_as_is_documented() {
    check("two_sensor", 1);
}

#[test]
fn it_agrees_with_people_on_rare_classes_as_is_documented() {
    check("rare", 2);
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
    assert_eq!(said["agreed"], 398, "{said}");
    assert_eq!(
        said["patterns"],
        json!({
            "small_clusters": { "given": 27, "agreed": 17, "judged": 31 },
            "chain": { "given": 5, "agreed": 1, "judged": 3 },
            "moving_clumps": { "given": 1, "agreed": 0, "judged": 2 },
        })
    );
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

/// The judge's errors in the tables of studies are those that it makes on the labelled sets.
#[test]
fn studies_know_how_often_it_errs() {
    let measured = |sets: &[&str]| -> Vec<(Class, Class)> {
        let pairs = sets.iter().flat_map(|set| {
            let labels = LabelledSet::read(file(set, "validation.csv")).unwrap();
            let swarms = labels.swarms(Some(&file(set, "starts.csv"))).unwrap();
            let judged = swarms.iter().map(|swarm| {
                let frames = frames(&swarm.world);
                let motion = replay_frames(&swarm.controller, &swarm.world, &swarm.start, &frames).unwrap();
                judge(&motion, &swarm.world).class()
            });
            let given = labels.classes().map(|name| {
                let class = Class::ALL.into_iter().find(|class| class.name() == name);
                class.unwrap()
            });
            given.zip(judged).collect::<Vec<_>>()
        });
        let mut pairs: Vec<(Class, Class)> = pairs.collect();
        pairs.sort();
        pairs
    };
    let known = |preset: Preset| {
        let mut pairs = JudgeErrors::of_model(&CapabilityModel::from(preset))
            .pairs()
            .to_vec();
        pairs.sort();
        pairs
    };
    assert_eq!(known(Preset::SingleSensor), measured(&["single_sensor"]));
    assert_eq!(known(Preset::TwoSensor), measured(&["two_sensor", "rare"]));
}
