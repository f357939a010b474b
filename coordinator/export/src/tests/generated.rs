//! Generated campaigns: of every kind, and filled with values that follow from a number.

use murmuration_model::{
    ArchiveEmbedder, CampaignRecord, CampaignState, ExportedCampaign, Rounds, Weight,
    labels::{Action, Annotator, Change, Entry, Labels, Preference, RequestId, Triple},
};
use murmuration_proto::{
    CampaignSpec, CheckpointDigest, Controller, Lineage, PictureShape, Purpose, RandomStream,
    SIMULATOR_VERSION, Verdict, training::Architecture,
};
use murmuration_store::{
    ArchivedIndividual, CheckpointRecord, ClusterMeasures, GenerationRecord, Trial,
    transfer::{Medoids, Member, Part},
};
use murmuration_trainer::{network::Network, onnx};
use proptest::prelude::*;
use std::sync::LazyLock;

/// Untrained embedders of pictures of 50 x 50 in five numbers: each is the parent of the next.
static MODELS: LazyLock<[Vec<u8>; 3]> = LazyLock::new(|| {
    [1, 2, 3].map(|seed| {
        let architecture = Architecture::compact(PictureShape::PAPER, 5).unwrap();
        onnx::export(&Network::<f32>::initialise(architecture, seed))
    })
});

/// An untrained embedder of pictures of 16 x 16 in 256 numbers.
static WIDE_MODEL: LazyLock<[Vec<u8>; 1]> = LazyLock::new(|| {
    let architecture = Architecture::compact(PictureShape::new(1, 16).unwrap(), 256).unwrap();
    [onnx::export(&Network::<f32>::initialise(architecture, 1))]
});

const SPECIES: &str = "[[species]]\nname = \"a\"\nshare = 0.5\nrobot.sensors = [{}]\n[[species]]\nname = \"b\"\nshare = 0.5\nrobot.sensors = [{}]\n";

/// A campaign that is generated.
#[derive(Debug, Clone)]
pub(super) struct GeneratedCampaign {
    pub(super) method: &'static str,
    pub(super) starts: u32,
    pub(super) judge: bool,
    pub(super) species: bool,
    pub(super) state: CampaignState,
    /// The number that everything in the archive follows from.
    pub(super) seed: u64,
    /// Whether its checkpoint has a parent, and, unless it is completed, has come of a round of feedback and is left for another.
    pub(super) is_refined: bool,
    /// Whether pictures are small, embeddings long, and generations of 500 individuals.
    pub(super) is_wide: bool,
    pub(super) log: Vec<(u8, u64, u8)>,
}

impl GeneratedCampaign {
    fn has_embedder(&self) -> bool {
        ["latent", "untrained", "concatenate"].contains(&self.method)
    }

    /// The checkpoints, parents first; the archive is embedded by the second, or by the only one.
    fn models(&self) -> &'static [Vec<u8>] {
        match (self.has_embedder(), self.is_wide, self.is_refined) {
            (false, ..) => &[],
            (true, true, _) => &WIDE_MODEL[..],
            (true, false, false) => &MODELS[..1],
            (true, false, true) if self.state == CampaignState::Completed => &MODELS[..2],
            (true, false, true) => &MODELS[..],
        }
    }

    fn embedder(&self) -> ArchiveEmbedder {
        let digests: Vec<_> = self
            .models()
            .iter()
            .map(|model| CheckpointDigest::of(model))
            .collect();
        match digests[..] {
            [] => ArchiveEmbedder::None,
            [checkpoint] | [_, checkpoint] => ArchiveEmbedder::Checkpoint(checkpoint),
            [_, from, to, ..] => ArchiveEmbedder::Switching {
                from: Some(from),
                to,
                embedded: 0,
            },
        }
    }

    const fn population(&self) -> u64 {
        if self.is_wide { 500 } else { 4 }
    }

    const fn dimensions(&self) -> u64 {
        if self.is_wide { 256 } else { 5 }
    }

    pub(super) fn spec(&self) -> CampaignSpec {
        let model = if self.species {
            ""
        } else {
            "model = \"single-sensor\"\n"
        };
        // An untrained network is made by its campaign.
        let checkpoint = match self.has_embedder() && self.method != "untrained" {
            true => format!("checkpoint = \"{}\"\n", CheckpointDigest::of(&self.models()[0])),
            false => String::new(),
        };
        let (species, channels) = match (self.species, self.is_wide) {
            (true, _) => (SPECIES, "[image]\nresolution = 8\nchannels = \"species\"\n"),
            (false, true) => ("", "[image]\nresolution = 16\n"),
            (false, false) => ("", ""),
        };
        let text = format!(
            "name = \"case\"\nmethod = \"{}\"\n{model}{checkpoint}{species}{channels}[evaluation]\nstarts = {}\njudge = {}\n\
             [search]\npopulation = {}\ngenerations = 2\n[taxonomy]\nmedoids = 2\n",
            self.method,
            self.starts,
            self.judge,
            self.population()
        );
        CampaignSpec::from_toml(&text).unwrap()
    }

    /// Bits that follow from the seed.
    fn bits(&self, index: u64, place: u64) -> u64 {
        // SplitMix64 of all three.
        let mut bits = self.seed;
        for number in [index, place] {
            bits = (bits ^ number).wrapping_add(0x9e37_79b9_7f4a_7c15);
            bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            bits ^= bits >> 31;
        }
        bits
    }

    /// A number from -1 to 1, now and then a special one.
    fn number(&self, index: u64, place: u64) -> f64 {
        match self.bits(index, place) % 11 {
            0 => -0.0,
            1 => f64::MIN_POSITIVE / 4.0,
            bits => (bits as f64 - 5.0) / 6.0 + f64::EPSILON * (self.bits(index, place + 1000) % 9) as f64,
        }
    }

    fn member(&self, spec: &CampaignSpec, index: u64) -> Member {
        let genes: Vec<f64> = (0..spec.model().genes() as u64)
            .map(|gene| self.number(index, 100 + gene).clamp(-1.0, 1.0))
            .collect();
        let trial = |start: u64| Trial {
            features: std::array::from_fn(|feature| self.number(index, 200 + 10 * start + feature as u64)),
            embedding: match self.has_embedder() {
                true => (0..self.dimensions())
                    .map(|place| self.number(index, 400 + 1000 * start + place) as f32)
                    .collect(),
                false => Vec::new(),
            },
            image: Some(
                (0..spec.image().bytes() as u64)
                    .map(|pixel| self.bits(index + start, pixel) as u8)
                    .collect(),
            ),
            verdict: self
                .judge
                .then(|| Verdict::try_from(1 + (self.bits(index, start) % 11) as i32).unwrap()),
        };
        let is_completed = self.state == CampaignState::Completed;
        Member {
            individual: ArchivedIndividual {
                index,
                generation: (index / self.population()) as u32,
                controller: Controller::new(spec.model(), &genes).unwrap(),
                seed: RandomStream::derive(spec.seed(), Purpose::Start, index).bits(),
                trials: (0..u64::from(self.starts)).map(trial).collect(),
                novelty: self.number(index, 2).abs(),
            },
            cluster: is_completed.then_some((index % 2) as u32),
            robust_trials: (is_completed && self.starts > 1).then_some((index % 2) as u8),
        }
    }

    /// A log in which somebody answers, undoes, and changes classes.
    pub(super) fn log(&self) -> Vec<(RequestId, Entry)> {
        let mut labels = Labels::default();
        let mut log = Vec::new();
        for (place, (what, index, class)) in self.log.iter().enumerate() {
            let class = format!("class {}", class % 3);
            let newest = labels.class_changes().next_back().map(|(entry, _)| entry);
            let action = match what % 11 {
                0 => Action::Undo,
                1 => Action::Rename {
                    class: class.parse().unwrap(),
                    to: "=ring, \"nested\"".parse().unwrap(),
                },
                2 => Action::Colour {
                    class: class.parse().unwrap(),
                    colour: "#102030".parse().unwrap(),
                },
                3 => Action::Compare {
                    triple: Triple::new(index % 8, (index % 8 + 1) % 8, (index % 8 + 2) % 8).unwrap(),
                    preference: Preference::ALL[(index % 3) as usize],
                },
                4 => Action::WithdrawComparison {
                    entry: labels.comparisons().last().map_or(0, |newest| newest.entry),
                },
                5 => Action::Delete {
                    class: class.parse().unwrap(),
                },
                6 => Action::Shortcut {
                    class: class.parse().unwrap(),
                    shortcut: (index % 2 == 0).then(|| "w".parse().unwrap()),
                },
                7 => Action::Revert {
                    entry: newest.unwrap_or_default(),
                },
                _ => Action::Answer {
                    index: index % 8,
                    answer: class.parse().unwrap(),
                },
            };
            let annotator = if what % 2 == 0 { "ana" } else { "synthetic" };
            let change = Change {
                annotator: Annotator::known(annotator).unwrap(),
                time_ms: 1_700_000_000_000 + place as u64,
                action,
            };
            let request = match what % 3 {
                0 => RequestId::of_round(1),
                _ => format!("request {place}").parse().unwrap(),
            };
            log.extend(labels.record(change).ok().map(|entry| (request, entry)));
        }
        log
    }

    /// Everything of the campaign, in order.
    pub(super) fn parts(&self) -> Vec<Part> {
        let spec = self.spec();
        let log = self.log();
        let record = CampaignRecord {
            id: "case-7".parse().unwrap(),
            weight: Weight::default(),
            state: self.state,
            error: String::new(),
            created_ms: 1_700_000_000_000,
            rollbacks: 1,
            decisions: 0,
            simulator_version: SIMULATOR_VERSION.to_owned(),
            generations_done: 2,
            last_novelty: None,
            embedder: self.embedder(),
            pictures_done: 0,
            rounds: match self.is_refined && !log.is_empty() && self.state != CampaignState::Completed {
                true => Rounds {
                    done: 1,
                    last_cutoff: log.len() as u64,
                    current_cutoff: None,
                },
                false => Rounds::default(),
            },
            spec,
            study: None,
            ended_ms: None,
        };
        let mut parts = Vec::new();
        let mut parent = None;
        for model in self.models() {
            let digest = CheckpointDigest::of(model);
            let lineage = Lineage {
                configuration: "seed = 1".to_owned(),
                parent: parent.replace(digest),
                ..Lineage::default()
            };
            let (size, created_ms) = (model.len() as u64, 5);
            parts.push(Part::Checkpoint(CheckpointRecord {
                digest,
                size,
                lineage,
                created_ms,
            }));
            let chunks = model.chunks(murmuration_proto::PART_BYTES);
            parts.extend(chunks.map(|chunk| Part::Chunk(chunk.to_vec())));
        }
        if !log.is_empty() {
            parts.push(Part::Labels(log.clone()));
        }
        for generation in 0..2 {
            let first = self.population() * u64::from(generation);
            let members: Vec<Member> = (first..first + self.population())
                .map(|index| self.member(&record.spec, index))
                .collect();
            let novelty: Vec<f64> = members.iter().map(|member| member.individual.novelty).collect();
            parts.push(Part::Generation(GenerationRecord::of(generation, &novelty, 3)));
            let divided = members.chunks(500).map(|some| Part::Individuals(some.to_vec()));
            parts.extend(divided);
        }
        if self.state == CampaignState::Completed {
            let cluster = |distance| ClusterMeasures {
                mean_distance: distance,
                novelty: 0.25,
            };
            parts.push(Part::Taxonomy(Medoids {
                medoids: vec![(2, cluster(0.5)), (5, cluster(1.0 / 3.0))],
                loss: 0.1,
            }));
        }
        let campaign = ExportedCampaign {
            record,
            label_entries: log.len() as u64,
            digest: String::new(),
        };
        parts.insert(0, Part::Campaign(Box::new(campaign)));
        parts
    }
}

pub(super) fn generated_campaign() -> impl Strategy<Value = GeneratedCampaign> {
    let methods = ["random", "hand-crafted", "latent", "untrained", "concatenate"];
    let states = [
        CampaignState::Completed,
        CampaignState::Running,
        CampaignState::Failed,
    ];
    let log = proptest::collection::vec(any::<(u8, u64, u8)>(), 0..12);
    let kind = (
        prop::sample::select(methods.to_vec()),
        1..4_u32,
        any::<bool>(),
        any::<bool>(),
        any::<bool>(),
    );
    (kind, prop::sample::select(states.to_vec()), any::<u64>(), log).prop_map(
        |((method, starts, judge, species, is_refined), state, seed, log)| {
            let one = GeneratedCampaign {
                method,
                starts,
                judge,
                species,
                state,
                seed,
                is_refined,
                is_wide: false,
                log,
            };
            GeneratedCampaign {
                species: species && !one.has_embedder(),
                ..one
            }
        },
    )
}
