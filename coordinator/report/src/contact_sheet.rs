//! The contact sheet: the paths of all behaviours of a taxonomy in one figure, as in a paper.

use super::{
    MedoidEntry, Report,
    card::{CardName, quality},
    numbers::percent,
    picture::{Bodies, trajectory_svg},
};
use maud::{Markup, PreEscaped, html};
use murmuration_swarm::text::beginning;
use std::fmt::Write as _;

/// Side of a behaviour's square, in units of the figure.
const SIDE: f64 = 240.0;
/// Height of a line of the caption under the square, and of the whole caption.
const LINE: f64 = 21.0;
const CAPTION: f64 = 2.0 * LINE + 6.0;
/// Space between two behaviours, and around the block of all behaviours.
const GAP: f64 = 14.0;
/// Maximum number of characters of a name in a caption, after the number.
const MOST_OF_NAME: usize = 20;
/// Maximum number of behaviours in a row.
const MOST_ABREAST: usize = 8;

/// The sheet as SVG, row by row, the behaviour of the largest cluster first. The caption of a behaviour has what the first two
/// lines of its card have: its number and name, and the share, the purity and the robustness of its cluster.
pub(super) fn svg(report: &Report) -> String {
    let columns = columns(report.medoids.len());
    let rows = report.medoids.len().div_ceil(columns);
    let width = GAP + columns as f64 * (SIDE + GAP);
    let height = GAP + rows as f64 * (SIDE + CAPTION + GAP);
    let mut sheet = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" \
         font-family=\"system-ui, sans-serif\" font-size=\"15\">\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n"
    );
    for (place, medoid) in report.medoids.iter().enumerate() {
        let left = GAP + (place % columns) as f64 * (SIDE + GAP);
        let top = GAP + (place / columns) as f64 * (SIDE + CAPTION + GAP);
        sheet += &behaviour(report, place, medoid, [left, top]).into_string();
        sheet.push('\n');
    }
    sheet + "</svg>\n"
}

/// Maximum size in bytes of a sheet that is embedded in a page.
const MOST_IN_PAGE: usize = 2 << 20;

/// The sheet as a data address, for a download in a page; `None` if the sheet is too large for a page.
pub(super) fn address(report: &Report) -> Option<String> {
    let sheet = svg(report);
    (sheet.len() <= MOST_IN_PAGE).then(|| {
        let mut address = "data:image/svg+xml,".to_owned();
        for byte in sheet.bytes() {
            // Most of a sheet consists of the characters of paths, which need no escape.
            if byte.is_ascii_alphanumeric() || b" .,:;/()='-_".contains(&byte) {
                address.push(byte.into());
            } else {
                // Writing to a string cannot fail.
                let _ = write!(address, "%{byte:02X}");
            }
        }
        address
    })
}

/// The paths of one behaviour as SVG, one unit per world unit.
pub(super) fn paths(report: &Report, medoid: &MedoidEntry) -> String {
    let (world, window) = (report.spec.world(), report.spec.image().window());
    let controller = &report.individuals[medoid.index as usize].controller;
    let bodies = Bodies::of(controller, world);
    trajectory_svg(&medoid.replay, world, bodies.colouring(), window)
}

/// Number of columns for a block of behaviours that is as square as possible, up to [`MOST_ABREAST`].
fn columns(count: usize) -> usize {
    (1..MOST_ABREAST)
        .find(|columns| columns * columns >= count)
        .unwrap_or(MOST_ABREAST)
}

fn behaviour(report: &Report, place: usize, medoid: &MedoidEntry, [left, top]: [f64; 2]) -> Markup {
    let world = report.spec.world();
    let scale = SIDE / world.width().max(world.height());
    let share = percent(medoid.cluster_size, report.individuals.len() as u64);
    let name = report.card_name(place);
    let shown = name.as_ref().map(|name| {
        let short = CardName {
            name: beginning(&name.name, MOST_OF_NAME).into_owned(),
            by: name.by,
        };
        (name.shown(), short.shown())
    });
    let is_unsure = name.is_some_and(|name| !name.is_sure());
    html! {
        g transform={ "translate(" (left) " " (top) ")" } {
            @if let Some((whole, _)) = &shown { title { (whole) } }
            g transform={ "scale(" (scale) ")" } { (PreEscaped(paths(report, medoid))) }
            text y=(SIDE + LINE) fill="#222" {
                tspan font-weight="bold" { (place + 1) }
                @if let Some((_, short)) = &shown {
                    tspan fill=[is_unsure.then_some("#666")] font-style=[is_unsure.then_some("italic")] { " " (short) }
                }
            }
            text y=(SIDE + 2.0 * LINE) fill="#666" font-size="11.5" { (share) (quality(report.purity(place), report.robust_trials(medoid))) }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample::{self, SMALL};
    use murmuration_model::labels::{ClassName, GivenClass};
    use murmuration_swarm::{Class, Verdict};

    #[test]
    fn all_behaviours_are_on_the_sheet_with_numbers_classes_and_shares() {
        let mut report = sample::report(&SMALL);
        let class: ClassName = "ring_of_few".parse().unwrap();
        report.names.classes[0].name = class.clone();
        let by_machine = false;
        let given = GivenClass { class, by_machine };
        report.names.by_individual.insert(report.medoids[0].index, given);
        let sheet = svg(&report);
        assert_eq!(sheet.matches("viewBox").count(), 1 + report.medoids.len());
        for (place, medoid) in report.medoids.iter().enumerate() {
            let number = format!("<tspan font-weight=\"bold\">{}</tspan>", place + 1);
            assert!(sheet.contains(&number), "{number}");
            let share = percent(medoid.cluster_size, report.individuals.len() as u64);
            assert!(sheet.contains(&share), "{share}");
        }
        assert!(
            sheet.contains("</tspan><tspan> ring of few</tspan></text>"),
            "{sheet}"
        );
        assert_eq!(sheet.matches("<svg").count(), sheet.matches("</svg>").count());
    }

    #[test]
    fn a_name_that_nobody_gave_is_grey_with_a_question_mark() {
        let mut report = sample::report(&SMALL);
        report.names = crate::Names::default();
        report.judged.medoids = vec![Verdict::Class(Class::Milling); report.medoids.len()];
        let sheet = svg(&report);
        let name = "<tspan fill=\"#666\" font-style=\"italic\"> milling?</tspan>";
        assert_eq!(sheet.matches(name).count(), report.medoids.len(), "{sheet}");
    }

    #[test]
    fn a_long_name_is_cut_and_said_whole_by_a_title() {
        let mut report = sample::report(&SMALL);
        let class: ClassName = "w".repeat(60).parse().unwrap();
        report.names.classes[0].name = class.clone();
        let by_machine = false;
        let given = GivenClass { class, by_machine };
        report.names.by_individual.insert(report.medoids[0].index, given);
        let sheet = svg(&report);
        assert!(
            sheet.contains(&format!("<title>{}</title>", "w".repeat(60))),
            "{sheet}"
        );
        assert!(
            sheet.contains(&format!("<tspan> {}…</tspan>", "w".repeat(MOST_OF_NAME))),
            "{sheet}"
        );
    }

    #[test]
    fn the_address_of_a_sheet_is_read_back_as_the_sheet() {
        let report = sample::report(&SMALL);
        let address = address(&report).unwrap();
        let mut parts = address.strip_prefix("data:image/svg+xml,").unwrap().split('%');
        let mut read = parts.next().unwrap().as_bytes().to_vec();
        for part in parts {
            read.push(u8::from_str_radix(&part[..2], 16).unwrap());
            read.extend(part[2..].bytes());
        }
        assert_eq!(String::from_utf8(read).unwrap(), svg(&report));
        assert!(!address.contains(['"', '<', '&', '#']));
    }

    #[test]
    fn sheets_are_nearly_square() {
        assert_eq!(
            [1, 2, 4, 5, 12, 16, 64, 1000].map(columns),
            [1, 2, 2, 3, 4, 4, 8, 8]
        );
    }
}
