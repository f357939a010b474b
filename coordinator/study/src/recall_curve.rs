//! Recall over evaluations: the rows of the study at each number of evaluations, with a plot and tables.

use crate::{
    figure::{Figure, Measure},
    outcome::{MeasuredCell, Outcome},
    plot::wide,
    recall::RecallStage,
    richness::Richness,
    tables::{Entry, Row},
    written::{self, columns},
};
use csv::Writer;
use maud::{Markup, html};
use murmuration_accuracy::Summary;
use murmuration_model::colours;
use murmuration_report::svg::{Drawing, MUTED, WHITE, percent_grid, tenth};
use murmuration_swarm::{FEATURE_NAMES, counted, grouped};
use std::io::{self, Write};

/// Panels beside each other; the size of a panel, and the space around its curves; pixels.
const COLUMNS: usize = 5;
const PANEL: [f64; 2] = [216.0, 190.0];
const FREE: [f64; 4] = [34.0, 30.0, 12.0, 30.0];
/// Height of a line of the legend, and number of entries in a line.
const LEGEND: f64 = 24.0;
const LEGEND_COLUMNS: usize = 5;

/// The dashes of the rows' curves, pixels: dashes distinguish rows without colours.
const DASHES: [&str; 6] = ["none", "7 3", "2 2", "9 3 2 3", "4 4", "12 3"];

/// The rows of the grid after a number of evaluations.
pub(crate) struct Stage {
    pub(crate) evaluations: u32,
    pub(crate) rows: Vec<Row>,
}

/// Recall at each number of evaluations; empty if recall is not measured.
pub(crate) fn stages(outcome: &Outcome) -> Vec<Stage> {
    let study = outcome.study();
    let is_measured = study.measures.which.contains(&Measure::Recall) && outcome.reference().is_some();
    let Some(plan) = study.measures.recall.as_ref().filter(|_| is_measured) else {
        return Vec::new();
    };
    let numbers = plan.at.iter().enumerate();
    numbers
        .map(|(place, evaluations)| Stage {
            evaluations: evaluations.get(),
            rows: study
                .rows()
                .into_iter()
                .map(|values| row(outcome, values, place))
                .collect(),
        })
        .collect()
}

/// A row at the stage `place`.
fn row(outcome: &Outcome, values: Vec<usize>, place: usize) -> Row {
    let of_row = outcome.cells().filter(|cell| cell.cell.values == values);
    let stages = of_row.filter_map(|cell| Some((cell, stage_of(&cell, place)?)));
    let figures: Vec<_> = stages
        .map(|(cell, stage)| outcome.stage_figures(cell.measured, stage))
        .collect();
    let entry = |figure: Figure| {
        let known: Vec<f64> = figures.iter().filter_map(|of| of.get(&figure).copied()).collect();
        let summary = Summary::of(&known)?;
        let entry = Entry {
            count: known.len(),
            mean: summary.mean,
            deviation: summary.deviation,
            resampled: None,
            published: None,
        };
        Some((figure, entry))
    };
    Row {
        entries: Measure::Recall.figures().into_iter().filter_map(entry).collect(),
        values,
    }
}

fn stage_of<'a>(cell: &MeasuredCell<'a>, place: usize) -> Option<&'a RecallStage> {
    cell.measured.recall.as_ref()?.stages.get(place)
}

/// A table of the niches reached and the verdicts found at each stage.
pub(crate) fn table(outcome: &Outcome, stages: &[Stage]) -> Markup {
    let rows = stages.first().map_or(0, |stage| stage.rows.len());
    html! {
        (wide("Table: recall over evaluations", &html! {
            table {
                thead { tr {
                    @for axis in &outcome.study().axes { th { (axis.name) } }
                    @for stage in stages { th.number { "niches, % at " (grouped(stage.evaluations.into())) } }
                    @for stage in stages { th.number { "classes and patterns, % at " (grouped(stage.evaluations.into())) } }
                } }
                tbody {
                    @for place in 0..rows {
                        tr {
                            @for name in outcome.study().names(&stages[0].rows[place].values) { th scope="row" { (name) } }
                            @for figure in [Figure::NichesReached, Figure::VerdictsFound] {
                                @for stage in stages {
                                    td.number { (in_words(stage.rows[place].entries.get(&figure))) }
                                }
                            }
                        }
                    }
                }
            }
        }))
    }
}

fn in_words(entry: Option<&Entry>) -> String {
    match entry {
        None => "-".to_owned(),
        Some(Entry {
            mean,
            deviation: None,
            ..
        }) => format!("{mean:.1}"),
        Some(Entry {
            mean,
            deviation: Some(deviation),
            ..
        }) => format!("{mean:.1} ± {deviation:.1}"),
    }
}

/// The plot, a standalone SVG: a panel for each figure, a curve for each row, with its standard deviation shaded.
pub(crate) fn plot(outcome: &Outcome, stages: &[Stage]) -> Markup {
    let has = |figure: &Figure| {
        stages
            .iter()
            .flat_map(|stage| &stage.rows)
            .any(|row| row.entries.contains_key(figure))
    };
    let figures: Vec<Figure> = Measure::Recall.figures().into_iter().filter(has).collect();
    let rows = stages.first().map_or(0, |stage| stage.rows.len());
    let lines = figures.len().div_ceil(COLUMNS) as f64;
    let width = COLUMNS as f64 * PANEL[0];
    let height = lines * PANEL[1] + rows.div_ceil(LEGEND_COLUMNS) as f64 * LEGEND + 12.0;
    let label = format!(
        "Recall over evaluations: {} with a curve for each of {}. The table beside it has the values.",
        counted(figures.len() as u64, "panel"),
        counted(rows as u64, "row")
    );
    let drawing = Drawing {
        size: [width, height],
        font_size: 11,
        title: "Recall over evaluations",
        label: Some(&label),
        paper: WHITE,
        shrinks: false,
    };
    drawing.with(&html! {
        @for (place, &figure) in figures.iter().enumerate() {
            @let [x, y] = [(place % COLUMNS) as f64 * PANEL[0], (place / COLUMNS) as f64 * PANEL[1]];
            g transform={ "translate(" (x) " " (y) ")" } { (panel(figure, stages, rows)) }
        }
        @for place in 0..rows {
            @let x = FREE[0] + (place % LEGEND_COLUMNS) as f64 * width / LEGEND_COLUMNS as f64;
            @let y = lines * PANEL[1] + ((place / LEGEND_COLUMNS) as f64 + 0.5) * LEGEND;
            line x1=(x) x2=(x + 22.0) y1=(y) y2=(y) stroke=(colour(place)) stroke-width="3" stroke-dasharray=(DASHES[place % DASHES.len()]) {}
            text x=(x + 30.0) y=(y + 4.0) font-size="13" { (outcome.study().row_in_words(&stages[0].rows[place].values)) }
        }
    })
}

fn panel(figure: Figure, stages: &[Stage], rows: usize) -> Markup {
    let [first, last] =
        [stages.first(), stages.last()].map(|stage| stage.map_or(1, |stage| stage.evaluations));
    let span = (f64::from(last) / f64::from(first)).ln();
    let [left, top, right, bottom] = FREE;
    let x = |evaluations: u32| {
        let share = if span > 0.0 {
            (f64::from(evaluations) / f64::from(first)).ln() / span
        } else {
            0.5
        };
        tenth(left + share * (PANEL[0] - left - right))
    };
    let y = |percent: f64| {
        tenth(PANEL[1] - bottom - percent.clamp(0.0, 100.0) / 100.0 * (PANEL[1] - top - bottom))
    };
    let points = |place: usize| -> Vec<(u32, &Entry)> {
        let points = stages
            .iter()
            .filter_map(|stage| Some((stage.evaluations, stage.rows.get(place)?.entries.get(&figure)?)));
        points.collect()
    };
    let path = |points: &[(u32, f64)]| -> String {
        points
            .iter()
            .map(|&(at, value)| format!("{},{} ", x(at), y(value)))
            .collect()
    };
    html! {
        text x=(left) y=(top - 12.0) font-weight="bold" { (figure) }
        (percent_grid([left, PANEL[0] - right], y))
        @for tick in [first, last] {
            @let end = if tick == first { "start" } else { "end" };
            text x=(x(tick)) y=(PANEL[1] - bottom + 16.0) text-anchor=(end) fill=(MUTED) { (grouped(tick.into())) }
        }
        @for place in 0..rows {
            @let points = points(place);
            @let spread: Vec<(u32, f64, f64)> = points.iter().filter_map(|(at, entry)| Some((*at, entry.mean, entry.deviation?))).collect();
            @let above = spread.iter().map(|(at, mean, deviation)| (*at, mean + deviation));
            @let below = spread.iter().rev().map(|(at, mean, deviation)| (*at, mean - deviation));
            @let band: Vec<(u32, f64)> = above.chain(below).collect();
            @let means: Vec<(u32, f64)> = points.iter().map(|(at, entry)| (*at, entry.mean)).collect();
            polygon points=(path(&band)) fill=(colour(place)) opacity="0.18" {}
            polyline points=(path(&means)) fill="none" stroke=(colour(place)) stroke-width="1.8" stroke-dasharray=(DASHES[place % DASHES.len()]) {}
            @for &(at, mean) in &means { circle cx=(x(at)) cy=(y(mean)) r="2" fill=(colour(place)) {} }
        }
    }
}

fn colour(place: usize) -> String {
    colours::hex(colours::class(place))
}

/// Writes `recall.csv`: one row for each measured cell and number of evaluations.
pub(crate) fn recall_csv(outcome: &Outcome, file: &mut dyn Write) -> io::Result<()> {
    let mut table = Writer::from_writer(file);
    let figures = Measure::Recall.figures();
    let names: Vec<_> = figures.iter().map(|figure| figure.name()).collect();
    let others = ["evaluations"].into_iter().chain(names.iter().map(AsRef::as_ref));
    table.write_record(columns(outcome, others))?;
    for (cell, stage) in each_stage(outcome) {
        let values = outcome.stage_figures(cell.measured, stage);
        let number = |figure| values.get(figure).map_or_else(String::new, f64::to_string);
        let others = [stage.evaluations.to_string()]
            .into_iter()
            .chain(figures.iter().map(number));
        table.write_record(written::row(outcome, &cell, others))?;
    }
    table.flush()
}

/// The columns of `richness.csv` that follow the columns of [`columns`].
pub(crate) const RICHNESS: [&str; 9] = [
    "evaluations",
    "of",
    "seen",
    "chao1",
    "standard_error",
    "low",
    "high",
    "ace",
    "in_atlas",
];

/// Writes `richness.csv`: one row for each cell of independent draws, number of evaluations, and kind of count: niches, or
/// classes and patterns.
pub(crate) fn richness_csv(outcome: &Outcome, file: &mut dyn Write) -> io::Result<()> {
    let mut table = Writer::from_writer(file);
    table.write_record(columns(outcome, RICHNESS))?;
    let in_atlas = outcome
        .reference()
        .map_or([0, 0], |of| [of.verdicts.len(), of.niches.len()]);
    for (cell, stage) in each_stage(outcome) {
        let counts = cell.measured.recall.as_ref();
        if !counts.is_some_and(|counts| counts.is_independent) {
            continue;
        }
        let estimates = [
            ("verdicts", stage.richness_of_verdicts(), in_atlas[0]),
            ("niches", stage.richness_of_niches(), in_atlas[1]),
        ];
        for (of, richness, in_atlas) in estimates {
            let Some(Richness {
                seen,
                chao1,
                standard_error,
                interval: [low, high],
                ace,
            }) = richness
            else {
                continue;
            };
            let known = [stage.evaluations.to_string(), of.to_owned(), seen.to_string()];
            let numbers = [chao1, standard_error, low, high].map(|value| value.to_string());
            let ace = ace.map_or_else(String::new, |ace| ace.to_string());
            let others = known
                .into_iter()
                .chain(numbers)
                .chain([ace, in_atlas.to_string()]);
            table.write_record(written::row(outcome, &cell, others))?;
        }
    }
    table.flush()
}

/// Writes `niches.csv`: one row for each niche, with its class, the number of the atlas's controllers in the niche, and its
/// centroid.
pub(crate) fn niches_csv(outcome: &Outcome, file: &mut dyn Write) -> io::Result<()> {
    let mut table = Writer::from_writer(file);
    table.write_record(["index", "class", "members"].into_iter().chain(FEATURE_NAMES))?;
    if let Some(reference) = outcome.reference() {
        for (index, niche) in reference.niches.iter().enumerate() {
            let known = [index.to_string(), niche.class.clone(), niche.members.to_string()];
            let features = niche.centroid.iter().zip(&reference.scale);
            let features = features.map(|(value, scale)| (value * scale).to_string());
            table.write_record(known.into_iter().chain(features))?;
        }
    }
    table.flush()
}

fn each_stage(outcome: &Outcome) -> impl Iterator<Item = (MeasuredCell<'_>, &RecallStage)> {
    outcome.cells().flat_map(|cell| {
        let stages = cell.measured.recall.iter().flat_map(|counts| &counts.stages);
        stages.map(move |stage| (cell, stage))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Corrections, Niche, RecallCounts, Reference, Study, sample};
    use std::{collections::BTreeMap, path::Path};

    /// An outcome of two rows with one cell each. Both cells reach one of two niches after 10 evaluations; the second row's cell
    /// reaches both niches after 100 evaluations.
    fn outcome() -> Outcome {
        let text = "name = \"r\"\nmeasures = [\"recall\", \"richness\"]\n\
            recall = { atlas = { model = \"single-sensor\", method = \"exhaustive\" }, at = [10, 100], niches = 2 }\n\
            axes = [{ name = \"method\", values = [{ name = \"drawn\", campaign.method = \"random\" }, \
            { name = \"bred\", campaign.method = \"hand-crafted\" }] }]\n\
            [campaign]\nmodel = \"single-sensor\"\nevaluation.judge = true";
        let study = Study::from_toml(text, Path::new("/"), false).unwrap();
        let stage = |evaluations, niches: [u64; 2]| RecallStage {
            evaluations,
            verdicts: BTreeMap::from([("milling".to_owned(), 9)]),
            niches: niches.to_vec(),
        };
        let measured = |place: usize, last: [u64; 2]| {
            let mut measured = sample::measured(&study, place, &[&["milling"]]);
            measured.recall = Some(RecallCounts {
                is_independent: place == 0,
                stages: vec![stage(10, [10, 0]), stage(100, last)],
            });
            Some(measured)
        };
        let niche = || Niche {
            centroid: [0.5; 5],
            class: "milling".to_owned(),
            members: 7,
        };
        let reference = Reference {
            measures: "so".to_owned(),
            campaign: "r-atlas-1".to_owned(),
            archive_digest: String::new(),
            verdicts: BTreeMap::from([("milling".to_owned(), 3)]),
            scale: [2.0; 5],
            niches: vec![niche(), niche()],
        };
        let cells = vec![measured(0, [100, 0]), measured(1, [60, 40])];
        Outcome::new(study, cells, Corrections::default()).with_reference(Some(reference))
    }

    fn rows(write: impl Fn(&Outcome, &mut dyn Write) -> io::Result<()>) -> Vec<BTreeMap<String, String>> {
        let mut bytes = Vec::new();
        write(&outcome(), &mut bytes).unwrap();
        let mut reader = csv::Reader::from_reader(bytes.as_slice());
        reader.deserialize().map(Result::unwrap).collect()
    }

    #[test]
    fn the_curves_of_two_rows_differ_without_their_colours() {
        let outcome = outcome();
        let picture = plot(&outcome, &stages(&outcome)).into_string();
        assert!(picture.contains("role=\"img\""));
        assert!(picture.contains("aria-label=\"Recall over evaluations: "));
        // Both rows reach half of all niches at first; in the end, the second row reaches all niches.
        let lines: Vec<&str> = picture.split("<polyline").skip(1).take(2).collect();
        let dashes = |line: &str| line.split("stroke-dasharray=\"").nth(1).unwrap().to_owned();
        assert!(dashes(lines[0]).starts_with("none\"") && dashes(lines[1]).starts_with("7 3\""));
        let ends: Vec<&str> = lines.iter().map(|line| line.split('"').nth(1).unwrap()).collect();
        let [flat, rising] = [0, 1].map(|line| {
            let heights: Vec<f64> = ends[line]
                .split_whitespace()
                .map(|point| point.split(',').nth(1).unwrap().parse().unwrap())
                .collect();
            heights[0] - heights[1]
        });
        assert!(flat.abs() < 1e-9 && rising > 50.0, "{flat} {rising}");
    }

    #[test]
    fn tables_have_every_stage_and_estimates_of_independent_draws_alone() {
        let recall = rows(recall_csv);
        let of = |place: usize, column: &str| recall[place][column].clone();
        assert_eq!(recall.len(), 4);
        assert_eq!(
            [of(2, "method"), of(2, "evaluations"), of(2, "niches_reached")],
            ["bred", "10", "50"]
        );
        assert_eq!([of(3, "evaluations"), of(3, "niches_reached")], ["100", "100"]);
        let richness = rows(richness_csv);
        assert_eq!(richness.len(), 4);
        assert!(richness.iter().all(|row| row["method"] == "drawn"));
        assert_eq!(richness[0]["in_atlas"], "1");
        let niches = rows(niches_csv);
        assert_eq!((niches.len(), niches[0]["members"].as_str()), (2, "7"));
        // Centroids are in the units of the features.
        assert_eq!(niches[0][FEATURE_NAMES[0]], "1");
    }
}
