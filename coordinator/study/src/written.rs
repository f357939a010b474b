//! The tables of a report as CSV: a header, then numbers that read back exactly.

use crate::{
    figure::Figure,
    outcome::{MeasuredCell, Outcome},
};
use csv::Writer;
use murmuration_model::labels::to_cell;
use std::io::{self, Write};

/// The columns of `cells.csv` and of `medoids.csv`, besides the columns for axes and figures.
pub(crate) const CELL: [&str; 6] = [
    "cell",
    "campaign",
    "archive_digest",
    "checkpoint",
    "seed",
    "evaluations",
];
pub(crate) const MEDOID: [&str; 8] = [
    "generation",
    "index",
    "class",
    "pattern",
    "by",
    "second_class",
    "start_seed",
    "controller",
];

/// The columns that identify the cell of a row, then `others`.
pub(crate) fn columns<'a>(
    outcome: &'a Outcome,
    others: impl IntoIterator<Item = &'a str>,
) -> impl Iterator<Item = &'a str> {
    let axes = outcome.study().axes.iter().map(|axis| axis.name.as_str());
    let known = ["cell", "campaign"].into_iter().chain(axes);
    known.chain(["seed"]).chain(others)
}

/// A row of a table with [`columns`].
pub(crate) fn row(
    outcome: &Outcome,
    cell: &MeasuredCell<'_>,
    others: impl IntoIterator<Item = String>,
) -> Vec<String> {
    let mut row = vec![cell.measured.cell.clone(), cell.measured.campaign.clone()];
    row.extend(outcome.study().names(&cell.cell.values).map(str::to_owned));
    row.push(cell.cell.spec.seed().to_string());
    row.extend(others);
    row
}

/// Writes `cells.csv`: one row for each measured cell.
pub(crate) fn cells(outcome: &Outcome, file: &mut dyn Write) -> io::Result<()> {
    let mut table = Writer::from_writer(file);
    let measures = outcome.study().measures.which.iter();
    let figures: Vec<Figure> = measures.flat_map(|measure| measure.figures()).collect();
    let names: Vec<_> = figures.iter().map(|figure| figure.name()).collect();
    let axes = outcome.study().axes.iter().map(|axis| axis.name.as_str());
    let header = CELL[..4]
        .iter()
        .copied()
        .chain(axes)
        .chain(CELL[4..].iter().copied());
    table.write_record(header.chain(names.iter().map(AsRef::as_ref)))?;
    for cell in outcome.cells() {
        let (measured, seed) = (cell.measured, cell.cell.spec.seed().to_string());
        let evaluations = measured.evaluations.to_string();
        let known = [
            &measured.cell,
            &measured.campaign,
            &measured.archive_digest,
            &measured.checkpoint,
        ];
        let known = known.into_iter().map(String::as_str);
        let of_cell = outcome.figures(measured);
        let numbers: Vec<String> = figures
            .iter()
            .map(|figure| of_cell.get(figure).map_or_else(String::new, f64::to_string))
            .collect();
        let row = known
            .chain(outcome.study().names(&cell.cell.values))
            .chain([seed.as_str(), evaluations.as_str()])
            .chain(numbers.iter().map(String::as_str));
        table.write_record(row)?;
    }
    table.flush()
}

/// Writes `medoids.csv`: one row for each medoid of each judged taxonomy, in the order of the cells and taxonomies.
pub(crate) fn medoids(outcome: &Outcome, file: &mut dyn Write) -> io::Result<()> {
    let mut table = Writer::from_writer(file);
    table.write_record(columns(outcome, MEDOID))?;
    for cell in outcome.cells() {
        let Some(behaviours) = &cell.measured.behaviours else {
            continue;
        };
        for taxonomy in &behaviours.taxonomies {
            for &index in &taxonomy.medoids {
                let (class, by) = outcome.class_of(cell.measured, index);
                let Some(individual) = behaviours.individuals.get(&index) else {
                    continue;
                };
                let genes: Vec<String> = individual.controller.iter().map(f64::to_string).collect();
                let others = [
                    taxonomy.generation.to_string(),
                    index.to_string(),
                    class.name().to_owned(),
                    individual.pattern.clone(),
                    to_cell(by).into_owned(),
                    individual.second_class.clone(),
                    individual.seed.to_string(),
                    genes.join(" "),
                ];
                table.write_record(row(outcome, &cell, others))?;
            }
        }
    }
    table.flush()
}
