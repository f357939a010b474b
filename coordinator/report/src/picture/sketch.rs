//! The canvas of coloured pictures: a transparent sheet that is drawn on in world coordinates.
//!
//! All agents of one colour are drawn as one path, so that the cost of a picture hardly grows with the swarm.

use super::{PictureError, side};
use murmuration_model::colours::{self, Rgb};
use murmuration_swarm::{Boundary, Controller, Obstacle, Pose, World};
use tiny_skia::{
    BlendMode, FillRule, LineCap, LineJoin, Paint, Path, PathBuilder, Pixmap, Rect, Stroke, Transform,
};

/// The sizes and species of the bodies of a swarm.
#[derive(Debug, Clone, PartialEq)]
pub struct Bodies {
    /// The species of each agent, as an index.
    species: Vec<usize>,
    /// The radius of each species, in world units.
    radii: Vec<f64>,
}

/// The meaning of an agent's colour, and its size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Colouring<'a> {
    /// The colour depends on the agent's number; all agents have the radius that the world defines.
    Agents,
    /// The colour and the radius depend on the agent's species.
    Species {
        /// The species of each agent, as an index.
        of_agents: &'a [usize],
        /// The radius of each species, in world units.
        radii: &'a [f64],
    },
}

impl Bodies {
    /// The bodies of the swarm of a controller.
    pub fn of(controller: &Controller, world: &World) -> Self {
        let species = controller.model().species().iter();
        Self {
            species: controller.species_of_robots(world.agents()),
            radii: species.map(|species| species.robot().radius()).collect(),
        }
    }

    /// Colours by species if there are several species, or else by agent.
    pub fn colouring(&self) -> Colouring<'_> {
        match self.radii.len() {
            0 | 1 => Colouring::Agents,
            _ => Colouring::Species {
                of_agents: &self.species,
                radii: &self.radii,
            },
        }
    }
}

impl Colouring<'_> {
    /// The agents of the colour with the index `place`, in a swarm of `agents` agents.
    pub(super) fn agents(self, place: usize, agents: usize) -> impl Iterator<Item = usize> {
        let count = colours::AGENTS.len();
        (0..agents).filter(move |&agent| match self {
            Self::Agents => agent % count == place,
            Self::Species { of_agents, .. } => of_agents.get(agent) == Some(&place),
        })
    }
}

/// A sheet of pixels that shows a world, transparent where nothing is drawn.
pub(super) struct Sketch<'a> {
    colouring: Colouring<'a>,
    pixels: Pixmap,
    /// Pixels per world unit.
    scale: f32,
    /// Radius of the largest body, in world units.
    radius: f64,
    /// Maximum distance along each axis between two consecutive points of a path, in world units. On a torus, a larger distance
    /// is a jump to the other side.
    longest: [f32; 2],
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
            radius: world.radius(),
            longest: match world.boundary() {
                Boundary::Torus => [world.width(), world.height()].map(|side| side as f32 / 2.0),
                Boundary::Walls | Boundary::Open => [f32::INFINITY; 2],
            },
        })
    }

    pub(super) fn width(&self) -> u32 {
        self.pixels.width()
    }

    pub(super) fn height(&self) -> u32 {
        self.pixels.height()
    }

    pub(super) fn clear(&mut self) {
        self.pixels.fill(tiny_skia::Color::TRANSPARENT);
    }

    /// Draws the walls, a thin line around the area that bodies can reach, and the obstacles.
    pub(super) fn walls(&mut self, world: &World) {
        for obstacle in world.obstacles() {
            let [x, y] = obstacle.centre().map(|value| value as f32 * self.scale);
            let path = match *obstacle {
                Obstacle::Disc { radius, .. } => PathBuilder::from_circle(x, y, radius as f32 * self.scale),
                Obstacle::Box { size, .. } => {
                    let [width, height] = size.map(|side| side as f32 * self.scale);
                    let rect = Rect::from_xywh(x - width / 2.0, y - height / 2.0, width, height);
                    rect.map(PathBuilder::from_rect)
                }
            };
            if let Some(path) = path {
                self.fill(&path, colours::LINE);
            }
        }
        if world.boundary() != Boundary::Walls {
            return;
        }
        let near = world.padding() as f32 * self.scale;
        let (width, height) = (
            world.width() as f32 * self.scale,
            world.height() as f32 * self.scale,
        );
        // A line through the middle of pixels is sharp. The half pixel also keeps the line inside the picture if the world has no
        // padding.
        let inset = near.floor() + 0.5;
        let Some(rect) = Rect::from_ltrb(inset, inset, width - inset, height - inset) else {
            return;
        };
        self.stroke(&PathBuilder::from_rect(rect), colours::LINE, 140, 1.0);
    }

    /// Draws the agents' paths through `frames`, oldest first, `width` pixels wide, with an opacity of `part` / 255.
    ///
    /// A path replaces the pixels under it, so that crossings do not grow darker and joints are invisible.
    pub(super) fn paths(&mut self, frames: &[&[Pose]], part: u8, width: f32) {
        let agents = frames.first().map_or(0, |frame| frame.len());
        for (place, &colour) in colours::AGENTS.iter().enumerate() {
            let mut path = PathBuilder::new();
            for agent in self.colouring.agents(place, agents) {
                for (i, frame) in frames.iter().enumerate() {
                    let (x, y) = self.pixel(frame[agent]);
                    if i == 0 || self.jumps(frames[i - 1][agent], frame[agent]) {
                        path.move_to(x, y);
                    } else {
                        path.line_to(x, y);
                    }
                }
            }
            if let Some(path) = path.finish() {
                self.stroke(&path, colour, part, width);
            }
        }
    }

    /// Draws the bodies at `poses`. A body is a disc with a tick in the direction of its heading; a clear ring separates the disc
    /// from the paths under it.
    pub(super) fn bodies(&mut self, poses: &[Pose]) {
        for (place, &colour) in colours::AGENTS.iter().enumerate() {
            let radius = self.radius(place);
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

    /// The colour and opacity of each pixel, row by row.
    pub(super) fn pixels(&self) -> impl ExactSizeIterator<Item = (Rgb, u8)> {
        self.pixels.pixels().iter().map(|pixel| {
            let plain = pixel.demultiply();
            ([plain.red(), plain.green(), plain.blue()], plain.alpha())
        })
    }

    /// Whether an agent left the world on one side and came in on the other.
    fn jumps(&self, from: Pose, to: Pose) -> bool {
        (0..2).any(|axis| (to[axis] - from[axis]).abs() > self.longest[axis])
    }

    /// Radius in pixels of the bodies of the colour with the index `place`; always large enough to see.
    fn radius(&self, place: usize) -> f32 {
        let own = match self.colouring {
            Colouring::Agents => None,
            Colouring::Species { radii, .. } => radii.get(place),
        };
        (*own.unwrap_or(&self.radius) as f32 * self.scale).max(1.2)
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
