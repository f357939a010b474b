//! A report of an invented campaign, for tests. The robots of the campaign drive without sensing, which makes no difference to a
//! report.

use super::{
    Entry, FurtherEntry, GenerationSummary, Judged, Map, MedoidEntry, Member, Names, PictureSheets, Pictured,
    Report, Spread,
};
use murmuration_model::{
    Repetition,
    labels::{Class, GivenClass},
};
use murmuration_swarm::{
    CampaignSpec, Class as JudgedClass, Controller, Pose, Purpose, RandomStream, Replay, Verdict, World,
};
use rand::RngExt as _;

/// The specification and the size of a sample campaign.
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

pub(super) fn report(sample: &Sample) -> Report {
    let spec = CampaignSpec::from_toml(sample.spec).unwrap();
    let mut stream = RandomStream::derive(spec.seed(), Purpose::Propose, 0);
    let count = spec.medoids() as usize;
    let population = sample.individuals.div_ceil(20);
    // Clusters with larger numbers have fewer members. The medoid of cluster c is individual c.
    let clusters: Vec<u32> = (0..sample.individuals)
        .map(|i| {
            if i < count {
                i as u32
            } else {
                (stream.random::<f64>() * stream.random::<f64>() * count as f64) as u32
            }
        })
        .collect();
    let centres: Vec<[f64; 2]> = (0..count)
        .map(|_| [stream.random_range(-3.0..3.0), stream.random_range(-2.0..2.0)])
        .collect();
    let mut near = |centre: f64| centre + (0..4).map(|_| stream.random_range(-0.45..0.45)).sum::<f64>();
    let points: Vec<[f64; 2]> = clusters
        .iter()
        .map(|&cluster| centres[cluster as usize].map(&mut near))
        .collect();
    let individuals: Vec<Entry> = (0..sample.individuals)
        .map(|i| Entry {
            generation: (i / population) as u32,
            controller: spec.controllers().sample(&mut stream),
            seed: stream.random_range(0..1 << 40),
            features: std::array::from_fn(|_| stream.random_range(-0.2..1.0)),
            embedding: match spec.space().embeds() {
                true => (0..5).map(|_| stream.random_range(-2.0..2.0) as f32).collect(),
                false => Vec::new(),
            },
            trials: Vec::new(),
            robustness: None,
            novelty_when_evaluated: 0.3 / (i / population + 2) as f64 * stream.random_range(0.3..2.0),
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
                mean_distance: stream.random_range(0.01..0.2),
                novelty: stream.random_range(0.001..0.1),
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
        checkpoint: match spec.space().embeds() {
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
        further: further(&medoids),
        medoids,
        clusters,
        loss: 123.4,
        judged: Judged {
            medoids: (0..count)
                .map(|place| Verdict::Class(JudgedClass::ALL[7 - place % 3]))
                .collect(),
            sample: vec![
                (0, Verdict::Class(JudgedClass::Random)),
                (1, Verdict::Class(JudgedClass::Milling)),
            ],
        },
        names: names(),
        repetition: Repetition::default(),
        spec,
    }
}

/// The pictures of the individuals: each individual has the picture of its medoid.
fn pictured(medoids: &[MedoidEntry], clusters: &[u32], spec: &CampaignSpec) -> Pictured {
    let mut sheets = PictureSheets::of(clusters.len(), spec.image().shape());
    for (index, &cluster) in (0..).zip(clusters) {
        sheets.add(index, &medoids[cluster as usize].image).unwrap();
    }
    sheets.finish().unwrap()
}

/// Two further individuals that move as the first two medoids do.
fn further(medoids: &[MedoidEntry]) -> Vec<FurtherEntry> {
    let like = medoids.iter().zip(20..22);
    like.map(|(medoid, index)| FurtherEntry {
        index,
        replay: medoid.replay.clone(),
    })
    .collect()
}

/// Members of a cluster that look like its medoid, at distances that no other cluster has.
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

/// Two classes. The first class has the first medoid and two other individuals; the judge alone named one of these individuals.
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
        best_novelty: level * stream.random_range(1.5..2.4),
        mean_novelty: level * stream.random_range(0.9..1.1),
        filtered: stream.random_range(10..40),
    }
}

/// The motion of robots that drive as if they saw no other robots, and stop at walls.
fn swarm(entry: &Entry, world: &World, frames: u32) -> Replay {
    let mut stream = RandomStream::derive(entry.seed, Purpose::Start, 0);
    let margin = world.margin();
    let (right, bottom) = (world.width() - margin, world.height() - margin);
    let mut agents: Vec<[f64; 3]> = (0..world.agents())
        .map(|_| {
            [
                stream.random_range(margin..right),
                stream.random_range(margin..bottom),
                stream.random_range(-3.1..3.1),
            ]
        })
        .collect();
    let genes = entry.controller.genes();
    let forward = world.wheel_radius() / 2.0 * (genes[0] + genes[1]);
    let turn = (genes[0] - genes[1]) / (2.0 * world.radius());
    let stride = (world.horizon() / frames).max(1);
    let (mut steps, mut poses) = (Vec::new(), Vec::new());
    for step in 0..=world.horizon() {
        if step % stride == 0 || step == world.horizon() {
            steps.push(step);
            let pose = |agent: &[f64; 3]| -> Pose { agent.map(|value| value as f32) };
            poses.extend(agents.iter().map(pose));
        }
        for [x, y, heading] in &mut agents {
            *x = (*x + forward * libm::cos(*heading)).clamp(margin, right);
            *y = (*y + forward * libm::sin(*heading)).clamp(margin, bottom);
            *heading += turn;
        }
    }
    Replay::new(steps, agents.len(), poses).unwrap()
}

/// Positions of agents in the last frames, with one channel per species if there are several.
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
