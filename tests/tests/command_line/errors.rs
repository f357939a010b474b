//! What is wrong is named, with the exit code that says whose fault it is.

use crate::Desk;
use std::fs;

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
        "cannot resume campaign small-1: it was already completed",
    );
    desk.check(&["submit", &spec], 1, "no coordinator is running");
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
        "is damaged (file is not a database): `murmuration doctor` says what can be saved",
    );
}
