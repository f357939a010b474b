//! A report of an invented campaign, for tests and for looking at.
//!
//! Its swarms obey the robots' kinematics and sensors but not the simulator's exact rules: the report does not care.

use super::{
    Entry, GenerationSummary, Map, MedoidEntry, Member, Names, PictureSheets, Pictured, Report, Spread,
};
use murmuration_model::{
    Repetition,
    labels::{Class, GivenClass},
};
use murmuration_proto::{CampaignSpec, Controller, Pose, Purpose, RandomStream, Replay, World};

/// What the sample should look like; the fields are those of a campaign.
pub(super) struct Sample {
    pub(super) spec: &'static str,
    pub(super) individuals: usize,
    pub(super) frames: u32,
}

pub(super) const SMALL: Sample = Sample {
    spec: "name = \"sample\"\nmodel = \"single-sensor\"\nmethod = \"hand-crafted\"\nfilter = true\n\
           [taxonomy]\nmedoids = 3\n[world]\nagents = 6\nhorizon = 200",
    individuals: 40,
    frames: 50,
};

/// Genes that show well-known behaviours: the paper's examples, then others.
const KNOWN: [[f64; 4]; 12] = [
    [-0.7, 0.3, 1.0, 1.0],
    [0.6, 1.0, 0.4, 0.5],
    [-0.7, -1.0, 1.0, -1.0],
    [0.2, 0.7, -0.5, -0.1],
    [1.0, 0.9, 1.0, 1.0],
    [-0.8, -0.7, 0.2, -0.5],
    [0.9, -0.4, 0.2, -0.4],
    [-0.8, 1.0, 0.4, -0.1],
    [0.4, 0.7, 0.9, 0.7],
    [0.9, 0.8, 0.5, 0.9],
    [0.3, -0.6, 0.9, 0.8],
    [0.1, 0.4, 1.0, 0.2],
];

/// The report of a [`Sample`].
pub(super) fn report(sample: &Sample) -> Report {
    let spec = CampaignSpec::from_toml(sample.spec).unwrap();
    let mut stream = RandomStream::derive(spec.seed(), Purpose::Propose, 0);
    let count = spec.medoids() as usize;
    let population = sample.individuals.div_ceil(20);
    // Cluster c is chosen more rarely than c - 1, and its medoid is individual c.
    let clusters: Vec<u32> = (0..sample.individuals)
        .map(|i| {
            if i < count {
                i as u32
            } else {
                (stream.unit() * stream.unit() * count as f64) as u32
            }
        })
        .collect();
    let centres: Vec<[f64; 2]> = (0..count)
        .map(|_| [stream.between(-3.0, 3.0), stream.between(-2.0, 2.0)])
        .collect();
    let mut near = |centre: f64| centre + (0..4).map(|_| stream.between(-0.45, 0.45)).sum::<f64>();
    let points: Vec<[f64; 2]> = clusters
        .iter()
        .map(|&cluster| centres[cluster as usize].map(&mut near))
        .collect();
    let individuals: Vec<Entry> = (0..sample.individuals)
        .map(|i| Entry {
            generation: (i / population) as u32,
            controller: match KNOWN.get(i) {
                Some(genes) if spec.model().genes() == 4 => Controller::new(spec.model(), genes).unwrap(),
                _ => spec.controllers().sample(&mut stream),
            },
            seed: stream.below(1 << 40),
            features: std::array::from_fn(|_| stream.between(-0.2, 1.0)),
            embedding: match spec.method().embeds() {
                true => (0..5).map(|_| stream.between(-2.0, 2.0) as f32).collect(),
                false => Vec::new(),
            },
            trials: Vec::new(),
            robustness: None,
            novelty_when_evaluated: 0.3 / (i / population + 2) as f64 * stream.between(0.3, 2.0),
        })
        .collect();
    let size = |place: usize| {
        clusters
            .iter()
            .filter(|&&cluster| cluster as usize == place)
            .count()
    };
    let medoids: Vec<MedoidEntry> = (0..count)
        .map(|place| {
            let replay = swarm(&individuals[place], spec.world(), sample.frames);
            MedoidEntry {
                index: place as u64,
                image: image(&replay, &individuals[place].controller, &spec),
                cluster_size: size(place) as u64,
                mean_distance: stream.between(0.01, 0.2),
                novelty: stream.between(0.001, 0.1),
                spread: Some(spread(
                    place,
                    &image(&replay, &individuals[place].controller, &spec),
                )),
                carried: None,
                replay,
            }
        })
        .collect();
    Report {
        campaign: format!("{}-1", spec.name().as_str()),
        digest: "3f9ac41be07d5528".repeat(4),
        checkpoint: match spec.method().embeds() {
            true => "81c0de7744aa90be".repeat(4),
            false => String::new(),
        },
        created_ms: 1_795_219_200_000,
        simulator_version: "1".to_owned(),
        generations: (0..20)
            .map(|generation| generation_of(generation, &mut stream))
            .collect(),
        map: Map {
            points,
            axis_titles: ["first component (61 %)".into(), "second component (22 %)".into()],
        },
        pictured: pictured(&medoids, &clusters, &spec),
        individuals,
        medoids,
        clusters,
        loss: 123.4,
        names: names(),
        repetition: Repetition::default(),
        spec,
    }
}

/// Individuals that look like their medoids.
fn pictured(medoids: &[MedoidEntry], clusters: &[u32], spec: &CampaignSpec) -> Pictured {
    let mut sheets = PictureSheets::of(clusters.len(), spec.image().shape());
    for (index, &cluster) in (0..).zip(clusters) {
        sheets.add(index, &medoids[cluster as usize].image).unwrap();
    }
    sheets.finish().unwrap()
}

/// Members that look like the medoid, at distances that no other cluster has.
fn spread(place: usize, image: &[u8]) -> Spread {
    let member = |index: usize, distance: f64| Member {
        index: index as u64,
        distance: distance * (place + 1) as f64,
        image: image.to_vec(),
    };
    Spread {
        nearest: member(20, 0.0123),
        median: member(21, 0.107),
        farthest: member(22, 1.31),
    }
}

/// Two classes, the first medoid and two others of the first of them, one of these by the machine alone.
fn names() -> Names {
    let class = |name: &str, colour: &str, labels| Class {
        name: name.parse().unwrap(),
        colour: colour.parse().unwrap(),
        shortcut: None,
        labels,
        near: Vec::new(),
    };
    let ring = "ring, or \"mill\"";
    let given = |by_machine| GivenClass {
        class: ring.parse().unwrap(),
        by_machine,
    };
    Names {
        classes: vec![class(ring, "#1d96e6", 4), class("wall", "#e6861d", 0)],
        by_individual: [(0, false), (5, false), (7, true)]
            .map(|(index, by_machine)| (index, given(by_machine)))
            .into(),
    }
}

fn generation_of(generation: u32, stream: &mut RandomStream) -> GenerationSummary {
    let level = 0.02 + 0.3 / f64::from(generation + 2);
    GenerationSummary {
        generation,
        best_novelty: level * stream.between(1.5, 2.4),
        mean_novelty: level * stream.between(0.9, 1.1),
        filtered: 10 + stream.below(30),
    }
}

/// Robots that drive, see and push each other apart.
fn swarm(entry: &Entry, world: &World, frames: u32) -> Replay {
    let mut stream = RandomStream::derive(entry.seed, Purpose::Start, 0);
    let margin = world.margin();
    let (right, bottom) = (world.width() - margin, world.height() - margin);
    let mut agents: Vec<[f64; 3]> = (0..world.agents())
        .map(|_| {
            [
                stream.between(margin, right),
                stream.between(margin, bottom),
                stream.between(-3.1, 3.1),
            ]
        })
        .collect();
    let genes = entry.controller.genes();
    let stride = (world.horizon() / frames).max(1);
    let (mut steps, mut poses) = (Vec::new(), Vec::new());
    for step in 0..=world.horizon() {
        if step % stride == 0 || step == world.horizon() {
            steps.push(step);
            poses.extend(
                agents
                    .iter()
                    .map(|agent| -> Pose { agent.map(|value| value as f32) }),
            );
        }
        for i in 0..agents.len() {
            let [x, y, heading] = agents[i];
            let (cos, sin) = (libm::cos(heading), libm::sin(heading));
            let seen = agents.iter().enumerate().any(|(j, other)| {
                let (ex, ey) = (other[0] - x, other[1] - y);
                let ahead = ex * cos + ey * sin;
                j != i && ahead > 0.0 && ex * ex + ey * ey - ahead * ahead < world.radius() * world.radius()
            });
            let (left, right_speed) = if seen {
                (genes[2], genes[3])
            } else {
                (genes[0], genes[1])
            };
            let forward = world.wheel_radius() / 2.0 * (left + right_speed);
            let mut at = [x + forward * cos, y + forward * sin];
            for (j, other) in agents.iter().enumerate() {
                let (dx, dy) = (at[0] - other[0], at[1] - other[1]);
                let distance = (dx * dx + dy * dy).sqrt();
                if j != i && distance < 2.0 * world.radius() && distance > 0.0 {
                    let push = (2.0 * world.radius() - distance) / distance;
                    at = [at[0] + dx * push, at[1] + dy * push];
                }
            }
            let turn = (left - right_speed) / (2.0 * world.radius());
            agents[i] = [
                at[0].clamp(margin, right),
                at[1].clamp(margin, bottom),
                heading + turn,
            ];
        }
    }
    Replay::new(steps, agents.len(), poses).unwrap()
}

/// Where agents were in the last frames, each species in its channel if there are several.
fn image(replay: &Replay, controller: &Controller, spec: &CampaignSpec) -> Vec<u8> {
    let (world, shape) = (spec.world(), spec.image().shape());
    let species = controller.species_of_robots(world.agents());
    let resolution = shape.side();
    let mut image = vec![0u8; shape.bytes()];
    let cell = |part: f64| ((part * resolution as f64) as usize).min(resolution - 1);
    let frames: Vec<_> = replay.frames().collect();
    for frame in &frames[frames.len().saturating_sub(50)..] {
        for (pose, species) in frame.iter().zip(&species) {
            let (x, y) = (
                f64::from(pose[0]) / world.width(),
                f64::from(pose[1]) / world.height(),
            );
            let channel = species % shape.channels() * shape.pixels();
            let pixel = &mut image[channel + cell(x) * resolution + cell(y)];
            *pixel = pixel.saturating_add(60);
        }
    }
    image
}
