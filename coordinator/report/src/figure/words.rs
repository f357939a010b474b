//! The text of drawings: as real text in an SVG for screens, and otherwise as outlines of an embedded font.

use super::Unit;
use maud::{Markup, html};
use murmuration_model::colours::{self, Rgb};
use skrifa::{
    FontRef, GlyphId, MetadataProvider as _,
    instance::{LocationRef, Size},
    outline::{DrawSettings, OutlinePen},
};
use tiny_skia::{Path, PathBuilder, PathSegment, Point, Transform};

/// The regular and the bold font. Their letters are as wide as those of Arial, and drawings leave room for letters of this width.
/// `fonts/OFL.txt` has their licence.
const FONTS: [&[u8]; 2] = [
    include_bytes!("../../fonts/Arimo-Regular.ttf"),
    include_bytes!("../../fonts/Arimo-Bold.ttf"),
];

pub(crate) struct Words {
    pub(crate) text: String,
    /// The point on the baseline that `anchor` selects.
    pub(crate) at: [f64; 2],
    pub(crate) anchor: Anchor,
    pub(crate) size: f64,
    pub(crate) colour: Rgb,
    pub(crate) bold: bool,
    /// Whether the text runs upwards.
    pub(crate) upwards: bool,
}

#[derive(Clone, Copy)]
pub(crate) enum Anchor {
    Start,
    Middle,
    End,
}

/// The width of a text of this size.
pub(crate) fn width_of(text: &str, size: f64, bold: bool) -> f64 {
    typeset(text, size, bold).map_or(0.0, |(_, glyphs)| {
        glyphs.iter().map(|(_, width)| f64::from(*width)).sum()
    })
}

/// The font, and each letter's glyph and width. A letter that the font does not have becomes the glyph of missing letters.
fn typeset(text: &str, size: f64, bold: bool) -> Option<(FontRef<'static>, Vec<(GlyphId, f32)>)> {
    let font = FontRef::new(FONTS[usize::from(bold)]).ok()?;
    let (letters, widths) = (
        font.charmap(),
        font.glyph_metrics(Size::new(size as f32), LocationRef::default()),
    );
    let glyph = |letter| {
        let glyph = letters.map(letter).unwrap_or(GlyphId::NOTDEF);
        (glyph, widths.advance_width(glyph).unwrap_or(0.0))
    };
    let glyphs = text.chars().map(glyph).collect();
    Some((font, glyphs))
}

impl Words {
    pub(super) fn svg(&self, unit: Unit) -> Markup {
        match unit {
            Unit::Pixel => self.text(),
            Unit::Point => html! {
                g { title { (self.text) } path d=(self.path_data()) fill=(colours::hex(self.colour)) {} }
            },
        }
    }

    /// The words as real text.
    fn text(&self) -> Markup {
        let [x, y] = self.at;
        let anchor = match self.anchor {
            Anchor::Start => None,
            Anchor::Middle => Some("middle"),
            Anchor::End => Some("end"),
        };
        let weight = self.bold.then_some("bold");
        let turned = self.upwards.then(|| format!("rotate(-90 {x} {y})"));
        html! {
            text x=(x) y=(y) font-size=(self.size) fill=(colours::hex(self.colour)) font-weight=[weight] text-anchor=[anchor]
                transform=[turned] { (self.text) }
        }
    }

    /// The outlines of the letters in the coordinates of the drawing, as the data of an SVG path.
    fn path_data(&self) -> String {
        let Some((path, transform)) = self.outlines() else {
            return String::new();
        };
        let Some(path) = path.transform(transform) else {
            return String::new();
        };
        let short = |point: Point| {
            format!(
                "{} {}",
                Unit::Point.short(point.x.into()),
                Unit::Point.short(point.y.into())
            )
        };
        let segment = |segment| match segment {
            PathSegment::MoveTo(to) => format!("M{}", short(to)),
            PathSegment::LineTo(to) => format!("L{}", short(to)),
            PathSegment::QuadTo(by, to) => format!("Q{} {}", short(by), short(to)),
            PathSegment::CubicTo(by, then, to) => format!("C{} {} {}", short(by), short(then), short(to)),
            PathSegment::Close => "Z".to_owned(),
        };
        path.segments().map(segment).collect()
    }

    /// The outlines of the letters about their anchor, and the transform that puts them in the drawing; `None` if the text is blank.
    pub(super) fn outlines(&self) -> Option<(Path, Transform)> {
        let (font, glyphs) = typeset(&self.text, self.size, self.bold)?;
        let (size, location) = (Size::new(self.size as f32), LocationRef::default());
        let all: f32 = glyphs.iter().map(|(_, width)| width).sum();
        let mut pen = Pen {
            path: PathBuilder::new(),
            along: match self.anchor {
                Anchor::Start => 0.0,
                Anchor::Middle => -all / 2.0,
                Anchor::End => -all,
            },
        };
        for (glyph, width) in glyphs {
            if glyph == GlyphId::NOTDEF {
                pen.box_of(width, self.size as f32);
            } else if let Some(outline) = font.outline_glyphs().get(glyph) {
                // An error would omit the letter, but no letter of the embedded font gives an error.
                let _ = outline.draw(DrawSettings::unhinted(size, location), &mut pen);
            }
            pen.along += width;
        }
        let transform = Transform::from_translate(self.at[0] as f32, self.at[1] as f32)
            .pre_rotate(if self.upwards { -90.0 } else { 0.0 });
        Some((pen.path.finish()?, transform))
    }
}

/// Draws the outlines of letters, with y downwards.
struct Pen {
    path: PathBuilder,
    /// Position along the line at which the letter begins.
    along: f32,
}

impl Pen {
    /// Draws a box for a missing letter of this width: the embedded fonts leave it blank.
    fn box_of(&mut self, width: f32, size: f32) {
        let (high, thick) = (0.7 * size, 0.06 * size);
        for inset in [thick, 2.0 * thick] {
            let (left, right) = (self.along + inset, self.along + width - inset);
            let (top, bottom) = (inset - high, -inset);
            // The inner rectangle runs the other way, so that it is a hole.
            let corners = match inset > thick {
                false => [[left, top], [right, top], [right, bottom], [left, bottom]],
                true => [[left, top], [left, bottom], [right, bottom], [right, top]],
            };
            self.path.move_to(corners[0][0], corners[0][1]);
            for [x, y] in &corners[1..] {
                self.path.line_to(*x, *y);
            }
            self.path.close();
        }
    }
}

impl OutlinePen for Pen {
    fn move_to(&mut self, x: f32, y: f32) {
        self.path.move_to(self.along + x, -y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.path.line_to(self.along + x, -y);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        self.path.quad_to(self.along + x1, -y1, self.along + x, -y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        let along = self.along;
        self.path
            .cubic_to(along + x1, -y1, along + x2, -y2, along + x, -y);
    }

    fn close(&mut self) {
        self.path.close();
    }
}
