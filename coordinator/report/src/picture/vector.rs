//! The paths of a swarm as SVG, for papers: the picture that [`trajectory_png`](super::trajectory_png) draws, in world units.

use super::{
    sketch::Colouring,
    trajectory::{ages, is_jump},
};
use murmuration_model::colours;
use murmuration_swarm::{Boundary, Obstacle, Pose, Replay, World};
use std::fmt::Write as _;

/// The paths of the last `window` steps. `colouring` determines the agents' colours. Older parts of a path are fainter. The
/// bodies are at their last positions, each with a tick in the direction of its heading, and the walls are a thin line. x goes
/// right and y down, as on a screen. A unit of the picture is a world unit, and the background is transparent.
pub fn trajectory_svg(replay: &Replay, world: &World, colouring: Colouring<'_>, window: u32) -> String {
    let (width, height) = (world.width(), world.height());
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" \
         fill=\"none\" stroke-linecap=\"round\" stroke-linejoin=\"round\">\n"
    );
    surroundings(&mut svg, world);
    let frames: Vec<&[Pose]> = replay.frames().collect();
    let line = width.max(height) / 290.0;
    for (first, last, part) in ages(replay.steps(), window) {
        let opacity = f32::from(part) / 255.0;
        let _ = writeln!(
            svg,
            "<g stroke-width=\"{line:.3}\" stroke-opacity=\"{opacity:.3}\">"
        );
        for (colour, agents) in coloured(colouring, replay.agents()) {
            let path: String = agents
                .iter()
                .map(|&agent| path(&frames[first..=last], agent, world))
                .collect();
            let _ = writeln!(svg, "<path stroke=\"{colour}\" d=\"{path}\"/>");
        }
        svg += "</g>\n";
    }
    if let Some(poses) = frames.last() {
        bodies(&mut svg, poses, world, colouring);
    }
    svg + "</svg>\n"
}

/// Draws the walls, a thin line around the area that bodies can reach, and the obstacles.
fn surroundings(svg: &mut String, world: &World) {
    let line = colours::hex(colours::LINE);
    for obstacle in world.obstacles() {
        let [x, y] = obstacle.centre();
        let _ = match *obstacle {
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
        };
    }
    if world.boundary() == Boundary::Walls {
        let near = world.padding();
        let (width, height) = (world.width() - 2.0 * near, world.height() - 2.0 * near);
        let _ = writeln!(
            svg,
            "<rect stroke=\"{line}\" stroke-opacity=\"0.55\" x=\"{near}\" y=\"{near}\" width=\"{width}\" height=\"{height}\"/>"
        );
    }
}

/// Each colour that agents have, with these agents.
fn coloured(colouring: Colouring<'_>, agents: usize) -> impl Iterator<Item = (String, Vec<usize>)> {
    colours::AGENTS
        .iter()
        .enumerate()
        .filter_map(move |(place, &colour)| {
            let agents: Vec<usize> = colouring.agents(place, agents).collect();
            (!agents.is_empty()).then(|| (colours::hex(colour), agents))
        })
}

/// The path of an agent through some frames.
fn path(frames: &[&[Pose]], agent: usize, world: &World) -> String {
    let mut path = String::new();
    for (place, frame) in frames.iter().enumerate() {
        let [x, y, _] = frame[agent];
        let begins = place == 0 || is_jump(world, frames[place - 1][agent], frame[agent]);
        let _ = write!(path, "{}{x:.2} {y:.2}", if begins { 'M' } else { 'L' });
    }
    path
}

fn bodies(svg: &mut String, poses: &[Pose], world: &World, colouring: Colouring<'_>) {
    for (colour, agents) in coloured(colouring, poses.len()) {
        for agent in agents {
            let [x, y, heading] = poses[agent];
            let radius = match colouring {
                Colouring::Agents => world.radius(),
                Colouring::Species { of_agents, radii } => {
                    let own = of_agents.get(agent).and_then(|&species| radii.get(species));
                    own.copied().unwrap_or_else(|| world.radius())
                }
            } as f32;
            let (tip_x, tip_y) = (
                x + 2.0 * radius * libm::cosf(heading),
                y + 2.0 * radius * libm::sinf(heading),
            );
            let _ = writeln!(
                svg,
                "<path stroke=\"{colour}\" stroke-width=\"{:.2}\" d=\"M{x:.2} {y:.2}L{tip_x:.2} {tip_y:.2}\"/>\
                 <circle fill=\"{colour}\" cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"{radius}\"/>",
                0.4 * radius
            );
        }
    }
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
            path(&frames, 0, &torus),
            "M490.00 100.00L498.00 100.00M6.00 100.00L14.00 100.00"
        );
        assert_eq!(path(&frames, 0, &world("agents = 1")).matches('M').count(), 1);
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
