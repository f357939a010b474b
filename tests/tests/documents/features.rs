//! The features of libraries: where `cargo build` and `cargo test` ask for different ones, every crate is compiled twice.

use std::{collections::BTreeMap, process::Command};

/// The features of each library that the workspace is built with, by name and version; `kinds` are the kinds of dependencies.
fn features(kinds: &str) -> BTreeMap<String, String> {
    let tree = Command::new(env!("CARGO"))
        .args([
            "tree",
            "--workspace",
            "--offline",
            "--prefix",
            "none",
            "--edges",
            kinds,
        ])
        .args(["--format", "{p}\t{f}"])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    assert!(tree.status.success(), "{}", String::from_utf8_lossy(&tree.stderr));
    let tree = String::from_utf8(tree.stdout).unwrap();
    let mut features = BTreeMap::<_, Vec<_>>::new();
    // Empty lines are between the trees of the workspace's crates.
    for line in tree.lines().filter(|line| !line.is_empty()) {
        let (library, of) = line.split_once('\t').unwrap();
        // A library that macros need too is built for them apart, with features of its own.
        let of = of.trim_end_matches(" (*)").to_owned();
        let all = features.entry(library.to_owned()).or_default();
        if !all.contains(&of) {
            all.push(of);
        }
    }
    let sorted = |(library, mut of): (String, Vec<String>)| {
        of.sort();
        (library, of.join(" | "))
    };
    features.into_iter().map(sorted).collect()
}

pub fn programs_and_tests_are_built_with_the_same() {
    let (build, test) = (features("normal,build"), features("normal,build,dev"));
    let differ: Vec<_> = build
        .iter()
        .filter(|(library, _)| !FOR_MACROS.iter().any(|name| library.starts_with(name)))
        .filter(|(library, of)| test.get(*library) != Some(*of))
        .map(|(library, of)| format!("{library}: {of} to build, {:?} to test", test.get(library)))
        .collect();
    assert!(build.len() > 300, "{} libraries", build.len());
    assert!(
        differ.is_empty(),
        "name them in tests/Cargo.toml:\n{}",
        differ.join("\n")
    );
}

/// What tests use as libraries, and the programs for their macros only.
const FOR_MACROS: [&str; 3] = ["proc-macro2 ", "quote ", "syn "];
