//! The number of cases that a property is tested with.

use proptest::test_runner::Config;

/// At most `cases` cases, and at most as many as the environment variable PROPTEST_CASES, for example on an emulated machine.
pub(crate) fn at_most(cases: u32) -> Config {
    let message = std::env::var("PROPTEST_CASES");
    let message = message.ok().and_then(|message| message.parse().ok());
    Config::with_cases(message.map_or(cases, |message: u32| message.min(cases)))
}
