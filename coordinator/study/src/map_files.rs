//! The maps of a study as files and on the study's page: one set of maps for each row, from the row's first replicate with maps.

use crate::{
    maps::{MappedIndividual, Maps},
    outcome::{MeasuredCell, Outcome},
    pictures::ReportError,
    written::{self, columns},
};
use base64::{Engine as _, engine::general_purpose::STANDARD};
use csv::Writer;
use maud::{Markup, html};
use murmuration_files::Folder;
use murmuration_report::{class_map, class_map::ClassPoint, score_histogram};
use murmuration_search::filter::CUTOFF;
use murmuration_swarm::Class;
use std::io::{self, Write};

/// The folder of the pictures in the report.
const FOLDER: &str = "maps";
/// Most characters of a file's name that come from the names of a row.
const NAME_CHARS: usize = 60;

/// The pictures of a row.
pub(crate) struct RowMaps {
    /// The row in words.
    words: String,
    /// The beginning of the names of the row's files.
    stem: String,
    behaviours: Picture,
    controllers: Picture,
    /// The histogram of heuristic scores, as SVG.
    scores: String,
    /// Share of neighbours of the same class, on the map of behaviours and on the map of controllers, percent.
    alike: [Option<f64>; 2],
}

/// A map as SVG and as PNG.
struct Picture {
    svg: String,
    png: Vec<u8>,
}

impl Picture {
    fn of(maps: &Maps, at: impl Fn(&MappedIndividual) -> [f64; 2], title: &str) -> Result<Self, ReportError> {
        let point = |individual: &MappedIndividual| ClassPoint {
            at: at(individual),
            class: individual.class(),
        };
        let points: Vec<ClassPoint> = maps.individuals.iter().map(point).collect();
        let (svg, png) = class_map::draw(&points, title).map_err(|error| ReportError::Map {
            title: title.to_owned(),
            reason: error.to_string(),
        })?;
        Ok(Self { svg, png })
    }
}

/// The pictures of every row with maps.
pub(crate) fn draw(outcome: &Outcome) -> Result<Vec<RowMaps>, ReportError> {
    let rows = outcome.study().rows().into_iter().enumerate();
    let maps = rows.filter_map(|(place, values)| {
        let mut cells = outcome.cells().filter(|cell| cell.cell.values == values);
        let (cell, maps) = cells.find_map(|cell| Some((cell, cell.measured.maps.as_ref()?)))?;
        Some(row(outcome, place, &cell, maps))
    });
    maps.collect()
}

fn row(
    outcome: &Outcome,
    place: usize,
    cell: &MeasuredCell<'_>,
    maps: &Maps,
) -> Result<RowMaps, ReportError> {
    let words = outcome.study().row_in_words(&cell.cell.values);
    let scores: Vec<(f64, Class)> = maps
        .individuals
        .iter()
        .map(|individual| (individual.score, individual.class()))
        .collect();
    Ok(RowMaps {
        stem: format!("{}-{}", place + 1, file_name(&words)),
        behaviours: Picture::of(maps, |of| of.behaviour, &format!("Behaviours: {words}"))?,
        controllers: Picture::of(maps, |of| of.controller, &format!("Controllers: {words}"))?,
        scores: score_histogram::svg(&scores, CUTOFF, &format!("Heuristic scores: {words}")),
        alike: [maps.alike(|of| of.behaviour), maps.alike(|of| of.controller)],
        words,
    })
}

/// Words as part of a file's name: lower-case letters and digits, with hyphens between.
fn file_name(words: &str) -> String {
    let parts = words.split(|c: char| !c.is_ascii_alphanumeric());
    let parts: Vec<String> = parts
        .filter(|part| !part.is_empty())
        .map(str::to_lowercase)
        .collect();
    parts.join("-").chars().take(NAME_CHARS).collect()
}

/// Writes the pictures and `maps.csv` into the folder of the report.
pub(crate) fn write(outcome: &Outcome, rows: &[RowMaps], files: &mut Folder) -> Result<(), ReportError> {
    for row in rows {
        let name = |what: &str| format!("{FOLDER}/{}-{what}", row.stem);
        for (what, picture) in [("behaviours", &row.behaviours), ("controllers", &row.controllers)] {
            files.text(&name(&format!("{what}.svg")), &picture.svg)?;
            files.bytes(&name(&format!("{what}.png")), &picture.png)?;
        }
        files.text(&name("scores.svg"), &row.scores)?;
    }
    files.write("maps.csv", |file| csv(outcome, file))?;
    Ok(())
}

/// The columns of `maps.csv` that follow the columns of [`columns`].
pub(crate) const COLUMNS: [&str; 7] = [
    "index",
    "class",
    "heuristic_score",
    "controller_x",
    "controller_y",
    "behaviour_x",
    "behaviour_y",
];

/// Writes `maps.csv`: one row for each mapped individual of every measured cell.
pub(crate) fn csv(outcome: &Outcome, file: &mut dyn Write) -> io::Result<()> {
    let mut table = Writer::from_writer(file);
    table.write_record(columns(outcome, COLUMNS))?;
    for cell in outcome.cells() {
        for individual in cell.measured.maps.iter().flat_map(|maps| &maps.individuals) {
            let of = [individual.index.to_string(), individual.class.clone()];
            let numbers = [individual.score].into_iter();
            let numbers = numbers.chain(individual.controller).chain(individual.behaviour);
            let numbers = numbers.map(|number| number.to_string());
            table.write_record(written::row(outcome, &cell, of.into_iter().chain(numbers)))?;
        }
    }
    table.flush()
}

/// The pictures on the study's page.
pub(crate) fn shown(rows: &[RowMaps]) -> Markup {
    html! {
        @for row in rows {
            h3 { (row.words) }
            @if let [Some(behaviours), Some(controllers)] = row.alike {
                p.lead {
                    "For " (format!("{behaviours:.0}")) " % of the individuals that are not random, the nearest individual on the map of behaviours "
                    "has the same class; on the map of controllers, for " (format!("{controllers:.0}")) " %."
                }
            }
            div.maps {
                @for (what, picture) in [("behaviours", &row.behaviours), ("controllers", &row.controllers)] {
                    figure {
                        img loading="lazy" alt={ "Map of " (what) ": " (row.words) } src={ "data:image/svg+xml;base64," (STANDARD.encode(&picture.svg)) };
                    }
                }
                figure {
                    img loading="lazy" alt={ "Histogram of heuristic scores: " (row.words) } src={ "data:image/svg+xml;base64," (STANDARD.encode(&row.scores)) };
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_files_are_plain() {
        assert_eq!(
            file_name("single sensor · Latent + labels"),
            "single-sensor-latent-labels"
        );
        assert_eq!(file_name("../x"), "x");
    }
}
