//! Describes how a world differs from the paper's world.

use crate::numbers::counted;
use murmuration_swarm::{Boundary, Noise, StartShape, World};

/// The differences between a world and the paper's world, with one phrase for each difference.
pub(super) fn differences(world: &World) -> Vec<String> {
    let paper = World::default();
    let mut phrases = Vec::new();
    if (world.width(), world.height()) != (paper.width(), paper.height()) {
        phrases.push(format!("{} × {}", world.width(), world.height()));
    }
    match world.boundary() {
        Boundary::Walls => {}
        Boundary::Open => phrases.push("open, without walls".to_owned()),
        Boundary::Torus => phrases.push("a torus".to_owned()),
    }
    if !world.obstacles().is_empty() {
        phrases.push(counted(world.obstacles().len() as u64, "obstacle"));
    }
    match world.start() {
        StartShape::Uniform => {}
        StartShape::Disc { radius } => phrases.push(format!("robots start in a disc of radius {radius}")),
        StartShape::Line { length } => phrases.push(format!("robots start on a line of length {length}")),
        StartShape::Poses(_) => phrases.push("robots start at given poses".to_owned()),
    }
    phrases.extend(of_noise(world.noise()));
    phrases
}

fn of_noise(noise: Noise) -> impl Iterator<Item = String> {
    let shares = [
        ("slip", noise.slip()),
        ("gain", noise.gain()),
        ("missed detections", noise.missed()),
        ("false detections", noise.false_detection()),
    ];
    let shares = shares.into_iter().filter(|(_, value)| *value > 0.0);
    let delay = (noise.delay() > 0).then(|| {
        let steps = counted(noise.delay().into(), "step");
        format!("sensing late by {steps}")
    });
    shares.map(|(name, value)| format!("{name} {value}")).chain(delay)
}

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_swarm::CampaignSpec;

    #[test]
    fn only_what_differs_from_the_papers_world_is_told() {
        let told = |text: &str| {
            let spec = format!("model = \"single-sensor\"\nmethod = \"random\"\n{text}");
            differences(CampaignSpec::from_toml(&spec).unwrap().world())
        };
        assert!(told("").is_empty());
        assert_eq!(
            told(
                "[world]\nboundary = \"torus\"\nwidth = 300\nobstacles = [{ x = 250, y = 250, radius = 40 }]\n\
                 [world.start]\nshape = \"disc\"\nradius = 100\n[world.noise]\nslip = 0.05\ndelay = 2"
            ),
            [
                "300 × 500",
                "a torus",
                "1 obstacle",
                "robots start in a disc of radius 100",
                "slip 0.05",
                "sensing late by 2 steps"
            ]
        );
    }
}
