//! Drawings as PDF: one page of the drawing's size, with vector paths and the outlines of text. The file needs no font, has no
//! transparency, and does not depend on the time.

use super::{Figure, Shape, Unit, Words};
use flate2::{Compression, write::ZlibEncoder};
use murmuration_model::colours::Rgb;
use pdf_writer::{
    Content, Filter, Finish as _, Pdf, Rect, Ref, TextStr,
    types::{LineCapStyle, LineJoinStyle},
};
use std::io::Write as _;
use tiny_skia::{PathSegment, Point};

const CATALOGUE: Ref = Ref::new(1);
const PAGES: Ref = Ref::new(2);
const PAGE: Ref = Ref::new(3);
const CONTENT: Ref = Ref::new(4);
const ABOUT: Ref = Ref::new(5);

/// Pixels per point in drawings for screens, as in CSS.
const PIXELS_PER_POINT: f64 = 96.0 / 72.0;

impl Figure {
    pub(crate) fn pdf(&self) -> Vec<u8> {
        let scale = match self.unit {
            Unit::Pixel => 1.0 / PIXELS_PER_POINT,
            Unit::Point => 1.0,
        };
        let [width, height] = self.size.map(|side| (side * scale) as f32);
        let content = self.content(scale as f32, height);
        let mut pdf = Pdf::new();
        pdf.catalog(CATALOGUE).pages(PAGES);
        pdf.pages(PAGES).kids([PAGE]).count(1);
        let mut page = pdf.page(PAGE);
        page.media_box(Rect::new(0.0, 0.0, width, height));
        page.parent(PAGES).contents(CONTENT);
        page.resources();
        page.finish();
        match compressed(&content) {
            Some(compressed) => {
                pdf.stream(CONTENT, &compressed).filter(Filter::FlateDecode);
            }
            None => {
                pdf.stream(CONTENT, &content);
            }
        }
        let mut about = pdf.document_info(ABOUT);
        about.title(TextStr(&self.title)).creator(TextStr("murmuration"));
        about.finish();
        pdf.finish()
    }

    fn content(&self, scale: f32, height: f32) -> Vec<u8> {
        let mut content = Content::new();
        // In a PDF, y goes up from the lower edge.
        content.transform([scale, 0.0, 0.0, -scale, 0.0, height]);
        content.set_line_cap(LineCapStyle::RoundCap);
        content.set_line_join(LineJoinStyle::RoundJoin);
        if self.unit == Unit::Pixel {
            block(&mut content, [0.0; 2], self.size, self.paper);
        }
        for shape in &self.shapes {
            shape.write(&mut content, self.unit);
        }
        content.finish().into_vec()
    }
}

impl Shape {
    fn write(&self, content: &mut Content, unit: Unit) {
        match self {
            Self::Words(words) => words.write(content),
            Self::Frame { at, side, colour } => {
                stroke(content, *colour, 1.0);
                let [x, y] = at.map(|coordinate| coordinate as f32);
                content.rect(x, y, *side as f32, *side as f32).stroke();
            }
            Self::Dots {
                centres,
                diameter,
                colour,
            } => {
                // A line without length, with round ends, is a disc.
                stroke(content, *colour, *diameter);
                for centre in centres {
                    let [x, y] = centre.map(|coordinate| unit.short(coordinate) as f32);
                    content.move_to(x, y).line_to(x, y);
                }
                content.stroke();
            }
            Self::Lines { lines, width, colour } => {
                stroke(content, *colour, *width);
                for line in lines {
                    for (place, point) in line.iter().enumerate() {
                        let [x, y] = point.map(|coordinate| unit.short(coordinate) as f32);
                        match place {
                            0 => content.move_to(x, y),
                            _ => content.line_to(x, y),
                        };
                    }
                }
                content.stroke();
            }
            Self::Block { at, size, colour } => block(content, *at, *size, *colour),
            Self::Picture { at, side, pixels } => {
                let columns = pixels.len().isqrt().max(1);
                let pixel = side / columns as f64;
                for (place, colour) in pixels.iter().enumerate() {
                    let [x, y] = [place % columns, place / columns].map(|cells| pixel * cells as f64);
                    block(content, [at[0] + x, at[1] + y], [pixel; 2], *colour);
                }
            }
        }
    }
}

impl Words {
    fn write(&self, content: &mut Content) {
        let outlines = self.outlines().and_then(|(path, placed)| path.transform(placed));
        let Some(path) = outlines else { return };
        fill(content, self.colour);
        let mut last = Point::zero();
        for segment in path.segments() {
            last = match segment {
                PathSegment::MoveTo(to) => {
                    let [x, y] = short(to);
                    content.move_to(x, y);
                    to
                }
                PathSegment::LineTo(to) => {
                    let [x, y] = short(to);
                    content.line_to(x, y);
                    to
                }
                // A PDF has cubic curves alone.
                PathSegment::QuadTo(by, to) => {
                    cubic(content, between(last, by), between(to, by), to);
                    to
                }
                PathSegment::CubicTo(by, then, to) => {
                    cubic(content, by, then, to);
                    to
                }
                PathSegment::Close => {
                    content.close_path();
                    last
                }
            };
        }
        content.fill_nonzero();
    }
}

fn cubic(content: &mut Content, by: Point, then: Point, to: Point) {
    let [[x1, y1], [x2, y2], [x3, y3]] = [by, then, to].map(short);
    content.cubic_to(x1, y1, x2, y2, x3, y3);
}

/// The point two thirds of the way from the end of a quadratic curve to its control point.
fn between(end: Point, control: Point) -> Point {
    Point::from_xy(
        end.x + (control.x - end.x) * 2.0 / 3.0,
        end.y + (control.y - end.y) * 2.0 / 3.0,
    )
}

fn short(point: Point) -> [f32; 2] {
    [point.x, point.y].map(|coordinate| Unit::Point.short(coordinate.into()) as f32)
}

fn block(content: &mut Content, at: [f64; 2], size: [f64; 2], colour: Rgb) {
    fill(content, colour);
    let [[x, y], [width, height]] =
        [at, size].map(|pair| pair.map(|length| Unit::Point.short(length) as f32));
    content.rect(x, y, width, height).fill_nonzero();
}

fn fill(content: &mut Content, colour: Rgb) {
    let [red, green, blue] = parts(colour);
    content.set_fill_rgb(red, green, blue);
}

fn stroke(content: &mut Content, colour: Rgb, width: f64) {
    let [red, green, blue] = parts(colour);
    content
        .set_stroke_rgb(red, green, blue)
        .set_line_width(Unit::Point.short(width) as f32);
}

fn parts(colour: Rgb) -> [f32; 3] {
    colour.map(|part| (1000.0 * f32::from(part) / 255.0).round() / 1000.0)
}

/// The compressed content. Writing to memory does not fail.
fn compressed(content: &[u8]) -> Option<Vec<u8>> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(content).ok()?;
    encoder.finish().ok()
}
