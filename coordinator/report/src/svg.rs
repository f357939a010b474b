//! Common parts of SVG drawings: their head, their colours, and the grid of percentages.

use maud::{Markup, html};

/// Colour of text and of main lines.
pub const INK: &str = "#1d1d1b";
/// Colour of secondary text.
pub const MUTED: &str = "#5f5e58";
/// The colour of grids and frames.
pub const GRID: &str = "#e4e1d8";
/// White background, for papers.
pub const WHITE: &str = "#fff";

/// The frame of a drawing: its size, its title and its background.
#[derive(Debug, Clone, Copy)]
pub struct Drawing<'a> {
    /// Width and height, in pixels.
    pub size: [f64; 2],
    /// Size of the drawing's text, in pixels.
    pub font_size: u32,
    /// The title that a browser shows if it shows the drawing alone.
    pub title: &'a str,
    /// The description for people who cannot see the drawing; `None` if text in the drawing describes it.
    pub label: Option<&'a str>,
    pub paper: &'a str,
    /// Whether the drawing shrinks to the width of its page.
    pub shrinks: bool,
}

impl Drawing<'_> {
    /// The drawing with this content. The drawing needs no other file, and can be printed at any size.
    pub fn with(&self, content: &Markup) -> Markup {
        let [width, height] = self.size;
        let role = self.label.map(|_| "img");
        let style = self.shrinks.then_some("max-width: 100%; height: auto");
        html! {
            svg xmlns="http://www.w3.org/2000/svg" viewBox={ "0 0 " (width) " " (height) } width=(width) height=(height)
                role=[role] aria-label=[self.label] font-family="sans-serif" font-size=(self.font_size) fill=(INK) style=[style] {
                title { (self.title) }
                rect width="100%" height="100%" fill=(self.paper) {}
                (content)
            }
        }
    }
}

/// Horizontal lines at 0, 25, 50, 75 and 100 percent from `left` to `right`, each with its number. `y` returns the vertical
/// position of a percentage.
pub fn percent_grid([left, right]: [f64; 2], y: impl Fn(f64) -> f64) -> Markup {
    html! {
        @for percent in [0.0, 25.0, 50.0, 75.0, 100.0] {
            line x1=(left) x2=(right) y1=(y(percent)) y2=(y(percent)) stroke=(GRID) {}
            text x=(left - 5.0) y=(y(percent) + 4.0) text-anchor="end" fill=(MUTED) { (percent) }
        }
    }
}

/// Rounds pixels to a tenth: nobody can see the difference, and the rounding keeps files small.
pub fn tenth(pixels: f64) -> f64 {
    (10.0 * pixels).round() / 10.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drawing_has_its_title_and_is_an_image_only_with_a_label() {
        let drawing = Drawing {
            size: [30.0, 20.5],
            font_size: 12,
            title: "A & B",
            label: None,
            paper: WHITE,
            shrinks: false,
        };
        let plain = drawing.with(&html! {}).into_string();
        assert!(plain.contains("viewBox=\"0 0 30 20.5\"") && plain.contains("<title>A &amp; B</title>"));
        assert!(!plain.contains("role=") && !plain.contains("style="));
        let labelled = Drawing {
            label: Some("what it shows"),
            ..drawing
        };
        let labelled = labelled.with(&html! {}).into_string();
        assert!(labelled.contains("role=\"img\" aria-label=\"what it shows\""));
    }
}
