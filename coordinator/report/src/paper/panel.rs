//! The paths of one behaviour as shapes of a figure.
//!
//! Colours are mixed with the white of the paper instead of transparent: publishers dislike transparency, and joints between
//! shades would be visible.

use crate::{
    MedoidEntry, Report,
    figure::Shape,
    picture::{Bodies, Line, Mark, marks, path_width, tip},
};
use murmuration_model::colours::{LINE, Rgb, over};
use murmuration_swarm::{Boundary, Obstacle, Pose, World};

const PAPER: Rgb = [0xff; 3];
/// Minimum width of a path, and of the tick of a body, in points: printers lose thinner lines.
const THINNEST: f64 = 0.3;
/// Minimum radius of a body, in points.
const SMALLEST: f64 = 0.45;
/// Width of the walls, in points.
const WALLS: f64 = 0.4;
/// Maximum distance, in points, of a path from the path that is drawn in its place and has fewer points.
const TOLERANCE: f64 = 0.03;

/// The part of the paper that shows the world.
pub(super) struct Place {
    /// Position of the left edge and of the upper edge, in points.
    at: [f64; 2],
    /// Points per world unit.
    scale: f64,
    area: Area,
}

/// The part of a world that a figure shows, in world units: its corner at the upper left, and its size.
pub(super) struct Area {
    at: [f64; 2],
    size: [f64; 2],
}

impl Area {
    /// The whole world without the space outside the walls, which bodies at the walls touch only with their rims.
    pub(super) fn of(world: &World) -> Self {
        let outside = match world.boundary() {
            Boundary::Walls => (world.padding() - world.radius()).max(0.0),
            Boundary::Open | Boundary::Torus => 0.0,
        };
        Self {
            at: [outside; 2],
            size: [world.width(), world.height()].map(|side| side - 2.0 * outside),
        }
    }

    /// Height, if the width is 1.
    pub(super) fn height(&self) -> f64 {
        self.size[1] / self.size[0]
    }

    fn contains(&self, point: [f64; 2]) -> bool {
        (0..2).all(|axis| (0.0..=self.size[axis]).contains(&(point[axis] - self.at[axis])))
    }
}

impl Place {
    /// The place of a world that is as wide as `side`.
    pub(super) fn new(world: &World, at: [f64; 2], side: f64) -> Self {
        let area = Area::of(world);
        Self {
            at,
            scale: side / area.size[0],
            area,
        }
    }

    fn point(&self, point: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|axis| self.at[axis] + self.scale * (point[axis] - self.area.at[axis]))
    }

    /// The line around an area.
    fn frame(&self, [x, y]: [f64; 2], [width, height]: [f64; 2], part: u8) -> Shape {
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.0]];
        let corner = |[right, down]: [f64; 2]| self.point([x + right * width, y + down * height]);
        Shape::Lines {
            lines: vec![corners.map(corner).to_vec()],
            width: WALLS,
            colour: over(LINE, part, PAPER),
        }
    }

    /// The parts of a line that are in the world, with as few points as look the same.
    fn line(&self, line: &Line) -> Vec<Vec<[f64; 2]>> {
        let line: Vec<[f64; 2]> = line.iter().map(|point| point.map(f64::from)).collect();
        let within = if line.iter().all(|point| self.area.contains(*point)) {
            vec![line]
        } else {
            cut(&line, &self.area)
        };
        let drawn = within.into_iter().map(|line| {
            let line: Vec<[f64; 2]> = line.into_iter().map(|point| self.point(point)).collect();
            simplified(&line, TOLERANCE)
        });
        drawn.collect()
    }
}

/// The paths of a behaviour, from bottom to top.
pub(super) fn shapes(report: &Report, medoid: &MedoidEntry, place: &Place) -> Vec<Shape> {
    let (world, window) = (report.spec.world(), report.spec.image().window());
    let bodies = Bodies::of(&report.individuals[medoid.index as usize].controller, world);
    let mut shapes = Vec::new();
    // Walls are the edge of a world that has walls. Other worlds need an edge, so that readers see where the world ends.
    if world.boundary() != Boundary::Walls {
        shapes.push(place.frame(place.area.at, place.area.size, 70));
    }
    for mark in marks(&medoid.replay, world, bodies.colouring(), window) {
        match mark {
            Mark::Obstacle(obstacle) => shapes.push(obstacle_shape(obstacle, place)),
            Mark::Walls { at, size } => shapes.push(place.frame(at, size, 140)),
            Mark::Paths { part, coloured } => {
                shapes.extend(coloured.into_iter().map(|(colour, lines)| Shape::Lines {
                    lines: lines.iter().flat_map(|line| place.line(line)).collect(),
                    width: (place.scale * path_width(world)).max(THINNEST),
                    colour: over(colour, part, PAPER),
                }));
            }
            Mark::Bodies {
                colour,
                radius,
                poses,
            } => shapes.extend(bodies_shapes(colour, radius, &poses, place)),
        }
    }
    shapes
}

fn obstacle_shape(obstacle: Obstacle, place: &Place) -> Shape {
    let [x, y] = obstacle.centre();
    match obstacle {
        Obstacle::Disc { radius, .. } => Shape::Dots {
            centres: vec![place.point([x, y])],
            diameter: 2.0 * place.scale * radius,
            colour: LINE,
        },
        Obstacle::Box {
            size: [width, height],
            ..
        } => Shape::Block {
            at: place.point([x - width / 2.0, y - height / 2.0]),
            size: [width, height].map(|side| place.scale * side),
            colour: LINE,
        },
    }
}

/// The ticks of bodies, and the bodies.
fn bodies_shapes(colour: Rgb, radius: f32, poses: &[Pose], place: &Place) -> [Shape; 2] {
    let shown = (place.scale * f64::from(radius)).max(SMALLEST);
    // Bodies that are drawn larger than they are have longer ticks, too.
    let reach = (shown / place.scale) as f32;
    let centre = |[x, y, _]: Pose| [x, y].map(f64::from);
    let poses = || poses.iter().filter(|pose| place.area.contains(centre(**pose)));
    let tick = |pose: &Pose| vec![centre(*pose), tip(*pose, reach).map(f64::from)];
    let ticks = poses().map(|pose| tick(pose).into_iter().map(|point| place.point(point)).collect());
    [
        Shape::Lines {
            lines: ticks.collect(),
            width: (0.4 * shown).max(THINNEST),
            colour,
        },
        Shape::Dots {
            centres: poses().map(|pose| place.point(centre(*pose))).collect(),
            diameter: 2.0 * shown,
            colour,
        },
    ]
}

/// The parts of a line in an area.
fn cut(line: &[[f64; 2]], area: &Area) -> Vec<Vec<[f64; 2]>> {
    let mut parts: Vec<Vec<[f64; 2]>> = Vec::new();
    for pair in line.windows(2) {
        let Some([from, to]) = cut_segment([pair[0], pair[1]], area) else {
            continue;
        };
        match parts.last_mut() {
            Some(part) if part.last() == Some(&from) => part.push(to),
            _ => parts.push(vec![from, to]),
        }
    }
    parts
}

/// The part of a segment in an area, if there is one.
fn cut_segment([from, to]: [[f64; 2]; 2], area: &Area) -> Option<[[f64; 2]; 2]> {
    // The shares of the way at which the segment is inside begin at `start` and end at `end`.
    let (mut start, mut end) = (0.0_f64, 1.0_f64);
    for axis in 0..2 {
        let way = to[axis] - from[axis];
        let edges = [area.at[axis], area.at[axis] + area.size[axis]];
        let shares = edges.map(|edge| (edge - from[axis]) / way);
        if way == 0.0 {
            if !(edges[0]..=edges[1]).contains(&from[axis]) {
                return None;
            }
            continue;
        }
        start = start.max(shares[0].min(shares[1]));
        end = end.min(shares[0].max(shares[1]));
    }
    let at = |share: f64| match share {
        0.0 => from,
        1.0 => to,
        _ => [0, 1].map(|axis| from[axis] + share * (to[axis] - from[axis])),
    };
    (start <= end).then(|| [at(start), at(end)])
}

/// The line with as few points as keep it within `tolerance` (the algorithm of Douglas and Peucker).
fn simplified(line: &[[f64; 2]], tolerance: f64) -> Vec<[f64; 2]> {
    let (&[first, .., last], between) = (line, 1..line.len().saturating_sub(1)) else {
        return line.to_vec();
    };
    let distances = between.map(|place| (place, distance(line[place], first, last)));
    match distances.max_by(|(_, one), (_, other)| one.total_cmp(other)) {
        Some((place, farthest)) if farthest > tolerance => {
            let mut kept = simplified(&line[..=place], tolerance);
            kept.pop();
            kept.extend(simplified(&line[place..], tolerance));
            kept
        }
        _ => vec![first, last],
    }
}

/// The distance of a point from a segment.
fn distance([x, y]: [f64; 2], from: [f64; 2], to: [f64; 2]) -> f64 {
    let [along, up] = [to[0] - from[0], to[1] - from[1]];
    let square = along * along + up * up;
    let share = match square > 0.0 {
        true => (((x - from[0]) * along + (y - from[1]) * up) / square).clamp(0.0, 1.0),
        false => 0.0,
    };
    libm::hypot(x - from[0] - share * along, y - from[1] - share * up)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_at_the_edge_of_the_world() {
        let area = Area {
            at: [0.0; 2],
            size: [10.0; 2],
        };
        let line = [[5.0, 5.0], [5.0, 15.0], [8.0, 15.0], [8.0, 5.0], [9.0, 5.0]];
        assert_eq!(
            cut(&line, &area),
            [
                vec![[5.0, 5.0], [5.0, 10.0]],
                vec![[8.0, 10.0], [8.0, 5.0], [9.0, 5.0]]
            ]
        );
        assert!(cut(&[[-1.0, -2.0], [-1.0, 20.0]], &area).is_empty());
    }

    #[test]
    fn points_on_a_straight_line_are_left_out() {
        let straight: Vec<[f64; 2]> = (0..50).map(|i| [f64::from(i), 2.0 * f64::from(i)]).collect();
        assert_eq!(simplified(&straight, 0.1), [[0.0, 0.0], [49.0, 98.0]]);
        let there_and_back = [[0.0, 0.0], [3.0, 0.0], [0.0, 0.0]];
        assert_eq!(simplified(&there_and_back, 0.1), there_and_back);
        let arc: Vec<[f64; 2]> = (0..=90)
            .map(|degree| f64::from(degree).to_radians())
            .map(|angle| [10.0 * angle.cos(), 10.0 * angle.sin()])
            .collect();
        let kept = simplified(&arc, 0.05);
        assert!((6..20).contains(&kept.len()), "{}", kept.len());
        for point in &arc {
            let near = kept
                .windows(2)
                .any(|pair| distance(*point, pair[0], pair[1]) <= 0.05);
            assert!(near, "{point:?}");
        }
        assert_eq!(simplified(&[[1.0, 1.0]], 0.1), [[1.0, 1.0]]);
    }
}
