//! The archive, the taxonomy, the classes and the generations as CSV: a header, then numbers that read back exactly.

use super::{Entry, Report};
use murmuration_proto::FEATURE_NAMES;
use std::io::{self, Write};

/// One row an individual, by index. Clusters count from 1, as the cards do.
pub(super) fn archive(report: &Report, file: &mut dyn Write) -> io::Result<()> {
    writeln!(file, "index,cluster,map_x,map_y,{},class", entry_columns(report))?;
    let rows = report
        .individuals
        .iter()
        .zip(&report.clusters)
        .zip(&report.map.points);
    for (index, ((entry, cluster), [x, y])) in rows.enumerate() {
        write!(file, "{index},{},{x},{y},", cluster + 1)?;
        write_entry(entry, file)?;
        write_class(report, index as u64, file)?;
    }
    Ok(())
}

/// One row a medoid, largest cluster first.
pub(super) fn taxonomy(report: &Report, file: &mut dyn Write) -> io::Result<()> {
    writeln!(
        file,
        "behaviour,index,cluster_size,mean_distance,{},class",
        entry_columns(report)
    )?;
    for (place, medoid) in report.medoids.iter().enumerate() {
        write!(
            file,
            "{},{},{},{},",
            place + 1,
            medoid.index,
            medoid.cluster_size,
            medoid.mean_distance
        )?;
        write_entry(&report.individuals[medoid.index as usize], file)?;
        write_class(report, medoid.index, file)?;
    }
    Ok(())
}

/// One row a class, in the order in which they were created: how many individuals are of it, and how many answers say so.
pub(super) fn classes(report: &Report, file: &mut dyn Write) -> io::Result<()> {
    writeln!(file, "class,colour,individuals,labels")?;
    for class in &report.names.classes {
        let (name, individuals) = (quoted(class.name.as_str()), report.names.individuals(class));
        writeln!(file, "{name},{},{individuals},{}", class.colour, class.labels)?;
    }
    Ok(())
}

/// One row a generation.
pub(super) fn generations(report: &Report, file: &mut dyn Write) -> io::Result<()> {
    writeln!(file, "generation,best_novelty,mean_novelty,filtered")?;
    for row in &report.generations {
        let (generation, best, mean) = (row.generation, row.best_novelty, row.mean_novelty);
        writeln!(file, "{generation},{best},{mean},{}", row.filtered)?;
    }
    Ok(())
}

fn entry_columns(report: &Report) -> String {
    let model = report.spec.model();
    let speeds = (0..model.speeds() / 2).map(|state| format!("vl{state},vr{state}"));
    let angles = (0..model.angles()).map(|_| "angle".to_owned());
    let features = FEATURE_NAMES.map(str::to_owned);
    let embedding = (0..report.embedding_dimensions()).map(|dimension| format!("embedding_{dimension}"));
    let columns: Vec<String> = features
        .into_iter()
        .chain(speeds)
        .chain(angles)
        .chain(embedding)
        .collect();
    format!("generation,seed,novelty,{}", columns.join(","))
}

fn write_entry(entry: &Entry, file: &mut dyn Write) -> io::Result<()> {
    write!(file, "{},{},{}", entry.generation, entry.seed, entry.novelty)?;
    for value in entry.features.iter().chain(entry.controller.genes()) {
        write!(file, ",{value}")?;
    }
    for value in &entry.embedding {
        write!(file, ",{value}")?;
    }
    Ok(())
}

/// The last cell of a row: what people called the individual, if anything.
fn write_class(report: &Report, index: u64, file: &mut dyn Write) -> io::Result<()> {
    let named = report.names.of(index);
    writeln!(
        file,
        ",{}",
        named.map_or(String::new(), |(_, class)| quoted(class.name.as_str()))
    )
}

/// A name as a cell; names have no ends of line.
fn quoted(name: &str) -> String {
    match name.contains([',', '"']) {
        true => format!("\"{}\"", name.replace('"', "\"\"")),
        false => name.to_owned(),
    }
}
