//! Checks the references of pages to other pages, files and commands.

use clap::Command;
use murmuration_tests::pages::{blocks, page, pages, prose, root};
use std::{collections::BTreeSet, fs, path::Path};

/// The targets of links and pictures: the text in `](...)`.
fn links(text: &str) -> impl Iterator<Item = &str> {
    text.split("](").skip(1).filter_map(|rest| rest.split(')').next())
}

/// The texts between backticks.
fn code(text: &str) -> Vec<String> {
    let spans = text.split('`').skip(1).step_by(2);
    spans
        .map(|span| span.split_whitespace().collect::<Vec<_>>().join(" "))
        .collect()
}

/// The anchors of a page's headings.
fn anchors(text: &str) -> BTreeSet<String> {
    let headings = text.lines().filter(|line| line.starts_with('#'));
    let slug = |heading: &str| {
        let text = heading.trim_start_matches('#').trim().to_lowercase();
        let kept = text.chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
        kept.collect::<String>().replace(' ', "-")
    };
    headings.map(slug).collect()
}

/// Whether a text between backticks is the path of a file or folder in the repository.
fn is_path(span: &str) -> bool {
    let top = [
        "benches/",
        "coordinator/",
        "deploy/",
        "docs/",
        "examples/",
        "fuzz/",
        "proto/",
        "scripts/",
        "tests/",
        "trainer/",
        "worker/",
    ];
    let plain = |c: char| c.is_alphanumeric() || "/._-".contains(c);
    span.chars().all(plain)
        && (span.contains('/') && span.ends_with(".rs") || top.iter().any(|top| span.starts_with(top)))
}

pub fn links_and_paths_lead_somewhere() {
    let root = root();
    let (mut followed, mut paths) = (0, 0);
    for (name, text) in pages() {
        let folder = root.join(&name);
        let folder = folder.parent().unwrap();
        for link in links(&prose(&text)).filter(|link| !link.contains("://")) {
            let (path, anchor) = link.split_once('#').unwrap_or((link, ""));
            let target = if path.is_empty() {
                root.join(&name)
            } else {
                folder.join(path)
            };
            assert!(target.exists(), "{name}: there is no {link}");
            if !anchor.is_empty() {
                let target = std::fs::read_to_string(&target).unwrap();
                assert!(
                    anchors(&target).contains(anchor),
                    "{name}: there is no heading for {link}"
                );
            }
            followed += 1;
        }
        for span in code(&prose(&text)).iter().filter(|span| is_path(span)) {
            assert!(exists(&root, span), "{name}: there is no `{span}`");
            paths += 1;
        }
    }
    assert!(followed > 15 && paths > 15, "{followed} links, {paths} paths");
    // The check must be able to fail.
    assert!(!exists(&root, "docs/nothing.md") && !anchors(&page("README.md")).contains("nothing"));
}

fn exists(place: &Path, path: &str) -> bool {
    let file = place.join(path);
    // A path of a module can name a folder, or a file without its ending.
    file.exists() || file.with_extension("").exists() || file.with_extension("rs").exists()
}

/// Checks the command and options of a mention such as `murmuration COMMAND ... --option ...`.
fn check_mention(page: &str, span: &str) {
    let mut command: &Command = &murmuration_program::command();
    let mut known = options(command);
    for word in span.split(' ').skip(1) {
        if let Some(option) = word.strip_prefix("--") {
            let option = option.trim_end_matches(',').split('=').next().unwrap();
            assert!(known.contains(option), "{page}: `{span}`: there is no --{option}");
        } else if let Some(found) = command.find_subcommand(word) {
            known.extend(options(found));
            command = found;
        } else {
            let has_commands = command.get_subcommands().next().is_some();
            let is_placeholder = word.chars().all(|c| c.is_ascii_uppercase() || c == '_');
            assert!(
                !has_commands || is_placeholder,
                "{page}: `{span}`: there is no command {word}"
            );
        }
    }
}

fn options(command: &Command) -> BTreeSet<String> {
    let longs = command.get_arguments().filter_map(clap::Arg::get_long);
    longs
        .map(str::to_owned)
        .chain(["help".to_owned(), "version".to_owned()])
        .collect()
}

pub fn commands_that_are_mentioned_exist() {
    let mut mentioned = 0;
    for (name, text) in pages() {
        for span in code(&prose(&text))
            .iter()
            .filter(|span| span.starts_with("murmuration "))
        {
            check_mention(&name, span);
            mentioned += 1;
        }
    }
    assert!(mentioned > 10, "{mentioned}");
}

/// Checks the language of every block: a command in a block that is not `sh` would be hidden from the tests of `command_line`.
pub fn every_block_says_what_it_is() {
    for (name, text) in pages() {
        for (language, lines) in blocks(&text) {
            let known = ["sh", "toml", "ini", "csv", "text", "python"].contains(&language.as_str());
            assert!(known, "{name}: a block of {language:?}:\n{}", lines.join("\n"));
        }
        let mut above = "";
        for line in prose(&text).lines() {
            let is_block = line.starts_with("    ") && above.is_empty();
            assert!(
                !is_block || line.trim().is_empty(),
                "{name}: an indented block:\n{line}"
            );
            above = if line.trim().is_empty() { "" } else { "text" };
        }
    }
}

/// KEDA verifies the coordinator's certificate, so `murmuration certs` must name the host that KEDA calls.
pub fn the_certificate_has_the_name_by_which_keda_calls() {
    let manifest = fs::read_to_string(root().join("deploy/keda/scaled-objects.yaml")).unwrap();
    let addresses: Vec<&str> = manifest
        .lines()
        .filter_map(|line| line.trim().strip_prefix("scalerAddress: "))
        .collect();
    let page = page("docs/operations.md");
    assert!(!addresses.is_empty());
    for address in addresses {
        let host = address.rsplit_once(':').unwrap().0;
        let is_named =
            |line: &str| line.starts_with("murmuration certs ") && line.split(' ').any(|word| word == host);
        assert!(
            page.lines().any(is_named),
            "`murmuration certs` lacks --host {host}"
        );
    }
}
