//! Runs the examples in the help of every command, and checks the text of the help.

use crate::{
    documents::{CONTROLLERS, FILM, NO_ENCODER},
    script::{
        Rule::{self, Before, NotRun},
        Script, free_port,
    },
};
use clap::Command;
use murmuration_program::groups;
use murmuration_tests::Test;

const LONG: &str = "it takes minutes and more";
const TRANSCRIBED: &str = "transcripts/campaign.md has it with less work";

/// Rules for examples, by the beginning of the example.
const RULES: [(&str, Rule); 24] = [
    ("murmuration extend latest", NotRun(TRANSCRIBED)),
    (
        "murmuration run examples/quick.toml",
        NotRun("the README has it too"),
    ),
    (
        "murmuration certs certs --host swarm.example --worker",
        Before("mv certs other-certs"),
    ),
    (
        "murmuration label latest --csv label-studio.csv",
        Before(
            "printf 'id,choice,created_at,image,annotator\\n4,ring,2026-11-20T10:00:00Z,ab12cd34-00003.png,ana\\n' \
             >label-studio.csv",
        ),
    ),
    (
        "murmuration recognise sleap.csv",
        Before("sed '1s/.*/frame_idx,track,body.x,body.y,heading/' tracks.csv >sleap.csv"),
    ),
    (
        "murmuration label latest",
        Before("printf 'index,class\\n0,ring\\n1,ring\\n2,clump\\n3,clump\\n' >my.csv"),
    ),
    (
        "murmuration labels latest",
        Before(
            "printf 'index,class\\n0,ring\\n1,ring\\n2,clump\\n3,clump\\n' >my.csv\n\
             murmuration label latest --csv my.csv --annotator ana\n\
             rm -f labels.csv",
        ),
    ),
    (
        "murmuration import my-campaign",
        // The data directory must not contain the campaign yet: the first import moves the old directory away.
        Before("test -e data-of-the-export || mv murmuration-data data-of-the-export"),
    ),
    (FILM, NotRun(NO_ENCODER)),
    ("murmuration evaluate", Before(CONTROLLERS)),
    (
        "murmuration filter --file",
        Before("printf -- '-0.7,0.3,1,1\\n' >controllers.txt"),
    ),
    // The example of `delete` has deleted the campaign.
    (
        "murmuration figure latest --out",
        Before("murmuration run small.toml"),
    ),
    (
        "murmuration restore",
        Before("mv backups/* backups/2026-11-21 || true\nmv murmuration-data before"),
    ),
    (
        "murmuration quarantine --lift",
        NotRun("no machine is quarantined"),
    ),
    ("murmuration lab study run studies/paper.toml", NotRun(LONG)),
    (
        "murmuration lab study run studies/small.toml",
        NotRun("docs/studies.md has it too"),
    ),
    (
        "murmuration lab study report small",
        Before(
            "murmuration lab study run studies/small.toml\n\
             cp murmuration-data/studies/small/medoids.csv my-classes.csv",
        ),
    ),
    ("murmuration lab atlas examples/atlas.toml --out", NotRun(LONG)),
    ("murmuration lab accuracy --labels two_sensor", NotRun(LONG)),
    ("murmuration lab judge --labels two_sensor", NotRun(LONG)),
    ("murmuration lab bench labels", NotRun(LONG)),
    ("murmuration lab bench cluster", NotRun(TRANSCRIBED)),
    ("murmuration lab bench pipeline", NotRun(TRANSCRIBED)),
    (
        "murmuration lab bench all",
        NotRun("single_node/command_line/commands.rs runs it"),
    ),
];

/// A command and its subcommands, recursively.
pub fn all(mut command: Command) -> Vec<Command> {
    command.build();
    let mut open = vec![command];
    let mut all = Vec::new();
    while let Some(command) = open.pop() {
        // Clap's own subcommand `help` is left out of the list.
        let within = command
            .get_subcommands()
            .filter(|command| command.get_name() != "help");
        open.extend(within.cloned());
        all.push(command);
    }
    all.sort_by_key(|command| command.get_bin_name().map(str::to_owned));
    all
}

/// The help text below the options of each command.
fn texts() -> Vec<String> {
    let texts = all(murmuration_program::command());
    let texts = texts.iter().filter_map(Command::get_after_help);
    texts.map(ToString::to_string).collect()
}

/// The examples of the commands of a group, as in the help.
fn examples_of(group: &Command) -> Vec<String> {
    let names: Vec<&str> = group.get_subcommands().map(Command::get_name).collect();
    let commands = all(murmuration_program::command()).into_iter();
    let of_group = commands.filter(|command| {
        let name = command.get_bin_name().unwrap_or_default();
        name.split(' ').nth(1).is_some_and(|name| names.contains(&name))
    });
    let texts = of_group.filter_map(|command| command.get_after_help().map(ToString::to_string));
    texts
        .flat_map(|text| examples(&text).collect::<Vec<_>>())
        .collect()
}

/// The examples in a help text. Two spaces separate a command from its explanation.
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
    let program = murmuration_program::command();
    // The help of the program without a command lists only the names of the options.
    let pages = all(program.clone()).into_iter();
    for mut command in pages.filter(|command| command.get_name() != program.get_name()) {
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

/// The examples of the overview and of each group of commands, by name. Groups without examples are left out.
fn groups_of_examples() -> Vec<(String, Vec<String>)> {
    let overview = murmuration_program::command()
        .get_after_help()
        .map(ToString::to_string);
    let overview = examples(&overview.unwrap_or_default()).collect();
    let groups = groups();
    let of_groups = groups
        .iter()
        .map(|group| (group.get_name().to_lowercase(), examples_of(group)));
    let all = [("overview".to_owned(), overview)].into_iter().chain(of_groups);
    all.filter(|(_, examples)| !examples.is_empty()).collect()
}

/// A test for each group of examples. The test runs a campaign, then the examples.
pub fn tests() -> Vec<Test> {
    let groups = groups_of_examples().into_iter();
    groups
        .map(|(name, examples)| Test::new(&format!("examples::{name}"), move || run(&name, examples)))
        .collect()
}

fn run(group: &str, examples: Vec<String>) {
    let port = free_port();
    let first = "murmuration run small.toml".to_owned();
    let has = |beginning: &str| examples.iter().any(|example| example.starts_with(beginning));
    let rules: Vec<_> = RULES
        .into_iter()
        .filter(|(beginning, _)| has(beginning))
        .collect();
    let script = Script::new(group, [first].into_iter().chain(examples).collect())
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
        .replace("rare/", "tests/labelled/rare/");
    let script = rules
        .into_iter()
        .fold(script, |script, (beginning, rule)| script.rule(beginning, rule));
    script.run();
}

/// Checks that every example is in a group, and that every rule applies to an example.
pub fn every_example_is_of_a_group() {
    let grouped: Vec<String> = groups_of_examples()
        .into_iter()
        .flat_map(|(_, examples)| examples)
        .collect();
    assert!(grouped.len() > 40, "{grouped:?}");
    for example in texts().iter().flat_map(|text| examples(text)) {
        assert!(grouped.contains(&example), "{example} is of no group");
    }
    let is_stale = |beginning: &str| !grouped.iter().any(|example| example.starts_with(beginning));
    let stale: Vec<_> = RULES
        .iter()
        .filter(|(beginning, _)| is_stale(beginning))
        .collect();
    assert!(stale.is_empty(), "no example begins like these: {stale:?}");
}
