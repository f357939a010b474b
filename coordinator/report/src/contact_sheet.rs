//! The contact sheet: the paths of all behaviours of a taxonomy in one figure, as a paper shows them.

use super::{
    MedoidEntry, Report,
    numbers::percent,
    picture::{Bodies, trajectory_svg},
};
use maud::{Markup, PreEscaped, html};
use std::io::{self, Write};

/// Side of a behaviour's square, in units of the figure.
const SIDE: f64 = 240.0;
/// Height of the line under it.
const CAPTION: f64 = 30.0;
/// Between two behaviours, and around all.
const GAP: f64 = 14.0;
/// Most behaviours in a row.
const MOST_ABREAST: usize = 8;

/// Writes the sheet as SVG: the largest cluster first, row by row, each behaviour with its number, its name if it has one, and
/// the share of the archive that is in its cluster.
pub(super) fn write(report: &Report, file: &mut dyn Write) -> io::Result<()> {
    let columns = columns(report.medoids.len());
    let rows = report.medoids.len().div_ceil(columns);
    let width = GAP + columns as f64 * (SIDE + GAP);
    let height = GAP + rows as f64 * (SIDE + CAPTION + GAP);
    writeln!(
        file,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" \
         font-family=\"system-ui, sans-serif\" font-size=\"15\">\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>"
    )?;
    for (place, medoid) in report.medoids.iter().enumerate() {
        let left = GAP + (place % columns) as f64 * (SIDE + GAP);
        let top = GAP + (place / columns) as f64 * (SIDE + CAPTION + GAP);
        writeln!(
            file,
            "{}",
            behaviour(report, (place, medoid), [left, top]).into_string()
        )?;
    }
    writeln!(file, "</svg>")
}

/// The paths of one behaviour as SVG, a unit for each world unit.
pub(super) fn paths(report: &Report, medoid: &MedoidEntry) -> String {
    let (world, window) = (report.spec.world(), report.spec.image().window());
    let controller = &report.individuals[medoid.index as usize].controller;
    let bodies = Bodies::of(controller, world);
    trajectory_svg(&medoid.replay, world, bodies.colouring(), window)
}

/// As near to a square of behaviours as there is, up to [`MOST_ABREAST`] in a row.
fn columns(count: usize) -> usize {
    (1..MOST_ABREAST)
        .find(|columns| columns * columns >= count)
        .unwrap_or(MOST_ABREAST)
}

fn behaviour(report: &Report, (place, medoid): (usize, &MedoidEntry), [left, top]: [f64; 2]) -> Markup {
    let world = report.spec.world();
    let scale = SIDE / world.width().max(world.height());
    let share = percent(medoid.cluster_size, report.individuals.len() as u64);
    let class = report.name_of(place).map(|name| name.class.shown());
    html! {
        g transform={ "translate(" (left) " " (top) ")" } {
            g transform={ "scale(" (scale) ")" } { (PreEscaped(paths(report, medoid))) }
            text y=(SIDE + 0.7 * CAPTION) fill="#222" {
                tspan font-weight="bold" { (place + 1) }
                @if let Some(class) = class { " " (class) }
                tspan fill="#666" { " " (share) }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample::{self, SMALL};
    use murmuration_model::labels::{ClassName, GivenClass};

    #[test]
    fn all_behaviours_are_on_the_sheet_with_numbers_classes_and_shares() {
        let mut report = sample::report(&SMALL);
        let class: ClassName = "ring_of_few".parse().unwrap();
        report.names.classes[0].name = class.clone();
        let by_machine = false;
        let given = GivenClass { class, by_machine };
        report.names.by_individual.insert(report.medoids[0].index, given);
        let mut sheet = Vec::new();
        write(&report, &mut sheet).unwrap();
        let sheet = String::from_utf8(sheet).unwrap();
        assert_eq!(sheet.matches("viewBox").count(), 1 + report.medoids.len());
        for (place, medoid) in report.medoids.iter().enumerate() {
            let number = format!("<tspan font-weight=\"bold\">{}</tspan>", place + 1);
            assert!(sheet.contains(&number), "{number}");
            let share = percent(medoid.cluster_size, report.individuals.len() as u64);
            assert!(sheet.contains(&share), "{share}");
        }
        assert!(sheet.contains("</tspan> ring of few<tspan"), "{sheet}");
        assert_eq!(sheet.matches("<svg").count(), sheet.matches("</svg>").count());
    }

    #[test]
    fn sheets_are_nearly_square() {
        assert_eq!(
            [1, 2, 4, 5, 12, 16, 64, 1000].map(columns),
            [1, 2, 2, 3, 4, 4, 8, 8]
        );
    }
}
