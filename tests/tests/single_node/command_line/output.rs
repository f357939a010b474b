//! Tests standard output and standard error that cannot be written, and logs that do not go to a terminal.

use crate::command_line::Desk;
use murmuration_tests::binary;
use std::{
    fs::File,
    io::{BufRead as _, BufReader},
    process::{Command, Stdio},
};

/// A device that is always full.
fn full() -> Stdio {
    File::options().write(true).open("/dev/full").unwrap().into()
}

/// A pipe that no one reads.
fn unread() -> Stdio {
    std::io::pipe().unwrap().1.into()
}

fn command(program: &str, arguments: &[&str], desk: &Desk) -> Command {
    let mut command = Command::new(binary(program));
    command
        .args(arguments)
        .env("MURMURATION_DATA", desk.path("data"))
        .stdin(Stdio::null());
    command
}

/// Exit code and standard error.
fn outcome(mut command: Command) -> (Option<i32>, String) {
    let output = command.stderr(Stdio::piped()).spawn().unwrap();
    let output = output.wait_with_output().unwrap();
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}

/// Programs and arguments of commands that print data: a table, lines of JSON during a campaign, help, a version, a script.
const PRINTING: [(&str, &[&str]); 9] = [
    ("murmuration", &["list"]),
    ("murmuration", &["watch", "latest", "--json"]),
    ("murmuration", &["show", "latest"]),
    ("murmuration", &["filter", "0.6,1,0.4,0.5"]),
    ("murmuration", &["--help"]),
    ("murmuration", &["--version"]),
    ("murmuration", &["completions", "bash"]),
    ("murmuration-worker", &["--help"]),
    ("murmuration-trainer", &["--version"]),
];

#[test]
fn output_that_cannot_be_written_is_an_error_and_a_reader_that_left_is_none() {
    let desk = Desk::new();
    assert_eq!(
        desk.murmuration.run(&["run", &desk.path("small.toml")]).code,
        Some(0)
    );
    for (program, arguments) in PRINTING {
        let mut cramped = command(program, arguments, &desk);
        cramped.stdout(full());
        let (code, message) = outcome(cramped);
        assert_eq!(code, Some(1), "{program} {arguments:?}: {message}");
        assert!(
            message.contains("error: cannot write to standard output: No space left on device"),
            "{program} {arguments:?}: {message}"
        );

        let mut unheard = command(program, arguments, &desk);
        unheard.stdout(unread());
        let (code, message) = outcome(unheard);
        assert_eq!(code, Some(0), "{program} {arguments:?}: {message}");
        assert!(!message.contains("error"), "{program} {arguments:?}: {message}");
    }
}

#[test]
fn an_error_that_cannot_be_told_keeps_its_exit_code() {
    let desk = Desk::new();
    for (program, arguments, code) in [
        ("murmuration", &["list"] as &[&str], 2),
        ("murmuration", &["list", "--coordinator", "http://127.0.0.1:9"], 1),
        ("murmuration", &["nonsense"], 2),
        ("murmuration-worker", &["--coordinator", "nowhere"], 1),
        ("murmuration-trainer", &["--coordinator", "nowhere"], 1),
    ] {
        let mut untold = command(program, arguments, &desk);
        let ended = untold.stdout(Stdio::null()).stderr(full()).status().unwrap();
        assert_eq!(ended.code(), Some(code), "{program} {arguments:?}");
    }
}

/// Starts a program with one more environment variable, and returns the first line of its log.
fn first_line(program: &str, arguments: &[&str], variable: Option<(&str, &str)>) -> String {
    let desk = Desk::new();
    let mut command = command(program, arguments, &desk);
    for inherited in ["NO_COLOR", "CLICOLOR", "CLICOLOR_FORCE"] {
        command.env_remove(inherited);
    }
    let mut running = command
        .env("RUST_LOG", "info")
        .envs(variable)
        .stderr(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let log = BufReader::new(running.stderr.take().unwrap());
    let line = log.lines().map(Result::unwrap).find(|line| line.contains("INFO"));
    running.kill().unwrap();
    running.wait().unwrap();
    line.unwrap()
}

#[test]
fn a_log_that_is_no_terminal_has_no_colours() {
    let nowhere = ["--coordinator", "http://127.0.0.1:9"];
    let serve = ["serve", "--listen", "127.0.0.1:0", "--workers", "1"];
    for (program, arguments) in [
        ("murmuration", &serve[..]),
        ("murmuration-worker", &nowhere[..]),
        ("murmuration-trainer", &nowhere[..]),
    ] {
        let line = first_line(program, arguments, None);
        assert!(!line.contains('\x1b'), "{program}: {line:?}");
        let forced = first_line(program, arguments, Some(("CLICOLOR_FORCE", "1")));
        assert!(forced.contains('\x1b'), "{program}: {forced:?}");
    }
}
