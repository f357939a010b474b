//! The tables of a report as CSV: a header, then numbers that read back exactly.

use crate::{figure::Figure, outcome::Outcome};
use csv::Writer;
use murmuration_model::labels::to_cell;
use std::io::{self, Write};

/// One row a measured cell.
pub(crate) fn cells(outcome: &Outcome, file: &mut dyn Write) -> io::Result<()> {
    let mut table = Writer::from_writer(file);
    let axes = outcome.study().axes().iter().map(|axis| axis.name.as_str());
    let figures: Vec<Figure> = figures(outcome);
    let header = ["cell", "campaign", "archive_digest", "checkpoint"].into_iter();
    let header = header.chain(axes).chain(["seed", "evaluations"]);
    table.write_record(header.chain(figures.iter().map(|figure| figure.name())))?;
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

/// One row a medoid of each judged taxonomy, in the order of the cells and taxonomies.
pub(crate) fn medoids(outcome: &Outcome, file: &mut dyn Write) -> io::Result<()> {
    let mut table = Writer::from_writer(file);
    let axes = outcome.study().axes().iter().map(|axis| axis.name.as_str());
    let last = [
        "seed",
        "generation",
        "index",
        "class",
        "pattern",
        "by",
        "start_seed",
        "controller",
    ];
    table.write_record(["cell", "campaign"].into_iter().chain(axes).chain(last))?;
    for cell in outcome.cells() {
        let measured = cell.measured;
        let Some(behaviours) = &measured.behaviours else {
            continue;
        };
        for taxonomy in &behaviours.taxonomies {
            for &index in &taxonomy.medoids {
                let (class, by) = outcome.class_of(measured, index);
                let Some(individual) = behaviours.individuals.get(&index) else {
                    continue;
                };
                let genes: Vec<String> = individual.controller.iter().map(f64::to_string).collect();
                let numbers = [
                    cell.cell.spec.seed().to_string(),
                    taxonomy.generation.to_string(),
                    index.to_string(),
                ];
                let rest = [
                    class.name().to_owned(),
                    individual.pattern.clone(),
                    to_cell(by).into_owned(),
                    individual.seed.to_string(),
                    genes.join(" "),
                ];
                let known = [measured.cell.as_str(), measured.campaign.as_str()].into_iter();
                let row = known.chain(outcome.study().names(&cell.cell.values));
                table.write_record(row.chain(numbers.iter().chain(&rest).map(String::as_str)))?;
            }
        }
    }
    table.flush()
}

/// The figures that the study measures.
fn figures(outcome: &Outcome) -> Vec<Figure> {
    let measures = outcome.study().measures().which.iter();
    measures.flat_map(|measure| measure.figures()).collect()
}
