//! `murmuration --help`: every command on one line, in groups.

use crate::{Help, Lab};
use clap::{Args as _, Command, Subcommand as _, builder::Styles};
use murmuration_cli::Global;
use std::fmt::Write as _;

/// Maximum width of a line of options, in columns.
const WIDTH: usize = 98;
/// The rest of the heading of the options.
const DESCRIBED: &str = " (`murmuration COMMAND --help` describes them):";

/// The groups of commands in the order of the help. Each is a command with the group's name and the options that all commands
/// share.
pub fn groups() -> Vec<Command> {
    let mut groups = Vec::from(murmuration_cli::Command::groups());
    groups.push(Lab::augment_subcommands(Command::new("Lab")));
    groups.push(Help::augment_subcommands(Command::new("Help")));
    groups.into_iter().map(Global::augment_args).collect()
}

/// The template of the help of `murmuration` itself.
pub(crate) fn overview() -> String {
    let styles = Styles::styled();
    let (header, literal) = (styles.get_header(), styles.get_literal());
    let groups = groups();
    let longest = |names: &mut dyn Iterator<Item = &str>| names.map(str::len).max().unwrap_or_default();
    let of_groups = longest(&mut groups.iter().map(Command::get_name));
    let of_commands = longest(
        &mut groups
            .iter()
            .flat_map(Command::get_subcommands)
            .map(Command::get_name),
    );
    let mut text = "{about}\n{usage-heading} {usage}\n".to_owned();
    for group in &groups {
        let mut heading = group.get_name();
        for command in group.get_subcommands().filter(|command| !command.is_hide_set()) {
            let (name, about) = (
                command.get_name(),
                command.get_about().cloned().unwrap_or_default(),
            );
            let (to_name, to_about) = (of_groups - heading.len(), of_commands - name.len());
            // Writing to a string cannot fail.
            let _ = writeln!(
                text,
                "{header}{heading}{header:#}{:to_name$}  {literal}{name}{literal:#}{:to_about$}  {about}",
                "", ""
            );
            heading = "";
        }
    }
    let _ = write!(
        text,
        "\n{header}Options{header:#}{DESCRIBED}{}{{after-help}}",
        options()
    );
    text
}

/// The names of the options that all commands share, in lines; the first goes on after the heading.
fn options() -> String {
    let global = Global::augment_args(Command::new("murmuration"));
    let named = global.get_arguments().filter_map(|option| {
        let value = option
            .get_value_names()
            .filter(|_| option.get_action().takes_values());
        let value = value
            .map(|names| format!(" {}", names.join(" ")))
            .unwrap_or_default();
        Some(format!("--{}{value}", option.get_long()?))
    });
    let (mut text, mut width) = (" ".to_owned(), "Options".len() + DESCRIBED.len() + 1);
    for option in named.chain(["--help", "--version"].map(str::to_owned)) {
        if width + option.len() > WIDTH {
            text.push_str("\n  ");
            width = 2;
        }
        width += option.len() + 2;
        text.push_str(&option);
        text.push_str(", ");
    }
    text.trim_end_matches(", ").replace(", \n", ",\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    #[test]
    fn every_command_is_in_one_group() {
        let mut listed: BTreeMap<String, usize> = BTreeMap::new();
        for command in groups().iter().flat_map(Command::get_subcommands) {
            *listed.entry(command.get_name().to_owned()).or_default() += 1;
        }
        let program = crate::command();
        let all = program
            .get_subcommands()
            .map(|command| (command.get_name().to_owned(), 1));
        assert_eq!(listed, all.collect());
    }

    #[test]
    fn the_overview_fits_a_screen() {
        let help = crate::command().render_help().to_string();
        assert!(help.lines().count() <= 52, "{help}");
        for line in help.lines() {
            assert!(line.chars().count() <= 100, "{line}");
        }
        for option in Global::augment_args(Command::new("")).get_arguments() {
            assert!(
                help.contains(&format!("--{}", option.get_long().unwrap())),
                "{help}"
            );
        }
        // The only headings are the names of the groups.
        assert!(help.contains("\nLabels     label "), "{help}");
    }
}
