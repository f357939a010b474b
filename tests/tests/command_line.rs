//! The command line as people and programs meet it: exit codes, words, JSON.

use murmuration_tests::{Finished, Murmuration, Running, small_latent_spec, small_spec};
use serde_json::Value;
use std::{fs, path::Path};
use tempfile::TempDir;

/// A data directory and a campaign file in it.
struct Desk {
    folder: TempDir,
    murmuration: Murmuration,
}

impl Desk {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let murmuration = Murmuration::over(&folder.path().join("data"));
        fs::write(folder.path().join("small.toml"), small_spec("").to_toml()).unwrap();
        Self { folder, murmuration }
    }

    fn path(&self, name: &str) -> String {
        self.folder.path().join(name).display().to_string()
    }

    fn write(&self, name: &str, text: &str) -> String {
        fs::write(self.folder.path().join(name), text).unwrap();
        self.path(name)
    }

    #[track_caller]
    fn check(&self, arguments: &[&str], code: i32, said: &str) {
        let Finished {
            code: got, stderr, ..
        } = self.murmuration.run(arguments);
        assert!(
            got == Some(code) && stderr.contains(said),
            "{arguments:?}: exit code {got:?}\n{stderr}\nnot {said:?}"
        );
        assert!(!stderr.contains("panicked"), "{stderr}");
    }
}

fn json(finished: &Finished) -> Value {
    assert_eq!(finished.code, Some(0), "{}", finished.stderr);
    serde_json::from_str(finished.stdout.lines().last().unwrap()).unwrap()
}

#[test]
fn a_run_ends_with_one_object_and_a_report() {
    let desk = Desk::new();
    let run = json(&desk.murmuration.run(&["run", &desk.path("small.toml"), "--json"]));
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
    let listed = json(&desk.murmuration.run(&["list", "--json"]));
    assert_eq!(
        (&listed["campaign"], &listed["state"]),
        (&"small-1".into(), &"completed".into())
    );
    let shown = json(
        &desk
            .murmuration
            .run(&["show", "latest", "--index", "99", "--json"]),
    );
    assert_eq!((&shown["index"], &shown["generation"]), (&99.into(), &4.into()));
    let out = desk.path("elsewhere");
    let written = desk.murmuration.run(&["report", "latest", "--out", &out]);
    assert_eq!(written.stdout.trim(), format!("{out}/report.html"));
    assert_eq!(fs::read(written.stdout.trim()).unwrap().len(), text.len());

    // What the report says about running it again is true.
    let again = json(
        &desk
            .murmuration
            .run(&["run", &format!("{out}/spec.toml"), "--json"]),
    );
    assert_eq!(
        (&again["digest"], &again["campaign"]),
        (&run["digest"], &"small-2".into())
    );
}

#[test]
fn an_individual_simulated_again_is_the_same_to_the_bit() {
    let desk = Desk::new();
    desk.check(&["run", &desk.path("small.toml")], 0, "campaign small-1");
    let shown = json(
        &desk
            .murmuration
            .run(&["show", "latest", "--index", "42", "--json"]),
    );
    let (controller, seed) = (shown["controller"].to_string(), shown["seed"].to_string());
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
    let simulated = json(&desk.murmuration.run(&arguments));
    assert_eq!(
        (&simulated["features"], &simulated["image"]),
        (&shown["features"], &shown["image"])
    );
}

#[test]
fn pictures_are_what_their_names_say() {
    let desk = Desk::new();
    let (gif, png, image) = (desk.path("a.gif"), desk.path("a.png"), desk.path("b.png"));
    let spec = desk.path("small.toml");
    let pictures = [
        "simulate",
        "--spec",
        &spec,
        "--controller",
        "0.6,1,0.4,0.5",
        "--gif",
        &gif,
        "--png",
        &png,
        "--image",
        &image,
    ];
    assert_eq!(desk.murmuration.run(&pictures).code, Some(0));
    assert!(fs::read(gif).unwrap().starts_with(b"GIF89a"));
    for picture in [png, image] {
        assert!(fs::read(picture).unwrap().starts_with(b"\x89PNG"));
    }
}

#[test]
fn bad_input_is_named_with_exit_code_2() {
    let desk = Desk::new();
    let minimal = "model = \"single-sensor\"\nmethod = \"random\"\n";
    let specs = [
        ("model = [", "TOML parse error at line 1"),
        (
            "method = \"random\"",
            "model = nothing: must be \"single-sensor\" or \"two-sensor\"",
        ),
        (
            "model = \"three-sensor\"\nmethod = \"random\"",
            "model = \"three-sensor\": must be",
        ),
        (&format!("{minimal}[search]\npopulation = -1"), "line 4"),
        (
            &format!("{minimal}[search]\npopulation = 0"),
            "search.population = 0: must be a whole number from 1 to 100000",
        ),
        (
            &format!("{minimal}[world]\nradius = nan"),
            "world.radius = NaN: must be",
        ),
        (
            &format!("{minimal}[world]\nraduis = 5"),
            "unknown field `raduis`, expected one of",
        ),
    ];
    for (text, said) in specs {
        desk.check(&["run", &desk.write("bad.toml", text)], 2, said);
    }
    desk.check(&["run", "missing.toml"], 2, "cannot read missing.toml");
    desk.check(
        &["run", &desk.path("small.toml"), "--workers", "0"],
        2,
        "--workers 0",
    );
    desk.check(&["list"], 2, "there is no data directory");
    desk.check(&["nonsense"], 2, "unrecognized subcommand");
    desk.check(
        &["simulate", "--controller", "0.1,0.2,0.3"],
        2,
        "controller = 3 values: must be 4 wheel speeds",
    );
    desk.check(
        &["simulate", "--controller", "0.1,0.2,0.3,nan"],
        2,
        "controller[3] = NaN: must be a number from -1 to 1",
    );
    desk.check(
        &["simulate", "--controller", "0.1,0.2,0.3,1.5"],
        2,
        "controller[3] = 1.5",
    );
    desk.check(
        &["simulate", "--controller", "0,0,0,0", "--model", "two-sensor"],
        2,
        "must be 9 values for the two-sensor model",
    );
    desk.check(
        &["simulate", "--controller", "0,0,0,0", "--model", "legs"],
        2,
        "single-sensor",
    );
    desk.check(
        &["simulate", "--case", &desk.write("case.json", "{")],
        2,
        "case.json: not JSON",
    );
    desk.check(&["filter", "1,2"], 2, "controller = 2 values");
    desk.check(
        &["submit", &desk.path("small.toml")],
        2,
        "there is no data directory",
    );
}

#[test]
fn what_fails_is_named_with_exit_code_1() {
    let desk = Desk::new();
    let spec = desk.path("small.toml");
    assert_eq!(desk.murmuration.run(&["run", &spec]).code, Some(0));
    desk.check(&["show", "small-9"], 2, "there is no campaign \"small-9\"");
    desk.check(
        &["show", "small-1", "--index", "100"],
        2,
        "small-1 has no individual 100: its archive holds 100",
    );
    desk.check(
        &["resume", "small-1"],
        1,
        "cannot resume campaign small-1: it is completed",
    );
    desk.check(&["submit", &spec], 1, "no coordinator is running");
    desk.check(
        &["list", "--coordinator", "http://127.0.0.1:9"],
        1,
        "no coordinator answers at http://127.0.0.1:9",
    );
    desk.check(
        &[
            "simulate",
            "--controller",
            "0,0,0,0",
            "--png",
            "/nonexistent/a.png",
        ],
        1,
        "cannot write /nonexistent/a.png",
    );

    let holder = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let taken = holder.local_addr().unwrap().to_string();
    desk.check(
        &["serve", "--listen", &taken],
        1,
        &format!("cannot listen on {taken}"),
    );

    let blocked = desk.write("a-file", "");
    desk.check(&["run", &spec, "--data", &blocked], 1, "a-file");
    let damaged = desk.folder.path().join("damaged");
    fs::create_dir(&damaged).unwrap();
    fs::write(
        damaged.join("murmuration.sqlite"),
        "no database, but longer than a header ".repeat(9),
    )
    .unwrap();
    desk.check(
        &["list", "--data", &damaged.display().to_string()],
        1,
        "is not a sound database",
    );
}

#[test]
fn a_second_process_is_told_who_holds_the_data_directory() {
    let desk = Desk::new();
    let mut serving = desk
        .murmuration
        .start(&["serve", "--listen", "127.0.0.1:0", "--workers", "1"]);
    let line = serving.wait_for("serving");
    let url = line.rsplit(' ').next().unwrap().to_owned();
    let spec = desk.path("small.toml");
    desk.check(
        &["run", &spec],
        1,
        &format!("at {url}: hand the campaign to it with `murmuration submit`"),
    );
    desk.check(&["serve"], 1, "one coordinator serves a data directory at a time");

    // Other commands find the coordinator by the data directory.
    let submitted = json(&desk.murmuration.run(&["submit", &spec, "--json"]));
    assert_eq!(submitted["campaign"], "small-1");
    desk.check(&["watch", "small-1"], 0, "campaign small-1 is completed");
    let lines = desk
        .murmuration
        .run(&["watch", "small-1", "--json", "--coordinator", &url]);
    assert_eq!(json(&lines)["state"], "completed");
    assert_eq!(serving.terminate(), Some(0));
}

#[test]
fn pause_resume_and_cancel_survive_the_coordinator() {
    let desk = Desk::new();
    let spec = desk.path("small.toml");
    let serve = ["serve", "--listen", "127.0.0.1:0", "--workers", "0"];
    let mut serving = desk.murmuration.start(&serve);
    let url = serving.wait_for("serving").rsplit(' ').next().unwrap().to_owned();
    desk.check(
        &["submit", &spec],
        0,
        "campaign small-1 submitted; next: murmuration watch small-1",
    );
    desk.check(&["submit", &spec], 0, "campaign small-2 submitted");
    desk.check(
        &["pause", "small-1"],
        0,
        "campaign small-1 is paused; next: murmuration resume small-1",
    );
    desk.check(&["cancel", "small-2"], 0, "campaign small-2 is cancelled");
    desk.check(
        &["pause", "small-2"],
        1,
        "cannot pause campaign small-2: it is cancelled",
    );
    serving.kill();

    let states: Vec<Value> = desk
        .murmuration
        .run(&["list", "--json"])
        .stdout
        .lines()
        .map(|line| serde_json::from_str::<Value>(line).unwrap()["state"].clone())
        .collect();
    assert_eq!(states, ["paused", "cancelled"]);
    desk.check(&["list", "--coordinator", &url], 1, "no coordinator answers");
    desk.check(
        &["resume", "small-1"],
        0,
        "campaign small-1 goes on with its stage evolve after generation 0",
    );
    desk.check(&["watch", "small-1"], 0, "campaign small-1 is completed");
}

#[test]
fn the_filter_scores_controllers() {
    let desk = Desk::new();
    let lines = desk.write("controllers.txt", "0.6,1,0.4,0.5\n\n0 0 0 0\n");
    let scored = desk.murmuration.run(&["filter", "--file", &lines, "--json"]);
    let verdicts: Vec<Value> = scored
        .stdout
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(
        (&verdicts[0]["passes"], &verdicts[1]["passes"]),
        (&true.into(), &false.into())
    );
    assert_eq!(verdicts[1]["score"], -25.0);
    let table = desk.murmuration.run(&["filter", "-0.7,0.3,1,1"]);
    assert!(table.stdout.contains("passes"), "{}", table.stdout);
}

#[test]
fn checkpoints_are_imported_listed_shown_and_exported() {
    let desk = Desk::new();
    let model = concat!(env!("CARGO_MANIFEST_DIR"), "/models/small.onnx");
    let imported = json(&desk.murmuration.run(&["checkpoints", "import", model, "--json"]));
    let digest = imported["checkpoint"].as_str().unwrap();
    let listed = json(&desk.murmuration.run(&["checkpoints", "list", "--json"]));
    assert_eq!(listed, imported);
    desk.check(&["checkpoints", "show", &digest[..8]], 0, "");
    let out = desk.path("out.onnx");
    desk.check(&["checkpoints", "export", &digest[..8], &out], 0, "wrote");
    assert!(
        fs::read(out).unwrap() == fs::read(model).unwrap(),
        "exported bytes differ"
    );

    let no_model = desk.write("no.onnx", "not a model");
    desk.check(
        &["checkpoints", "import", &no_model],
        2,
        "this is not an ONNX model",
    );
    desk.check(
        &["checkpoints", "show", "ffff"],
        2,
        "there is no checkpoint \"ffff\"",
    );
}

#[test]
fn trainings_are_measured() {
    let desk = Desk::new();
    let measured = desk
        .murmuration
        .run(&["bench", "train", "--behaviours", "300", "--json"]);
    assert_eq!(measured.code, Some(0), "{}", measured.stderr);
    let figures: Vec<Value> = measured
        .stdout
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(figures.len(), 4);
    for figures in &figures {
        let figure = |name: &str| figures[name].as_f64().unwrap();
        assert!(
            0.0 < figure("seconds_per_step") && figure("seconds_per_step") <= figure("seconds_per_epoch")
        );
    }
    desk.check(&["bench", "train", "--behaviours", "3"], 2, "3 behaviours");
}

#[test]
fn completions_are_written_for_every_shell() {
    let desk = Desk::new();
    for shell in ["bash", "zsh", "fish"] {
        let written = desk.murmuration.run(&["completions", shell]);
        assert!(
            written.code == Some(0) && written.stdout.contains("murmuration"),
            "{shell}"
        );
    }
}

#[test]
fn workers_of_their_own_processes_come_and_go() {
    let desk = Desk::new();
    let spec = desk.path("small.toml");
    let undisturbed = json(&desk.murmuration.run(&["run", &spec, "--json"]))["digest"].clone();

    let mut serving = desk
        .murmuration
        .start(&["serve", "--listen", "127.0.0.1:0", "--workers", "0"]);
    let url = serving.wait_for("serving").rsplit(' ').next().unwrap().to_owned();
    let leaves = Running::worker(&url);
    desk.check(&["submit", &spec], 0, "campaign small-2 submitted");
    assert_eq!(leaves.terminate(), Some(0));
    let killed = Running::worker(&url);
    killed.kill();
    let _stays = Running::worker(&url);
    desk.check(&["watch", "small-2"], 0, "campaign small-2 is completed");
    let digest = desk.murmuration.run(&["digest", "small-2"]);
    assert_eq!(digest.stdout.trim(), undisturbed);
}

#[test]
fn a_latent_campaign_runs_unattended_and_moves_to_another_checkpoint() {
    let desk = Desk::new();
    let spec = desk.write("latent.toml", &small_latent_spec("").to_toml());
    let first = desk.murmuration.run(&["run", &spec]);
    assert_eq!(first.code, Some(0), "{}", first.stderr);
    let again = json(&desk.murmuration.run(&["run", &spec, "--json"]));
    assert!(
        first.stdout.contains(again["digest"].as_str().unwrap()),
        "{}",
        first.stdout
    );
    let other = json(&desk.murmuration.run(&["run", &spec, "--seed", "9", "--json"]));
    assert_ne!(other["digest"], again["digest"]);

    let checkpoints = desk.murmuration.run(&["checkpoints", "list", "--json"]).stdout;
    let checkpoints: Vec<Value> = checkpoints
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(checkpoints.len(), 2, "one of each seed");
    for metric in ["triplet_accuracy", "spread", "rank"] {
        assert!(checkpoints[0]["metrics"][metric].as_f64().unwrap() > 0.0);
    }
    let second = checkpoints[1]["checkpoint"].as_str().unwrap();
    desk.check(
        &["adopt", "small-1", &second[..10]],
        0,
        "open the report in a browser",
    );
    let shown = json(&desk.murmuration.run(&["show", "small-1", "--json"]));
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
