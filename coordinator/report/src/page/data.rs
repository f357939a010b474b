//! The numbers that the page's scripts draw. They are columns of little-endian binary in base64, so that the data of 100,000
//! individuals and the motions of all medoids stay small and load quickly.

use crate::{
    Entry, Report, again,
    picture::{
        Bodies,
        columns::{self, MotionView, WorldView, column, span, spread},
        thinned,
    },
    pictured::{COLUMNS, MOST_POINTS, TILES},
};
use base64::{Engine as _, engine::general_purpose::STANDARD};
use maud::{Markup, PreEscaped, html};
use murmuration_model::colours;
use serde::Serialize;

/// Maximum size of the motions of all medoids together, in bytes before base64.
const MOTION_BYTES: usize = 6 << 20;

/// Data that the report's script draws.
#[derive(Debug, Serialize)]
#[serde(rename_all = "camelCase")]
struct ReportView {
    world: WorldView,
    agent_colours: Vec<String>,
    cluster_colours: Vec<String>,
    classes: Vec<String>,
    runs: Vec<MotionView>,
    archive: ArchiveView,
    pictures: PicturesView,
    /// The command that simulates individuals again.
    simulator: String,
}

/// The individuals on the map, in columns.
#[derive(Debug, Serialize)]
#[serde(rename_all = "camelCase")]
struct ArchiveView {
    x: String,
    y: String,
    spans: [f64; 2],
    cluster: String,
    index: String,
    class: String,
    /// Whether the rule-based judge gave the class.
    machine: String,
    generation: String,
    /// Novelty when evaluated.
    novelty: String,
    /// Genes in units of `gene_unit`.
    genes: String,
    gene_unit: f64,
    tile: String,
    /// Number of trials that show the individual's own behaviour; 255 if the individual has one trial.
    robust: String,
    trials: usize,
    medoids: Vec<usize>,
}

/// The sheets of pictures. The individual of each tile also has its exact genes and its seed, to simulate the individual again.
#[derive(Debug, Serialize)]
struct PicturesView {
    sheets: Vec<String>,
    side: u32,
    columns: usize,
    tiles: usize,
    genes: String,
    seeds: String,
}

/// The data of the page as a block of JSON, which browsers do not run.
pub(super) fn block(report: &Report) -> Markup {
    // A `<` could end the block. Its escape has the same meaning in JSON.
    let json = serde_json::json!(view(report))
        .to_string()
        .replace('<', "\\u003c");
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

fn view(report: &Report) -> ReportView {
    let world = report.spec.world();
    let runs = report
        .medoids
        .iter()
        .map(|medoid| {
            let controller = &report.individuals[medoid.index as usize].controller;
            let bodies = Bodies::of(controller, world);
            let most_bytes = MOTION_BYTES / report.medoids.len();
            columns::motion(&medoid.replay, world, bodies.colouring(), most_bytes)
        })
        .collect();
    let cluster_colour = |place| colours::hex(colours::cluster(place));
    let classes = report.names.classes.iter();
    ReportView {
        world: world.into(),
        agent_colours: colours::AGENTS.map(colours::hex).to_vec(),
        cluster_colours: (0..report.medoids.len()).map(cluster_colour).collect(),
        classes: classes.map(|class| class.name.shown()).collect(),
        runs,
        archive: archive(report),
        pictures: pictures(report),
        simulator: again::simulator(&report.spec),
    }
}

fn pictures(report: &Report) -> PicturesView {
    let pictured = &report.pictured;
    let entries = || {
        pictured
            .indices
            .iter()
            .map(|&index| &report.individuals[index as usize])
    };
    let genes = entries().flat_map(|entry| entry.controller.genes());
    PicturesView {
        sheets: pictured
            .sheets
            .iter()
            .map(|sheet| STANDARD.encode(sheet))
            .collect(),
        side: report.spec.image().resolution(),
        columns: COLUMNS,
        tiles: TILES,
        genes: column(genes.map(|gene| gene.to_le_bytes())),
        seeds: column(entries().map(|entry| entry.seed.to_le_bytes())),
    }
}

/// Tile number of an individual without its own picture.
const TILELESS: u16 = u16::MAX;

/// Class number of an individual without a name.
const NAMELESS: u16 = u16::MAX;

/// Number of an individual's trials that show its own behaviour; 255 if the individual has one trial.
fn robust_starts(report: &Report, entry: &Entry) -> u8 {
    let starts = report.spec.starts().get() as f64;
    entry
        .robustness
        .map_or(u8::MAX, |robustness| (robustness * starts).round() as u8)
}

/// The individuals on the map. The unit of genes is 0.0001, or more if genes are large.
fn archive(report: &Report) -> ArchiveView {
    let shown = shown_points(report);
    let entries = || shown.iter().map(|&index| &report.individuals[index]);
    let axis = |axis: usize| shown.iter().map(move |&index| report.map.points[index][axis]);
    let place_of = |medoid: u64| shown.partition_point(|&index| index < medoid as usize);
    let genes = || entries().flat_map(|entry| entry.controller.genes());
    let largest = genes().fold(0.0, |largest: f64, gene| largest.max(gene.abs()));
    let gene_unit = f64::max(1e-4, largest / f64::from(i16::MAX));
    ArchiveView {
        x: spread(axis(0)),
        y: spread(axis(1)),
        spans: [span(axis(0)), span(axis(1))],
        cluster: column(
            shown
                .iter()
                .map(|&index| (report.clusters[index] as u16).to_le_bytes()),
        ),
        index: column(shown.iter().map(|&index| (index as u32).to_le_bytes())),
        class: column(shown.iter().map(|&index| {
            let class = report.names.of(index as u64);
            class.map_or(NAMELESS, |(place, _)| place as u16).to_le_bytes()
        })),
        machine: column(
            shown
                .iter()
                .map(|&index| [u8::from(report.names.is_by_machine(index as u64))]),
        ),
        generation: column(entries().map(|entry| entry.generation.to_le_bytes())),
        novelty: column(entries().map(|entry| (entry.novelty_when_evaluated as f32).to_le_bytes())),
        genes: column(genes().map(|gene| ((gene / gene_unit).round() as i16).to_le_bytes())),
        gene_unit,
        tile: column(shown.iter().map(|&index| {
            let tile = report.pictured.tile(index as u64);
            tile.map_or(TILELESS, |tile| tile as u16).to_le_bytes()
        })),
        robust: column(entries().map(|entry| [robust_starts(report, entry)])),
        trials: report.spec.starts().get(),
        medoids: report
            .medoids
            .iter()
            .map(|medoid| place_of(medoid.index))
            .collect(),
    }
}
