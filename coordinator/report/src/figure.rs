//! Drawings for papers, as SVG, as PDF and as PNG. The PDF and the PNG use an embedded font instead of the system's fonts, so that
//! the same drawing gives the same bytes on every machine.

mod pdf;
mod words;

use crate::{
    picture::{PictureError, encoded, encoded_at},
    svg::{Drawing, tenth},
};
use base64::{Engine as _, engine::general_purpose::STANDARD};
use maud::{Markup, html};
use murmuration_model::colours::{self, Rgb};
use std::fmt::Write as _;
use tiny_skia::{
    Color, FillRule, FilterQuality, LineCap, LineJoin, Paint, PathBuilder, Pixmap, PixmapPaint,
    PremultipliedColorU8, Rect, Stroke, Transform,
};
pub(crate) use words::{Anchor, Words, width_of};

/// The colours of the module `svg`, as red, green and blue.
pub(crate) const INK: Rgb = [0x1d, 0x1d, 0x1b];
pub(crate) const MUTED: Rgb = [0x5f, 0x5e, 0x58];
pub(crate) const GRID: Rgb = [0xe4, 0xe1, 0xd8];

/// A drawing. A PNG has several pixels per unit.
pub(crate) struct Figure {
    pub(crate) size: [f64; 2],
    pub(crate) unit: Unit,
    pub(crate) title: String,
    pub(crate) paper: Rgb,
    /// The shapes from bottom to top.
    pub(crate) shapes: Vec<Shape>,
}

/// The unit of a drawing's coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Unit {
    /// A pixel of a screen. The SVG has real text, in a font of the reader's system.
    Pixel,
    /// 1/72 inch on paper. The SVG has its size in millimetres, the outlines of its text, and no background.
    Point,
}

impl Unit {
    /// Rounds a coordinate: nobody can see the difference, and the rounding keeps files small.
    fn short(self, coordinate: f64) -> f64 {
        match self {
            Self::Pixel => tenth(coordinate),
            Self::Point => (100.0 * coordinate).round() / 100.0,
        }
    }
}

/// Millimetres per point.
pub(crate) const MM_PER_POINT: f64 = 25.4 / 72.0;

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
    /// Lines through points, with round ends.
    Lines {
        lines: Vec<Vec<[f64; 2]>>,
        width: f64,
        colour: Rgb,
    },
    /// A filled rectangle.
    Block {
        /// Position of the left edge and of the upper edge.
        at: [f64; 2],
        size: [f64; 2],
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

impl Figure {
    pub(crate) fn svg(&self) -> Result<String, PictureError> {
        let shapes = self
            .shapes
            .iter()
            .map(|shape| shape.svg(self.unit))
            .collect::<Result<Vec<_>, _>>()?;
        let shapes = html! { @for shape in shapes { (shape) } };
        Ok(match self.unit {
            Unit::Pixel => self.on_screen(&shapes),
            Unit::Point => self.on_paper(&shapes),
        }
        .into_string())
    }

    fn on_screen(&self, shapes: &Markup) -> Markup {
        let drawing = Drawing {
            size: self.size,
            font_size: 16,
            title: &self.title,
            label: None,
            paper: &colours::hex(self.paper),
            shrinks: true,
        };
        drawing.with(shapes)
    }

    fn on_paper(&self, shapes: &Markup) -> Markup {
        let [width, height] = self.size.map(|side| Unit::Point.short(side));
        let [across, down] = self
            .size
            .map(|side| format!("{}mm", Unit::Point.short(side * MM_PER_POINT)));
        html! {
            svg xmlns="http://www.w3.org/2000/svg" viewBox={ "0 0 " (width) " " (height) } width=(across) height=(down)
                stroke-linecap="round" stroke-linejoin="round" {
                title { (self.title) }
                (shapes)
            }
        }
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
        let per_metre = match self.unit {
            Unit::Pixel => None,
            Unit::Point => Some((1000.0 / MM_PER_POINT * f64::from(scale)).round() as u32),
        };
        encoded_at(
            &opaque,
            [width as usize, height as usize],
            png::ColorType::Rgb,
            per_metre,
        )
    }
}

impl Shape {
    fn svg(&self, unit: Unit) -> Result<Markup, PictureError> {
        Ok(match self {
            Self::Words(words) => words.svg(unit),
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
                let dot = |[x, y]: &[f64; 2]| format!("M{} {}h0", unit.short(*x), unit.short(*y));
                let dots: String = centres.iter().map(dot).collect();
                html! {
                    path d=(dots) stroke=(colours::hex(*colour)) stroke-width=(diameter) stroke-linecap="round" fill="none" {}
                }
            }
            Self::Lines { lines, width, colour } => {
                let data: String = lines.iter().map(|line| line_data(line, unit)).collect();
                html! { path d=(data) stroke=(colours::hex(*colour)) stroke-width=(unit.short(*width)) fill="none" {} }
            }
            Self::Block {
                at: [x, y],
                size: [width, height],
                colour,
            } => {
                let [x, y, width, height] = [x, y, width, height].map(|length| unit.short(*length));
                html! { rect x=(x) y=(y) width=(width) height=(height) fill=(colours::hex(*colour)) {} }
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
            Self::Words(words) => {
                if let Some((path, placed)) = words.outlines() {
                    fill(sheet, &path, words.colour, transform.pre_concat(placed));
                }
            }
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
                if let Some(path) = path.finish() {
                    fill(sheet, &path, *colour, transform);
                }
            }
            Self::Lines { lines, width, colour } => {
                if let Some(path) = path_through(lines) {
                    let pen = Stroke {
                        width: *width as f32,
                        line_cap: LineCap::Round,
                        line_join: LineJoin::Round,
                        ..Stroke::default()
                    };
                    sheet.stroke_path(&path, &paint(*colour), &pen, transform, None);
                }
            }
            Self::Block {
                at: [x, y],
                size: [width, height],
                colour,
            } => {
                if let Some(block) = Rect::from_xywh(*x as f32, *y as f32, *width as f32, *height as f32) {
                    sheet.fill_rect(block, &paint(*colour), transform, None);
                }
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

/// A line as the data of an SVG path. Each point is relative to the point before it, because differences are shorter to write.
fn line_data(line: &[[f64; 2]], unit: Unit) -> String {
    let mut data = String::new();
    let mut before = [0.0; 2];
    for (place, point) in line.iter().enumerate() {
        let point = point.map(|coordinate| unit.short(coordinate));
        let [x, y] = [0, 1].map(|axis| unit.short(point[axis] - before[axis]) + 0.0);
        // Writing to a string cannot fail.
        let _ = write!(data, "{}{x} {y}", if place == 0 { 'M' } else { 'l' });
        before = point;
    }
    data
}

fn path_through(lines: &[Vec<[f64; 2]>]) -> Option<tiny_skia::Path> {
    let mut path = PathBuilder::new();
    for line in lines {
        for (place, [x, y]) in line.iter().enumerate() {
            match place {
                0 => path.move_to(*x as f32, *y as f32),
                _ => path.line_to(*x as f32, *y as f32),
            }
        }
    }
    path.finish()
}

fn fill(sheet: &mut Pixmap, path: &tiny_skia::Path, colour: Rgb, transform: Transform) {
    sheet.fill_path(path, &paint(colour), FillRule::Winding, transform, None);
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
            unit: Unit::Pixel,
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
