//! Drawings for papers, as SVG and as PNG. The PNG uses an embedded font instead of the system's fonts, so that the same drawing
//! gives the same bytes on every machine.

use crate::{
    picture::{PictureError, encoded},
    svg::{Drawing, tenth},
};
use base64::{Engine as _, engine::general_purpose::STANDARD};
use maud::{Markup, html};
use murmuration_model::colours::{self, Rgb};
use skrifa::{
    FontRef, GlyphId, MetadataProvider as _,
    instance::{LocationRef, Size},
    outline::{DrawSettings, OutlinePen},
};
use tiny_skia::{
    Color, FillRule, FilterQuality, Paint, PathBuilder, Pixmap, PixmapPaint, PremultipliedColorU8, Rect,
    Stroke, Transform,
};

/// The regular and the bold font of the PNG. Their letters are as wide as those of Arial, and drawings leave room for letters of
/// this width. `fonts/OFL.txt` has their licence.
const FONTS: [&[u8]; 2] = [
    include_bytes!("../fonts/Arimo-Regular.ttf"),
    include_bytes!("../fonts/Arimo-Bold.ttf"),
];

/// The colours of the module `svg`, as red, green and blue.
pub(crate) const INK: Rgb = [0x1d, 0x1d, 0x1b];
pub(crate) const MUTED: Rgb = [0x5f, 0x5e, 0x58];
pub(crate) const GRID: Rgb = [0xe4, 0xe1, 0xd8];

/// A drawing. A PNG has several pixels per unit.
pub(crate) struct Figure {
    pub(crate) size: [f64; 2],
    pub(crate) title: String,
    pub(crate) paper: Rgb,
    /// The shapes from bottom to top.
    pub(crate) shapes: Vec<Shape>,
}

pub(crate) enum Shape {
    Words(Words),
    /// A line around a square, one unit wide.
    Frame {
        /// Position of the left edge and of the upper edge.
        at: [f64; 2],
        side: f64,
        colour: Rgb,
    },
    Dots {
        centres: Vec<[f64; 2]>,
        diameter: f64,
        colour: Rgb,
    },
    /// A square picture whose pixels stay sharp at any size.
    Picture {
        /// Position of the left edge and of the upper edge.
        at: [f64; 2],
        side: f64,
        /// The pixels, row by row.
        pixels: Vec<Rgb>,
    },
}

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

impl Figure {
    pub(crate) fn svg(&self) -> Result<String, PictureError> {
        let shapes = self
            .shapes
            .iter()
            .map(Shape::svg)
            .collect::<Result<Vec<_>, _>>()?;
        let drawing = Drawing {
            size: self.size,
            font_size: 16,
            title: &self.title,
            label: None,
            paper: &colours::hex(self.paper),
            shrinks: true,
        };
        Ok(drawing
            .with(&html! { @for shape in shapes { (shape) } })
            .into_string())
    }

    /// Draws the figure with `scale` pixels per unit.
    pub(crate) fn png(&self, scale: f32) -> Result<Vec<u8>, PictureError> {
        let [width, height] = self.size.map(|side| (side as f32 * scale).round() as u32);
        let mut sheet = Pixmap::new(width, height).ok_or(PictureError::Size(width.max(height).into()))?;
        let [red, green, blue] = self.paper;
        sheet.fill(Color::from_rgba8(red, green, blue, 0xff));
        for shape in &self.shapes {
            shape.draw(&mut sheet, Transform::from_scale(scale, scale));
        }
        // The PNG has no opacity, because every drawing has a background.
        let opaque = sheet.data().chunks_exact(4).flat_map(|pixel| &pixel[..3]);
        let opaque: Vec<u8> = opaque.copied().collect();
        encoded(&opaque, [width as usize, height as usize], png::ColorType::Rgb)
    }
}

impl Shape {
    fn svg(&self) -> Result<Markup, PictureError> {
        Ok(match self {
            Self::Words(words) => words.svg(),
            Self::Frame {
                at: [x, y],
                side,
                colour,
            } => {
                html! { rect x=(x) y=(y) width=(side) height=(side) fill="none" stroke=(colours::hex(*colour)) {} }
            }
            Self::Dots {
                centres,
                diameter,
                colour,
            } => {
                let dot = |[x, y]: &[f64; 2]| format!("M{} {}h0", tenth(*x), tenth(*y));
                let dots: String = centres.iter().map(dot).collect();
                html! {
                    path d=(dots) stroke=(colours::hex(*colour)) stroke-width=(diameter) stroke-linecap="round" fill="none" {}
                }
            }
            Self::Picture {
                at: [x, y],
                side,
                pixels,
            } => {
                // Some programs blur enlarged pixels, so each pixel is embedded at its final size.
                let scale = (*side as usize).div_ceil(pixels.len().isqrt());
                let png = encoded(
                    &enlarged(pixels, scale),
                    [pixels.len().isqrt() * scale; 2],
                    png::ColorType::Rgb,
                )?;
                let address = format!("data:image/png;base64,{}", STANDARD.encode(png));
                html! { image x=(x) y=(y) width=(side) height=(side) href=(address) style="image-rendering: pixelated" {} }
            }
        })
    }

    fn draw(&self, sheet: &mut Pixmap, transform: Transform) {
        match self {
            Self::Words(words) => words.draw(sheet, transform),
            Self::Frame {
                at: [x, y],
                side,
                colour,
            } => {
                if let Some(square) = Rect::from_xywh(*x as f32, *y as f32, *side as f32, *side as f32) {
                    let path = PathBuilder::from_rect(square);
                    sheet.stroke_path(&path, &paint(*colour), &Stroke::default(), transform, None);
                }
            }
            Self::Dots {
                centres,
                diameter,
                colour,
            } => {
                let mut path = PathBuilder::new();
                for [x, y] in centres {
                    path.push_circle(*x as f32, *y as f32, *diameter as f32 / 2.0);
                }
                fill(sheet, path, *colour, transform);
            }
            Self::Picture {
                at: [x, y],
                side,
                pixels,
            } => {
                let columns = pixels.len().isqrt();
                let Some(mut picture) = Pixmap::new(columns as u32, columns as u32) else {
                    return;
                };
                for (pixel, [red, green, blue]) in picture.pixels_mut().iter_mut().zip(pixels) {
                    *pixel = PremultipliedColorU8::from_rgba(*red, *green, *blue, 0xff).unwrap_or(*pixel);
                }
                let paint = PixmapPaint {
                    quality: FilterQuality::Nearest,
                    ..PixmapPaint::default()
                };
                let enlarged = *side as f32 / columns as f32;
                let transform = transform
                    .pre_translate(*x as f32, *y as f32)
                    .pre_scale(enlarged, enlarged);
                sheet.draw_pixmap(0, 0, picture.as_ref(), &paint, transform, None);
            }
        }
    }
}

impl Words {
    fn svg(&self) -> Markup {
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

    fn draw(&self, sheet: &mut Pixmap, transform: Transform) {
        let Ok(font) = FontRef::new(FONTS[usize::from(self.bold)]) else {
            return;
        };
        let (size, location) = (Size::new(self.size as f32), LocationRef::default());
        let (letters, widths) = (font.charmap(), font.glyph_metrics(size, location));
        let glyphs: Vec<GlyphId> = self
            .text
            .chars()
            .filter_map(|letter| letters.map(letter))
            .collect();
        let width = |glyph: &GlyphId| widths.advance_width(*glyph).unwrap_or(0.0);
        let all: f32 = glyphs.iter().map(width).sum();
        let mut pen = Pen {
            path: PathBuilder::new(),
            along: match self.anchor {
                Anchor::Start => 0.0,
                Anchor::Middle => -all / 2.0,
                Anchor::End => -all,
            },
        };
        for glyph in &glyphs {
            if let Some(outline) = font.outline_glyphs().get(*glyph) {
                // An error would omit the letter, but no letter of the embedded font gives an error.
                let _ = outline.draw(DrawSettings::unhinted(size, location), &mut pen);
            }
            pen.along += width(glyph);
        }
        let transform = transform
            .pre_translate(self.at[0] as f32, self.at[1] as f32)
            .pre_rotate(if self.upwards { -90.0 } else { 0.0 });
        fill(sheet, pen.path, self.colour, transform);
    }
}

/// Draws the outlines of letters, with y downwards.
struct Pen {
    path: PathBuilder,
    /// Position along the line at which the letter begins.
    along: f32,
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

fn fill(sheet: &mut Pixmap, path: PathBuilder, colour: Rgb, transform: Transform) {
    if let Some(path) = path.finish() {
        sheet.fill_path(&path, &paint(colour), FillRule::Winding, transform, None);
    }
}

fn paint([red, green, blue]: Rgb) -> Paint<'static> {
    let mut paint = Paint::default();
    paint.set_color_rgba8(red, green, blue, 0xff);
    paint
}

/// The pixels of a square picture, each drawn as a square with a side of `scale` pixels.
fn enlarged(pixels: &[Rgb], scale: usize) -> Vec<u8> {
    let columns = pixels.len().isqrt();
    let side = columns * scale;
    let pixel = |at: usize| pixels[at / side / scale * columns + at % side / scale];
    (0..side * side).flat_map(pixel).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::sample::decode_png;

    fn drawn(shape: Shape, scale: f32) -> (u32, u32, Vec<u8>) {
        let figure = Figure {
            size: [60.0, 20.0],
            title: "a drawing".to_owned(),
            paper: [0xff; 3],
            shapes: vec![shape],
        };
        decode_png(&figure.png(scale).unwrap())
    }

    fn words(text: &str, bold: bool, anchor: Anchor) -> Shape {
        Shape::Words(Words {
            text: text.to_owned(),
            at: [30.0, 16.0],
            anchor,
            size: 16.0,
            colour: [0; 3],
            bold,
            upwards: false,
        })
    }

    /// Sum of the darkness of the pixels of each column.
    fn columns((width, _, pixels): (u32, u32, Vec<u8>)) -> Vec<u64> {
        let mut columns = vec![0; width as usize];
        for (place, pixel) in pixels.chunks(3).enumerate() {
            columns[place % width as usize] += 255 - u64::from(pixel[0]);
        }
        columns
    }

    #[test]
    fn words_are_drawn_and_bold_ones_are_darker() {
        let dark = |text, bold| {
            columns(drawn(words(text, bold, Anchor::Middle), 2.0))
                .iter()
                .sum::<u64>()
        };
        let (plain, bold) = (dark("Milling", false), dark("Milling", true));
        assert!(plain > 0 && bold > plain + plain / 10, "{plain} {bold}");
        assert_eq!(dark("", false), 0);
    }

    #[test]
    fn words_begin_or_end_at_their_place_or_stand_about_it() {
        let around = |anchor| {
            let columns = columns(drawn(words("ill", false, anchor), 1.0));
            let (left, right) = columns.split_at(30);
            [left, right].map(|half| half.iter().sum::<u64>())
        };
        let [[_, start], [left, right], [end, _]] = [Anchor::Start, Anchor::Middle, Anchor::End].map(around);
        assert_eq!((around(Anchor::Start)[0], around(Anchor::End)[1]), (0, 0));
        assert!(start > 0 && end > 0 && left.abs_diff(right) < (left + right) / 3);
    }

    #[test]
    fn dots_are_round_and_pictures_stay_sharp() {
        let dots = Shape::Dots {
            centres: vec![[10.0, 10.0]],
            diameter: 8.0,
            colour: [0xff, 0, 0],
        };
        let (width, height, pixels) = drawn(dots, 1.0);
        assert_eq!((width, height), (60, 20));
        let at = |x: usize, y: usize| &pixels[3 * (y * 60 + x)..][..3];
        assert_eq!((at(10, 10), at(6, 6)), (&[0xff, 0, 0][..], &[0xff; 3][..]));

        let picture = Shape::Picture {
            at: [10.0, 0.0],
            side: 20.0,
            pixels: vec![[0; 3], [9; 3], [9; 3], [0; 3]],
        };
        let (_, _, pixels) = drawn(picture, 1.0);
        let row: Vec<u8> = (0..60).map(|x| pixels[3 * (5 * 60 + x)]).collect();
        let expected: Vec<u8> = [(255, 10), (0, 10), (9, 10), (255, 30)]
            .iter()
            .flat_map(|&(value, count)| vec![value; count])
            .collect();
        assert_eq!(row, expected);
    }
}
