//! Tests commands that need no campaign.

use crate::command_line::Desk;
use murmuration_tests::schemas::check_documents;
use std::fs;

#[test]
fn pictures_are_what_their_names_say() {
    let desk = Desk::new();
    // Commands create missing parent folders.
    let (gif, png, image) = (
        desk.path("moving/a.gif"),
        desk.path("a.png"),
        desk.path("still/grey/b.png"),
    );
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
fn certificates_are_made_in_new_folders() {
    let desk = Desk::new();
    desk.check(&["certs", &desk.path("secrets/of/mine")], 0, "ca.pem");
    assert!(fs::exists(desk.path("secrets/of/mine/server.pem")).unwrap());
}

#[test]
fn the_filter_scores_controllers() {
    let desk = Desk::new();
    let lines = desk.write("controllers.txt", "0.6,1,0.4,0.5\n\n[0, 0, 0, 0]\n");
    let scored = desk.murmuration.run(&["filter", "--file", &lines, "--json"]);
    let verdicts = scored.lines();
    assert_eq!(
        (&verdicts[0]["passes"], &verdicts[1]["passes"]),
        (&true.into(), &false.into())
    );
    assert_eq!(verdicts[1]["score"], -25.0);
    let table = desk.murmuration.run(&["filter", "-0.7,0.3,1,1"]);
    assert!(table.stdout.contains("passes"), "{}", table.stdout);
}

#[test]
fn a_controller_that_begins_with_a_minus_sign_is_told_from_an_option() {
    let desk = Desk::new();
    let (one, other) = ("0.6,1,0.4,0.5", "-0.7,0.3,1,1");
    for arguments in [
        &["filter", one, other, "--json"][..],
        &["filter", "--json", one, other],
        &["filter", one, "--json", other],
        &["filter", one, "--json", "--", other],
        &["filter", "--json", "--", one, other],
    ] {
        let scored = desk.murmuration.run(arguments);
        assert_eq!(scored.code, Some(0), "{arguments:?}: {}", scored.stderr);
        let lines = scored.lines();
        assert_eq!(lines.len(), 2, "{arguments:?}");
        assert_eq!(lines[1]["controller"][0], -0.7, "{arguments:?}");
    }
    let simulated = desk
        .murmuration
        .run(&["simulate", "--controller", other, "--json"]);
    assert_eq!(simulated.last_line()["controller"][0], -0.7);
    desk.check(&["filter", "-0.7,0.3,1"], 2, "controller = 3 values");
    desk.check(&["filter", one, "--jsn"], 2, "'--json'");
    desk.check(
        &["simulate", "--controller", "--json"],
        2,
        "a value is required for '--controller <CONTROLLER>'",
    );
    let file = desk.write("controllers.txt", "\u{feff}0.6,1,0.4,0.5\r\n-0.7,0.3,1,1\r\n");
    let scored = desk.murmuration.run(&["filter", "--file", &file, "--json"]);
    assert_eq!(scored.lines().len(), 2, "{}", scored.stderr);
}

#[test]
fn checkpoints_are_imported_listed_shown_and_exported() {
    let desk = Desk::new();
    let model = concat!(env!("CARGO_MANIFEST_DIR"), "/models/small.onnx");
    let imported = desk
        .murmuration
        .run(&["checkpoints", "import", model, "--json"])
        .last_line();
    let digest = imported["digest"].as_str().unwrap();
    let listed = desk
        .murmuration
        .run(&["checkpoints", "list", "--json"])
        .last_line();
    assert_eq!(listed, imported);
    desk.check(&["checkpoints", "show", &digest[..8]], 0, "");
    let out = desk.path("exported/models/out.onnx");
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
        .run(&["lab", "bench", "train", "--behaviours", "300", "--json"]);
    let figures = measured.lines();
    check_documents("bench-train", &measured.stdout);
    assert_eq!(figures.len(), 4);
    for figures in &figures {
        let figure = |name: &str| figures[name].as_f64().unwrap();
        assert!(
            0.0 < figure("seconds_per_step") && figure("seconds_per_step") <= figure("seconds_per_epoch")
        );
    }
    desk.check(&["lab", "bench", "train", "--behaviours", "3"], 2, "3 behaviours");
}

#[test]
fn every_speed_is_measured_beside_its_peer() {
    let desk = Desk::new();
    let arguments = ["lab", "bench", "all", "--seconds", "0.02", "--python", "missing"];
    let as_json = desk.murmuration.run(&[&arguments[..], &["--json"]].concat());
    check_documents("bench-all", &as_json.stdout);
    let rows = as_json.lines();
    assert_eq!(rows.len(), 10);
    for row in &rows {
        let figure = |name: &str| row[name].as_f64();
        assert!(figure("ours").unwrap() > 0.0, "{row}");
        let ratio = figure("peer").map(|peer| figure("ours").unwrap() / peer);
        assert_eq!(figure("ratio"), ratio, "{row}");
        assert_eq!(row["machine"], rows[0]["machine"]);
    }
    let beside: Vec<_> = rows.iter().filter(|row| row["ratio"].is_number()).collect();
    let peers: Vec<_> = beside.iter().map(|row| row["peer_name"].as_str()).collect();
    let plain = Some("plain loop");
    assert_eq!(peers, [plain, plain, Some("brute force"), Some("FasterPAM")]);
    assert!(as_json.stderr.contains("pip install"), "{}", as_json.stderr);
    let table = desk.murmuration.run(&arguments);
    let lines: Vec<&str> = table.stdout.lines().collect();
    assert_eq!(lines.len(), 12, "{}", table.stdout);
    assert!(lines[0].starts_with("ITEM ") && lines[11].starts_with("machine: "));
    desk.check(&["lab", "bench", "all", "--seconds=-1"], 2, "--seconds");
}

#[test]
fn the_manual_has_a_page_for_every_command() {
    let desk = Desk::new();
    let written = desk.murmuration.run(&["man", &desk.path("man")]);
    assert_eq!(written.code, Some(0), "{}", written.stderr);
    for (page, says) in [
        ("murmuration.1", "murmuration\\-run(1)"),
        ("murmuration-export.1", "\\-\\-csv"),
        ("murmuration-lab-study-run.1", ".SH EXAMPLES"),
    ] {
        let text = std::fs::read_to_string(desk.folder.path().join("man").join(page)).unwrap();
        assert!(text.contains(says), "{page}:\n{text}");
    }
    assert!(!desk.folder.path().join("man/murmuration-man.1").exists());
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
