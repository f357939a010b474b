//! Whether the positions of tracks make sense in the world of their film.

use crate::{Filmed, MAX_GAP_FRAMES, Tracks, TracksError, file::Robot};
use murmuration_swarm::Boundary;
use std::f64::consts::PI;

/// Least share of positions between the walls.
const MIN_INSIDE: f64 = 0.95;
/// The same in a world that robots may leave.
const MIN_INSIDE_OPEN: f64 = 0.05;
/// A swarm that spans less than this share of the arena is small.
const SMALL: f64 = 0.03;
/// The greatest share of a plane that discs of equal size can cover.
const DENSEST: f64 = 0.9069;

/// The positions of a film, as they are in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Understood {
    /// Share of the positions that are between the walls, or at most a robot's radius outside them, 0 to 1.
    pub inside: f64,
    /// The longer side of the rectangle that the positions span, world units.
    pub width: f64,
}

/// A rectangle: its corners with the least and with the greatest coordinates.
#[derive(Debug, Clone, Copy)]
struct Span([[f64; 2]; 2]);

impl Span {
    const NOTHING: Self = Self([[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]]);

    fn with(self, at: [f64; 2]) -> Self {
        let Self([least, greatest]) = self;
        Self([
            [least[0].min(at[0]), least[1].min(at[1])],
            [greatest[0].max(at[0]), greatest[1].max(at[1])],
        ])
    }

    fn sides(self) -> [f64; 2] {
        let Self([least, greatest]) = self;
        [0, 1].map(|axis| greatest[axis] - least[axis])
    }

    /// The least and the greatest value on each axis.
    fn by_axis(self) -> [[f64; 2]; 2] {
        let Self([least, greatest]) = self;
        [0, 1].map(|axis| [least[axis], greatest[axis]])
    }
}

impl Tracks {
    /// Checks the robots and their positions at the end of the film, in the frames of the last `steps` steps.
    ///
    /// # Errors
    /// [`TracksError::Ghost`], [`TracksError::Outside`] and [`TracksError::Small`].
    pub fn understood(&self, steps: u32, filmed: &Filmed<'_>) -> Result<Understood, TracksError> {
        let frames = (f64::from(steps) * filmed.frames_a_step).ceil() as u32;
        let first = self.frames()[1].saturating_sub(frames);
        self.check_ghosts(first)?;
        let robots = self.robots.iter();
        let sightings =
            robots.flat_map(|robot| robot.sightings.range(first.saturating_sub(MAX_GAP_FRAMES)..));
        let positions: Vec<[f64; 2]> = sightings.map(|(_, sighting)| sighting.at).collect();
        let placed = || positions.iter().map(|&at| filmed.place(at));
        let world = filmed.world;
        let sides = [world.width(), world.height()];
        let is_inside = |at: &[f64; 2]| {
            let near = -world.radius()..=world.radius();
            (0..2).all(|axis| near.contains(&(at[axis] - at[axis].clamp(0.0, sides[axis]))))
        };
        let inside = placed().filter(is_inside).count() as f64 / positions.len().max(1) as f64;
        let of_tracks = positions
            .iter()
            .fold(Span::NOTHING, |span, &at| span.with(at))
            .by_axis();
        let walls = Span(filmed.walls()).by_axis();
        let least = match world.boundary() {
            Boundary::Walls | Boundary::Torus => MIN_INSIDE,
            Boundary::Open => MIN_INSIDE_OPEN,
        };
        let path = self.path.clone();
        if inside < least {
            return Err(TracksError::Outside {
                path,
                inside,
                walls,
                span: of_tracks,
            });
        }
        let span = placed().fold(Span::NOTHING, Span::with);
        let width = span.sides().into_iter().fold(0.0, f64::max);
        let share = width / sides[0].max(sides[1]);
        match share < SMALL && !self.has_room(span, filmed) {
            true => Err(TracksError::Small {
                path,
                share,
                walls,
                span: of_tracks,
            }),
            false => Ok(Understood { inside, width }),
        }
    }

    /// Whether the robots have room in `span` and, in a world with walls, room between `span` and the walls.
    fn has_room(&self, span: Span, filmed: &Filmed<'_>) -> bool {
        let world = filmed.world;
        let radius = world.radius();
        let [width, height] = span.sides().map(|side| side + 2.0 * radius);
        let area = f64::from(self.robots()) * PI * radius * radius;
        let Span([least, greatest]) = span;
        let is_in_wall = least.iter().any(|&side| side < radius / 2.0)
            || greatest[0] > world.width() - radius / 2.0
            || greatest[1] > world.height() - radius / 2.0;
        DENSEST * width * height >= area && !(world.boundary() == Boundary::Walls && is_in_wall)
    }

    /// Refuses a robot that is seen in less than half of the frames from `first` on.
    fn check_ghosts(&self, first: u32) -> Result<(), TracksError> {
        if !self.refuses_ghosts {
            return Ok(());
        }
        let of = self.seen_frames(first).len() as u64;
        let of_robot = |robot: &Robot| robot.sightings.range(first..).count() as u64;
        match self.robots.iter().find(|robot| 2 * of_robot(robot) < of) {
            None => Ok(()),
            Some(ghost) => Err(TracksError::Ghost {
                path: self.path.clone(),
                robot: ghost.name.clone(),
                frames: ghost.sightings.range(first..).map(|(&frame, _)| frame).collect(),
                of,
            }),
        }
    }
}
