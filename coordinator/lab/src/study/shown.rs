//! Tables of a study in the terminal.

use crate::json;
use murmuration_cli::{
    CliError,
    table::{Table, left, right},
};
use murmuration_link::{errln, outln};
use murmuration_study::{Entry, Figure, Outcome, Row, Table as StudyTable};
use murmuration_swarm::counted;
use std::path::Path;

/// Prints the tables of a study, for a person or for programs; `report` is the page of its report, if one was written.
pub(super) fn show(outcome: &Outcome, report: Option<&Path>, as_json: bool) -> Result<(), CliError> {
    if as_json {
        return Ok(json::print(json::Study::of(outcome, report))?);
    }
    for (place, table) in outcome.tables().iter().enumerate() {
        if place > 0 {
            outln!("")?;
        }
        outln!("{}", table.measure.title())?;
        print_table(outcome, table)?;
    }
    if let Some(page) = report {
        outln!("\nreport    {}", page.display())?;
    }
    let (measured, all) = (outcome.cells().count(), outcome.study().cells.len());
    if measured < all {
        errln!("{measured} of {} measured", counted(all as u64, "cell"));
    }
    Ok(())
}

/// Prints one table. Only the first figure has its published value beside it; the report has all published values.
fn print_table(outcome: &Outcome, table: &StudyTable) -> Result<(), CliError> {
    let study = outcome.study();
    let figures = table.figures();
    let first = figures.first();
    let published = |row: &Row| row.entries.get(first?)?.published;
    let is_published = table.rows.iter().any(|row| published(row).is_some());
    let axes = study.axes.iter().map(|axis| left(axis.name.to_uppercase()));
    let mut columns: Vec<_> = axes.chain([right("N")]).collect();
    let mut headings = figures
        .iter()
        .map(|figure| right(figure.name().replace('_', " ").to_uppercase()));
    columns.extend(headings.next());
    columns.extend(is_published.then(|| right("PUBLISHED")));
    columns.extend(headings);
    let mut printed = Table::new(columns);
    for row in &table.rows {
        let names = study.names(&row.values).map(str::to_owned);
        let count = row.entries.values().map(|entry| entry.count).max();
        let mut words = figures.iter().map(|figure| match row.entries.get(figure) {
            Some(entry) => in_words(entry, *figure),
            None => "-".to_owned(),
        });
        let mut cells: Vec<String> = names.chain([or_dash(count)]).collect();
        cells.extend(words.next());
        cells.extend(is_published.then(|| or_dash(published(row))));
        cells.extend(words);
        printed.row(cells);
    }
    Ok(printed.print()?)
}

fn or_dash(value: Option<impl ToString>) -> String {
    value.map_or_else(|| "-".to_owned(), |value| value.to_string())
}

/// An entry as text, such as `5.83 ± 0.26`.
fn in_words(entry: &Entry, figure: Figure) -> String {
    let decimals = figure.decimals();
    match entry.deviation {
        Some(deviation) => format!("{:.decimals$} ± {deviation:.decimals$}", entry.mean),
        None => format!("{:.decimals$}", entry.mean),
    }
}
