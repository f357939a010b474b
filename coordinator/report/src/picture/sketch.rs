//! What the coloured pictures are drawn with: a transparent sheet in world coordinates.
//!
//! Agents of one colour are drawn together, so that the cost of a picture hardly grows with the swarm.

use super::{PictureError, side};
use murmuration_model::colours::{self, Rgb};
use murmuration_proto::{Pose, World};
use tiny_skia::{
    BlendMode, FillRule, LineCap, LineJoin, Paint, Path, PathBuilder, Pixmap, Rect, Stroke, Transform,
};

/// What the colour of an agent says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Colouring<'a> {
    /// Which agent it is.
    Agents,
    /// Its species: for each agent, the place of its species.
    Species(&'a [usize]),
}

impl<'a> Colouring<'a> {
    /// By species if there are several: `species` has the place of the species of each agent.
    #[must_use]
    pub fn of(species: &'a [usize]) -> Self {
        match species.iter().any(|&place| place > 0) {
            true => Self::Species(species),
            false => Self::Agents,
        }
    }
    /// The agents that have the colour at `place`, out of so many.
    fn agents(self, place: usize, agents: usize) -> impl Iterator<Item = usize> {
        let count = colours::AGENTS.len();
        (0..agents).filter(move |&agent| match self {
            Self::Agents => agent % count == place,
            Self::Species(species) => species.get(agent).is_some_and(|species| species % count == place),
        })
    }
}

/// A sheet of pixels that shows a world, transparent where nothing is drawn.
pub(super) struct Sketch<'a> {
    colouring: Colouring<'a>,
    pixels: Pixmap,
    /// Pixels in a world unit.
    scale: f32,
    /// Radius of a body in pixels; at least large enough to be seen.
    radius: f32,
}

impl<'a> Sketch<'a> {
    /// An empty sheet for `world` whose longer side is `size` pixels.
    pub(super) fn new(world: &World, size: u32, colouring: Colouring<'a>) -> Result<Self, PictureError> {
        let size = f64::from(side(size.into())?);
        let scale = size / world.width().max(world.height());
        let pixels = |length: f64| (length * scale).round().max(1.0) as u32;
        Ok(Self {
            colouring,
            pixels: Pixmap::new(pixels(world.width()), pixels(world.height()))
                .ok_or(PictureError::Size(size as u64))?,
            scale: scale as f32,
            radius: ((world.radius() * scale) as f32).max(1.2),
        })
    }

    pub(super) fn width(&self) -> u32 {
        self.pixels.width()
    }

    pub(super) fn height(&self) -> u32 {
        self.pixels.height()
    }

    /// Makes the sheet empty again.
    pub(super) fn clear(&mut self) {
        self.pixels.fill(tiny_skia::Color::TRANSPARENT);
    }

    /// The walls, a thin line around where bodies can be.
    pub(super) fn walls(&mut self, world: &World) {
        let near = world.padding() as f32 * self.scale;
        let (width, height) = (
            world.width() as f32 * self.scale,
            world.height() as f32 * self.scale,
        );
        // On the middle of pixels a line is sharp, and without padding it is still inside the picture.
        let inset = near.floor() + 0.5;
        let Some(rect) = Rect::from_ltrb(inset, inset, width - inset, height - inset) else {
            return;
        };
        self.stroke(&PathBuilder::from_rect(rect), colours::LINE, 140, 1.0);
    }

    /// Paths through the agents' `frames`, oldest first, `width` pixels wide, with an opacity of `part` / 255.
    ///
    /// They replace what is under them, so that crossings do not grow darker and joints are not seen.
    pub(super) fn paths(&mut self, frames: &[&[Pose]], part: u8, width: f32) {
        let agents = frames.first().map_or(0, |frame| frame.len());
        for (place, &colour) in colours::AGENTS.iter().enumerate() {
            let mut path = PathBuilder::new();
            for agent in self.colouring.agents(place, agents) {
                for (i, frame) in frames.iter().enumerate() {
                    let (x, y) = self.pixel(frame[agent]);
                    match i {
                        0 => path.move_to(x, y),
                        _ => path.line_to(x, y),
                    }
                }
            }
            if let Some(path) = path.finish() {
                self.stroke(&path, colour, part, width);
            }
        }
    }

    /// The bodies at `poses`: discs, each with a tick that points where it heads, set off from the paths under them.
    pub(super) fn bodies(&mut self, poses: &[Pose]) {
        let radius = self.radius;
        for (place, &colour) in colours::AGENTS.iter().enumerate() {
            let (mut discs, mut ticks) = (PathBuilder::new(), PathBuilder::new());
            for pose in self
                .colouring
                .agents(place, poses.len())
                .map(|agent| poses[agent])
            {
                let (x, y) = self.pixel(pose);
                discs.push_circle(x, y, radius);
                ticks.move_to(x, y);
                ticks.line_to(
                    x + 2.0 * radius * libm::cosf(pose[2]),
                    y + 2.0 * radius * libm::sinf(pose[2]),
                );
            }
            let (Some(discs), Some(ticks)) = (discs.finish(), ticks.finish()) else {
                continue;
            };
            let heading_is_seen = radius >= 2.0;
            if heading_is_seen {
                self.stroke(&discs, colour, 0, 0.5 * radius);
                self.stroke(&ticks, colour, 255, (0.4 * radius).max(1.2));
            }
            self.fill(&discs, colour);
        }
    }

    /// The pixels, row by row: colour and opacity.
    pub(super) fn pixels(&self) -> impl ExactSizeIterator<Item = (Rgb, u8)> {
        self.pixels.pixels().iter().map(|pixel| {
            let plain = pixel.demultiply();
            ([plain.red(), plain.green(), plain.blue()], plain.alpha())
        })
    }

    fn pixel(&self, [x, y, _]: Pose) -> (f32, f32) {
        (x * self.scale, y * self.scale)
    }

    fn fill(&mut self, path: &Path, colour: Rgb) {
        let paint = replacing(colour, 255);
        self.pixels
            .fill_path(path, &paint, FillRule::Winding, Transform::identity(), None);
    }

    fn stroke(&mut self, path: &Path, colour: Rgb, part: u8, width: f32) {
        let pen = Stroke {
            width,
            line_cap: LineCap::Round,
            line_join: LineJoin::Round,
            ..Stroke::default()
        };
        let paint = replacing(colour, part);
        self.pixels
            .stroke_path(path, &paint, &pen, Transform::identity(), None);
    }
}

fn replacing([red, green, blue]: Rgb, part: u8) -> Paint<'static> {
    let mut paint = Paint {
        blend_mode: BlendMode::Source,
        anti_alias: true,
        ..Paint::default()
    };
    paint.set_color_rgba8(red, green, blue, part);
    paint
}
