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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Axes, Origin, Reading, TracksFile, YAxis};
    use murmuration_model::csv_file::ColumnNames;
    use murmuration_swarm::World;
    use std::path::Path;

    fn file(text: &[u8]) -> TracksFile<&[u8]> {
        TracksFile::open(Path::new("t.csv"), text, ColumnNames::default()).unwrap()
    }

    /// Reads tracks of 24 robots in a square with this corner and side, in 60 frames, and checks them.
    fn understood(corner: f64, side: f64, filmed: &Filmed<'_>) -> Result<Understood, String> {
        let rows: String = (0..60 * 24)
            .map(|row| {
                let (frame, robot) = (row / 24, row % 24);
                let place = |step: i32| corner + side * f64::from(robot * step % 24) / 23.0;
                format!("{frame},{robot},{},{}\n", place(1), place(7))
            })
            .collect();
        let text = format!("frame,robot,x,y\n{rows}");
        let tracks = Tracks::read(file(text.as_bytes()), Reading::default()).unwrap();
        tracks.understood(100, filmed).map_err(|error| error.to_string())
    }

    #[test]
    fn positions_outside_the_walls_are_refused_with_the_box_that_they_span() {
        let world = World::default();
        let inside = understood(100.0, 200.0, &Filmed::new(&world)).unwrap();
        assert_eq!(
            inside,
            Understood {
                inside: 1.0,
                width: 200.0
            }
        );
        assert_eq!(
            understood(700.0, 200.0, &Filmed::new(&world)).unwrap_err(),
            "t.csv: 0 % of the positions are inside the walls (x 0 to 500, y 0 to 500); the positions span x 700 to 900, y 700 \
             to 900"
        );
        let centred = Filmed::new(&world).with_axes(Axes {
            origin: Origin::Centre,
            y: YAxis::Up,
        });
        assert!(understood(-150.0, 200.0, &Filmed::new(&world)).is_err());
        assert_eq!(understood(-150.0, 200.0, &centred).unwrap().inside, 1.0);
    }

    #[test]
    fn a_swarm_in_a_corner_of_the_world_is_refused_and_a_dense_one_is_not() {
        let world = World::default();
        let metres = understood(0.2, 1.5, &Filmed::new(&world)).unwrap_err();
        assert!(metres.contains("which is 0 % of the arena"), "{metres}");
        let filmed = Filmed::new(&world).with_arena([2.0, 2.0]).unwrap();
        assert_eq!(understood(0.2, 1.5, &filmed).unwrap().width, 375.0);
        // 24 robots with a radius of 5 fit into a square with a side of 50, and into none with a side of 10.
        assert!(understood(200.0, 40.0, &Filmed::new(&world)).is_ok());
        assert!(understood(200.0, 10.0, &Filmed::new(&world)).is_err());
    }

    #[test]
    fn a_robot_that_is_seldom_seen_is_refused_with_its_frames() {
        let world = World::default();
        let rows: String = (0..60).map(|frame| format!("{frame},0,100,100\n")).collect();
        let text = format!("frame,robot,x,y\n{rows}20,ghost,2,2\n21,ghost,2,2\n40,ghost,2,2\n");
        let read = |min_frames| {
            let reading = Reading {
                min_frames,
                ..Reading::default()
            };
            let tracks = Tracks::read(file(text.as_bytes()), reading).unwrap();
            tracks
                .understood(100, &Filmed::new(&world))
                .map_err(|error| error.to_string())
        };
        assert_eq!(
            read(None).unwrap_err(),
            "t.csv: robot \"ghost\" is seen in only 3 of 60 frames (20, 21, 40)"
        );
        assert!(read(Some(1)).is_ok() && read(Some(4)).is_ok());
    }
}
