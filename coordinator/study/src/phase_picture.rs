//! The picture of phase diagrams: SVG that prints at any size and needs no other files.
//!
//! A diagram over two axes has a map of the most frequent classes, then a map for each class with contour lines of the class's
//! share. A diagram over one axis has a line for each class.

use crate::{contours::Grid, phase::PhaseDiagram, study::Axis};
use maud::{Markup, html};
use murmuration_model::colours::{self, PAPER, class_colour};
use murmuration_report::svg::{Drawing, INK, MUTED, percent_grid, tenth};
use murmuration_swarm::Class;
use std::{collections::BTreeMap, fmt::Write as _};

/// Sides of the plot of a panel, and the space around it; pixels.
const WIDTH: f64 = 260.0;
const HEIGHT: f64 = 190.0;
const LEFT: f64 = 62.0;
const TOP: f64 = 34.0;
const RIGHT: f64 = 14.0;
const BOTTOM: f64 = 46.0;
/// Width of the classes' names beside lines.
const LEGEND: f64 = 130.0;
/// Height of the title of a diagram.
const TITLE: f64 = 34.0;
/// Number of panels side by side.
const PANELS: usize = 3;
/// Smallest share with which a class gets a panel, percent.
const LEAST: f64 = 10.0;
/// Shares with a contour line, percent, and the width of the line.
const LEVELS: [(f64, f64); 3] = [(25.0, 0.8), (50.0, 1.8), (75.0, 0.8)];

/// The picture of all diagrams of a study, one below the other; `None` without diagrams.
pub(crate) fn svg(title: &str, diagrams: &[PhaseDiagram<'_>]) -> Option<String> {
    let panels: Vec<Vec<Markup>> = diagrams.iter().map(panels).collect();
    let most = panels.iter().map(Vec::len).max()?;
    let [panel_width, panel_height] = [LEFT + WIDTH + RIGHT, TOP + HEIGHT + BOTTOM];
    let heights: Vec<f64> = panels
        .iter()
        .map(|panels| TITLE + panels.len().div_ceil(PANELS) as f64 * panel_height)
        .collect();
    let legend = if diagrams.iter().any(|diagram| diagram.y.is_none()) {
        LEGEND
    } else {
        0.0
    };
    let width = most.min(PANELS) as f64 * panel_width + legend;
    let height: f64 = heights.iter().sum();
    let tops = heights.iter().scan(0.0, |top, height| {
        let this = *top;
        *top += height;
        Some(this)
    });
    let drawing = Drawing {
        size: [width, height],
        font_size: 12,
        title,
        label: None,
        paper: &colours::hex(PAPER),
        shrinks: false,
    };
    let content = html! {
        @for ((diagram, panels), top) in diagrams.iter().zip(&panels).zip(tops) {
            text x=(LEFT) y=(top + 24.0) font-size="16" font-weight="bold" { (heading(title, diagram)) }
            @for (place, panel) in panels.iter().enumerate() {
                @let [column, row] = [place % PANELS, place / PANELS];
                g transform={ "translate(" (column as f64 * panel_width + LEFT) " " (top + TITLE + row as f64 * panel_height + TOP) ")" } {
                    (panel)
                }
            }
        }
    };
    Some(drawing.with(&content).into_string())
}

fn heading(title: &str, diagram: &PhaseDiagram<'_>) -> String {
    match diagram.of.is_empty() {
        true => title.to_owned(),
        false => format!("{title}: {}", diagram.of.join(", ")),
    }
}

/// The panels of a diagram, each with its plot's upper left corner at (0, 0).
fn panels(diagram: &PhaseDiagram<'_>) -> Vec<Markup> {
    let Some(y) = diagram.y else {
        return vec![lines(diagram)];
    };
    let classes = diagram.classes(LEAST);
    let of_classes = classes.iter().map(|&class| of_class(diagram, y, class));
    [most_frequent(diagram, y)]
        .into_iter()
        .chain(of_classes)
        .collect()
}

/// The most frequent class of each cell: the smaller the class's share, the paler its colour.
fn most_frequent(diagram: &PhaseDiagram<'_>, y: &Axis) -> Markup {
    let most = |cell: &BTreeMap<Class, f64>| {
        // `max_by` returns the last of several equal maxima, so `rev` puts the first class last.
        let most = cell
            .iter()
            .rev()
            .max_by(|(_, one), (_, other)| one.total_cmp(other));
        most.map(|(&class, &share)| (class, share))
    };
    panel("most frequent class", diagram, y, most, html! {})
}

/// The share of a class, with its contour lines.
fn of_class(diagram: &PhaseDiagram<'_>, y: &Axis, class: Class) -> Markup {
    let share = |cell: &BTreeMap<Class, f64>| cell.get(&class).map(|&share| (class, share));
    let [step_x, step_y] = steps(diagram, y);
    let grid = Grid::new(diagram.x.values.len(), diagram.shares(class));
    let contour = |level: f64| {
        let mut path = String::new();
        for [from, to] in grid.iter().flat_map(|grid| grid.contour(level)) {
            let [[x1, y1], [x2, y2]] = [from, to].map(|[column, row]| {
                [
                    tenth((column + 0.5) * step_x),
                    tenth(HEIGHT - (row + 0.5) * step_y),
                ]
            });
            // Writing to a text cannot fail.
            let _ = write!(path, "M{x1} {y1}L{x2} {y2}");
        }
        path
    };
    let contours = html! {
        g fill="none" stroke=(INK) {
            @for (level, width) in LEVELS {
                @let path = contour(level);
                @if !path.is_empty() { path d=(path) stroke-width=(width) {} }
            }
        }
    };
    panel(&class.words(), diagram, y, share, contours)
}

fn steps(diagram: &PhaseDiagram<'_>, y: &Axis) -> [f64; 2] {
    [
        WIDTH / diagram.x.values.len().max(1) as f64,
        HEIGHT / y.values.len().max(1) as f64,
    ]
}

/// A map: each cell has the colour of a class, as strong as the share of the class, and shows that share.
fn panel(
    name: &str,
    diagram: &PhaseDiagram<'_>,
    y: &Axis,
    of: impl Fn(&BTreeMap<Class, f64>) -> Option<(Class, f64)>,
    over: Markup,
) -> Markup {
    let [step_x, step_y] = steps(diagram, y);
    let cells = diagram.rows().enumerate().flat_map(|(row, cells)| {
        let cells = cells.iter().enumerate();
        cells
            .filter_map(|(column, cell)| Some(([column, row], of(cell)?)))
            // A tint below half a percent looks like white paper.
            .filter(|(_, (_, share))| *share >= 0.5)
            .collect::<Vec<_>>()
    });
    let cells: Vec<_> = cells.collect();
    html! {
        text y="-10" font-weight="bold" { (name) }
        @for ([column, row], (class, share)) in &cells {
            rect x=(tenth(*column as f64 * step_x)) y=(tenth(HEIGHT - (*row as f64 + 1.0) * step_y))
                width=(tenth(step_x)) height=(tenth(step_y)) fill=(colours::hex(tint(*class, *share))) {}
        }
        (over)
        g font-size="10" text-anchor="middle" {
            @for ([column, row], (_, share)) in &cells {
                text x=(tenth((*column as f64 + 0.5) * step_x)) y=(tenth(HEIGHT - (*row as f64 + 0.5) * step_y + 3.5)) { (share.round()) }
            }
        }
        (frame())
        (ticks(diagram.x))
        g text-anchor="end" fill=(MUTED) {
            @for (place, value) in y.values.iter().enumerate() {
                text x="-6" y=(tenth(HEIGHT - (place as f64 + 0.5) * step_y + 4.0)) { (value) }
            }
        }
        text transform={ "rotate(-90)" } x=(-HEIGHT / 2.0) y="-44" text-anchor="middle" { (y.name) }
    }
}

/// A line for each class over one axis.
fn lines(diagram: &PhaseDiagram<'_>) -> Markup {
    let step = WIDTH / diagram.x.values.len().max(1) as f64;
    let y = |share: f64| tenth(HEIGHT * (1.0 - share / 100.0));
    let path = |class: Class| {
        let mut path = String::new();
        let mut pen = 'M';
        for (place, share) in diagram.shares(class).into_iter().enumerate() {
            match share {
                Some(share) => {
                    // Writing to a text cannot fail.
                    let _ = write!(path, "{pen}{} {}", tenth((place as f64 + 0.5) * step), y(share));
                    pen = 'L';
                }
                None => pen = 'M',
            }
        }
        path
    };
    let classes = diagram.classes(LEAST);
    html! {
        (percent_grid([0.0, WIDTH], y))
        g fill="none" stroke-width="2.2" stroke-linejoin="round" {
            @for &class in &classes { path d=(path(class)) stroke=(colours::hex(class_colour(class))) {} }
        }
        @for (place, class) in classes.iter().enumerate() {
            rect x=(WIDTH + 12.0) y=(18.0 * place as f64) width="11" height="11" rx="2" fill=(colours::hex(class_colour(*class))) {}
            text x=(WIDTH + 28.0) y=(18.0 * place as f64 + 10.0) { (class.words()) }
        }
        (frame())
        (ticks(diagram.x))
        text transform="rotate(-90)" x=(-HEIGHT / 2.0) y="-44" text-anchor="middle" { "share of all trials, %" }
    }
}

fn frame() -> Markup {
    html! { rect width=(WIDTH) height=(HEIGHT) fill="none" stroke=(MUTED) stroke-width="0.8" {} }
}

/// The numbers of the axis from left to right, as many as fit, and the name of the axis.
fn ticks(axis: &Axis) -> Markup {
    let step = WIDTH / axis.values.len().max(1) as f64;
    let longest = axis.values.iter().map(|value| value.chars().count()).max();
    let every = (7.0 * longest.unwrap_or(1) as f64 / step).ceil().max(1.0) as usize;
    html! {
        g text-anchor="middle" fill=(MUTED) {
            @for (place, value) in axis.values.iter().enumerate().step_by(every) {
                text x=(tenth((place as f64 + 0.5) * step)) y=(HEIGHT + 16.0) { (value) }
            }
        }
        text x=(WIDTH / 2.0) y=(HEIGHT + 35.0) text-anchor="middle" { (axis.name) }
    }
}

/// A class's colour, as strong as a share, percent.
fn tint(class: Class, share: f64) -> colours::Rgb {
    colours::over(class_colour(class), (2.55 * share).round() as u8, PAPER)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Corrections, JudgedTrials, Outcome, Study, sample};
    use murmuration_swarm::Verdict;
    use std::path::Path;

    /// A study in which swarms of six robots mill, and swarms of twelve robots are of the class `random`.
    fn outcome(phase: &str) -> Outcome {
        let text = format!(
            "name = \"p\"\nmeasures = [\"shares\"]\nphase = {{ {phase} }}\n\
             axes = [\n\
             {{ name = \"robots\", field = \"world.agents\", numbers = [6, 12] }},\n\
             {{ name = \"slip\", field = \"world.noise.slip\", numbers = [0, 0.5] }}]\n\
             [campaign]\nmodel = \"single-sensor\"\nmethod = \"random\"\nevaluation.judge = true"
        );
        let study = Study::from_toml(&text, Path::new("/"), false).unwrap();
        let measured = |place: usize| {
            let class = if place < 2 { Class::Milling } else { Class::Random };
            let mut measured = sample::measured(&study, place, &[]);
            measured.behaviours = None;
            measured.shares = Some(JudgedTrials::from_iter([Verdict::Class(class)]));
            Some(measured)
        };
        let all = (0..4).map(measured).collect();
        Outcome::new(study.clone(), all, Corrections::default())
    }

    fn drawn(phase: &str) -> String {
        svg("p", &outcome(phase).phase_diagrams()).unwrap()
    }

    #[test]
    fn two_axes_make_maps_with_contours() {
        let picture = drawn("x = \"robots\", y = \"slip\"");
        for name in ["most frequent class", ">milling<", ">random<"] {
            assert_eq!(picture.matches(name).count(), 1, "{name}");
        }
        assert!(!picture.contains("dispersal"), "no cell shows it");
        // Each class's map has a line at each level, half of the way from the first column to the second.
        assert_eq!(picture.matches("<path").count(), 2 * LEVELS.len());
        let middle = format!("M{0} {1}L{0} {2}", WIDTH / 2.0, 0.75 * HEIGHT, 0.25 * HEIGHT);
        let upwards = format!("M{0} {2}L{0} {1}", WIDTH / 2.0, 0.75 * HEIGHT, 0.25 * HEIGHT);
        assert!(
            picture.contains(&middle) || picture.contains(&upwards),
            "{picture}"
        );
        let whole = colours::hex(class_colour(Class::Milling));
        assert_eq!(picture.matches(&format!("fill=\"{whole}\"")).count(), 4);
    }

    #[test]
    fn one_axis_makes_a_line_for_each_class_and_others_make_diagrams() {
        let picture = drawn("x = \"robots\"");
        assert_eq!(picture.matches("p: slip = ").count(), 2);
        assert_eq!(picture.matches("<path").count(), 2 * 2);
        // The line falls from all trials at six robots to no trials at twelve robots.
        let down = format!("M{} 0L{} {HEIGHT}", WIDTH / 4.0, WIDTH * 0.75);
        assert_eq!(picture.matches(&down).count(), 2);
    }

    #[test]
    fn a_study_without_diagrams_has_no_picture() {
        assert_eq!(svg("p", &[]), None);
    }
}
