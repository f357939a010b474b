//! What is shown of a study.

use super::super::{
    CliError, json,
    table::{Table, left, right},
};
use murmuration_link::{errln, outln};
use murmuration_proto::counted;
use murmuration_study::{Entry, Figure, Outcome, Table as StudyTable};
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
    let (measured, all) = (outcome.cells().count(), outcome.study().cells().len());
    if measured < all {
        errln!("{measured} of {} measured", counted(all as u64, "cell"));
    }
    Ok(())
}

fn print_table(outcome: &Outcome, table: &StudyTable) -> Result<(), CliError> {
    let study = outcome.study();
    let figures = table.figures();
    let published = |figure: &Figure| {
        let mut entries = table.rows.iter().filter_map(|row| row.entries.get(figure));
        entries.any(|entry| entry.published.is_some())
    };
    let axes = study.axes().iter().map(|axis| left(axis.name.to_uppercase()));
    let mut columns: Vec<_> = axes.chain([right("N")]).collect();
    for figure in &figures {
        columns.push(right(figure.name().replace('_', " ").to_uppercase()));
        if published(figure) {
            columns.push(right("PUBLISHED"));
        }
    }
    let mut printed = Table::new(columns);
    for row in &table.rows {
        let count = row.entries.values().map(|entry| entry.count).max().unwrap_or(0);
        let names = study.names(&row.values).map(str::to_owned);
        let mut cells: Vec<String> = names.chain([count.to_string()]).collect();
        for figure in &figures {
            let entry = row.entries.get(figure);
            cells.push(entry.map_or_else(|| "-".to_owned(), |entry| in_words(entry, *figure)));
            if published(figure) {
                let value = entry.and_then(|entry| entry.published);
                cells.push(value.map_or_else(|| "-".to_owned(), |value| value.to_string()));
            }
        }
        printed.row(cells);
    }
    Ok(printed.print()?)
}

/// `5.83 ± 0.26`.
fn in_words(entry: &Entry, figure: Figure) -> String {
    let decimals = figure.decimals();
    match entry.deviation {
        Some(deviation) => format!("{:.decimals$} ± {deviation:.decimals$}", entry.mean),
        None => format!("{:.decimals$}", entry.mean),
    }
}
