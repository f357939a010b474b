//! Checks the pages `transcripts/*.md`. The pages have, word for word, the output of commands over a small campaign, of refused
//! commands, the help of commands, and the fields of their JSON.
//!
//! A page's `console` block is a script and its output: `$` begins a command, `>` continues a command, `!` begins a line of
//! stderr, and `[2]` is an exit code other than 0. A command's comment is the kind of the JSON documents that the command prints.
//! The comment is `figures` if the command prints figures of this machine, and `stays` if it runs until the end of the script.
//! Paths, digests, ports, times and tokens are replaced by names in brackets. CONTRIBUTING.md explains how to accept a change.

use crate::{
    examples::all,
    script::{Captured, Rule::Stays, Script},
};
use clap::Command;
use murmuration_tests::{
    binary,
    pages::blocks,
    schemas::{check_documents, schema},
    small_spec,
};
use regex::Regex;
use serde_json::{Map, Value};
use std::{collections::BTreeSet, fmt::Write as _, fs, path::PathBuf, process};

/// Patterns and their replacements.
const FILTERS: [(&str, &str); 15] = [
    (r"/[^\s\x22':,]*/\.tmp[A-Za-z0-9]+(/work)?", "[folder]"),
    (r"\b[0-9a-f]{64}\b", "[digest]"),
    (r"\b[0-9a-f]{12}\b", "[digest]"),
    (r"\bmur_[A-Za-z0-9_-]+", "[token]"),
    (r"\d{4}-\d\d-\d\dT[0-9:.]+Z", "[time]"),
    (r"127\.0\.0\.1:\d{2,}", "127.0.0.1:[port]"),
    (r"/open\?code=[A-Za-z0-9_-]+", "/open?code=[code]"),
    (r"\b[0-9.]+ s; open", "[seconds] s; open"),
    (r#""seconds":[0-9.e-]+"#, r#""seconds":[seconds]"#),
    (r#"_ms":\d+"#, r#"_ms":[time]"#),
    (r#""image":"[^"]*""#, r#""image":"[image]""#),
    (r"by process \d+", "by process [process]"),
    (r#"(schema |"database_schema":)\d+"#, "${1}[version]"),
    // The number of progress lines depends on a run's speed.
    (r"(?m)^.* · .*\n", ""),
    (r"(?m)^.* done in .*\n", ""),
];

/// Patterns for figures of this machine, of any length. A figure can have as many digits after the point as a digest.
const FIGURES: [(&str, &str); 3] = [
    FILTERS[0],
    (r"[0-9][0-9.,]*(e-?\d+)?", "[figure]"),
    (r" {2,}", "  "),
];

/// Environment variable. If it is set, the tests rewrite the pages with the current output.
const WRITE: &str = "MURMURATION_WRITE_TRANSCRIPTS";

/// Kinds of documents that no transcript prints. Such a document needs a machine that computed wrongly, takes minutes, or
/// contains the machine's name.
const NOT_PRINTED: [&str; 5] = [
    "node",
    "lifted-quarantine",
    "bench-all",
    "bench-train",
    "bench-labels",
];

pub fn of_one_campaign() {
    check_console("campaign");
}

pub fn of_refusals() {
    check_console("errors");
}

pub fn of_a_coordinator_that_stays() {
    check_console("served");
}

/// Checks the transcript of the overview, and of the usage, purpose and options of each command.
pub fn of_help() {
    let overview = process::Command::new(binary("murmuration"))
        .arg("--help")
        .env_clear()
        .env("COLUMNS", "100")
        .output()
        .unwrap();
    let mut text = format!("```text\n{}```\n", String::from_utf8(overview.stdout).unwrap());
    for command in all(murmuration_program::command()) {
        if !command.is_hide_set() && command.get_name() != "murmuration" {
            outline(command, &mut text);
        }
    }
    for program in ["murmuration-worker", "murmuration-trainer"] {
        let help = process::Command::new(binary(program))
            .arg("--help")
            .env_clear()
            .env("COLUMNS", "100")
            .output()
            .unwrap();
        write!(
            text,
            "\n```text\n{}```\n",
            String::from_utf8(help.stdout).unwrap()
        )
        .unwrap();
    }
    check_page("help", &text);
}

fn outline(mut command: Command, text: &mut String) {
    let usage = command.render_usage().to_string();
    let about = command.get_about().map(ToString::to_string).unwrap_or_default();
    write!(
        text,
        "\n`{}`\n{about}",
        usage.trim_start_matches("Usage: ").trim()
    )
    .unwrap();
    let own = command
        .get_opts()
        .filter(|option| !option.is_global_set() && !option.is_hide_set());
    let own: Vec<String> = own
        .filter_map(|option| {
            let value = option
                .get_value_names()
                .filter(|_| option.get_action().takes_values());
            let value = value.map(|names| format!(" {}", names.join(" ")));
            Some(format!("--{}{}", option.get_long()?, value.unwrap_or_default()))
        })
        .collect();
    if !own.is_empty() {
        write!(text, ": `{}`", own.join("`, `")).unwrap();
    }
    text.push('\n');
}

/// Checks the transcript of the fields of every kind of documents, with their types.
pub fn of_schemas() {
    let mut text = String::new();
    for kind in kinds() {
        let schema = schema(&kind);
        writeln!(text, "## {kind}\n\n```text").unwrap();
        let mut lines = Vec::new();
        fields(&schema, &schema, "", &mut lines);
        for line in lines {
            writeln!(text, "{line}").unwrap();
        }
        text.push_str("```\n\n");
    }
    check_page("schemas", &text);
}

/// The fields of a schema within `root`, as `PATH: TYPE`.
fn fields(root: &Value, schema: &Value, path: &str, lines: &mut Vec<String>) {
    let schema = resolved(root, schema);
    let none = Map::new();
    let properties = schema["properties"].as_object().unwrap_or(&none);
    for (name, field) in properties {
        let path = if path.is_empty() {
            name.clone()
        } else {
            format!("{path}.{name}")
        };
        lines.push(format!("{path}: {}", type_of(root, field)));
        fields(root, field, &path, lines);
        fields(root, &field["items"], &format!("{path}[]"), lines);
        for choice in field["anyOf"].as_array().into_iter().flatten() {
            fields(root, choice, &path, lines);
        }
    }
}

fn resolved<'a>(root: &'a Value, schema: &'a Value) -> &'a Value {
    match schema["$ref"].as_str() {
        Some(path) => root.pointer(path.trim_start_matches('#')).unwrap(),
        None => schema,
    }
}

fn type_of(root: &Value, schema: &Value) -> String {
    let schema = resolved(root, schema);
    if let Some(choices) = schema["anyOf"].as_array() {
        let choices: Vec<String> = choices.iter().map(|choice| type_of(root, choice)).collect();
        return choices.join(" or ");
    }
    let name = match &schema["type"] {
        Value::Array(names) => {
            let names: Vec<&str> = names.iter().filter_map(Value::as_str).collect();
            names.join(" or ")
        }
        name => name.as_str().unwrap_or("any").to_owned(),
    };
    match schema["enum"].as_array() {
        Some(values) => {
            let values: Vec<String> = values.iter().map(ToString::to_string).collect();
            values.join(" | ")
        }
        None if schema["items"].is_object() => format!("{name} of {}", type_of(root, &schema["items"])),
        None => name,
    }
}

/// Checks that every command and every kind of document is in a transcript or in a list of exceptions.
pub fn every_command_and_every_kind_of_document_has_one() {
    let steps: Vec<Step> = ["campaign", "errors", "served"]
        .into_iter()
        .flat_map(|page| steps(&text_of(page)))
        .collect();
    // These commands print scripts for a shell or clap's own text, print the machine's name, last minutes, or run in other tests.
    let without = [
        "murmuration completions",
        "murmuration man",
        "murmuration lab bench all",
        "murmuration lab bench train",
        "murmuration lab bench labels",
        "murmuration schema",
    ];
    let mut checked = 0;
    for command in all(murmuration_program::command()) {
        let name = command.get_bin_name().unwrap_or_default().to_owned();
        if command.has_subcommands() || without.contains(&name.as_str()) {
            continue;
        }
        let begins = format!("{name} ");
        let has = |step: &Step| format!("{} ", step.command).contains(&begins);
        assert!(steps.iter().any(has), "{name} has no transcript");
        checked += 1;
    }
    assert!(checked > 35, "{checked}");
    let printed: BTreeSet<&str> = steps.iter().filter_map(|step| step.kind.as_deref()).collect();
    let kinds = kinds();
    let unprinted: BTreeSet<&str> = kinds
        .iter()
        .map(String::as_str)
        .filter(|kind| !printed.contains(kind))
        .collect();
    assert_eq!(unprinted, BTreeSet::from(NOT_PRINTED));
}

/// The kinds of documents that have schemas.
fn kinds() -> Vec<String> {
    let command = murmuration_program::command();
    let schema = command.find_subcommand("schema").unwrap();
    let kind = schema.get_positionals().next().unwrap();
    let values = kind.get_possible_values().into_iter();
    values.map(|value| value.get_name().to_owned()).collect()
}

/// A command of a transcript.
struct Step {
    /// The command as the shell reads it; a command can have several lines.
    command: String,
    /// The kind of the documents that the command prints.
    kind: Option<String>,
    figures: bool,
    stays: bool,
}

/// The commands of a page.
fn steps(page: &str) -> Vec<Step> {
    let mut commands: Vec<String> = Vec::new();
    for (_, lines) in blocks(page)
        .into_iter()
        .filter(|(language, _)| language == "console")
    {
        for line in lines {
            match (
                line.strip_prefix("$ "),
                line.strip_prefix("> "),
                commands.last_mut(),
            ) {
                (Some(command), ..) => commands.push(command.to_owned()),
                (None, Some(more), Some(command)) => *command += &format!("\n{more}"),
                _ => {}
            }
        }
    }
    commands.into_iter().map(Step::new).collect()
}

impl Step {
    fn new(command: String) -> Self {
        let (_, comment) = command.split_once("  # ").unwrap_or_default();
        let is = |word: &str| comment.split(", ").any(|known| known == word);
        let kind = comment
            .split(", ")
            .find(|word| !["", "figures", "stays"].contains(word));
        Self {
            kind: kind.map(str::to_owned),
            figures: is("figures"),
            stays: is("stays"),
            command,
        }
    }

    /// The command and its output, in the format of the pages.
    fn transcript(&self, captured: &Captured) -> String {
        let mut text = format!("$ {}\n", self.command.replace('\n', "\n> "));
        let filters: &[_] = if self.figures { &FIGURES } else { &FILTERS };
        text += &replaced(&captured.stdout, filters);
        for line in replaced(&captured.stderr, filters).lines() {
            writeln!(text, "! {line}").unwrap();
        }
        match captured.code {
            Some(0) | None => {}
            Some(code) => writeln!(text, "[{code}]").unwrap(),
        }
        text
    }
}

fn replaced(text: &str, filters: &[(&str, &str)]) -> String {
    let mut text = text.to_owned();
    if !text.is_empty() && !text.ends_with('\n') {
        text.push('\n');
    }
    for (pattern, name) in filters {
        text = Regex::new(pattern)
            .unwrap()
            .replace_all(&text, *name)
            .into_owned();
    }
    text
}

/// Runs the commands of a page, and checks that the page shows their output, and that documents are of their kinds.
fn check_console(page: &str) {
    let steps = steps(&text_of(page));
    let commands = steps.iter().map(|step| step.command.clone()).collect();
    let script = Script::new(page, commands).small_campaign(small_spec("").to_toml());
    let script = match steps.iter().any(|step| step.stays) {
        true => script.rule("RUST_LOG=off murmuration serve", Stays("pages:")),
        false => script,
    };
    let mut text = "```console\n".to_owned();
    for (step, captured) in steps.iter().zip(script.capture()) {
        if let Some(kind) = &step.kind {
            assert_eq!(captured.code, Some(0), "{}: {}", step.command, captured.stderr);
            check_documents(kind, &captured.stdout);
        }
        let prints_documents = step.command.contains(" --json") && captured.code == Some(0);
        assert_eq!(step.kind.is_some(), prints_documents, "{}", step.command);
        text += &step.transcript(&captured);
    }
    check_page(page, &format!("{text}```\n"));
}

fn path_of(page: &str) -> PathBuf {
    let folder = PathBuf::from(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/tests/command_line/transcripts"
    ));
    folder.join(page).with_extension("md")
}

fn text_of(page: &str) -> String {
    fs::read_to_string(path_of(page)).unwrap()
}

/// Checks that a page consists of an introduction, which ends at the second empty line, and `text`.
#[track_caller]
fn check_page(page: &str, text: &str) {
    let kept = text_of(page);
    let mut parts = kept.splitn(3, "\n\n");
    let introduction = [parts.next().unwrap(), parts.next().unwrap()].join("\n\n");
    let now = format!("{introduction}\n\n{text}");
    if std::env::var_os(WRITE).is_some() && std::env::var_os("CI").is_none() {
        fs::write(path_of(page), &now).unwrap();
        return;
    }
    let line = kept.lines().zip(now.lines()).position(|(kept, now)| kept != now);
    let line = line.unwrap_or_else(|| kept.lines().count().min(now.lines().count()));
    let at = |text: &str| text.lines().nth(line).unwrap_or("(its end)").to_owned();
    assert!(
        kept == now,
        "{}:{}:\n  kept: {}\n   now: {}\nIf this is right, run it again with {WRITE}=1 and read the difference",
        path_of(page).display(),
        line + 1,
        at(&kept),
        at(&now)
    );
}
