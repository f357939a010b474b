//! The paths of a swarm as SVG, for papers: the picture that [`trajectory_png`](super::trajectory_png) draws, in world units.

use super::{
    sketch::Colouring,
    trajectory::{ages, is_jump},
};
use murmuration_model::colours::{self, Rgb};
use murmuration_swarm::{Boundary, Obstacle, Pose, Replay, World};
use std::fmt::Write as _;

/// A part of a picture, in world units.
pub(crate) enum Mark {
    Obstacle(Obstacle),
    /// The edge of the area that bodies can reach: its corner at the upper left, and its size.
    Walls {
        at: [f64; 2],
        size: [f64; 2],
    },
    /// Paths of the same age, with their opacity out of 255.
    Paths {
        part: u8,
        /// Each colour with its lines.
        coloured: Vec<(Rgb, Vec<Line>)>,
    },
    /// Bodies of the same colour, each with a tick from its centre in the direction of its heading.
    Bodies {
        colour: Rgb,
        radius: f32,
        poses: Vec<Pose>,
    },
}

/// The points of a line.
pub(crate) type Line = Vec<[f32; 2]>;

/// The paths of the last `window` steps, from bottom to top. `colouring` determines the agents' colours. Older parts of a path are
/// fainter. The bodies are at their last positions. x goes right and y down, as on a screen.
pub(crate) fn marks(replay: &Replay, world: &World, colouring: Colouring<'_>, window: u32) -> Vec<Mark> {
    let mut marks = surroundings(world);
    let frames: Vec<&[Pose]> = replay.frames().collect();
    for (first, last, part) in ages(replay.steps(), window) {
        let coloured = coloured(colouring, replay.agents()).map(|(place, agents)| {
            let lines = agents
                .iter()
                .flat_map(|&agent| lines(&frames[first..=last], agent, world));
            (colours::AGENTS[place], lines.collect())
        });
        marks.push(Mark::Paths {
            part,
            coloured: coloured.collect(),
        });
    }
    if let Some(poses) = frames.last() {
        marks.extend(
            coloured(colouring, poses.len()).map(|(place, agents)| Mark::Bodies {
                colour: colours::AGENTS[place],
                radius: radius(world, colouring, place),
                poses: agents.into_iter().map(|agent| poses[agent]).collect(),
            }),
        );
    }
    marks
}

/// Width of a path, in world units.
pub(crate) fn path_width(world: &World) -> f64 {
    world.width().max(world.height()) / 290.0
}

/// The end of a body's tick.
pub(crate) fn tip([x, y, heading]: Pose, radius: f32) -> [f32; 2] {
    [
        x + 2.0 * radius * libm::cosf(heading),
        y + 2.0 * radius * libm::sinf(heading),
    ]
}

/// The paths as SVG. A unit of the picture is a world unit, and the background is transparent.
pub fn trajectory_svg(replay: &Replay, world: &World, colouring: Colouring<'_>, window: u32) -> String {
    let (width, height) = (world.width(), world.height());
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" \
         fill=\"none\" stroke-linecap=\"round\" stroke-linejoin=\"round\">\n"
    );
    for mark in marks(replay, world, colouring, window) {
        // Writing to a string cannot fail.
        let _ = match &mark {
            Mark::Obstacle(obstacle) => write_obstacle(&mut svg, obstacle),
            Mark::Walls { at, size } => write_walls(&mut svg, *at, *size),
            Mark::Paths { part, coloured } => write_paths(&mut svg, path_width(world), *part, coloured),
            Mark::Bodies {
                colour,
                radius,
                poses,
            } => write_bodies(&mut svg, *colour, *radius, poses),
        };
    }
    svg + "</svg>\n"
}

/// The obstacles, and the walls: a thin line around the area that bodies can reach.
fn surroundings(world: &World) -> Vec<Mark> {
    let mut marks: Vec<Mark> = world.obstacles().iter().cloned().map(Mark::Obstacle).collect();
    if world.boundary() == Boundary::Walls {
        let near = world.padding();
        marks.push(Mark::Walls {
            at: [near; 2],
            size: [world.width(), world.height()].map(|side| side - 2.0 * near),
        });
    }
    marks
}

/// The place in the palette of each colour that agents have, with these agents.
fn coloured(colouring: Colouring<'_>, agents: usize) -> impl Iterator<Item = (usize, Vec<usize>)> {
    (0..colours::AGENTS.len()).filter_map(move |place| {
        let agents: Vec<usize> = colouring.agents(place, agents).collect();
        (!agents.is_empty()).then_some((place, agents))
    })
}

/// Radius of the bodies of the colour with the index `place`.
fn radius(world: &World, colouring: Colouring<'_>, place: usize) -> f32 {
    let own = match colouring {
        Colouring::Agents => None,
        Colouring::Species { radii, .. } => radii.get(place).copied(),
    };
    own.unwrap_or_else(|| world.radius()) as f32
}

/// The path of an agent through some frames, in pieces where the agent left a torus and came in again.
fn lines(frames: &[&[Pose]], agent: usize, world: &World) -> Vec<Line> {
    let mut lines: Vec<Line> = Vec::new();
    for (place, frame) in frames.iter().enumerate() {
        let [x, y, _] = frame[agent];
        let begins = place == 0 || is_jump(world, frames[place - 1][agent], frame[agent]);
        match lines.last_mut() {
            Some(line) if !begins => line.push([x, y]),
            _ => lines.push(vec![[x, y]]),
        }
    }
    lines
}

fn write_obstacle(svg: &mut String, obstacle: &Obstacle) -> std::fmt::Result {
    let line = colours::hex(colours::LINE);
    let [x, y] = obstacle.centre();
    match *obstacle {
        Obstacle::Disc { radius, .. } => {
            writeln!(
                svg,
                "<circle fill=\"{line}\" cx=\"{x}\" cy=\"{y}\" r=\"{radius}\"/>"
            )
        }
        Obstacle::Box {
            size: [width, height],
            ..
        } => {
            let (left, top) = (x - width / 2.0, y - height / 2.0);
            writeln!(
                svg,
                "<rect fill=\"{line}\" x=\"{left}\" y=\"{top}\" width=\"{width}\" height=\"{height}\"/>"
            )
        }
    }
}

fn write_walls(svg: &mut String, [x, y]: [f64; 2], [width, height]: [f64; 2]) -> std::fmt::Result {
    let line = colours::hex(colours::LINE);
    writeln!(
        svg,
        "<rect stroke=\"{line}\" stroke-opacity=\"0.55\" x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\"/>"
    )
}

fn write_paths(svg: &mut String, width: f64, part: u8, coloured: &[(Rgb, Vec<Line>)]) -> std::fmt::Result {
    let opacity = f32::from(part) / 255.0;
    writeln!(
        svg,
        "<g stroke-width=\"{width:.3}\" stroke-opacity=\"{opacity:.3}\">"
    )?;
    for (colour, lines) in coloured {
        write!(svg, "<path stroke=\"{}\" d=\"", colours::hex(*colour))?;
        for line in lines {
            for (place, [x, y]) in line.iter().enumerate() {
                write!(svg, "{}{x:.2} {y:.2}", if place == 0 { 'M' } else { 'L' })?;
            }
        }
        svg.push_str("\"/>\n");
    }
    writeln!(svg, "</g>")
}

fn write_bodies(svg: &mut String, colour: Rgb, radius: f32, poses: &[Pose]) -> std::fmt::Result {
    let colour = colours::hex(colour);
    for &pose in poses {
        let ([x, y, _], [tip_x, tip_y]) = (pose, tip(pose, radius));
        writeln!(
            svg,
            "<path stroke=\"{colour}\" stroke-width=\"{:.2}\" d=\"M{x:.2} {y:.2}L{tip_x:.2} {tip_y:.2}\"/>\
             <circle fill=\"{colour}\" cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"{radius}\"/>",
            0.4 * radius
        )?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::sample::{ring, world};

    #[test]
    fn every_agent_has_a_body_and_a_path_of_its_colour() {
        let world = world("agents = 3");
        let svg = trajectory_svg(&ring(&world, 400, 5), &world, Colouring::Agents, 160);
        assert_eq!(svg.matches("<circle").count(), 3);
        for place in 0..3 {
            let colour = colours::hex(colours::AGENTS[place]);
            assert!(svg.contains(&format!("<path stroke=\"{colour}\" d=\"M")), "{svg}");
        }
        assert!(!svg.contains(&colours::hex(colours::AGENTS[3])));
        assert!(svg.starts_with("<svg xmlns") && svg.ends_with("</svg>\n"));
    }

    #[test]
    fn a_path_over_the_edge_of_a_torus_begins_anew() {
        let torus = world("agents = 1\nboundary = \"torus\"");
        let poses = vec![
            [490.0, 100.0, 0.0],
            [498.0, 100.0, 0.0],
            [6.0, 100.0, 0.0],
            [14.0, 100.0, 0.0],
        ];
        let replay = Replay::new(vec![0, 1, 2, 3], 1, poses).unwrap();
        let frames: Vec<&[Pose]> = replay.frames().collect();
        assert_eq!(
            lines(&frames, 0, &torus),
            [
                vec![[490.0, 100.0], [498.0, 100.0]],
                vec![[6.0, 100.0], [14.0, 100.0]]
            ]
        );
        assert_eq!(lines(&frames, 0, &world("agents = 1")).len(), 1);
    }

    #[test]
    fn obstacles_and_walls_are_drawn_where_they_are() {
        let world = world("agents = 1\nobstacles = [{ x = 250, y = 200, radius = 40 }]");
        let svg = trajectory_svg(&ring(&world, 1, 1), &world, Colouring::Agents, 160);
        assert!(svg.contains("cx=\"250\" cy=\"200\" r=\"40\""), "{svg}");
        assert!(
            svg.contains("x=\"15\" y=\"15\" width=\"470\" height=\"470\""),
            "{svg}"
        );
    }
}
