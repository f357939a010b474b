//! How many cases a property is tested with.

use proptest::test_runner::Config;

/// So many cases; fewer where the environment's PROPTEST_CASES says fewer, as on a machine that is emulated.
pub(crate) fn at_most(cases: u32) -> Config {
    let said = std::env::var("PROPTEST_CASES");
    let said = said.ok().and_then(|said| said.parse().ok());
    Config::with_cases(said.map_or(cases, |said: u32| said.min(cases)))
}
