//! The table of faults and their outcomes.

use murmuration_tests::OVER_TOO_EARLY;
use std::{
    fmt, fs,
    panic::{AssertUnwindSafe, catch_unwind},
    path::Path,
    time::{Duration, Instant},
};

/// One fault and its outcome.
pub struct Row {
    /// Description of the fault, with numbers.
    pub done: String,
    /// Description of the outcome.
    pub found: String,
}

/// Factors on the length of campaigns for the first attempt at a fault, the second and so on.
const STRETCHES: [u32; 4] = [1, 4, 16, 64];

/// The row of a scenario, or the message of its panic.
fn caught(scenario: impl FnOnce() -> Row) -> Result<Row, String> {
    catch_unwind(AssertUnwindSafe(scenario)).map_err(|panic| {
        let text = panic.downcast_ref::<String>().cloned();
        text.or_else(|| panic.downcast_ref::<&str>().map(|text| (*text).to_owned()))
            .unwrap_or_default()
    })
}

/// The rows, with the time that each scenario took.
pub struct Table {
    seed: u64,
    rows: Vec<(&'static str, Result<Row, String>, Duration)>,
}

impl Table {
    pub fn new(seed: u64) -> Self {
        Self {
            seed,
            rows: Vec::new(),
        }
    }

    /// Runs a scenario. If the scenario's campaign ends before the faults have struck, runs the scenario again with longer
    /// campaigns. Any other panic becomes the row's outcome and the error.
    pub fn run(&mut self, name: &'static str, scenario: impl Fn(u32) -> Row) -> Result<(), String> {
        let begun = Instant::now();
        let mut row = Err(String::new());
        for stretch in STRETCHES {
            row = caught(|| scenario(stretch));
            if !matches!(&row, Err(found) if found.starts_with(OVER_TOO_EARLY)) {
                break;
            }
        }
        let failed = row.as_ref().err().cloned();
        self.rows.push((name, row, begun.elapsed()));
        failed.map_or(Ok(()), Err)
    }

    /// Number of scenarios that were run.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Writes the table into `docs/reliability.md`.
    pub fn publish(&self) {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/reliability.md");
        let page = fs::read_to_string(&path).unwrap();
        let (begin, end) = ("<!-- table -->\n", "<!-- end of table -->");
        let (before, rest) = page.split_once(begin).unwrap();
        let (_, after) = rest.split_once(end).unwrap();
        fs::write(&path, format!("{before}{begin}{self}\n{end}{after}")).unwrap();
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "Seed {}.\n", self.seed)?;
        writeln!(f, "| fault | what was done | what was found | seconds |")?;
        writeln!(f, "|---|---|---|---|")?;
        for (name, row, took) in &self.rows {
            let seconds = took.as_secs();
            match row {
                Ok(Row { done, found }) => writeln!(f, "| {name} | {done} | {found} | {seconds} |")?,
                Err(panic) => writeln!(
                    f,
                    "| {name} | | **FAILED**: {} | {seconds} |",
                    panic.replace('\n', " ")
                )?,
            }
        }
        Ok(())
    }
}
