//! The page of a study's report: one HTML document that needs nothing else.

use crate::{
    corrections::JUDGE,
    figure::{Figure, Measure},
    outcome::{MeasuredCell, Outcome},
    pictures::CellPictures,
    plot::dots,
    tables::{Entry, Row, Table},
};
use base64::{Engine as _, engine::general_purpose::STANDARD};
use maud::{DOCTYPE, Markup, PreEscaped, html};
use murmuration_model::colours;
use murmuration_proto::Class;
use murmuration_proto::{counted, grouped};

const STYLE: &str = include_str!("page.css");

/// The page loads nothing, sends nothing, and embeds nothing of another site.
const POLICY: &str =
    "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'";

/// The whole document; `pictures` has those of each measured cell, in order.
pub(crate) fn render(outcome: &Outcome, tables: &[Table], pictures: &[CellPictures]) -> String {
    let study = outcome.study();
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta http-equiv="Content-Security-Policy" content=(POLICY);
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                meta name="generator" content="Murmuration";
                title { "Study " (study.name().as_str()) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                (header(outcome))
                main {
                    @for table in tables { (section(outcome, table)) }
                    (behaviours(outcome, pictures))
                    (cells(outcome))
                    (commands(outcome))
                }
            }
        }
    };
    page.into_string()
}

fn header(outcome: &Outcome) -> Markup {
    let study = outcome.study();
    let (measured, all) = (outcome.cells().count(), study.cells().len());
    html! {
        header {
            p.eyebrow { "Study" }
            h1 { (study.name().as_str()) }
            p.lead {
                (counted(study.rows().len() as u64, "row")) ", "
                (counted(study.seeds().len() as u64, "replicate")) " each: "
                @if measured == all { (counted(all as u64, "campaign")) "." }
                @else { (grouped(measured as u64)) " of " (counted(all as u64, "campaign")) " measured so far." }
                @if let Some(embedders) = study.embedders() {
                    " The replicates share " (counted(embedders.get().into(), "embedder"))
                    " for each dataset and training."
                }
            }
            @for source in outcome.sources() { p.lead { "Published figures: " (source) "." } }
        }
    }
}

fn section(outcome: &Outcome, table: &Table) -> Markup {
    let figures = table.figures();
    let main = figures.first().copied();
    html! {
        section id=(table.measure.name()) {
            h2 { (table.measure.title()) }
            p.lead { (explained(outcome, table.measure)) }
            @if figures.is_empty() { p.lead { "Nothing is measured yet." } }
            @else {
                div.wide {
                    table {
                        thead { tr {
                            @for axis in outcome.study().axes() { th { (axis.name) } }
                            th.number { "n" }
                            @for figure in &figures { th.number { (figure) } }
                        } }
                        tbody { @for row in &table.rows { (line(outcome, row, &figures)) } }
                    }
                }
                @if let Some(main) = main {
                    (dots(&table.rows, main, |row| named(outcome, row)))
                    p.legend {
                        span.key-mean { "mean and standard deviation" }
                        @if table.rows.iter().flat_map(|row| row.entries.values()).any(|entry| entry.resampled.is_some()) {
                            span.key-judge { "with the judge's errors (5th to 95th percentile)" }
                        }
                        @if table.rows.iter().flat_map(|row| row.entries.values()).any(|entry| entry.published.is_some()) {
                            span.key-published { "published" }
                        }
                    }
                }
            }
        }
    }
}

/// A row in words.
fn named(outcome: &Outcome, row: &Row) -> String {
    let names: Vec<&str> = outcome.study().names(&row.values).collect();
    match names.is_empty() {
        true => outcome.study().name().as_str().to_owned(),
        false => names.join(" · "),
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

fn explained(outcome: &Outcome, measure: Measure) -> Markup {
    match measure {
        Measure::Behaviours => {
            let named = outcome.named_by();
            html! {
                "Medoids of each class and distinct classes: the mean over the last "
                (outcome.study().measures().generations)
                " taxonomies of a replicate, then mean ± sample standard deviation over the replicates. "
                @for (by, count) in &named {
                    @let who = if by == JUDGE { "The rule-based judge" } else { by.as_str() };
                    (who) " named " (counted(*count as u64, "individual")) ". "
                }
                @if named.contains_key(JUDGE) {
                    "The second line has the judge's errors: mean, 5th and 95th percentile of 1,000 resamplings of the replicates and of \
                     the classes that people give to what the judge so names."
                }
            }
        }
        Measure::Accuracy => html! {
            "Share of labelled triplets in which the anchor is nearer to the positive than to the negative, percent; n counts \
             different embeddings. The first column leaves out anchors of the class random."
        },
        Measure::Search => html! {
            "Loss of the last taxonomy, and mean novelty of the last generation. Both are in units of the behaviour space: compare \
             them only within a method."
        },
    }
}

fn behaviours(outcome: &Outcome, pictures: &[CellPictures]) -> Markup {
    html! {
        @if !pictures.is_empty() {
            section #medoids {
                h2 { "The medoids" }
                p.lead {
                    "The last taxonomy of each cell: the paths of the last steps, and the class that it was given. To name them \
                     yourself, edit the columns class and by of medoids.csv and write the report again with --classes."
                }
                @for (cell, pictures) in outcome.cells().zip(pictures) { (cell_medoids(outcome, &cell, pictures)) }
            }
        }
    }
}

fn cell_medoids(outcome: &Outcome, cell: &MeasuredCell<'_>, pictures: &CellPictures) -> Markup {
    html! {
        @if !pictures.medoids.is_empty() {
            details {
                summary { (outcome.study().cell_in_words(cell.cell)) " " span { (cell.measured.campaign) } }
                div.medoids {
                    @for (index, png) in &pictures.medoids {
                        @let (class, by) = outcome.class_of(cell.measured, *index);
                        figure style={ "--class:" (colour(class)) } {
                            img loading="lazy" alt={ "Individual " (index) } src={ "data:image/png;base64," (STANDARD.encode(png)) };
                            figcaption {
                                b { (class.name().replace('_', " ")) }
                                " " (grouped(*index))
                                @if by != JUDGE { " (" (by) ")" }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// The colour of a class, the same in every report.
fn colour(class: Class) -> String {
    let place = Class::ALL.into_iter().position(|known| known == class);
    colours::hex(colours::cluster(place.unwrap_or_default()))
}

fn cells(outcome: &Outcome) -> Markup {
    html! {
        section #cells {
            h2 { "The cells" }
            p.lead { "Each is a campaign. Two runs of its specification have the same digest." }
            div.wide {
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
            }
        }
    }
}

fn commands(outcome: &Outcome) -> Markup {
    let name = outcome.study().name().as_str();
    html! {
        section #commands {
            h2 { "Commands" }
            pre {
                "murmuration study run study.toml            # run this study again, or go on with it\n"
                "murmuration study show " (name) "\n"
                "murmuration study report " (name) " --classes medoids.csv\n"
                "murmuration report CAMPAIGN                 # the report of one cell"
            }
            p.lead { "cells.csv has the figures of each cell; medoids.csv has each judged individual. Every table here follows from them." }
        }
    }
}
