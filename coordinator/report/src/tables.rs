//! The archive, the taxonomy, the classes and the generations as CSV. A table has a header, numbers that can be read again
//! exactly, and names as [`to_cell`] writes names.

use super::{Entry, Report};
use csv::Writer;
use murmuration_model::{
    labels::to_cell,
    tables::{GENERATION_COLUMNS, behaviour_cells, behaviour_columns, embedding_columns, generation_row},
};
use murmuration_swarm::FEATURE_NAMES;
use std::io::{self, Write};

/// One row per individual, by index. The first cluster has the number 1, as on the cards.
pub(super) fn archive(report: &Report, file: &mut dyn Write) -> io::Result<()> {
    let mut table = Writer::from_writer(file);
    let own = ["index", "cluster", "map_x", "map_y"].map(str::to_owned);
    table.write_record(columns(&own, report))?;
    let rows = report
        .individuals
        .iter()
        .zip(&report.clusters)
        .zip(&report.map.points);
    for (index, ((entry, cluster), [x, y])) in rows.enumerate() {
        let own = [
            index.to_string(),
            (cluster + 1).to_string(),
            x.to_string(),
            y.to_string(),
        ];
        table.write_record(row(&own, entry, report, index as u64))?;
    }
    table.flush()
}

/// One row per medoid, largest cluster first. A medoid's novelty is measured in the whole archive. The name of a cluster is the
/// class of its medoid, or a name from an earlier version of the taxonomy. The column after an inherited name has the number of
/// that version.
pub(super) fn taxonomy(report: &Report, file: &mut dyn Write) -> io::Result<()> {
    let mut table = Writer::from_writer(file);
    let own = [
        "cluster",
        "index",
        "cluster_size",
        "mean_distance",
        "mean_robustness",
        "novelty",
        "cluster_name",
        "name_from_version",
    ]
    .map(str::to_owned);
    table.write_record(columns(&own, report))?;
    for (place, medoid) in report.medoids.iter().enumerate() {
        let name = report.name_of(place);
        let carried = name.and_then(|name| name.carried);
        let own = [
            (place + 1).to_string(),
            medoid.index.to_string(),
            medoid.cluster_size.to_string(),
            medoid.mean_distance.to_string(),
            or_empty(report.robustness_of_cluster(place)),
            medoid.novelty.to_string(),
            name.map(|name| to_cell(name.class.as_str()).into_owned())
                .unwrap_or_default(),
            carried
                .map(|carried| carried.version.to_string())
                .unwrap_or_default(),
        ];
        let entry = &report.individuals[medoid.index as usize];
        table.write_record(row(&own, entry, report, medoid.index))?;
    }
    table.flush()
}

/// One row per trial, by individual, then by start.
pub(super) fn trials(report: &Report, file: &mut dyn Write) -> io::Result<()> {
    let mut table = Writer::from_writer(file);
    let own = ["index", "start", "seed"].into_iter().chain(FEATURE_NAMES);
    let embedding = embedding_columns(report.embedding_dimensions());
    table.write_record(own.map(str::to_owned).chain(embedding))?;
    for (index, entry) in report.individuals.iter().enumerate() {
        for (start, trial) in entry.trials.iter().enumerate() {
            let own = [index.to_string(), start.to_string(), trial.seed.to_string()];
            let features = trial.features.iter().map(f64::to_string);
            let embedding = trial.embedding.iter().map(f32::to_string);
            table.write_record(own.into_iter().chain(features).chain(embedding))?;
        }
    }
    table.flush()
}

/// One row per class, in the order in which classes were first named, with the numbers of the class's individuals and answers.
pub(super) fn classes(report: &Report, file: &mut dyn Write) -> io::Result<()> {
    let mut table = Writer::from_writer(file);
    table.write_record(["class", "colour", "individuals", "labels"])?;
    for class in &report.names.classes {
        table.write_record([
            to_cell(class.name.as_str()).into_owned(),
            class.colour.to_string(),
            report.names.individuals(class).total().to_string(),
            class.labels.to_string(),
        ])?;
    }
    table.flush()
}

pub(super) fn generations(report: &Report, file: &mut dyn Write) -> io::Result<()> {
    let mut table = Writer::from_writer(file);
    table.write_record(GENERATION_COLUMNS)?;
    for row in &report.generations {
        table.write_record(generation_row(
            row.generation,
            row.best_novelty,
            row.mean_novelty,
            row.filtered,
        ))?;
    }
    table.flush()
}

/// The columns of a table of individuals: first `own`, then the data of an individual, then its class.
fn columns(own: &[String], report: &Report) -> Vec<String> {
    let known = ["generation", "seed", "novelty_when_evaluated", "robustness"].map(str::to_owned);
    let genes = report.spec.model().gene_names();
    let behaviour = behaviour_columns(&genes, report.embedding_dimensions());
    own.iter().cloned().chain(known).chain(behaviour).collect()
}

fn or_empty(number: Option<f64>) -> String {
    number.map(|number| number.to_string()).unwrap_or_default()
}

/// A row of a table with these [`columns`].
fn row(own: &[String], entry: &Entry, report: &Report, index: u64) -> Vec<String> {
    let known = [
        entry.generation.to_string(),
        entry.seed.to_string(),
        entry.novelty_when_evaluated.to_string(),
        or_empty(entry.robustness),
    ];
    let class = report.names.of(index).map(|(_, class)| &class.name);
    let behaviour = behaviour_cells(&entry.features, entry.controller.genes(), &entry.embedding, class);
    own.iter().cloned().chain(known).chain(behaviour).collect()
}
