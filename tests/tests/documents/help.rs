//! The help of every command: its examples are run, and its text is checked.

use crate::{
    commands::{CONTROLLERS, FILM, NO_ENCODER, SAVED_WORLD},
    script::{
        Rule::{Before, NotRun, Stays},
        Script, free_port,
    },
};
use clap::Command;
use murmuration_coordinator::cli;

const LONG: &str = "it takes minutes and more";

/// Every command with those within it.
fn all(mut command: Command) -> Vec<Command> {
    command.build();
    let mut open = vec![command];
    let mut all = Vec::new();
    while let Some(command) = open.pop() {
        // Not clap's own `help`.
        let within = command
            .get_subcommands()
            .filter(|command| command.get_name() != "help");
        open.extend(within.cloned());
        all.push(command);
    }
    all.sort_by_key(|command| command.get_bin_name().map(str::to_owned));
    assert!(all.len() > 35, "{}", all.len());
    all
}

/// What stands below the options of each command.
fn texts() -> Vec<String> {
    let texts = all(cli::command());
    let texts = texts.iter().filter_map(Command::get_after_help);
    texts.map(ToString::to_string).collect()
}

/// The examples in such a text: after a command may stand, apart from it, what it is for.
fn examples(text: &str) -> impl Iterator<Item = String> {
    let lines = text.lines().filter(|line| line.starts_with("  "));
    lines.filter_map(|line| Some(line.trim_start().split("  ").next()?.to_owned()))
}

pub fn prose_flows_to_the_width_of_the_terminal() {
    let mut checked = 0;
    for text in texts() {
        let lines: Vec<&str> = text.lines().collect();
        for pair in lines.windows(2) {
            let ends = pair[1].is_empty() || pair[1].starts_with("  ") || pair[0].starts_with("  ");
            assert!(
                pair[0].is_empty() || ends,
                "a paragraph is broken in two:\n{text}"
            );
            checked += 1;
        }
    }
    assert!(checked > 40, "{checked}");
}

pub fn what_every_command_has_stands_after_its_own_options() {
    for mut command in all(cli::command()) {
        let help = command.render_help().to_string();
        let (own, general) = help.split_once("\nOptions of every command:\n").unwrap();
        let shows = |text: &str, option: &str| {
            let mut words = text.lines().filter_map(|line| line.split_whitespace().next());
            words.any(|word| word == option)
        };
        for option in [
            "--data",
            "--coordinator",
            "--ca",
            "--token-file",
            "--checkpoint-store",
            "--json",
        ] {
            assert!(shows(general, option) && !shows(own, option), "{option}\n{help}");
        }
        let own_options = command.get_opts().filter(|option| !option.is_global_set());
        for option in own_options.filter_map(clap::Arg::get_long) {
            let option = format!("--{option}");
            assert!(!shows(general, &option), "{option}\n{help}");
        }
    }
}

pub fn every_example_works() {
    let examples: Vec<String> = texts().iter().flat_map(|text| examples(text)).collect();
    assert!(examples.len() > 20, "{examples:?}");
    let port = free_port();
    Script::new("help", examples)
        .replace(
            "murmuration serve --workers 0",
            format!("murmuration serve --workers 0 --data served --listen 127.0.0.1:{port}"),
        )
        .replace("--values 7", "--values 7 --data atlas-data")
        .replace("atlas latest --out", "atlas latest --data atlas-data --out")
        .replace("delete two-sensor-3", "delete small-1")
        .replace("/backups/", "backups/")
        .replace("single_sensor/", "tests/labelled/single_sensor/")
        .replace("two_sensor/", "tests/labelled/two_sensor/")
        .replace("rare/", "tests/labelled/rare/")
        .rule(
            "murmuration run examples/quick.toml",
            NotRun("the README has it too"),
        )
        .rule("murmuration run examples/single-sensor.toml", NotRun(LONG))
        .rule("murmuration study run studies/paper.toml", NotRun(LONG))
        .rule(
            "murmuration study report small",
            Before(
                "murmuration study run studies/small.toml\n\
                 cp murmuration-data/studies/small/medoids.csv my-classes.csv",
            ),
        )
        .rule("murmuration atlas examples/atlas.toml --out", NotRun(LONG))
        .rule("murmuration resume latest", Before("interrupted small.toml"))
        .rule("murmuration serve", Stays("pages:"))
        .rule(
            "murmuration certs certs --host swarm.example --worker",
            Before("mv certs other-certs"),
        )
        .rule("murmuration accuracy --labels two_sensor", NotRun(LONG))
        .rule("murmuration judge --labels two_sensor", NotRun(LONG))
        .rule("murmuration bench labels", NotRun(LONG))
        .rule(
            "murmuration list",
            Before("test -e murmuration-data || murmuration run small.toml"),
        )
        .rule(
            "murmuration label latest",
            Before(
                "test -e murmuration-data || murmuration run small.toml\n\
                 printf 'id,class\\n0,ring\\n1,ring\\n2,clump\\n3,clump\\n' >my.csv",
            ),
        )
        .rule(
            "murmuration labels latest",
            Before(
                "printf 'id,class\\n0,ring\\n1,ring\\n2,clump\\n3,clump\\n' >my.csv\n\
                 murmuration label latest --csv my.csv --annotator ana\n\
                 rm -f labels.csv",
            ),
        )
        .rule(
            "murmuration export",
            Before("test -e murmuration-data || murmuration run small.toml"),
        )
        .rule(
            "murmuration import my-campaign",
            // Into a data directory that has it not yet; those of the commands that follow stay.
            Before("test -e data-of-the-export || mv murmuration-data data-of-the-export"),
        )
        .rule(FILM, NotRun(NO_ENCODER))
        .rule("murmuration world", Before(SAVED_WORLD))
        .rule("murmuration evaluate", Before(CONTROLLERS))
        .rule(
            "murmuration filter --file",
            Before("printf -- '-0.7,0.3,1,1\\n' >controllers.txt"),
        )
        .rule(
            "murmuration restore",
            Before("mv backups/* backups/2026-11-21 || true\nmv murmuration-data before"),
        )
        .rule(
            "murmuration quarantine --lift",
            NotRun("no machine is quarantined"),
        )
        .run();
}
