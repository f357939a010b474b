//! Generated campaigns of every kind, filled with values that follow from a seed.

use crate::{
    ArchivedIndividual, ClusterMeasures, DataDirectory, GenerationRecord, Store, StoredTaxonomy, Trial,
    archive::{insert_generation, insert_individuals},
    checkpoint_rows::checkpoint_number,
    checkpoints::Checkpoints,
    individual::compressed,
    labels::insert,
    numbers::clamped,
    taxonomies::insert_taxonomy,
};
use murmuration_model::{
    CampaignId, CampaignState, Weight,
    labels::{Action, Annotator, Change, Entry, Labels, RequestId},
};
use murmuration_proto::SIMULATOR_VERSION;
use murmuration_swarm::{
    CampaignSpec, CheckpointDigest, Controller, Lineage, PictureShape, Purpose, RandomStream, Verdict,
    training::Architecture,
};
use murmuration_train::{network::Network, onnx};
use proptest::prelude::*;
use rusqlite::params;
use std::{path::Path, sync::LazyLock};

/// Untrained embedders that turn pictures of 50 x 50 pixels into five numbers. Each embedder is the parent of the next.
static MODELS: LazyLock<[Vec<u8>; 3]> = LazyLock::new(|| {
    [1, 2, 3].map(|seed| {
        let architecture = Architecture::compact(PictureShape::PAPER, 5).unwrap();
        onnx::export(&Network::<f32>::initialise(architecture, seed))
    })
});

/// An untrained embedder that turns pictures of 16 x 16 pixels into 256 numbers.
static WIDE_MODEL: LazyLock<[Vec<u8>; 1]> = LazyLock::new(|| {
    let architecture = Architecture::compact(PictureShape::new(1, 16).unwrap(), 256).unwrap();
    [onnx::export(&Network::<f32>::initialise(architecture, 1))]
});

const SPECIES: &str = "[[species]]\nname = \"a\"\nshare = 0.5\nrobot.sensors = [{}]\n[[species]]\nname = \"b\"\nshare = 0.5\nrobot.sensors = [{}]\n";

/// A generated campaign.
#[derive(Debug, Clone)]
pub(super) struct GeneratedCampaign {
    pub(super) method: &'static str,
    pub(super) starts: u32,
    pub(super) judge: bool,
    pub(super) species: bool,
    pub(super) state: CampaignState,
    /// Random seed of everything in the archive.
    pub(super) seed: u64,
    /// Whether the campaign's checkpoint has a parent. In a campaign that is not completed, the checkpoint then comes from a
    /// round of feedback, and the campaign is moving to another checkpoint.
    pub(super) is_refined: bool,
    /// Whether pictures are small, embeddings are long, and generations have 500 individuals.
    pub(super) is_wide: bool,
    pub(super) log: Vec<(u8, u64, u8)>,
}

impl GeneratedCampaign {
    fn has_embedder(&self) -> bool {
        self.method != "random" && self.method != "hand-crafted"
    }

    /// The campaign's checkpoints, parents first. The second checkpoint embeds the archive, or the only checkpoint does.
    fn models(&self) -> &'static [Vec<u8>] {
        match (self.has_embedder(), self.is_wide, self.is_refined) {
            (false, ..) => &[],
            (true, true, _) => &WIDE_MODEL[..],
            (true, false, false) => &MODELS[..1],
            (true, false, true) if self.state == CampaignState::Completed => &MODELS[..2],
            (true, false, true) => &MODELS[..],
        }
    }

    /// The checkpoint of the archive, and the next checkpoint.
    fn embedder(&self) -> [Option<CheckpointDigest>; 2] {
        let digests: Vec<_> = self
            .models()
            .iter()
            .map(|model| CheckpointDigest::of(model))
            .collect();
        match digests[..] {
            [] => [None, None],
            [checkpoint] | [_, checkpoint] => [Some(checkpoint), None],
            [_, from, to, ..] => [Some(from), Some(to)],
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
        // A campaign of the method `untrained` makes its own network.
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

    /// Bits that follow from the seed, `index` and `place`.
    fn bits(&self, index: u64, place: u64) -> u64 {
        // This is SplitMix64 of the seed, `index` and `place`.
        let mut bits = self.seed;
        for number in [index, place] {
            bits = (bits ^ number).wrapping_add(0x9e37_79b9_7f4a_7c15);
            bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            bits ^= bits >> 31;
        }
        bits
    }

    /// A number from -1 to 1, sometimes a special number such as -0.0.
    fn number(&self, index: u64, place: u64) -> f64 {
        match self.bits(index, place) % 11 {
            0 => -0.0,
            1 => f64::MIN_POSITIVE / 4.0,
            bits => (bits as f64 - 5.0) / 6.0 + f64::EPSILON * (self.bits(index, place + 1000) % 9) as f64,
        }
    }

    fn individual(&self, spec: &CampaignSpec, index: u64) -> ArchivedIndividual {
        let genes: Vec<f64> = (0..spec.model().genes() as u64)
            .map(|gene| self.number(index, 100 + gene).clamp(-1.0, 1.0))
            .collect();
        let trial = |start: u64| Trial {
            features: std::array::from_fn(|feature| {
                let number = self.number(index, 200 + 10 * start + feature as u64);
                // Only angular momentum and group rotation can be negative.
                if matches!(feature, 1 | 4) {
                    number
                } else {
                    number.abs()
                }
            }),
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
        ArchivedIndividual {
            index,
            generation: (index / self.population()) as u32,
            controller: Controller::new(spec.model(), &genes).unwrap(),
            seed: RandomStream::derive(spec.seed(), Purpose::Start, index).random(),
            trials: (0..u64::from(self.starts)).map(trial).collect(),
            novelty: self.number(index, 2).abs(),
        }
    }

    /// A log with answers, undos and changes of classes.
    pub(super) fn log(&self) -> Vec<(RequestId, Entry)> {
        let mut labels = Labels::default();
        let mut log = Vec::new();
        for (place, (what, index, class)) in self.log.iter().enumerate() {
            let class = format!("class {}", class % 3);
            let newest = labels.class_changes().next_back().map(|(entry, _)| entry);
            let action = match what % 9 {
                0 => Action::Undo,
                1 => Action::Rename {
                    class: class.parse().unwrap(),
                    to: "=ring, \"nested\"".parse().unwrap(),
                },
                2 => Action::Colour {
                    class: class.parse().unwrap(),
                    colour: "#102030".parse().unwrap(),
                },
                3 => Action::Delete {
                    class: class.parse().unwrap(),
                },
                4 => Action::Shortcut {
                    class: class.parse().unwrap(),
                    shortcut: (index % 2 == 0).then(|| "w".parse().unwrap()),
                },
                5 => Action::Revert {
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

    /// A store in `folder` with the campaign, and with data that an export leaves out: another campaign, another checkpoint, a
    /// notice, and a former taxonomy.
    pub(super) async fn store(&self, folder: &Path) -> Place {
        let place = Place::with_another(folder).await;
        let mut parent = None;
        for model in self.models() {
            let lineage = Lineage {
                configuration: "seed = 1".to_owned(),
                parent: parent.replace(CheckpointDigest::of(model)),
                ..Lineage::default()
            };
            let published = place.checkpoints.publish(lineage, model.clone().into());
            published.await.unwrap();
        }
        self.insert_rows(&place.store);
        place
    }

    fn insert_rows(&self, store: &Store) {
        let (spec, log) = (self.spec(), self.log());
        let refined = self.is_refined && !log.is_empty() && self.state != CampaignState::Completed;
        store
            .write(|transaction| {
                let number = |digest: Option<CheckpointDigest>| {
                    digest.map(|digest| checkpoint_number(transaction, digest).unwrap())
                };
                transaction.execute(
                    "INSERT INTO campaigns (number, id, spec, simulator_version, state, error, created_ms, rollbacks, checkpoint,
                        next_checkpoint, rounds, last_label_cutoff, decisions, study, request, tags, note)
                     VALUES (7, 'case-7', ?1, ?2, ?3, '', 1700000000000, 1, ?4, ?5, ?6, ?7, 5, 'study', 'request', 'a b', 'Note')",
                    params![
                        spec.to_toml(),
                        SIMULATOR_VERSION,
                        self.state.name(),
                        number(self.embedder()[0]),
                        number(self.embedder()[1]),
                        refined,
                        if refined { clamped(log.len() as u64) } else { 0 },
                    ],
                )?;
                for (request, entry) in &log {
                    insert(transaction, 7, request, std::slice::from_ref(entry))?;
                }
                for generation in 0..2 {
                    let first = self.population() * u64::from(generation);
                    let individuals: Vec<_> = (first..first + self.population())
                        .map(|index| self.individual(&spec, index))
                        .collect();
                    let novelty: Vec<f64> = individuals.iter().map(|one| one.novelty).collect();
                    insert_generation(transaction, 7, &GenerationRecord::of(generation, &novelty, 3))?;
                    insert_individuals(transaction, 7, &individuals, &compressed(&individuals)?)?;
                    if generation == 0 || self.state == CampaignState::Completed {
                        insert_taxonomy(transaction, 7, &self.taxonomy(first + self.population()), &[], Some(5))?;
                    }
                }
                transaction.execute("INSERT INTO notices VALUES (1, 7, 5, 'rolled back', 1)", [])?;
                Ok(())
            })
            .unwrap();
    }

    fn taxonomy(&self, individuals: u64) -> StoredTaxonomy {
        let cluster = |mean_distance| ClusterMeasures {
            mean_distance,
            novelty: 0.25,
        };
        let place = |index: u64| (index % 2) as u32;
        StoredTaxonomy {
            medoids: vec![2, individuals - 3],
            clusters: (0..individuals).map(place).collect(),
            loss: 0.1,
            measures: vec![cluster(0.5), cluster(1.0 / 3.0)],
            robust_trials: match self.starts {
                1 => Vec::new(),
                _ => (0..individuals).map(|index| place(index) as u8).collect(),
            },
        }
    }
}

/// A data directory.
pub(super) struct Place {
    pub(super) store: Store,
    pub(super) checkpoints: Checkpoints,
    _held: DataDirectory,
}

impl Place {
    /// A data directory with a campaign, and with a checkpoint that no campaign uses.
    pub(super) async fn with_another(folder: &Path) -> Self {
        let held = DataDirectory::hold(folder).unwrap();
        let store = Store::open(&held).unwrap();
        let checkpoints = Checkpoints::open(store.clone(), folder, None).unwrap();
        let text = "name = \"other\"\nmodel = \"single-sensor\"\nmethod = \"random\"";
        let other = CampaignSpec::from_toml(text).unwrap();
        store.create_campaign(&other, Weight::default(), 0).unwrap();
        let network = Network::<f32>::initialise(Architecture::compact(PictureShape::PAPER, 3).unwrap(), 9);
        let published = checkpoints.publish(Lineage::default(), onnx::export(&network).into());
        published.await.unwrap();
        Self {
            store,
            checkpoints,
            _held: held,
        }
    }

    pub(super) fn campaigns(&self) -> Vec<CampaignId> {
        self.store.campaign_ids().unwrap()
    }
}

/// A completed campaign with everything that a campaign can have.
pub(super) fn full() -> GeneratedCampaign {
    GeneratedCampaign {
        method: "latent",
        starts: 2,
        judge: true,
        species: false,
        state: CampaignState::Completed,
        seed: 7,
        is_refined: true,
        is_wide: false,
        log: vec![
            (8, 1, 0),
            (9, 2, 1),
            (1, 0, 1),
            (8, 1, 2),
            (3, 4, 0),
            (6, 0, 0),
            (6, 1, 2),
            (5, 0, 0),
            (7, 0, 0),
            (3, 5, 1),
            (4, 0, 0),
            (0, 0, 0),
        ],
    }
}

pub(super) fn generated_campaign() -> impl Strategy<Value = GeneratedCampaign> {
    let methods = [
        "random",
        "random\"\nspace = \"both",
        "hand-crafted",
        "latent",
        "untrained",
    ];
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
