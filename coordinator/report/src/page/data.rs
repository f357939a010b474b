//! The numbers that the page's scripts draw from: columns of little-endian binary in base64, so that 100,000
//! individuals and the motion of every medoid stay small and load at once.

use crate::{
    Entry, Report, again,
    picture::{
        Bodies,
        columns::{self, column, span, spread},
        thinned,
    },
    pictured::{COLUMNS, MOST_POINTS, TILES},
};
use base64::{Engine as _, engine::general_purpose::STANDARD};
use maud::{Markup, PreEscaped, html};
use murmuration_model::colours;
use serde_json::{Value, json};

/// Bytes for the motion of all medoids together, before base64.
const MOTION_BYTES: usize = 6 << 20;

/// A block of JSON, which browsers do not run.
pub(super) fn block(report: &Report) -> Markup {
    // `<` could end the block; written as an escape it is the same JSON.
    let json = content(report).to_string().replace('<', "\\u003c");
    html! { script #data type="application/json" { (PreEscaped(json)) } }
}

/// Indices of the individuals that the map shows, ascending; every medoid is among them.
pub(super) fn shown_points(report: &Report) -> Vec<usize> {
    let mut shown = thinned(report.individuals.len(), MOST_POINTS);
    shown.extend(report.medoids.iter().map(|medoid| medoid.index as usize));
    shown.sort_unstable();
    shown.dedup();
    shown
}

fn content(report: &Report) -> Value {
    let world = report.spec.world();
    let runs: Vec<Value> = report
        .medoids
        .iter()
        .map(|medoid| {
            let controller = &report.individuals[medoid.index as usize].controller;
            let bodies = Bodies::of(controller, world);
            let most_bytes = MOTION_BYTES / report.medoids.len();
            columns::motion(&medoid.replay, world, bodies.colouring(), most_bytes)
        })
        .collect();
    json!({
        "world": columns::world(world),
        "agentColours": colours::AGENTS.map(colours::hex),
        "clusterColours": (0..report.medoids.len()).map(|place| colours::hex(colours::cluster(place))).collect::<Vec<_>>(),
        "classes": report.names.classes.iter().map(|class| class.name.shown()).collect::<Vec<_>>(),
        "runs": runs,
        "archive": archive(report),
        "pictures": pictures(report),
        "simulator": again::simulator(&report.spec),
    })
}

/// The sheets of pictures, and of the individual of each tile the exact genes and the seed, with which it can be simulated again.
fn pictures(report: &Report) -> Value {
    let pictured = &report.pictured;
    let entries = || {
        pictured
            .indices
            .iter()
            .map(|&index| &report.individuals[index as usize])
    };
    json!({
        "sheets": pictured.sheets.iter().map(|sheet| STANDARD.encode(sheet)).collect::<Vec<_>>(),
        "side": report.spec.image().resolution(),
        "columns": COLUMNS,
        "tiles": TILES,
        "genes": column(entries().flat_map(|entry| entry.controller.genes()).map(|gene| gene.to_le_bytes())),
        "seeds": column(entries().map(|entry| entry.seed.to_le_bytes())),
    })
}

/// The tile of an individual without a picture of its own.
const TILELESS: u16 = u16::MAX;

/// The class of an individual without a name.
const NAMELESS: u16 = u16::MAX;

/// The number of an individual's trials that show its own behaviour; 255 if it has one trial.
fn robust_starts(report: &Report, entry: &Entry) -> u8 {
    let starts = report.spec.starts().get() as f64;
    entry
        .robustness
        .map_or(u8::MAX, |robustness| (robustness * starts).round() as u8)
}

/// The individuals on the map: place, cluster, index, class, who gave that, generation, novelty when evaluated, genes in
/// ten-thousandths, or coarser where genes are large, and tile.
fn archive(report: &Report) -> Value {
    let shown = shown_points(report);
    let entries = || shown.iter().map(|&index| &report.individuals[index]);
    let axis = |axis: usize| shown.iter().map(move |&index| report.map.points[index][axis]);
    let place_of = |medoid: u64| shown.partition_point(|&index| index < medoid as usize);
    let genes = || entries().flat_map(|entry| entry.controller.genes());
    let largest = genes().fold(0.0, |largest: f64, gene| largest.max(gene.abs()));
    let gene_unit = f64::max(1e-4, largest / f64::from(i16::MAX));
    json!({
        "x": spread(axis(0)),
        "y": spread(axis(1)),
        "spans": [span(axis(0)), span(axis(1))],
        "cluster": column(shown.iter().map(|&index| (report.clusters[index] as u16).to_le_bytes())),
        "index": column(shown.iter().map(|&index| (index as u32).to_le_bytes())),
        "class": column(shown.iter().map(|&index| {
            report.names.of(index as u64).map_or(NAMELESS, |(place, _)| place as u16).to_le_bytes()
        })),
        "machine": column(shown.iter().map(|&index| [u8::from(report.names.is_by_machine(index as u64))])),
        "generation": column(entries().map(|entry| entry.generation.to_le_bytes())),
        "novelty": column(entries().map(|entry| (entry.novelty_when_evaluated as f32).to_le_bytes())),
        "genes": column(genes().map(|gene| ((gene / gene_unit).round() as i16).to_le_bytes())),
        "geneUnit": gene_unit,
        "tile": column(shown.iter().map(|&index| {
            report.pictured.tile(index as u64).map_or(TILELESS, |tile| tile as u16).to_le_bytes()
        })),
        // In starts, 255 where individuals have one.
        "robust": column(entries().map(|entry| [robust_starts(report, entry)])),
        "trials": report.spec.starts().get(),
        "medoids": report.medoids.iter().map(|medoid| place_of(medoid.index)).collect::<Vec<_>>(),
    })
}
