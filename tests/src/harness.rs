//! A test harness for targets whose tests need more than this repository: a browser, containers, Python packages or root's
//! rights.
//!
//! If a machine lacks a requirement of a test, the test is ignored: a line gives the reason, and `scripts/skipped` prints this
//! line again. Under `CI=true`, the test fails instead if the requirement could be installed. A target with this harness has
//! `harness = false` in `Cargo.toml`, because Rust's own harness cannot ignore a test at run time. The target lists its tests in
//! `main`; `#[test]` has no effect there.

use crate::requirements::{Missing, Requirement};
use libtest_mimic::{Arguments, Trial};
use std::{collections::BTreeMap, fs, io, process::ExitCode};

/// A test with its requirements.
pub struct Test {
    name: String,
    body: Box<dyn FnOnce() + Send>,
    needs: Vec<Requirement>,
}

/// A test from the path of its function: `test!(labelling::two_at_once)`, or `test!(async ...)` for an async function. The name
/// of the test is the path from the target's root, as in Rust's own harness.
#[macro_export]
macro_rules! test {
    (async $path:path) => {
        $crate::Test::of_function(concat!(module_path!(), "::", stringify!($path)), || {
            $crate::block_on($path())
        })
    };
    ($path:path) => {
        $crate::Test::of_function(concat!(module_path!(), "::", stringify!($path)), $path)
    };
}

/// Runs a future on several threads.
pub fn block_on<T>(future: impl Future<Output = T>) -> T {
    tokio::runtime::Runtime::new().unwrap().block_on(future)
}

/// The decision whether this machine runs a test.
#[derive(Debug, PartialEq, Eq)]
enum Fate {
    Runs,
    /// Ignored, for this reason.
    Ignored(String),
    /// Fails, for this reason.
    Fails(String),
}

impl Fate {
    fn of(missing: Option<Missing>, ci: bool) -> Self {
        match missing {
            None => Self::Runs,
            Some(missing) if ci && missing.can_be_had => Self::Fails(missing.reason),
            Some(missing) => Self::Ignored(missing.reason),
        }
    }
}

impl Test {
    /// A test without requirements.
    #[must_use]
    pub fn new(name: &str, body: impl FnOnce() + Send + 'static) -> Self {
        Self {
            name: name.to_owned(),
            body: Box::new(body),
            needs: Vec::new(),
        }
    }

    /// A test whose name is the path of its function without the target's name, with which the path begins.
    #[must_use]
    pub fn of_function(path: &str, body: impl FnOnce() + Send + 'static) -> Self {
        Self::new(path.split_once("::").map_or(path, |(_target, name)| name), body)
    }

    /// Adds a requirement.
    #[must_use]
    pub fn needs(mut self, requirement: Requirement) -> Self {
        self.needs.push(requirement);
        self
    }
}

/// Runs the tests selected on the command line, in parallel as Rust's own harness does.
#[must_use]
pub fn run(tests: Vec<Test>) -> ExitCode {
    run_with(&Arguments::from_args(), tests)
}

/// Runs tests as [`run`] does, but one test after the other.
#[must_use]
pub fn run_one_by_one(tests: Vec<Test>) -> ExitCode {
    let mut arguments = Arguments::from_args();
    arguments.test_threads = Some(1);
    run_with(&arguments, tests)
}

fn run_with(arguments: &Arguments, mut tests: Vec<Test>) -> ExitCode {
    let ci = std::env::var("CI").is_ok_and(|ci| ci == "true");
    // A runner with one process per test passes the exact name of its test: the requirements of other tests need no check.
    let only = arguments.filter.clone().filter(|_| arguments.exact);
    if let Some(name) = &only {
        tests.retain(|test| test.name == *name);
    }
    let mut ignored = BTreeMap::<String, Vec<String>>::new();
    let trials = tests.into_iter().map(|Test { name, body, needs }| {
        let missing = needs.into_iter().find_map(Requirement::missing);
        match Fate::of(missing, ci) {
            Fate::Runs => Trial::test(name, || {
                body();
                Ok(())
            }),
            Fate::Ignored(reason) => {
                ignored.entry(reason.clone()).or_default().push(name.clone());
                // If ignored tests are requested, the ignored test fails with the reason.
                Trial::test(name, || Err(reason.into())).with_ignored_flag(true)
            }
            Fate::Fails(reason) => Trial::test(name, move || Err(format!("CI=true, and {reason}").into())),
        }
    });
    let trials = trials.collect();
    if only.is_none() {
        record_skipped(&ignored).unwrap();
    }
    let conclusion = libtest_mimic::run(arguments, trials);
    for reason in ignored.keys() {
        eprintln!("ignored: {reason}");
    }
    conclusion.exit_code()
}

/// Writes the names of this target's ignored tests, by reason, to the place where `scripts/skipped` looks.
fn record_skipped(ignored: &BTreeMap<String, Vec<String>>) -> io::Result<()> {
    // target/PROFILE/deps/NAME-HASH
    let program = std::env::current_exe()?;
    let (Some(target), Some(name)) = (program.ancestors().nth(3), program.file_stem()) else {
        return Ok(());
    };
    let name = name.to_string_lossy();
    let name = name.rsplit_once('-').map_or(&*name, |(name, _hash)| name);
    let folder = target.join("skipped");
    fs::create_dir_all(&folder)?;
    let lines = ignored
        .iter()
        .map(|(reason, tests)| format!("{} tests of `{name}`: {reason}\n", tests.len()));
    fs::write(folder.join(name), lines.collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn missing(can_be_had: bool) -> Option<Missing> {
        Some(Missing {
            reason: "there is no swan here".to_owned(),
            can_be_had,
        })
    }

    #[test]
    fn what_is_missing_is_ignored_and_fails_in_ci_where_it_could_be_had() {
        let reason = || "there is no swan here".to_owned();
        assert_eq!(Fate::of(None, true), Fate::Runs);
        assert_eq!(Fate::of(missing(true), false), Fate::Ignored(reason()));
        assert_eq!(Fate::of(missing(true), true), Fate::Fails(reason()));
        assert_eq!(Fate::of(missing(false), true), Fate::Ignored(reason()));
    }

    /// The Rust files of a folder and the folders in it.
    fn sources(folder: &Path) -> Vec<(String, String)> {
        let mut files = Vec::new();
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                files.extend(sources(&path));
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                files.push((path.display().to_string(), fs::read_to_string(&path).unwrap()));
            }
        }
        files
    }

    /// A target without Rust's harness would never run a function marked `#[test]`.
    #[test]
    fn no_target_with_this_harness_has_a_test_that_would_not_run() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let manifest: toml::Table = fs::read_to_string(root.join("Cargo.toml"))
            .unwrap()
            .parse()
            .unwrap();
        let mut seen = 0;
        for target in manifest["test"].as_array().unwrap() {
            assert_eq!(target["harness"].as_bool(), Some(false), "{target}");
            let path = root.join(target["path"].as_str().unwrap());
            for (name, text) in sources(path.parent().unwrap()) {
                let test = text
                    .lines()
                    .map(str::trim)
                    .find(|line| line.ends_with("test]") || line.contains("::test("));
                assert_eq!(
                    test, None,
                    "{name}: list it where the target lists its tests, with test!(), instead"
                );
                seen += 1;
            }
        }
        assert!(seen > 10, "only {seen} files");
    }
}
