//! Tests campaigns from a specification to a report, and runs a report's specification again.

use crate::command_line::Desk;
use murmuration_swarm::FEATURE_NAMES;
use murmuration_tests::{small_latent_spec, small_spec, whole_number};
use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

#[test]
fn a_figure_has_the_format_of_its_ending_and_replaces_nothing() {
    let desk = Desk::new();
    let run = desk.murmuration.run(&["run", &desk.path("small.toml")]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let draw = |options: &[&str]| desk.murmuration.run(&[&["figure", "latest"], options].concat());
    for (name, begins) in [
        ("a.pdf", "%PDF-1."),
        ("a.svg", "<svg "),
        ("new/a.png", "\u{fffd}PNG"),
    ] {
        let out = desk.path(name);
        let drawn = draw(&["--behaviours", "3,1", "--labels", "letters", "--out", &out]);
        assert_eq!(drawn.code, Some(0), "{}", drawn.stderr);
        assert_eq!(drawn.stdout.trim(), out);
        assert!(drawn.stderr.contains("a: behaviour 3"), "{}", drawn.stderr);
        let file = String::from_utf8_lossy(&fs::read(&out).unwrap()).into_owned();
        assert!(file.starts_with(begins), "{name}");
    }
    let out = desk.path("a.svg");
    for (options, message) in [
        (&["--out", &out][..], "exists already"),
        (&["--out", "a.eps"], "name a file that ends in .pdf, .svg or .png"),
        (
            &["--behaviours", "5", "--out", "b.svg"],
            "must be numbers from 1 to 4",
        ),
        (&["--width", "900mm", "--out", "b.svg"], "from 20mm to 500mm"),
    ] {
        let refused = draw(options);
        assert_eq!(refused.code, Some(2), "{options:?}: {}", refused.stderr);
        assert!(refused.stderr.contains(message), "{}", refused.stderr);
    }
    let whole = draw(&["--width", "page", "--shares", "--force", "--out", &out, "--json"]).last_line();
    assert_eq!(
        (&whole["width_mm"], &whole["figure"]),
        (&178.0.into(), &out.as_str().into())
    );
    assert!(whole["behaviours"][0]["share"].as_f64().unwrap() > 0.0);
}

#[test]
fn a_run_ends_with_one_object_and_a_report() {
    let desk = Desk::new();
    let run = desk
        .murmuration
        .run(&["run", &desk.path("small.toml"), "--json"])
        .last_line();
    assert_eq!(
        (&run["campaign"], &run["evaluations"]),
        (&"small-1".into(), &100.into())
    );
    assert!(run["seconds"].as_f64().unwrap() > 0.0);
    let page = run["report"].as_str().unwrap();
    let text = fs::read_to_string(page).unwrap();
    assert!(
        text.contains(run["digest"].as_str().unwrap()),
        "the report does not show the digest"
    );
    for beside in [
        "archive.csv",
        "taxonomy.csv",
        "classes.csv",
        "map.svg",
        "novelty.svg",
        "spec.toml",
        "medoids/01-trajectory.png",
    ] {
        assert!(
            Path::new(page).with_file_name("").join(beside).exists(),
            "{beside} is missing"
        );
    }

    let digest = desk.murmuration.run(&["digest", "small-1"]);
    assert_eq!(digest.stdout.trim(), run["digest"]);
    let listed = desk.murmuration.run(&["list", "--json"]).last_line();
    assert_eq!(
        (&listed["id"], &listed["state"]),
        (&"small-1".into(), &"completed".into())
    );
    assert!(listed["best_novelty"].as_f64().unwrap() >= listed["mean_novelty"].as_f64().unwrap());
    assert_eq!(
        (&listed["evaluations_done"], &listed["evaluations"]),
        (&100.into(), &100.into())
    );
    // The campaign has no training.
    assert!(listed["training"].is_null());
    let shown = desk
        .murmuration
        .run(&["show", "latest", "--index", "99", "--json"])
        .last_line();
    assert_eq!((&shown["index"], &shown["generation"]), (&99.into(), &4.into()));
    let out = desk.path("else/where");
    let written = desk.murmuration.run(&["report", "latest", "--out", &out]);
    assert_eq!(written.stdout.trim(), format!("{out}/report.html"));
    assert_eq!(fs::read(written.stdout.trim()).unwrap().len(), text.len());

    // A campaign with the report's own specification has the same digest.
    let again = desk
        .murmuration
        .run(&["run", &format!("{out}/spec.toml"), "--json"])
        .last_line();
    assert_eq!(
        (&again["digest"], &again["campaign"]),
        (&run["digest"], &"small-2".into())
    );
}

/// A table of a report: in each row, the cells by column name.
fn table(path: &Path) -> Vec<BTreeMap<String, String>> {
    let text = fs::read_to_string(path).unwrap();
    let mut lines = text.lines().map(|line| line.split(','));
    let header: Vec<&str> = lines.next().unwrap().collect();
    let row = |cells: std::str::Split<'_, char>| {
        let named = header.iter().map(|name| (*name).to_owned());
        named.zip(cells.map(str::to_owned)).collect()
    };
    lines.map(row).collect()
}

#[test]
fn robustness_can_be_counted_again_from_the_tables() {
    let desk = Desk::new();
    let text = small_spec("").to_toml().replace("starts = 1", "starts = 4");
    desk.check(&["run", &desk.write("starts.toml", &text)], 0, "campaign small-1");
    let folder = PathBuf::from(desk.path("data/reports/small-1"));
    let features =
        |row: &BTreeMap<String, String>| FEATURE_NAMES.map(|name| row[name].parse::<f64>().unwrap());
    let medoids: Vec<_> = table(&folder.join("taxonomy.csv")).iter().map(features).collect();
    let mut robust: BTreeMap<String, f64> = BTreeMap::new();
    let archive = table(&folder.join("archive.csv"));
    for trial in table(&folder.join("trials.csv")) {
        let own = features(&trial);
        let distance = |medoid: &[f64; 5]| -> f64 {
            let squares = own.iter().zip(medoid).map(|(a, b)| (a - b) * (a - b));
            squares.sum()
        };
        let nearest = (1..)
            .zip(&medoids)
            .min_by(|(_, a), (_, b)| distance(a).total_cmp(&distance(b)));
        let individual = &archive[trial["index"].parse::<usize>().unwrap()];
        let is_own = individual["cluster"] == nearest.unwrap().0.to_string();
        *robust.entry(trial["index"].clone()).or_default() += if is_own { 0.25 } else { 0.0 };
    }
    assert_eq!(robust.len(), 100);
    for individual in &archive {
        let told: f64 = individual["robustness"].parse().unwrap();
        assert_eq!(
            robust[&individual["index"]], told,
            "individual {}",
            individual["index"]
        );
    }
    assert!(robust.values().any(|&share| share < 1.0));
}

#[test]
fn the_novelty_of_a_behaviour_is_measured_in_the_whole_archive() {
    let desk = Desk::new();
    desk.check(&["run", &desk.path("small.toml")], 0, "campaign small-1");
    let folder = PathBuf::from(desk.path("data/reports/small-1"));
    let archive = table(&folder.join("archive.csv"));
    let features =
        |row: &BTreeMap<String, String>| FEATURE_NAMES.map(|name| row[name].parse::<f64>().unwrap());
    let page = fs::read_to_string(folder.join("report.html")).unwrap();
    let mut moved = 0;
    for row in table(&folder.join("taxonomy.csv")) {
        let own = features(&row);
        let distance = |other: &BTreeMap<String, String>| -> f64 {
            let squares = own.iter().zip(features(other)).map(|(a, b)| (a - b) * (a - b));
            squares.sum::<f64>().sqrt()
        };
        let mut distances: Vec<f64> = archive.iter().map(distance).collect();
        distances.sort_by(f64::total_cmp);
        let nearest = &distances[1..16];
        let novelty = nearest.iter().sum::<f64>() / nearest.len() as f64;
        let told: f64 = row["novelty"].parse().unwrap();
        assert!((novelty - told).abs() < 1e-12, "{novelty} {told}");
        let evaluated: f64 = row["novelty_when_evaluated"].parse().unwrap();
        moved += usize::from((evaluated - told).abs() > 1e-9);

        let index = row["index"].as_str();
        let shown = desk
            .murmuration
            .run(&["show", "small-1", "--index", index])
            .stdout;
        assert!(
            shown.contains(&format!(
                "novelty when evaluated {}\n",
                row["novelty_when_evaluated"]
            )),
            "{shown}"
        );
        let card = page
            .split("<article")
            .find(|card| card.contains(&format!("<dd>{index}</dd>")));
        let card = card.unwrap().split_once("<dt>Novelty</dt><dd>").unwrap().1;
        let card: f64 = card.split_once('<').unwrap().0.parse().unwrap();
        // A card shows the novelty with two or more significant digits.
        assert!((novelty - card).abs() <= 0.05 * novelty, "{novelty} {card}");
    }
    assert!(moved > 0, "none was measured anew");
    assert!(page.contains("novelty when evaluated ${"));
}

#[test]
fn an_individual_simulated_again_is_the_same_to_the_bit() {
    let desk = Desk::new();
    desk.check(&["run", &desk.path("small.toml")], 0, "campaign small-1");
    let shown = desk
        .murmuration
        .run(&["show", "latest", "--index", "42", "--json"])
        .last_line();
    let (controller, seed) = (shown["controller"].to_string(), whole_number(&shown["seed"]));
    let spec = desk.path("small.toml");
    let arguments = [
        "simulate",
        "--spec",
        &spec,
        "--controller",
        &controller,
        "--seed",
        &seed,
        "--json",
    ];
    let simulated = desk.murmuration.run(&arguments).last_line();
    assert_eq!(
        (&simulated["features"], &simulated["image"]),
        (&shown["features"], &shown["image"])
    );
}

#[test]
fn a_latent_campaign_runs_unattended_and_moves_to_another_checkpoint() {
    let desk = Desk::new();
    let spec = desk.write("latent.toml", &small_latent_spec("").to_toml());
    let first = desk.murmuration.run(&["run", &spec]);
    assert_eq!(first.code, Some(0), "{}", first.stderr);
    let again = desk.murmuration.run(&["run", &spec, "--json"]).last_line();
    assert!(
        first.stdout.contains(again["digest"].as_str().unwrap()),
        "{}",
        first.stdout
    );
    let other = desk
        .murmuration
        .run(&["run", &spec, "--seed", "9", "--json"])
        .last_line();
    assert_ne!(other["digest"], again["digest"]);

    let checkpoints = desk.murmuration.run(&["checkpoints", "list", "--json"]).lines();
    assert_eq!(checkpoints.len(), 2, "one of each seed");
    for metric in ["triplet_accuracy", "spread", "rank"] {
        assert!(checkpoints[0]["metrics"][metric].as_f64().unwrap() > 0.0);
    }
    let second = checkpoints[1]["digest"].as_str().unwrap();
    desk.check(
        &["adopt", "small-1", &second[..10]],
        0,
        "open the report in a browser",
    );
    let shown = desk.murmuration.run(&["show", "small-1", "--json"]).last_line();
    assert_eq!(
        (&shown["checkpoint"], &shown["state"]),
        (&second.into(), &"completed".into())
    );
    let page = fs::read_to_string(desk.path("data/reports/small-1/report.html")).unwrap();
    assert!(page.contains(second) && page.contains("learned embedding"));
    desk.check(
        &["adopt", "small-1", "0000"],
        2,
        "there is no checkpoint \"0000\"",
    );
}
