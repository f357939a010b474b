//! The figure of a paper: the paths of chosen behaviours, at the width of a column or of a page, as SVG, PDF or PNG.
//!
//! Lengths are in points (1/72 inch), so that text has the size on paper that journals ask for.

mod options;
mod panel;

use crate::{
    Report, ReportError,
    figure::{Anchor, Figure, INK, MM_PER_POINT, MUTED, Shape, Unit, Words, width_of},
    numbers::percent,
    picture::PictureError,
};
use murmuration_swarm::Invalid;
pub use options::{Behaviours, Columns, Labels, MOST_BEHAVIOURS, Options, Width};
use panel::{Area, Place};
use rayon::prelude::*;

/// Size of the text, and height of a line of text.
const TEXT: f64 = 7.5;
const LINE: f64 = 9.0;
/// Distance from the paths to the text.
const SPACE: f64 = 2.0;
/// Space between two behaviours, across and down.
const GAP: f64 = 6.0;
/// Maximum number of lines of a label.
const MOST_LINES: usize = 2;

/// Width of a behaviour that the number of columns is chosen for, and minimum width for many behaviours.
const WANTED: f64 = 28.0 / MM_PER_POINT;
const LEAST: f64 = 10.0 / MM_PER_POINT;
/// Height of a page's text. Behaviours become smaller, down to [`LEAST`], until the figure fits.
const PAGE: f64 = 240.0 / MM_PER_POINT;
/// Minimum width of a behaviour, and maximum height of a figure, in millimetres.
const NARROWEST_MM: f64 = 5.0;
const HIGHEST_MM: f64 = 1000.0;
/// Pixels per point of a PNG: 300 per inch.
const PIXELS: f32 = 300.0 / 72.0;

/// The format of a figure's file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    Svg,
    Pdf,
    /// 300 pixels per inch.
    Png,
}

impl Format {
    pub const ALL: [Self; 3] = [Self::Svg, Self::Pdf, Self::Png];

    /// The ending of the names of files of this format.
    #[must_use]
    pub const fn ending(self) -> &'static str {
        match self {
            Self::Svg => "svg",
            Self::Pdf => "pdf",
            Self::Png => "png",
        }
    }
}

/// Why there is no figure.
#[derive(Debug, thiserror::Error)]
pub enum FigureError {
    /// The options do not fit the taxonomy or each other.
    #[error(transparent)]
    Options(#[from] Invalid),
    #[error(transparent)]
    Report(#[from] ReportError),
    #[error("cannot write the figure: {0}")]
    Picture(#[from] PictureError),
}

/// A figure that is drawn.
pub struct PaperFigure {
    figure: Figure,
    /// The behaviours in the order of the figure.
    pub panels: Vec<Panel>,
}

/// One behaviour of a figure.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// The number of the behaviour in the report, from 1.
    pub behaviour: usize,
    /// Its label in the figure.
    pub label: Option<String>,
    /// Its name, with a question mark unless a person gave the name.
    pub name: Option<String>,
    /// The share of its cluster in the archive, 0 to 1.
    pub share: f64,
}

impl PaperFigure {
    /// Draws the figure. The `report` needs no pictures of individuals for it.
    ///
    /// # Errors
    /// [`FigureError::Options`] if a behaviour does not exist, or if the behaviours would be too narrow or the figure too high;
    /// [`FigureError::Report`] if the report does not fit together.
    pub fn draw(report: &Report, options: &Options) -> Result<Self, FigureError> {
        crate::check(report)?;
        let panels = panels(report, options)?;
        let layout = Layout::of(report, options, &panels)?;
        let figure = Figure {
            size: layout.size(panels.len()),
            unit: Unit::Point,
            title: format!("Behaviours of {}", report.campaign),
            paper: [0xff; 3],
            shapes: layout.shapes(report, &panels),
        };
        Ok(Self { figure, panels })
    }

    /// The bytes of a file of this format.
    ///
    /// # Errors
    /// [`FigureError::Picture`] if a PNG would be too large.
    pub fn file(&self, format: Format) -> Result<Vec<u8>, FigureError> {
        Ok(match format {
            Format::Svg => self.figure.svg()?.into_bytes(),
            Format::Pdf => self.figure.pdf(),
            Format::Png => self.figure.png(PIXELS)?,
        })
    }

    /// Width and height on paper, in millimetres.
    #[must_use]
    pub fn size_mm(&self) -> [f64; 2] {
        self.figure
            .size
            .map(|side| (10.0 * side * MM_PER_POINT).round() / 10.0)
    }
}

fn panels(report: &Report, options: &Options) -> Result<Vec<Panel>, Invalid> {
    let places = match &options.behaviours {
        Some(behaviours) => behaviours.places(report.medoids.len())?,
        None => report.folding().0,
    };
    // A taxonomy can have more distinct behaviours than a figure.
    if places.len() > MOST_BEHAVIOURS {
        Behaviours::new(places.iter().map(|place| place + 1).collect())?;
    }
    let panel = |(position, place): (usize, usize)| {
        let behaviour = place + 1;
        let name = report.card_name(place).map(|name| name.shown());
        Panel {
            behaviour,
            label: match options.labels {
                Labels::Letters => Some(letters(position)),
                Labels::Numbers => Some(behaviour.to_string()),
                Labels::Names => Some(name.clone().unwrap_or_else(|| format!("behaviour {behaviour}"))),
                Labels::None => None,
            },
            name,
            share: report.medoids[place].cluster_size as f64 / report.individuals.len().max(1) as f64,
        }
    };
    Ok(places.into_iter().enumerate().map(panel).collect())
}

/// The letters of a position: a to z, then aa, ab and so on.
fn letters(position: usize) -> String {
    let letter = char::from(b'a' + (position % 26) as u8);
    match position / 26 {
        0 => letter.to_string(),
        more => format!("{}{letter}", letters(more - 1)),
    }
}

/// The places of behaviours and their text.
struct Layout {
    columns: usize,
    /// Width and height of a behaviour.
    side: [f64; 2],
    /// The lines of each behaviour's label, with the share of its cluster, if the figure has shares.
    labels: Vec<(Vec<String>, Option<String>)>,
    /// Height of the labels; 0 without labels.
    text: f64,
    /// Whether labels are above the behaviours, as letters are in papers.
    above: bool,
    bold: bool,
}

impl Layout {
    fn of(report: &Report, options: &Options, panels: &[Panel]) -> Result<Self, Invalid> {
        let width = options.width.millimetres() / MM_PER_POINT;
        let with = |columns| Self::with(report, options, panels, width, columns);
        let layout = match options.columns {
            Some(columns) => with(columns.get().min(panels.len())),
            None => {
                let most = panels.len();
                let mut columns = ((width / WANTED).round() as usize).clamp(1, most);
                while columns < most
                    && with(columns).size(panels.len())[1] > PAGE
                    && across(width, columns + 1) >= LEAST
                {
                    columns += 1;
                }
                // With as many rows, fewer columns have larger behaviours and a fuller last row.
                with(panels.len().div_ceil(panels.len().div_ceil(columns)))
            }
        };
        layout.check(options, panels.len())?;
        Ok(layout)
    }

    fn with(report: &Report, options: &Options, panels: &[Panel], width: f64, columns: usize) -> Self {
        let side = across(width, columns);
        let bold = matches!(options.labels, Labels::Letters | Labels::Numbers);
        let label = |panel: &Panel| {
            let share = options.shares.then(|| share_of(report, panel));
            let taken = share
                .as_ref()
                .map_or(0.0, |share| width_of(share, TEXT, false) + GAP);
            let words = panel.label.as_deref().unwrap_or_default();
            (wrapped(words, [side - taken, side], bold), share)
        };
        let labels: Vec<_> = panels.iter().map(label).collect();
        let lines = labels
            .iter()
            .map(|(lines, share)| lines.len().max(usize::from(share.is_some())))
            .max()
            .unwrap_or(0);
        Self {
            columns,
            side: [side, side * Area::of(report.spec.world()).height()],
            labels,
            text: match lines {
                0 => 0.0,
                lines => SPACE + LINE * lines as f64,
            },
            above: options.labels == Labels::Letters,
            bold,
        }
    }

    fn check(&self, options: &Options, count: usize) -> Result<(), Invalid> {
        if self.side[0] * MM_PER_POINT < NARROWEST_MM {
            let width = options.width.millimetres();
            return Err(Invalid::new(
                "columns",
                self.columns,
                format!(
                    "fewer, because behaviours would be narrower than {NARROWEST_MM} mm in a figure {width} mm wide"
                ),
            ));
        }
        let height = self.size(count)[1] * MM_PER_POINT;
        match height > HIGHEST_MM {
            true => Err(Invalid::new(
                "behaviours",
                format!("{count} numbers"),
                format!(
                    "fewer, because the figure would be {height:.0} mm high; {HIGHEST_MM} mm are possible. More columns also help"
                ),
            )),
            false => Ok(()),
        }
    }

    fn size(&self, count: usize) -> [f64; 2] {
        let rows = count.div_ceil(self.columns) as f64;
        [
            self.columns as f64 * (self.side[0] + GAP) - GAP,
            rows * (self.side[1] + self.text + GAP) - GAP,
        ]
    }

    fn shapes(&self, report: &Report, panels: &[Panel]) -> Vec<Shape> {
        let drawn = panels.par_iter().enumerate().map(|(position, panel)| {
            let left = (position % self.columns) as f64 * (self.side[0] + GAP);
            let top = (position / self.columns) as f64 * (self.side[1] + self.text + GAP);
            let (paths, text) = match self.above {
                true => (top + self.text, top - SPACE),
                false => (top, top + self.side[1]),
            };
            let place = Place::new(report.spec.world(), [left, paths], self.side[0]);
            let mut shapes = panel::shapes(report, &report.medoids[panel.behaviour - 1], &place);
            shapes.extend(self.words(position, [left, text]).map(Shape::Words));
            shapes
        });
        drawn.flatten_iter().collect()
    }

    /// The label of a behaviour, and the share of its cluster, in lines below `top`.
    fn words(&self, position: usize, [left, top]: [f64; 2]) -> impl Iterator<Item = Words> {
        let (lines, share) = &self.labels[position];
        let baseline = move |line: usize| top + SPACE + LINE * line as f64 + TEXT - 0.5;
        let words = |text: &String, at, anchor| Words {
            text: text.clone(),
            at,
            anchor,
            size: TEXT,
            colour: INK,
            bold: false,
            upwards: false,
        };
        let label = lines.iter().enumerate().map(move |(line, text)| Words {
            bold: self.bold,
            ..words(text, [left, baseline(line)], Anchor::Start)
        });
        let share = share.iter().map(move |share| Words {
            colour: MUTED,
            ..words(share, [left + self.side[0], baseline(0)], Anchor::End)
        });
        label.chain(share)
    }
}

/// Width of a behaviour in a figure of this width.
fn across(width: f64, columns: usize) -> f64 {
    (width + GAP) / columns as f64 - GAP
}

fn share_of(report: &Report, panel: &Panel) -> String {
    let medoid = &report.medoids[panel.behaviour - 1];
    percent(medoid.cluster_size, report.individuals.len() as u64)
}

/// A text in at most [`MOST_LINES`] lines of these widths (the first line, and the others); the end of a longer text is cut.
fn wrapped(text: &str, [first, other]: [f64; 2], bold: bool) -> Vec<String> {
    let fits = |line: &str, lines: usize| {
        let width = if lines == 0 { first } else { other };
        width_of(line, TEXT, bold) <= width
    };
    let mut lines: Vec<String> = Vec::new();
    let mut line = String::new();
    for word in text.split_whitespace() {
        let longer = if line.is_empty() {
            word.to_owned()
        } else {
            format!("{line} {word}")
        };
        let is_last = lines.len() + 1 == MOST_LINES;
        if line.is_empty() || is_last || fits(&longer, lines.len()) {
            line = longer;
        } else {
            lines.push(std::mem::replace(&mut line, word.to_owned()));
        }
    }
    if !line.is_empty() {
        lines.push(line);
    }
    for (place, line) in lines.iter_mut().enumerate() {
        while !fits(line, place) && line.chars().count() > 2 {
            let kept = line.trim_end_matches('…').chars().count() - 1;
            let begun: String = line.chars().take(kept).collect();
            *line = format!("{}…", begun.trim_end());
        }
    }
    lines
}

#[cfg(test)]
mod tests;
