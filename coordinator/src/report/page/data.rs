//! The numbers that the page's scripts draw from: columns of little-endian binary in base64, so that 100,000
//! individuals and the motion of every medoid stay small and load at once.

use crate::{
    picture::{colours, thinned},
    report::Report,
};
use base64::{Engine as _, engine::general_purpose::STANDARD};
use maud::{Markup, PreEscaped, html};
use murmuration_proto::{Replay, World};
use serde_json::{Value, json};

/// Most individuals on the map.
const MOST_POINTS: usize = 100_000;
/// Bytes for the motion of all medoids together, before base64.
const MOTION_BYTES: usize = 6 << 20;
const MOST_FRAMES: usize = 400;
const POSE_BYTES: usize = 5;

/// A block of JSON that no browser runs.
pub(super) fn block(report: &Report) -> Markup {
    // `<` could end the block; written as an escape it is the same JSON.
    let json = content(report).to_string().replace('<', "\\u003c");
    html! { script #data type="application/json" { (PreEscaped(json)) } }
}

/// Indices of the individuals that the map shows, ascending; every medoid is among them.
pub(super) fn shown_points(report: &Report) -> Vec<usize> {
    let mut shown = thinned(report.individuals.len(), MOST_POINTS);
    shown.extend(report.medoids.iter().map(|medoid| medoid.index as usize));
    shown.sort_unstable();
    shown.dedup();
    shown
}

fn content(report: &Report) -> Value {
    let world = report.spec.world();
    let runs: Vec<Value> = report
        .medoids
        .iter()
        .map(|medoid| run(&medoid.replay, world, report.medoids.len()))
        .collect();
    json!({
        "world": {
            "width": world.width(), "height": world.height(), "padding": world.padding(), "radius": world.radius(),
        },
        "agentColours": colours::AGENTS.map(colours::hex),
        "clusterColours": (0..report.medoids.len()).map(|place| colours::hex(colours::cluster(place))).collect::<Vec<_>>(),
        "runs": runs,
        "archive": archive(report),
    })
}

/// Steps, number of agents, and for each frame and agent x and y (0 to 65535 over the world) and heading (0 to 255 over
/// a turn), each as one column.
fn run(replay: &Replay, world: &World, medoids: usize) -> Value {
    let agents = replay.agents();
    let most = (MOTION_BYTES / (POSE_BYTES * agents * medoids)).min(MOST_FRAMES);
    let frames: Vec<_> = replay.frames().collect();
    let shown = thinned(frames.len(), most);
    let poses = || shown.iter().flat_map(|&frame| frames[frame]);
    let turn = |heading: f32| {
        let turns = f64::from(heading) / std::f64::consts::TAU;
        ((turns - turns.floor()) * 256.0).round() as u32 as u8
    };
    json!({
        "agents": agents,
        "steps": shown.iter().map(|&frame| replay.steps()[frame]).collect::<Vec<_>>(),
        "x": column(poses().map(|pose| sixteen_bits(f64::from(pose[0]) / world.width()).to_le_bytes())),
        "y": column(poses().map(|pose| sixteen_bits(f64::from(pose[1]) / world.height()).to_le_bytes())),
        "heading": column(poses().map(|pose| [turn(pose[2])])),
    })
}

/// The individuals on the map: place, cluster, index, generation, novelty and genes in ten-thousandths.
fn archive(report: &Report) -> Value {
    let shown = shown_points(report);
    let entries = || shown.iter().map(|&index| &report.individuals[index]);
    let axis = |axis: usize| {
        let values = || report.map.points.iter().map(|point| point[axis]);
        let low = values().fold(f64::INFINITY, f64::min);
        let span = values().fold(f64::NEG_INFINITY, f64::max) - low;
        let place = move |value: f64| if span > 0.0 { (value - low) / span } else { 0.5 };
        column(
            shown
                .iter()
                .map(|&index| sixteen_bits(place(report.map.points[index][axis])).to_le_bytes()),
        )
    };
    let place_of = |medoid: u64| shown.partition_point(|&index| index < medoid as usize);
    json!({
        "x": axis(0),
        "y": axis(1),
        "cluster": column(shown.iter().map(|&index| (report.clusters[index] as u16).to_le_bytes())),
        "index": column(shown.iter().map(|&index| (index as u32).to_le_bytes())),
        "generation": column(entries().map(|entry| entry.generation.to_le_bytes())),
        "novelty": column(entries().map(|entry| (entry.novelty as f32).to_le_bytes())),
        "genes": column(entries().flat_map(|entry| entry.controller.genes()).map(|gene| ((gene * 1e4).round() as i16).to_le_bytes())),
        "medoids": report.medoids.iter().map(|medoid| place_of(medoid.index)).collect::<Vec<_>>(),
    })
}

fn sixteen_bits(part: f64) -> u16 {
    (part * 65535.0).round() as u16
}

fn column<const N: usize>(values: impl Iterator<Item = [u8; N]>) -> String {
    STANDARD.encode(values.collect::<Vec<_>>().as_flattened())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::sample::{ring, world};

    fn bytes(run: &Value, column: &str) -> Vec<u8> {
        STANDARD.decode(run[column].as_str().unwrap()).unwrap()
    }

    #[test]
    fn a_run_reads_back_to_within_its_resolution() {
        let world = world("width = 800.0");
        let replay = ring(&world, 1200, 3);
        let run = run(&replay, &world, 16);
        assert_eq!(run["steps"].as_array().unwrap().len(), 400);
        assert_eq!(run["steps"][399], 1200);
        let (xs, headings) = (bytes(&run, "x"), bytes(&run, "heading"));
        let last = replay.frames().last().unwrap();
        for (agent, pose) in last.iter().enumerate() {
            let at = 399 * 24 + agent;
            let x = f64::from(u16::from_le_bytes([xs[2 * at], xs[2 * at + 1]])) / 65535.0 * 800.0;
            assert!((x - f64::from(pose[0])).abs() < 0.01);
            let turned = f64::from(headings[at]) / 256.0 * std::f64::consts::TAU - f64::from(pose[2]);
            assert!(
                libm::cos(turned) > 0.9998,
                "heading {} read as {}",
                pose[2],
                headings[at]
            );
        }
    }

    #[test]
    fn huge_swarms_lose_frames_not_the_start_or_the_end() {
        let crowd = world("agents = 10000\nwidth = 5000.0\nheight = 5000.0");
        let run = run(&ring(&crowd, 400, 10), &crowd, 16);
        let steps = run["steps"].as_array().unwrap();
        assert_eq!(
            (steps[0].clone(), steps.last().unwrap().clone()),
            (json!(0), json!(400))
        );
        assert!(16 * bytes(&run, "x").len() < MOTION_BYTES);
    }
}
