//! Checks that options have environment variables, and that docs/security.md documents the seats of cost classes.

use clap::Command;
use murmuration_access::CostClass;
use murmuration_swarm::grouped;
use std::process;

/// Options without an environment variable.
fn without_variable(command: &Command) -> Vec<String> {
    let options = command
        .get_arguments()
        .filter(|argument| !argument.is_positional());
    let own = options.filter(|argument| !["help", "version"].contains(&argument.get_id().as_str()));
    let without = own.filter(|argument| argument.get_env().is_none());
    without
        .filter_map(|argument| Some(format!("--{}", argument.get_long()?)))
        .collect()
}

pub fn what_starts_a_service_is_an_environment_variable_too() {
    let command = murmuration_program::command();
    // Among the options of all commands, only `--json` has no variable: JSON must be requested explicitly.
    assert_eq!(without_variable(&command), ["--json"]);
    let serve = command.find_subcommand("serve").unwrap();
    assert!(serve.get_arguments().count() > 8);
    assert_eq!(without_variable(serve), [""; 0]);

    for program in ["murmuration-worker", "murmuration-trainer"] {
        let help = process::Command::new(murmuration_tests::binary(program))
            .arg("--help")
            .output()
            .unwrap();
        let help = String::from_utf8(help.stdout).unwrap();
        let (_, options) = help.split_once("Options:").unwrap();
        // The help of each option begins with a line with the option's name.
        let mut shown: Vec<(&str, bool)> = Vec::new();
        for line in options.lines() {
            if let Some(name) = line
                .split_whitespace()
                .find(|word| word.starts_with("--"))
                .filter(|_| line.trim_start().starts_with('-'))
            {
                shown.push((name, false));
            }
            if let Some((_, has_variable)) = shown.last_mut() {
                *has_variable |= line.contains("[env: MURMURATION_");
            }
        }
        assert!(shown.len() > 6, "{help}");
        shown.retain(|(name, has_variable)| !has_variable && !["--help", "--version"].contains(name));
        assert_eq!(shown, [], "{program}");
    }
}

pub fn the_page_on_security_has_the_seats_of_each_class() {
    let page = include_str!("../../../docs/security.md");
    for class in CostClass::LIMITED {
        let limits = class.limits();
        let [total, share] = [limits.total, limits.share].map(|count| grouped(count.get() as u64));
        let row = format!("| `{class}` | {total} | {share} |");
        assert!(page.contains(&row), "docs/security.md: there is no {row}");
    }
}
