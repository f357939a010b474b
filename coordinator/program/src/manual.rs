//! The manual: a page for each command. Text that the help shows below the options goes to the usual sections of a manual.

use super::EXIT_CODES;
use clap::Command;
use clap_mangen::{
    Man,
    roff::{Roff, roman},
};
use murmuration_files::write_file;
use std::{fs, io, path::Path};

/// Writes `murmuration.1`, which lists the commands by `groups`, and `murmuration-COMMAND.1` for each command. The folder may
/// exist.
pub(super) fn write(command: Command, groups: &[Command], folder: &Path) -> io::Result<()> {
    let mut command = command.disable_help_subcommand(true);
    command.build();
    fs::create_dir_all(folder)?;
    write_with_those_within(command, groups, folder)
}

fn write_with_those_within(command: Command, groups: &[Command], folder: &Path) -> io::Result<()> {
    for within in command.get_subcommands().filter(|within| !within.is_hide_set()) {
        write_with_those_within(within.clone(), &[], folder)?;
    }
    let (name, text) = page(command, groups)?;
    write_file(&folder.join(name), text).map(drop)
}

/// A page and the name of its file. Without groups, the page lists the subcommands in one section.
fn page(command: Command, groups: &[Command]) -> io::Result<(String, Vec<u8>)> {
    let help = command.get_after_help().map(ToString::to_string);
    let help = BelowOptions::of(help.as_deref().unwrap_or_default());
    let mut command = command.after_help(None::<&'static str>);
    if !help.prose.is_empty() {
        command = command.long_about(help.prose.join("\n\n"));
    }
    let name = command.get_name().to_owned();
    let man = Man::new(command).source(concat!("murmuration ", env!("CARGO_PKG_VERSION")));
    let mut text = Vec::new();
    if groups.is_empty() {
        man.render(&mut text)?;
    } else {
        man.render_title(&mut text)?;
        man.render_name_section(&mut text)?;
        man.render_synopsis_section(&mut text)?;
        man.render_description_section(&mut text)?;
        for group in groups {
            section(&name, group).to_writer(&mut text)?;
        }
        man.render_options_section(&mut text)?;
        man.render_version_section(&mut text)?;
    }
    help.sections().to_writer(&mut text)?;
    Ok((man.get_filename(), text))
}

/// A section that lists the pages of a group of commands of `program`.
fn section(program: &str, group: &Command) -> Roff {
    let mut roff = Roff::new();
    roff.control("SH", [group.get_name().to_uppercase().as_str()]);
    for command in group.get_subcommands().filter(|command| !command.is_hide_set()) {
        let about = command.get_about().map(ToString::to_string).unwrap_or_default();
        let page = format!("{program}-{}(1)", command.get_name());
        roff.control("TP", []).text([roman(page)]).text([roman(about)]);
    }
    roff
}

/// The paragraphs below the options in a command's help.
struct BelowOptions<'a> {
    prose: Vec<&'a str>,
    /// The examples, with the line that announces them.
    examples: Option<&'a str>,
}

impl<'a> BelowOptions<'a> {
    fn of(text: &'a str) -> Self {
        let mut examples = None;
        let mut prose = Vec::new();
        for paragraph in text.split("\n\n").filter(|paragraph| !paragraph.is_empty()) {
            if paragraph.starts_with("Example") {
                examples = Some(paragraph);
            } else if !paragraph.starts_with(EXIT_CODES) {
                prose.push(paragraph);
            }
        }
        Self { prose, examples }
    }

    fn sections(&self) -> Roff {
        let mut roff = Roff::new();
        let codes = EXIT_CODES.trim_start_matches("Exit codes: ");
        roff.control("SH", ["EXIT STATUS"]).text([roman(codes)]);
        if let Some(examples) = self.examples {
            roff.control("SH", ["EXAMPLES"]).control("nf", []);
            for line in examples.lines().skip(1) {
                roff.text([roman(as_a_shell_takes_it(line.trim_start()))]);
            }
            roff.control("fi", []);
        }
        roff
    }
}

/// Writes the purpose of an example as a shell comment behind it.
fn as_a_shell_takes_it(example: &str) -> String {
    match example.split_once("  ") {
        Some((command, purpose)) => format!("{command}  # {}", purpose.trim_start()),
        None => example.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory as _;

    /// Titles of a page's sections, in order.
    fn sections(text: &str) -> Vec<&str> {
        let headings = text.lines().filter_map(|line| line.strip_prefix(".SH "));
        headings.map(|heading| heading.trim_matches('"')).collect()
    }

    #[test]
    fn what_help_says_below_the_options_stands_in_its_section() {
        let mut command = super::super::Arguments::command();
        command.build();
        let (name, text) = page(command.clone(), &crate::help::groups()).unwrap();
        let text = String::from_utf8(text).unwrap();
        assert_eq!(name, "murmuration.1");
        let expected = "NAME SYNOPSIS DESCRIPTION CAMPAIGNS LABELS ROBOTS DATA CLUSTER LAB HELP OPTIONS";
        let expected: Vec<&str> = expected.split(' ').collect();
        let last = ["OPTIONS OF EVERY COMMAND", "VERSION", "EXIT STATUS", "EXAMPLES"];
        assert_eq!(sections(&text), [&expected, &last[..]].concat());
        assert!(text.contains("\nmurmuration\\-lab(1)\n"), "{text}");
        assert!(
            text.contains("\nmurmuration run examples/quick.toml  # search and write a report: 10 s\n"),
            "{text}"
        );
        assert!(
            text.contains("\n0 done, 1 failed, 2 bad usage or input.\n"),
            "{text}"
        );

        let doctor = command.find_subcommand("doctor").unwrap();
        let (name, text) = page(doctor.clone(), &[]).unwrap();
        let text = String::from_utf8(text).unwrap();
        assert_eq!(name, "murmuration-doctor.1");
        let (description, rest) = text.split_once(".SH OPTIONS").unwrap();
        assert!(description.contains("Exit code 0 means"), "{text}");
        assert!(rest.contains("EXIT STATUS"), "{text}");
        assert!(
            rest.ends_with(".SH EXAMPLES\n.nf\nmurmuration doctor\n.fi\n"),
            "{text}"
        );
        assert!(text.contains(concat!("murmuration ", env!("CARGO_PKG_VERSION"))));
    }

    #[test]
    fn no_page_has_a_section_without_a_meaning() {
        let mut command = super::super::Arguments::command();
        command.build();
        let mut open = vec![command];
        let mut with_examples = 0;
        while let Some(command) = open.pop() {
            open.extend(command.get_subcommands().cloned());
            let (name, text) = page(command, &[]).unwrap();
            let text = String::from_utf8(text).unwrap();
            assert!(
                ["EXTRA", "Examples:", "Exit codes:"]
                    .iter()
                    .all(|word| !text.contains(word)),
                "{name}: {text}"
            );
            with_examples += usize::from(sections(&text).contains(&"EXAMPLES"));
        }
        assert!(with_examples > 20, "{with_examples}");
    }
}
