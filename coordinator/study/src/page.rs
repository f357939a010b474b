//! The page of a study's report: one HTML document that needs no other files.

use crate::{
    corrections::JUDGE,
    figure::{Figure, Measure},
    map_files::{self, RowMaps},
    outcome::{MeasuredCell, Outcome},
    phase_picture,
    pictures::MedoidPictures,
    plot::{dots, wide},
    recall_curve, share_bars,
    tables::{Entry, Row, Table},
};
use base64::{Engine as _, engine::general_purpose::STANDARD};
use maud::{Markup, PreEscaped, html};
use murmuration_model::colours::{self, class_colour};
use murmuration_report::Document;
use murmuration_swarm::{Class, counted, grouped};
use std::collections::BTreeMap;

const STYLE: &str = concat!(include_str!("page.css"), include_str!("tables.css"));

/// The style sheet of [`tables_and_plots`], for a page that defines the colours `--ink`, `--muted`, `--line`, `--accent`, and
/// `--warm` for published figures.
pub const TABLES_STYLE: &str = include_str!("tables.css");

/// The pictures of a report, besides its tables.
pub(crate) struct Pictures {
    /// The phase diagrams as SVG, if the study has any.
    pub(crate) phase: Option<String>,
    /// The pictures of each measured cell, in order.
    pub(crate) behaviours: Vec<MedoidPictures>,
    /// The maps of each row with maps.
    pub(crate) maps: Vec<RowMaps>,
}

/// The whole document; `files_beside` says whether the tables and pictures of the report are files beside the document.
pub(crate) fn render(outcome: &Outcome, drawn: &Pictures, files_beside: bool) -> String {
    let study = outcome.study();
    let title = format!("Study {}", study.name.as_str());
    let document = Document {
        title: &title,
        style: STYLE,
        scripts: false,
        pictures_beside: false,
    };
    document.with(&html! {
        (header(outcome))
        main.study {
            @if let Some(picture) = &drawn.phase { (phase_diagrams(picture, files_beside)) }
            @for table in outcome.tables() {
                @if table.measure == Measure::Maps { (mapped(outcome, &drawn.maps, files_beside)) }
                @else { (section(outcome, table, files_beside)) }
            }
            (behaviours(outcome, &drawn.behaviours, files_beside))
            (cells(outcome))
            (commands(outcome, files_beside))
        }
    })
}

/// The tables and plots of a study so far, without the maps: for a page that includes [`TABLES_STYLE`].
pub fn tables_and_plots(outcome: &Outcome) -> Markup {
    let phase = phase_picture::svg(outcome.study().name.as_str(), &outcome.phase_diagrams());
    let tables = outcome.tables().iter();
    html! {
        @if let Some(picture) = &phase { (phase_diagrams(picture, false)) }
        @for table in tables.filter(|table| table.measure != Measure::Maps) { (section(outcome, table, false)) }
    }
}

fn header(outcome: &Outcome) -> Markup {
    let study = outcome.study();
    let (measured, all) = (outcome.cells().count(), study.cells.len());
    html! {
        header {
            p.eyebrow { "Study" }
            h1 { (study.name.as_str()) }
            @if study.is_quick() {
                p.lead {
                    strong { "Shortened by --quick." } " Its campaigns are smaller and fewer than the study says: it shows what the report looks like, "
                    "and its figures are not to be compared with published ones."
                }
            }
            p.lead {
                (counted(study.rows().len() as u64, "row")) ", "
                (counted(study.seeds.len() as u64, "replicate")) " each: "
                @if measured == all { (counted(all as u64, "campaign")) "." }
                @else { (grouped(measured as u64)) " of " (counted(all as u64, "campaign")) " measured so far." }
                @if let Some(embedders) = study.embedders {
                    " The replicates share " (counted(embedders.get().into(), "embedder"))
                    " for each dataset and training."
                }
            }
            @for source in outcome.sources() { p.lead { "Published figures: " (source) "." } }
        }
    }
}

fn phase_diagrams(picture: &str, files_beside: bool) -> Markup {
    html! {
        section #phase {
            h2 { "Phase diagrams" }
            p.lead {
                "Percentage of the trials of each cell that the rule-based judge gave a class: the stronger the colour, the larger. Thin \
                 lines are at 25 and 75 percent, the thick one at 50. Classes that no cell shows in a tenth of its trials are left out."
                @if files_beside { " The figures are in cells.csv, the picture is phase.svg." }
            }
            (wide("Phase diagrams", &PreEscaped(picture.to_owned())))
        }
    }
}

fn section(outcome: &Outcome, table: &Table, files_beside: bool) -> Markup {
    let figures = table.figures();
    let main = figures.first().copied();
    html! {
        section id=(table.measure.name()) {
            h2 { (table.measure.title()) }
            p.lead { (explained(outcome, table.measure, files_beside)) }
            @if figures.is_empty() { p.lead { "Nothing is measured yet." } }
            @else {
                (wide(&format!("Table: {}", table.measure.title()), &html! {
                    table {
                        thead { tr {
                            @for axis in &outcome.study().axes { th { (axis.name) } }
                            th.number { "n" }
                            @for figure in &figures { th.number { (figure) } }
                        } }
                        tbody { @for row in &table.rows { (line(outcome, row, &figures)) } }
                    }
                }))
                @if table.measure == Measure::Shares {
                    (wide(&plot_of(table), &share_bars::bars(&table.rows, |row| outcome.study().row_in_words(&row.values))))
                    p.legend {
                        (share_bars::legend(&table.rows))
                        @if any(table, |entry| entry.published.is_some()) { span.key-published { "published: random" } }
                    }
                } @else if table.measure == Measure::Recall {
                    (recall(outcome))
                } @else if let Some(main) = main {
                    (wide(&plot_of(table), &dots(&table.rows, main, |row| outcome.study().row_in_words(&row.values))))
                    p.legend {
                        span.key-mean { "mean and standard deviation" }
                        @if any(table, |entry| entry.resampled.is_some()) {
                            span.key-judge { "with the judge's errors (5th to 95th percentile)" }
                        }
                        @if any(table, |entry| entry.published.is_some()) {
                            span.key-published { "published" }
                        }
                    }
                }
            }
        }
    }
}

fn plot_of(table: &Table) -> String {
    format!("Plot: {}", table.measure.title())
}

/// Whether some entry of a table satisfies `has`.
fn any(table: &Table, has: impl Fn(&Entry) -> bool) -> bool {
    table.rows.iter().flat_map(|row| row.entries.values()).any(has)
}

fn mapped(outcome: &Outcome, maps: &[RowMaps], files_beside: bool) -> Markup {
    html! {
        section #maps {
            h2 { (Measure::Maps.title()) }
            p.lead { (explained(outcome, Measure::Maps, files_beside)) }
            @if maps.is_empty() { p.lead { "Nothing is measured yet." } }
            (map_files::shown(maps))
        }
    }
}

fn recall(outcome: &Outcome) -> Markup {
    let stages = recall_curve::stages(outcome);
    html! {
        (wide("Plot: recall over evaluations", &recall_curve::plot(outcome, &stages)))
        p.legend { span { "Mean over the replicates and standard deviation, over evaluations on a logarithmic scale." } }
        (recall_curve::table(outcome, &stages))
    }
}

fn line(outcome: &Outcome, row: &Row, figures: &[Figure]) -> Markup {
    let count = row.entries.values().map(|entry| entry.count).max();
    html! {
        tr {
            @for name in outcome.study().names(&row.values) { th scope="row" { (name) } }
            td.number { @match count { Some(count) => { (count) }, None => { "-" } } }
            @for figure in figures {
                td.number {
                    @match row.entries.get(figure) {
                        Some(entry) => { (shown(entry, *figure)) },
                        None => { "-" },
                    }
                }
            }
        }
    }
}

fn shown(entry: &Entry, figure: Figure) -> Markup {
    let decimals = figure.decimals();
    let number = |value: f64| format!("{value:.decimals$}");
    html! {
        strong { (number(entry.mean)) }
        @if let Some(deviation) = entry.deviation { " ± " (number(deviation)) }
        @if let Some(resampled) = entry.resampled {
            small title="with the judge's errors: mean, 5th and 95th percentile" {
                (number(resampled.mean)) " (" (number(resampled.low)) " to " (number(resampled.high)) ")"
            }
        }
        @if let Some(published) = entry.published { small.published { "published " (published) } }
    }
}

fn explained(outcome: &Outcome, measure: Measure, files_beside: bool) -> Markup {
    match measure {
        Measure::Behaviours => {
            let named = outcome.named_by();
            html! {
                "Medoids of each class and distinct classes: the mean over the last "
                (outcome.study().measures.generations)
                " taxonomies of a replicate, then mean ± sample standard deviation over the replicates. "
                (judged_by(&named)) " \
                 The second judge, which learned from labels and shares nothing with the rules, names the same medoids: a class counts as \
                 distinct by both judges if at least one medoid has it from both. "
                @if named.contains_key(JUDGE) {
                    "The second line has the judge's errors: mean, 5th and 95th percentile of 1,000 resamplings of the replicates and of \
                     the classes that the annotators of the labelled sets, each a vision model with a written brief, give to what the \
                     judge so names."
                }
            }
        }
        Measure::Shares => html! {
            "Percentage of all trials of a replicate's archive that the rule-based judge gave each class, then mean ± sample standard \
             deviation over the replicates. Small clusters, chains and moving clumps are patterns among the random trials. The second \
             line has the judge's errors: mean, 5th and 95th percentile of 1,000 resamplings of the replicates and of the classes that \
             the annotators of the labelled sets, each a vision model with a written brief, give to what the judge so names."
        },
        Measure::Accuracy => html! {
            "Share of labelled triplets in which the anchor is nearer to the positive than to the negative, percent; n counts \
             different embeddings. The first column leaves out anchors of the class random."
        },
        Measure::Search => html! {
            "Loss of the last taxonomy, and mean novelty of the last generation. Both are in units of the behaviour space: compare \
             them only within a method."
        },
        Measure::Recall => html! {
            @if let (Some(reference), Some(plan)) = (outcome.reference(), &outcome.study().measures.recall) {
                "Of what the atlas (campaign " (reference.campaign) ") holds, the share that the first individuals of each archive \
                 find. Its behaviours, in the five features divided by their standard deviations, are "
                (counted(reference.niches.len() as u64, "niche")) " of about equal size; a niche is reached if an individual lies in it, \
                 and of the class that most of its controllers are of. A class or pattern is found if a trial was judged so; the \
                 atlas has " (reference.verdicts.len()) ". The table is of "
                (grouped(plan.at.last().map_or(0, |at| u64::from(at.get())))) " evaluations."
            }
        },
        Measure::Richness => html! {
            @if let Some(reference) = outcome.reference() {
                "How many niches of the behaviour space, and how many classes and patterns, there are by Chao1 and ACE, from how often \
                 each was met: of the method random alone, since both take draws to be independent. The atlas has "
                (counted(reference.niches.len() as u64, "niche")) " and " (reference.verdicts.len())
                " classes and patterns. Mean ± sample standard deviation over the replicates"
                @if files_beside { "; richness.csv has the 95 % interval of each" } "."
            }
        },
        Measure::Maps => html! {
            "Behaviours and controllers of the first generation of the first replicate of each row, placed by t-SNE, in the colours of \
             the class that the judge gave most trials. Neighbours are alike; the distances between groups mean nothing. The histogram has the \
             heuristic scores of the same controllers."
        },
    }
}

/// The line about annotators: `Judged by: the rule-based judge; 37 of 320 medoids by ann.`
fn judged_by(named: &BTreeMap<String, usize>) -> String {
    let all: usize = named.values().sum();
    let people = named.iter().filter(|(by, _)| *by != JUDGE);
    let people = people.map(|(by, count)| {
        let medoids = counted(all as u64, "medoid");
        format!("{} of {medoids} by {by}", grouped(*count as u64))
    });
    let judge = named
        .contains_key(JUDGE)
        .then(|| "the rule-based judge".to_owned());
    let message: Vec<String> = judge.into_iter().chain(people).collect();
    match message.is_empty() {
        true => String::new(),
        false => format!("Judged by: {}.", message.join("; ")),
    }
}

fn behaviours(outcome: &Outcome, pictures: &[MedoidPictures], files_beside: bool) -> Markup {
    html! {
        @if pictures.iter().any(|medoids| !medoids.is_empty()) {
            section #medoids {
                h2 { "The medoids" }
                p.lead {
                    "The last taxonomy of each cell: the paths of the last steps, and the class that it was given. To name them \
                     yourself, use the study's page of a coordinator"
                    @if files_beside {
                        "; or edit the columns class and by of medoids.csv and write the report again with --classes"
                    }
                    "."
                }
                @for (cell, pictures) in outcome.cells().zip(pictures) { (cell_medoids(outcome, &cell, pictures)) }
            }
        }
    }
}

fn cell_medoids(outcome: &Outcome, cell: &MeasuredCell<'_>, pictures: &MedoidPictures) -> Markup {
    html! {
        @if !pictures.is_empty() {
            details {
                summary { (outcome.study().cell_in_words(cell.cell)) " " span { (cell.measured.campaign) } }
                div.medoids {
                    @for (index, png) in pictures {
                        @let (class, by) = outcome.class_of(cell.measured, *index);
                        figure style={ "--class:" (colours::hex(class_colour(class))) } {
                            img loading="lazy" alt={ "Individual " (index) } src={ "data:image/png;base64," (STANDARD.encode(png)) };
                            figcaption {
                                b { (class.words()) }
                                " " (grouped(*index))
                                @if by != JUDGE { " (" (by) ")" }
                                @if let Some(second) = second(cell, *index).filter(|second| *second != class) {
                                    small { "second judge: " (second.words()) }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// The second judge's class of a medoid.
fn second(cell: &MeasuredCell<'_>, index: u64) -> Option<Class> {
    cell.measured.behaviours.as_ref()?.second(index)
}

fn cells(outcome: &Outcome) -> Markup {
    html! {
        section #cells {
            h2 { "The cells" }
            p.lead { "Each cell is a campaign. Two runs of one specification have the same digest." }
            (wide("Table: the cells", &html! {
                table {
                    thead { tr {
                        th { "cell" } th { "campaign" } th.number { "evaluations" } th { "digest of the archive" } th { "checkpoint" }
                    } }
                    tbody {
                        @for cell in outcome.cells() {
                            tr {
                                th scope="row" { (outcome.study().cell_in_words(cell.cell)) }
                                td { (cell.measured.campaign) }
                                td.number { (grouped(cell.measured.evaluations)) }
                                td { code { (cell.measured.archive_digest) } }
                                td { code { (cell.measured.checkpoint.chars().take(16).collect::<String>()) } }
                            }
                        }
                    }
                }
            }))
        }
    }
}

fn commands(outcome: &Outcome, files_beside: bool) -> Markup {
    let name = outcome.study().name.as_str();
    html! {
        section #commands {
            h2 { "Commands" }
            pre {
                "murmuration lab study run study.toml            # run this study again, or go on with it\n"
                "murmuration lab study show " (name) "\n"
                "murmuration lab study report " (name) " --classes medoids.csv\n"
                "murmuration report CAMPAIGN                 # the report of one cell"
            }
            @if files_beside {
                p.lead { "cells.csv has the figures of each cell; medoids.csv has each judged individual. Every table here follows from them." }
            }
        }
    }
}
