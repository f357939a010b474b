//! Tests that errors name the problem, and that exit codes distinguish usage errors from failures.

use crate::command_line::Desk;
use murmuration_tests::Finished;
use std::{fs, os::unix::fs::symlink, path::Path, process::Command};

#[test]
fn bad_input_is_named_with_exit_code_2() {
    let desk = Desk::new();
    let minimal = "model = \"single-sensor\"\nmethod = \"random\"\n";
    let specs = [
        ("model = [", "TOML parse error at line 1"),
        (
            "method = \"random\"",
            "model is missing: must be \"single-sensor\" or \"two-sensor\"",
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
            "unknown field `raduis` in [world]: did you mean `radius`?",
        ),
        (
            &format!("{minimal}[label]\npopulation = 5"),
            "its `population` belongs in [search]",
        ),
        (
            &format!("\u{feff}{minimal}[search]\npopulation = -1").replace('\n', "\r\n"),
            "4 | population = -1\n  |              ^^\nsearch.population must be a whole number, 0 or more, not",
        ),
    ];
    for (text, expected) in specs {
        desk.check(&["run", &desk.write("bad.toml", text)], 2, expected);
    }
    let marked = format!("\u{feff}{minimal}[search]\r\npopulation = 5\r\ngenerations = 3\r\n");
    let marked = desk.write("marked.toml", &marked);
    desk.check(&["simulate", "--controller", "0,0,0,0", "--spec", &marked], 0, "");
    desk.check(&["run", "missing.toml"], 2, "cannot read missing.toml");
    let meant = format!("did you mean {}?", desk.path("small.toml"));
    desk.check(&["run", &desk.path("smal.toml")], 2, &meant);
    for rate in ["0", "-5", "nan"] {
        desk.check(
            &["recognise", "film.csv", "--fps", rate],
            2,
            "it must be a number over 0",
        );
    }
    let empty = desk.write("empty.csv", "");
    for arguments in [
        vec!["recognise", &empty],
        vec!["lab", "judge", "--labels", &empty],
    ] {
        desk.check(&arguments, 2, "empty.csv: the file is empty");
    }
    desk.check(
        &["run", &desk.path("small.toml"), "--workers", "0"],
        2,
        "--workers 0",
    );
    desk.check(&["list"], 2, "there is no data directory");
    // Two behaviours of two classes do not form a triplet.
    let labels = "id,class,v1,v2,v3,v4,average_speed,angular_momentum,radial_variance_x20,scatter,group_rotation\n\
                  1,dispersal,-0.6,0.6,-0.6,-0.4,0.14,0.0,0.85,0.45,0.0\n2,random,-0.2,0.3,-0.1,-0.3,0.22,0.0,0.84,0.46,0.0\n";
    let labels = desk.write("labels.csv", labels);
    let accuracy = ["lab", "accuracy", "--labels", &labels, "--features"];
    desk.check(&accuracy, 2, "there is no triplet to measure by");
    desk.check(&["nonsense"], 2, "unrecognized subcommand");
    desk.check(
        &["completions", "bash", "--json"],
        2,
        "and no JSON: leave out --json",
    );
    desk.check(
        &["simulate", "--controller", "0.1,0.2,0.3"],
        2,
        "controller = 3 values: must be 4 wheel speeds",
    );
    desk.check(
        &["simulate", "--controller", "0.1,0.2,0.3,nan"],
        2,
        "controller.right_1 = NaN: must be a number from -1 to 1",
    );
    desk.check(
        &["simulate", "--controller", "0.1,0.2,0.3,1.5"],
        2,
        "controller.right_1 = 1.5",
    );
    let digits = format!("0,0,0,1{}", "0".repeat(300));
    for (controller, expected) in [
        (
            digits.as_str(),
            "controller.right_1 = 1e300: must be a number from -1 to 1",
        ),
        ("[0,0,0,0", "with or without square brackets around the list"),
        ("0 0 0 0", "separated by commas"),
    ] {
        desk.check(&["simulate", "--controller", controller], 2, expected);
    }
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
    desk.check(&["label", "latest"], 2, "<--csv <FILE>|--synthetic <N>>");
    desk.check(
        &["submit", &desk.path("small.toml")],
        2,
        "there is no data directory",
    );
}

#[test]
fn a_file_that_never_ends_is_not_read_for_ever() {
    let desk = Desk::new();
    let endless = "/dev/zero";
    let campaign = "cannot read /dev/zero: it is too long: a campaign file has at most 1,048,576 bytes";
    let url = "https://127.0.0.1:9";
    let cases = [
        (vec!["run", endless], campaign),
        (
            vec!["simulate", "--controller", "0,0,0,0", "--spec", endless],
            campaign,
        ),
        (
            vec!["simulate", "--case", endless],
            "a reference case has at most",
        ),
        (
            vec!["filter", "--file", endless],
            "a file of controllers has at most",
        ),
        (
            vec!["lab", "judge", "--labels", endless],
            "a file of labels has at most",
        ),
        (
            vec!["label", "latest", "--csv", endless],
            "a file of labels has at most",
        ),
        (
            vec!["lab", "accuracy", "--features", "--labels", endless],
            "a file of labels has at most",
        ),
        (
            vec!["checkpoints", "import", endless],
            "a checkpoint has at most 67,108,864 bytes",
        ),
        (vec!["serve", "--tokens", endless], "a tokens file has at most"),
        (
            vec!["list", "--coordinator", url, "--ca", endless],
            "a PEM file has at most",
        ),
        (
            vec!["list", "--coordinator", url, "--token-file", endless],
            "a token's file has at most 4,096 bytes",
        ),
    ];
    for (arguments, expected) in cases {
        desk.check(&arguments, 2, expected);
    }
}

#[test]
fn a_report_that_the_data_directory_cannot_hold_goes_elsewhere() {
    let desk = Desk::new();
    desk.check(&["run", &desk.path("small.toml")], 0, "");
    fs::remove_dir_all(desk.path("data/reports")).unwrap();
    desk.write("data/reports", "");
    desk.check(
        &["report", "latest"],
        2,
        "name a folder for the report with --out DIR",
    );
    desk.check(&["report", "latest", "--out", &desk.path("report")], 0, "");
}

#[test]
fn a_pipe_that_no_process_reads_is_not_waited_for() {
    let desk = Desk::new();
    let pipe = desk.path("pipe");
    let made = Command::new("mkfifo").arg(&pipe).status().unwrap();
    assert!(made.success());
    let simulate = ["simulate", "--controller", "0,0,0,0", "--tracks", &pipe];
    desk.check(&simulate, 1, "it is a pipe that no process reads");
}

#[test]
fn a_picture_is_written_under_a_name_of_its_kind() {
    let desk = Desk::new();
    for (option, name, expected) in [
        (
            "--gif",
            "x.png",
            "would hold an animated GIF: name a file that ends in .gif",
        ),
        (
            "--png",
            "x.gif",
            "would hold a PNG picture: name a file that ends in .png",
        ),
        (
            "--image",
            "x.jpg",
            "would hold a PNG picture: name a file that ends in .png",
        ),
    ] {
        let path = desk.path(name);
        let arguments = ["simulate", "--controller", "0,0,0,0", option, &path];
        desk.check(&arguments, 2, &format!("{option} {path} {expected}"));
        assert!(!Path::new(&path).exists());
    }
    for (option, name) in [("--png", "x.PNG"), ("--image", "x")] {
        let path = desk.path(name);
        desk.check(
            &["simulate", "--controller", "0,0,0,0", option, &path],
            0,
            &format!("wrote {path}"),
        );
    }
}

#[test]
fn a_table_of_results_replaces_no_file_that_is_read() {
    let desk = Desk::new();
    let (spec, genomes) = (desk.path("small.toml"), desk.path("genomes.csv"));
    fs::write(&genomes, "-0.7,0.3,1,1\n").unwrap();
    desk.check(
        &["evaluate", &spec, &genomes, "--out", &genomes],
        2,
        "is a file that is read",
    );
    assert_eq!(fs::read_to_string(&genomes).unwrap(), "-0.7,0.3,1,1\n");
    let out = desk.path("results.csv");
    desk.check(
        &["evaluate", &spec, &genomes, "--out", &out],
        0,
        &format!("wrote {out}"),
    );
    desk.check(
        &["evaluate", &spec, &genomes, "--out", &out],
        2,
        &format!("{out} exists already"),
    );
    desk.check(
        &["evaluate", &spec, &genomes, "--force", "--out", &out],
        0,
        &format!("replaced {out}"),
    );
}

#[test]
fn what_is_no_file_of_its_kind_is_named() {
    let desk = Desk::new();
    let data = desk.folder.path().join("odd");
    fs::create_dir_all(data.join("murmuration.sqlite")).unwrap();
    let spec = desk.path("small.toml");
    for arguments in [
        &["list"][..],
        &["run", &spec],
        &["doctor"],
        &["backup", "elsewhere"],
    ] {
        let data = data.display().to_string();
        desk.check(
            &[arguments, &["--data", &data]].concat(),
            1,
            &format!("cannot open the database {data}/murmuration.sqlite: it is a folder, and no file"),
        );
    }
    let certs = desk.folder.path().join("certs");
    fs::create_dir(&certs).unwrap();
    symlink(desk.path("unmounted"), certs.join("ca.pem")).unwrap();
    desk.check(
        &["certs", &certs.display().to_string()],
        2,
        "unmounted, which does not exist",
    );
}

#[test]
fn a_file_is_no_data_directory() {
    let desk = Desk::new();
    let (file, spec) = (desk.write("a-file", ""), desk.path("small.toml"));
    let (labels, elsewhere) = (
        desk.write("labels.csv", "index,class\n0,ring\n"),
        desk.path("elsewhere"),
    );
    for arguments in [
        &["run", &spec][..],
        &["list"],
        &["serve"],
        &["digest", "latest"],
        &["submit", &spec],
        &["label", "latest", "--csv", &labels, "--annotator", "ana"],
        &["evaluate", &spec, &desk.write("genomes.csv", "0,0,0,0\n")],
        &["checkpoints", "list"],
        &["doctor"],
        &["quarantine"],
        &["backup", &elsewhere],
        &["lab", "study", "list"],
        &["lab", "study", "show", "small"],
    ] {
        let message = format!("{file} is not a folder, so it cannot be a data directory");
        desk.check(&[arguments, &["--data", &file]].concat(), 2, &message);
    }
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
        &["pause", "small-1"],
        1,
        "cannot pause campaign small-1: it was already completed",
    );
    desk.check(
        &["submit", &spec],
        1,
        "no coordinator runs over this data directory",
    );
    desk.check(
        &["list", "--coordinator", "http://127.0.0.1:9"],
        1,
        "no coordinator answers at http://127.0.0.1:9",
    );
    desk.check(
        &["simulate", "--controller", "0,0,0,0", "--png", "/dev/null/a.png"],
        1,
        "cannot write /dev/null/a.png",
    );

    let holder = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let taken = holder.local_addr().unwrap().to_string();
    desk.check(
        &["serve", "--listen", &taken],
        1,
        &format!("cannot listen on {taken}"),
    );

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
        "is damaged (file is not a database): `murmuration doctor` says what is damaged",
    );
}

/// A text that must not reach a terminal, and the cleaned form of this text.
const HOSTILE: [&str; 2] = ["a\u{1b}]0;owned\u{7}\u{9b}2J\u{202e}b", "a]0;owned2Jb"];

#[test]
fn words_of_files_and_arguments_do_not_reach_a_terminal_as_they_are() {
    let desk = Desk::new();
    let [hostile, cleaned] = HOSTILE;
    let spec = desk.path("small.toml");
    assert_eq!(desk.murmuration.run(&["run", &spec]).code, Some(0));
    let header = desk.write("header.csv", &format!("index,{hostile}\n1,2,3\n"));
    let class = desk.write("class.csv", &format!("index,class\n1,{hostile}\n"));
    let image = desk.write(
        "image.csv",
        &format!("image,class\n\"{hostile}\nerror: b.png\",ring\n"),
    );
    let tokens = desk.write("tokens.toml", &format!("[[token]]\nname = '{hostile}'\n"));
    let tracks = desk.write("tracks.csv", &format!("{hostile},x,y\n"));
    let named = desk.path(&format!("{hostile}\nerror: c"));
    fs::write(&named, "x\n").unwrap();
    let long = desk.write("long.csv", &format!("index,{}\n1,2,3\n", "x".repeat(400_000)));
    for arguments in [
        &["label", "latest", "--csv", &header, "--annotator", "ana"][..],
        &["label", "latest", "--csv", &class, "--annotator", "ana"],
        &["label", "latest", "--csv", &named, "--annotator", "ana"],
        &["label", "latest", "--csv", &long, "--annotator", "ana"],
        &["label", hostile, "--csv", &class, "--annotator", "ana"],
        &["lab", "judge", "--labels", &header],
        &["lab", "accuracy", "--features", "--labels", &image],
        &["evaluate", &spec, &header],
        &["evaluate", &named, &header],
        &["recognise", &tracks],
        &["serve", "--tokens", &tokens],
        &["run", &named],
        &["run", &spec, "--seed", hostile],
        &["run", &spec, hostile],
        &[hostile],
        &["show", hostile],
    ] {
        let Finished { code, stderr, .. } = desk.murmuration.run(arguments);
        assert_eq!(code, Some(2), "{arguments:?}: {stderr:?}");
        let hidden = |c: char| c != '\n' && c.is_control() || c == '\u{202e}';
        assert!(!stderr.contains(hidden), "{arguments:?}: {stderr:?}");
        assert!(!stderr.contains("\nerror: "), "{arguments:?}: {stderr:?}");
        assert!(stderr.len() < 5_000, "{arguments:?}: {} bytes", stderr.len());
    }
    desk.check(&["run", &named], 2, &format!("{cleaned} error: c:"));
}
