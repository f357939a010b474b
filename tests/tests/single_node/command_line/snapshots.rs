//! What commands print, word for word, in `snapshots`: the help of each, what it prints about a small campaign, and what it
//! says when it is refused.
//!
//! Texts do not depend on the terminal, the machine or the clock: what would is replaced by its name in brackets.
//! CONTRIBUTING.md says how to accept a change.

use crate::command_line::{
    Desk,
    json::Schemas,
    transcripts::{ERRORS, OUTPUTS, SERVED, Transcript},
};
use clap::Command;
use murmuration_coordinator::cli;
use murmuration_tests::{Finished, binary};
use std::{collections::BTreeSet, fs, path::Path, process};

/// What is replaced, and by what.
const FILTERS: [(&str, &str); 13] = [
    (r"/[^\s\x22':,]*/\.tmp[A-Za-z0-9]+", "[folder]"),
    (r"\b[0-9a-f]{64}\b", "[digest]"),
    (r"\b[0-9a-f]{12}\b", "[digest]"),
    (r"\bmur_[A-Za-z0-9_-]+", "[token]"),
    (r"\d{4}-\d\d-\d\dT[0-9:.]+Z", "[time]"),
    (r"127\.0\.0\.1:\d{2,}", "127.0.0.1:[port]"),
    (r"\b[0-9.]+ s; open", "[seconds] s; open"),
    (r#""seconds":[0-9.e-]+"#, r#""seconds":[seconds]"#),
    (r#""image":"[^"]*""#, r#""image":"[image]""#),
    (r"by process \d+", "by process [process]"),
    (r#"(schema |"database_schema":)\d+"#, "${1}[version]"),
    // How often a run tells of its progress depends on its speed.
    (r"(?m)^.* · .*\n", ""),
    (r"(?m)^.* done in .*\n", ""),
];

/// Figures of this machine, of any length.
const FIGURES: [(&str, &str); 2] = [(r"[0-9][0-9.,]*(e-?\d+)?", "[figure]"), (r" {2,}", "  ")];

const MODELS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/models");

#[track_caller]
fn check(name: &str, text: &str, filters: &[(&str, &str)]) {
    let mut settings = insta::Settings::clone_current();
    settings.set_snapshot_path("snapshots");
    settings.set_prepend_module_to_snapshot(false);
    settings.set_omit_expression(true);
    for (pattern, name) in filters {
        settings.add_filter(pattern, *name);
    }
    settings.bind(|| insta::assert_snapshot!(name, text));
}

/// Every command, by its name with spaces, and those within it.
fn commands() -> Vec<String> {
    let mut command = cli::command();
    command.build();
    let mut open = vec![command];
    let mut names = Vec::new();
    while let Some(command) = open.pop() {
        // Not clap's own `help`.
        let within = command
            .get_subcommands()
            .filter(|within| within.get_name() != "help");
        open.extend(within.cloned());
        names.push(command.get_bin_name().unwrap_or(command.get_name()).to_owned());
    }
    names.extend(["murmuration-worker", "murmuration-trainer"].map(str::to_owned));
    names.sort();
    names
}

fn help_name(command: &str) -> String {
    format!("help-{}", command.replace(' ', "-"))
}

/// The kinds of documents that there are schemas of.
fn kinds() -> Vec<String> {
    let command = cli::command();
    let schema = command.find_subcommand("schema").unwrap();
    let kind = schema.get_positionals().next().unwrap();
    let values = kind.get_possible_values().into_iter();
    values.map(|value| value.get_name().to_owned()).collect()
}

#[test]
fn the_help_of_every_command_is_as_it_was() {
    let commands = commands();
    assert!(commands.len() > 40, "{commands:?}");
    for command in commands {
        let mut words = command.split(' ');
        let help = process::Command::new(binary(words.next().unwrap()))
            .args(words)
            .arg("--help")
            .env_clear()
            .env("COLUMNS", "100")
            .output()
            .unwrap();
        check(
            &help_name(&command),
            &String::from_utf8(help.stdout).unwrap(),
            &[],
        );
    }
}

#[test]
fn what_commands_print_about_a_campaign_is_as_it_was_and_as_their_schemas_say() {
    let desk = Desk::new();
    let mut schemas = Schemas::new(&desk);
    for transcript in &OUTPUTS {
        check_transcript(&desk, transcript, &mut schemas);
    }
    schemas.check_that_all_were_used(&kinds());
}

#[test]
fn what_commands_refuse_is_told_as_it_was() {
    let desk = Desk::new();
    let mut schemas = Schemas::new(&desk);
    for transcript in &ERRORS {
        check_transcript(&desk, transcript, &mut schemas);
    }
}

#[test]
fn what_commands_say_to_a_coordinator_that_stays_is_as_it_was() {
    let desk = Desk::new();
    let quiet = [("RUST_LOG", "off")];
    let arguments = ["serve", "--listen", "127.0.0.1:0", "--workers", "0"];
    let mut serving = desk.murmuration.start_with(&arguments, &quiet);
    serving.wait_for("serving");
    let mut schemas = Schemas::new(&desk);
    for transcript in &SERVED {
        check_transcript(&desk, transcript, &mut schemas);
    }
    let (code, rest) = serving.terminate_and_hear();
    assert_eq!(code, Some(0));
    check("serve", &rest, &FILTERS);
}

#[test]
fn the_schema_of_every_document_is_as_it_was() {
    let desk = Desk::new();
    for kind in kinds() {
        let schema = desk.murmuration.run(&["schema", &kind]);
        assert_eq!(schema.code, Some(0), "{}", schema.stderr);
        check(&format!("schema-{kind}"), &schema.stdout, &[]);
    }
}

/// A test that is gone, or a snapshot that waits to be accepted, would leave its file behind.
#[test]
fn every_snapshot_is_of_a_test() {
    let transcripts = OUTPUTS.iter().chain(&ERRORS).chain(&SERVED);
    let mut names: BTreeSet<String> = transcripts.map(|transcript| transcript.name.to_owned()).collect();
    names.extend(commands().iter().map(|command| help_name(command)));
    names.extend(kinds().iter().map(|kind| format!("schema-{kind}")));
    names.insert("serve".to_owned());
    let files = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/single_node/command_line/snapshots");
    let files = fs::read_dir(files).unwrap().map(|file| file.unwrap().file_name());
    let files: BTreeSet<String> = files.map(|file| file.into_string().unwrap()).collect();
    let expected: BTreeSet<String> = names.iter().map(|name| format!("{name}.snap")).collect();
    assert_eq!(files, expected);
}

/// Every command has a transcript, or is known to have none.
#[test]
fn every_command_has_a_transcript() {
    // A script for a shell, and clap's; what names the machine or lasts minutes; and what other tests here run.
    let without = [
        "murmuration completions",
        "murmuration man",
        "murmuration bench all",
        "murmuration bench train",
        "murmuration bench labels",
        "murmuration schema",
        "murmuration serve",
    ];
    let transcripts: Vec<&Transcript> = OUTPUTS.iter().chain(&ERRORS).chain(&SERVED).collect();
    let command = cli::command();
    let is_group = |name: &str| {
        let words: Vec<&str> = name.split(' ').skip(1).collect();
        let found = words
            .iter()
            .try_fold(&command, |at, word| at.find_subcommand(word));
        found.is_some_and(Command::has_subcommands)
    };
    for name in commands() {
        if !name.contains(' ') || is_group(&name) || without.contains(&name.as_str()) {
            continue;
        }
        let words: Vec<&str> = name.split(' ').skip(1).collect();
        let has = |transcript: &&&Transcript| transcript.arguments.starts_with(&words);
        assert!(transcripts.iter().any(|transcript| has(&transcript)), "{name}");
    }
}

fn check_transcript(desk: &Desk, transcript: &Transcript, schemas: &mut Schemas) {
    for (name, text) in transcript.files {
        desk.write(name, text);
    }
    let folder = desk.folder.path().display().to_string();
    let arguments: Vec<String> = transcript
        .arguments
        .iter()
        .map(|word| word.replace("FOLDER", &folder).replace("MODELS", MODELS))
        .collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let Finished { code, stdout, stderr } = desk.murmuration.run(&arguments);
    let filters = match transcript.figures {
        // Digits after a point may be as many as those of a digest.
        true => [&FILTERS[..1], &FIGURES].concat(),
        false => FILTERS.to_vec(),
    };
    if let Some(kind) = transcript.kind {
        assert_eq!(code, Some(transcript.code), "{arguments:?}\n{stderr}");
        schemas.check(kind, &stdout);
    }
    assert_eq!(
        transcript.kind.is_some(),
        transcript.code == 0 && arguments.contains(&"--json"),
        "{arguments:?}"
    );
    assert_eq!(code, Some(transcript.code), "{arguments:?}\n{stdout}\n{stderr}");
    let command = transcript.arguments.join(" ");
    let text = format!(
        "$ murmuration {command}\n[exit code {}]\n[stdout]\n{stdout}[stderr]\n{stderr}",
        transcript.code
    );
    check(transcript.name, &text, &filters);
}
