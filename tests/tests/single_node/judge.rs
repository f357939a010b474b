//! Tests how often the judges agree with labels, on swarms that were not used to tune the judges.

use murmuration_accuracy::{LabelledSet, Swarm};
use murmuration_judge::{Measures, frames, judge, judge_species};
use murmuration_model::labels::ConfusionMatrix;
use murmuration_report::atlas::agreed;
use murmuration_sim::{
    replay::{replay, replay_frames},
    simulate::Start,
};
use murmuration_study::{JudgeErrors, second_judge};
use murmuration_swarm::{CapabilityModel, Class, Controller, Pattern, Preset, Replay, World};
use murmuration_tests::Murmuration;
use serde_json::{Value, json};
use std::{
    f64::consts::{FRAC_PI_3, FRAC_PI_6},
    fs,
    num::NonZeroU32,
    path::PathBuf,
};

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

/// A judge, and the heading of its agreement table in docs/judge.md.
#[derive(Clone, Copy)]
struct Judge {
    heading: &'static str,
    class_of: fn(&Replay, &World) -> Class,
}

const RULES: Judge = Judge {
    heading: "## Agreement with the annotators",
    class_of: |motion, world| judge(motion, world).class(),
};
const SECOND: Judge = Judge {
    heading: "## The second judge",
    class_of: second_judge,
};

/// A column of a judge's table in docs/judge.md: agreement as `[same, all]`, and kappa. The rows are each class (`None` without
/// swarms), all swarms, swarms where both annotators were sure, and swarms where one annotator was not sure.
fn documented(heading: &str, column: usize) -> (Vec<Option<[u32; 2]>>, String) {
    let page = include_str!("../../../docs/judge.md");
    let (_, section) = page.split_once(&format!("\n{heading}\n")).unwrap();
    let rows = section.lines().filter(|line| line.starts_with('|')).skip(2);
    let cell = |row: &str| {
        let cell = row.split('|').nth(column + 2).unwrap().replace('*', "");
        // The cell of the sum also contains a percentage.
        cell.split('(').next().unwrap().trim().to_owned()
    };
    let mut cells: Vec<String> = rows.take(CLASSES.len() + 4).map(cell).collect();
    let kappa = cells.remove(CLASSES.len() + 1);
    (cells.iter().map(|cell| counts(cell)).collect(), kappa)
}

/// The test does not ascribe a count to chance if its probability at the documented rate is lower than this.
const IMPROBABLE: f64 = 0.001;

/// The probability of at most `count` successes in `all` trials, if each trial succeeds with probability `rate`.
fn at_most(count: u32, all: u32, rate: f64) -> f64 {
    let term = |successes: u32| {
        let ways = (1..=successes).map(|k| f64::from(all - successes + k) / f64::from(k));
        ways.product::<f64>()
            * rate.powi(successes.cast_signed())
            * (1.0 - rate).powi((all - successes).cast_signed())
    };
    (0..=count).map(term).sum()
}

/// The numbers of `186 of 200`.
fn counts(words: &str) -> Option<[u32; 2]> {
    let (same, all) = words.split_once(" of ")?;
    Some([same.parse().ok()?, all.parse().ok()?])
}

/// Checks that a judge agrees with the labels of a set as often as docs/judge.md states, up to chance. A chaotic motion can get
/// another class if numbers are rounded differently, but the judge must not become worse.
#[track_caller]
fn check(by: Judge, set: &str, column: usize) {
    let labels = LabelledSet::read(file(set, "validation.csv")).unwrap();
    let swarms = labels.swarms(Some(&file(set, "starts.csv"))).unwrap();
    let judged = swarms.iter().map(|swarm| {
        let stride = NonZeroU32::new(4).unwrap();
        let motion = replay(&swarm.controller, &swarm.world, &swarm.start, stride).unwrap();
        (by.class_of)(&motion, &swarm.world).name()
    });
    let pairs: Vec<(&str, &str)> = labels.classes().zip(judged).collect();
    let agreement = column_of(set, "agreement");
    assert_eq!(agreement.len(), pairs.len());

    let of = |chosen: &dyn Fn(usize) -> bool| {
        let chosen = (0..pairs.len()).filter(|&i| chosen(i));
        chosen.fold([0, 0], |[same, all], i| {
            [same + u32::from(pairs[i].0 == pairs[i].1), all + 1]
        })
    };
    let classes = CLASSES.iter().map(|&class| of(&|i| pairs[i].0 == class));
    let rest = [
        of(&|_| true),
        of(&|i| agreement[i] == "both"),
        of(&|i| agreement[i] == "one unsure"),
    ];
    let measured: Vec<[u32; 2]> = classes.chain(rest).collect();
    let (documented, kappa) = documented(by.heading, column);
    for ([same, all], documented) in measured.into_iter().zip(documented) {
        let Some([expected, of]) = documented else {
            assert_eq!(all, 0, "{set}");
            continue;
        };
        println!("{set}: {same} of {all}, docs/judge.md says {expected} of {of}");
        assert_eq!(all, of, "{set}");
        // The rate follows the rule of succession: a class without errors on a few swarms can still have errors on other swarms.
        let rate = f64::from(expected + 1) / f64::from(of + 2);
        let probability = at_most(same, all, rate);
        assert!(
            probability > IMPROBABLE,
            "{set}: {same} of {all} instead of {expected} has the probability {probability}"
        );
    }
    let matrix: ConfusionMatrix<&str> = pairs.iter().copied().collect();
    let measured = matrix.kappa().unwrap();
    println!("{set}: kappa {measured:.3}, docs/judge.md says {kappa}");
    // Landis and Koch (1977) call a kappa over 0.6 "substantial" agreement.
    assert!(measured > 0.6, "{set}: {measured}");
}

/// A column of the validation part of a set.
fn column_of(set: &str, name: &str) -> Vec<String> {
    let table = fs::read_to_string(file(set, "validation.csv")).unwrap();
    let (head, rows) = table.split_once('\n').unwrap();
    let place = head.split(',').position(|column| column == name).unwrap();
    let rows = rows.lines().map(|row| row.split(',').nth(place).unwrap());
    rows.map(str::to_owned).collect()
}

/// The number and the class of each swarm of a table of two species.
fn read_by(reader: &str) -> Vec<(String, String)> {
    let table = fs::read_to_string(file("two_species", reader)).unwrap();
    let rows = table.lines().skip(1).map(|row| row.split_once(',').unwrap());
    rows.map(|(number, class)| (number.to_owned(), class.to_owned()))
        .collect()
}

/// Checks that the judge agrees with two readers about two species as often as docs/judge.md states, up to chance.
#[test]
fn it_agrees_with_readers_about_two_species_as_often_as_documented() {
    let labels = LabelledSet::read(file("two_species", "swarms.csv")).unwrap();
    let swarms = labels.swarms(None).unwrap();
    let judged = labels.ids().zip(&swarms).map(|(id, swarm)| {
        let (controller, world) = (&swarm.controller, &swarm.world);
        let motion = replay_frames(controller, world, &swarm.start, &frames(world)).unwrap();
        let verdict = judge_species(&motion, &controller.species_of_robots(world.agents()), world);
        (id.to_owned(), verdict.name().to_owned())
    });
    let judged: Vec<_> = judged.collect();
    let readers = ["reader-1.csv", "reader-2.csv"].map(read_by);
    let even = fs::read_to_string(file("two_species", "even.csv")).unwrap();
    let even: Vec<&str> = even.lines().skip(1).collect();
    let page = include_str!("../../../docs/judge.md");
    for (row, one, other) in [
        ("the two readers", &readers[0], &readers[1]),
        ("judge and first reader", &readers[0], &judged),
        ("judge and second reader", &readers[1], &judged),
    ] {
        let line = page
            .lines()
            .find(|line| line.starts_with(&format!("| {row} |")))
            .unwrap();
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        for (cell, is_counted) in [
            (2, &(|_: &str| true) as &dyn Fn(&str) -> bool),
            (4, &|number| even.contains(&number)),
        ] {
            let pairs = one
                .iter()
                .zip(other)
                .filter(|((number, _), _)| is_counted(number));
            let pairs: Vec<_> = pairs.inspect(|(one, other)| assert_eq!(one.0, other.0)).collect();
            let same = pairs.iter().filter(|(one, other)| one.1 == other.1).count() as u32;
            let [expected, of] = counts(cells[cell]).unwrap();
            println!(
                "{row}: {same} of {}, docs/judge.md says {expected} of {of}",
                pairs.len()
            );
            assert_eq!(pairs.len() as u32, of, "{row}");
            let rate = f64::from(expected + 1) / f64::from(of + 2);
            assert!(
                at_most(same, of, rate) > IMPROBABLE,
                "{row}: {same} instead of {expected}"
            );
            if row == "the two readers" {
                let matrix: ConfusionMatrix<&str> = pairs
                    .iter()
                    .map(|(one, other)| (one.1.as_str(), other.1.as_str()))
                    .collect();
                let kappa = format!("{:.3}", matrix.kappa().unwrap());
                assert_eq!((same, kappa.as_str()), (expected, cells[cell + 1]));
            }
        }
    }
}

/// The example controllers of the paper (appendix "Example Controllers"), with the behaviour of each according to the paper.
const EXAMPLES: [(Class, Preset, &[f64]); 8] = [
    (Class::Milling, Preset::SingleSensor, &[0.6, 1.0, 0.4, 0.5]),
    (Class::CyclicPursuit, Preset::SingleSensor, &[-0.7, 0.3, 1.0, 1.0]),
    (Class::Aggregation, Preset::SingleSensor, &[-0.7, -1.0, 1.0, -1.0]),
    (Class::Dispersal, Preset::SingleSensor, &[0.2, 0.7, -0.5, -0.1]),
    (Class::WallFollowing, Preset::SingleSensor, &[1.0, 0.9, 1.0, 1.0]),
    (Class::Random, Preset::SingleSensor, &[-0.8, -0.7, 0.2, -0.5]),
    (
        Class::NestedCycle,
        Preset::TwoSensor,
        &[0.8, 0.5, 0.6, -0.5, -0.5, 0.0, -0.2, 0.5, -FRAC_PI_3],
    ),
    (
        Class::ConcavePath,
        Preset::TwoSensor,
        &[-0.4, 0.8, 0.9, -0.1, 0.6, 1.0, 0.4, 0.0, FRAC_PI_6],
    ),
];

/// The judge's thresholds were not tuned on these examples. A published example shows its behaviour more often than any other
/// behaviour, and the judge must find this.
#[test]
fn it_sees_the_behaviour_of_the_papers_examples_from_most_starts() {
    check_examples(RULES);
}

/// The second judge did not learn from these examples either.
#[test]
fn the_second_judge_sees_the_behaviour_of_the_papers_examples_from_most_starts() {
    check_examples(SECOND);
}

#[track_caller]
fn check_examples(by: Judge) {
    const STARTS: u64 = 32;
    let world = World::default();
    for (class, preset, genes) in EXAMPLES {
        let controller = Controller::new(preset, genes).unwrap();
        let judged = (1..=STARTS).map(|seed| {
            let motion = replay_frames(&controller, &world, &Start::seeded(seed), &frames(&world));
            (by.class_of)(&motion.unwrap(), &world)
        });
        let same = judged.filter(|judged| *judged == class).count();
        println!("{class}: {same} of {STARTS} starts");
        assert!(same as u64 > STARTS / 2, "{class}: {same} of {STARTS} starts");
    }
}

#[test]
fn the_probability_of_a_count_is_that_of_the_binomial_distribution() {
    assert!((at_most(0, 4, 0.5) - 1.0 / 16.0).abs() < 1e-12);
    assert!((at_most(2, 4, 0.5) - 11.0 / 16.0).abs() < 1e-12);
    assert!((at_most(200, 200, 0.93) - 1.0).abs() < 1e-9);
    // The check would detect if the rules agreed with a fourteenth fewer of the swarms with one sensor.
    let rate = 187.0 / 202.0;
    assert!(at_most(186, 200, rate) > IMPROBABLE && at_most(172, 200, rate) < IMPROBABLE);
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
        let line = format!("- {}: {} of {}\n", class.words(), counts[0], counts[1]);
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
fn it_agrees_with_annotators_on_one_sensor_as_often_as_is_documented() {
    check(RULES, "single_sensor", 0);
}

#[test]
fn it_agrees_with_annotators_on_two_sensors_as_often_as_is_documented() {
    check(RULES, "two_sensor", 1);
}

#[test]
fn it_agrees_with_annotators_on_rare_classes_as_often_as_is_documented() {
    check(RULES, "rare", 2);
}

#[test]
fn the_second_judge_agrees_with_annotators_as_often_as_is_documented() {
    for (column, set) in ["single_sensor", "two_sensor", "rare"].into_iter().enumerate() {
        check(SECOND, set, column);
    }
}

#[test]
fn the_command_says_the_same_and_counts_patterns() {
    let murmuration = Murmuration::over(&std::env::temp_dir());
    let sets = ["single_sensor", "two_sensor", "rare"];
    let files = sets.map(|set| file(set, "validation.csv").display().to_string());
    let [single, two, rare] = files.each_ref().map(String::as_str);
    let finished = murmuration.run(&[
        "lab", "judge", "--labels", single, "--labels", two, "--labels", rare, "--json",
    ]);
    assert_eq!(finished.code, Some(0), "{}", finished.stderr);
    let measured: Value = serde_json::from_str(&finished.stdout).unwrap();

    let (mut agreed, mut second, mut patterns) =
        (0, 0, Pattern::OF_ONE_SPECIES.map(|pattern| (pattern, [0; 3])));
    for set in sets {
        let labels = LabelledSet::read(file(set, "validation.csv")).unwrap();
        let swarms = labels.swarms(Some(&file(set, "starts.csv"))).unwrap();
        let given = labels.classes().zip(labels.patterns());
        for (
            Swarm {
                controller,
                start,
                world,
            },
            (class, named),
        ) in swarms.iter().zip(given)
        {
            let motion = replay_frames(controller, world, start, &frames(world)).unwrap();
            let verdict = judge(&motion, world);
            agreed += u32::from(verdict.class().name() == class);
            second += u32::from(second_judge(&motion, world).name() == class);
            for (pattern, [given, both, judged]) in &mut patterns {
                let people = named.split('|').any(|named| named == pattern.name());
                let judge = verdict.pattern() == Some(*pattern);
                *given += u32::from(people);
                *judged += u32::from(judge);
                *both += u32::from(people && judge);
            }
        }
    }
    assert_eq!(
        [
            &measured["behaviours"],
            &measured["agreed"],
            &measured["second_judge"]["agreed"],
        ],
        [&json!(441), &json!(agreed), &json!(second)]
    );
    for (pattern, [given, both, judged]) in patterns {
        let counted = json!({ "given": given, "agreed": both, "judged": judged });
        assert_eq!(
            measured["patterns"][pattern.name()],
            counted,
            "{}",
            pattern.name()
        );
    }
}

#[test]
fn the_command_names_a_file_of_starts_that_is_not_there() {
    let murmuration = Murmuration::over(&std::env::temp_dir());
    let labels = file("rare", "validation.csv").display().to_string();
    let missing = murmuration.run(&["lab", "judge", "--labels", &labels, "--starts", "nowhere.csv"]);
    assert!(
        missing.code == Some(2) && missing.stderr.contains("nowhere.csv"),
        "{}",
        missing.stderr
    );
}

/// Checks that the judge's errors in the tables of studies equal the judge's errors on the labelled sets.
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
