//! Every parser of outside input, as a function of bytes that must not panic. Fuzzers call these functions, and a short test of
//! every build calls them too.
//!
//! A parser may refuse any input. An accepted input must be the same after it is written and read again.

use murmuration_model::{
    Weight,
    csv_file::ColumnNames,
    labels::{Action, Annotator, Change, Labelled, Table, to_csv},
};
use murmuration_onnx::EmbedderModel;
use murmuration_proto::v1;
use murmuration_search::medoids::Clustering;
use murmuration_sim::case::Case;
use murmuration_store::{
    ArchivedIndividual, ClusterMeasures, DataDirectory, GenerationRecord, Provenance, Store, Trial,
    checkpoints::Checkpoints,
    transfer::{ReceivedCampaign, Unsound, export},
};
use murmuration_study::{Corrections, Study};
use murmuration_swarm::{
    CampaignSpec, CheckpointDigest, Controller, Feedback, Invalid, Lineage, Preset, Purpose, RandomStream,
    Replay, Search, Verdict, World, training::Configuration,
};
use murmuration_tracks::{Filmed, Reading, Tracks, TracksFile};
use prost::Message;
use rand::RngExt as _;
use serde_json::Value;
use std::{
    fmt::Debug,
    fs,
    io::{Read as _, Write as _},
    path::Path,
    str::from_utf8,
};

/// A parser and its name.
#[derive(Debug, Clone, Copy)]
pub struct Edge {
    pub name: &'static str,
    /// Parses the bytes, and panics if the parser has a bug.
    pub parse: fn(&[u8]),
    /// Valid inputs, from which fuzzing starts.
    pub seeds: fn() -> Vec<Vec<u8>>,
}

pub const EDGES: [Edge; 8] = [
    Edge {
        name: "campaign_toml",
        parse: campaign_toml,
        seeds: campaign_files,
    },
    Edge {
        name: "messages",
        parse: messages,
        seeds: encoded,
    },
    Edge {
        name: "case_json",
        parse: case_json,
        seeds: || files("vectors", "json"),
    },
    Edge {
        name: "checkpoint",
        parse: checkpoint,
        seeds: || files("models", "onnx"),
    },
    Edge {
        name: "labels_csv",
        parse: labels_csv,
        seeds: tables,
    },
    Edge {
        name: "tracks_csv",
        parse: tracks_csv,
        seeds: films,
    },
    Edge {
        name: "studies",
        parse: studies,
        seeds: study_files,
    },
    Edge {
        name: "campaign_database",
        parse: campaign_database,
        seeds: || vec![exported()],
    },
];

/// Parses a campaign file, and the configuration of a training, which checkpoints contain.
pub fn campaign_toml(bytes: &[u8]) {
    let Ok(text) = from_utf8(bytes) else { return };
    if let Ok(spec) = CampaignSpec::from_toml(text) {
        let written = CampaignSpec::from_toml(&spec.to_toml());
        assert_eq!(written.as_ref().ok(), Some(&spec), "{written:?}");
        assert_eq!(
            CampaignSpec::try_from(v1::CampaignSpec::from(&spec)).as_ref(),
            Ok(&spec)
        );
    }
    if let Ok(configuration) = Configuration::from_toml(text) {
        let written = Configuration::from_toml(&configuration.to_toml());
        assert_eq!(written.as_ref().ok(), Some(&configuration), "{written:?}");
    }
}

/// Parses a message: the first byte selects the kind of message, and the other bytes encode the message.
pub fn messages(bytes: &[u8]) {
    let Some((kind, bytes)) = bytes.split_first() else {
        return;
    };
    match kind % 7 {
        0 => read_back(bytes, |spec: &CampaignSpec| v1::CampaignSpec::from(spec)),
        1 => read_back(bytes, |lineage: &Lineage| {
            lineage.describe(CheckpointDigest::of(b""), 0, 0)
        }),
        2 => read_back(bytes, |replay: &Replay| v1::Replay::from(replay.clone())),
        3 => read_back(bytes, |world: &World| v1::World::from(world.clone())),
        4 => read_back(bytes, |feedback: &Feedback| v1::Feedback::from(feedback)),
        5 => read_back(bytes, |&search: &Search| v1::Search::from(search)),
        _ => {
            let Some(individual) = decoded::<v1::Individual>(bytes) else {
                return;
            };
            for model in [Preset::SingleSensor, Preset::TwoSensor] {
                if let Ok(controller) = Controller::new(model, &individual.controller) {
                    let again = Controller::new(controller.model(), controller.genes());
                    assert_eq!(again.as_ref(), Ok(&controller));
                }
            }
        }
    }
}

/// Checks that a message, if accepted, is the same after it is written and read again.
fn read_back<M, T>(bytes: &[u8], write: impl Fn(&T) -> M)
where
    M: Message + Default,
    T: TryFrom<M, Error = Invalid> + Debug + PartialEq,
{
    if let Some(Ok(read)) = decoded::<M>(bytes).map(T::try_from) {
        assert_eq!(T::try_from(write(&read)).as_ref(), Ok(&read));
    }
}

fn decoded<M: Message + Default>(bytes: &[u8]) -> Option<M> {
    M::decode(bytes).ok()
}

/// Parses a reference case.
pub fn case_json(bytes: &[u8]) {
    let Ok(text) = from_utf8(bytes) else { return };
    if let Ok(case) = Case::from_json(text) {
        let written = serde_json::from_str::<Value>(text).unwrap().to_string();
        let again = Case::from_json(&written).unwrap();
        assert_eq!(format!("{again:?}"), format!("{case:?}"));
    }
}

/// Parses a published or imported checkpoint.
pub fn checkpoint(bytes: &[u8]) {
    if let Ok(model) = EmbedderModel::read(bytes) {
        let again = EmbedderModel::read(model.encoded()).unwrap();
        assert_eq!(format!("{again:?}"), format!("{model:?}"));
        assert!(again.encoded() == model.encoded(), "other bytes the second time");
    }
}

/// Parses a label file.
pub fn labels_csv(bytes: &[u8]) {
    let parse = |bytes: &[u8]| Table::parse(Path::new("labels.csv"), bytes, None).map(Table::into_answers);
    if let Ok(answers) = parse(bytes) {
        let spec = CampaignSpec::from_toml("model = \"single-sensor\"\nmethod = \"random\"").unwrap();
        let individual = v1::Individual {
            controller: vec![0.5; 4],
            features: vec![0.25; 5],
            ..v1::Individual::default()
        };
        let labelled = |answer| Labelled {
            answer,
            individual: &individual,
        };
        let written = to_csv(&spec, answers.iter().map(labelled)).unwrap();
        assert_eq!(parse(&written).as_ref(), Ok(&answers));
    }
}

/// Parses a study file, and a table of the classes that people gave.
pub fn studies(bytes: &[u8]) {
    let Ok(text) = from_utf8(bytes) else { return };
    for quick in [false, true] {
        if let Ok(study) = Study::from_toml(text, Path::new("/"), quick) {
            let rows = study.rows();
            assert_eq!(rows.len() * study.seeds.len(), study.cells.len());
        }
    }
    let _ = Corrections::parse(text);
}

/// Reads the database of a campaign that was exported by another coordinator.
pub fn campaign_database(bytes: &[u8]) {
    let mut file = tempfile::NamedTempFile::new().unwrap();
    file.write_all(bytes).unwrap();
    if let Ok(received) = ReceivedCampaign::open(file.path()) {
        let _ = received.archive::<Unsound>(|_| Ok(()));
    }
}

/// Parses tracks of robots.
pub fn tracks_csv(bytes: &[u8]) {
    const STEPS: u32 = 100;
    let parse = |bytes: &[u8]| {
        let file = TracksFile::open(Path::new("tracks.csv"), bytes, ColumnNames::default())?;
        Tracks::read(file, Reading::default())
    };
    let world = World::default();
    let filmed = Filmed::new(&world);
    let Ok(Ok(frames)) = parse(bytes).map(|tracks| tracks.ending(STEPS, &filmed)) else {
        return;
    };
    // Coordinates can be so far apart that their difference is infinite; frames with such coordinates are not compared.
    let numbers = frames.iter().flatten().flatten();
    if numbers.copied().all(f64::is_finite) {
        let again = parse(murmuration_tracks::to_csv(&frames, &[]).as_bytes()).unwrap();
        assert_eq!(again.ending(STEPS, &filmed).as_ref(), Ok(&frames));
    }
}

/// Mutates an input in ways that often break parsers. The same random stream gives the same mutation.
#[must_use]
pub fn mutated(seed: &[u8], dice: &mut RandomStream) -> Vec<u8> {
    const TELLING: [&[u8]; 12] = [
        b"\"",
        b"\n",
        b"[",
        b"]",
        b"-1",
        b"1e999",
        b"nan",
        b"18446744073709551616",
        b"\xff",
        b"\x00",
        b"0x",
        b"=",
    ];
    let mut bytes = seed.to_vec();
    for _ in 0..dice.random_range(1..=4) {
        let at = dice.random_range(0..=bytes.len());
        let end = bytes.len().min(at + dice.random_range(1..=16));
        match dice.random_range(0..6) {
            0 if at < bytes.len() => bytes[at] ^= 1 << dice.random_range(0..8),
            1 if at < bytes.len() => bytes[at] = dice.random(),
            2 => drop(bytes.drain(at..end)),
            3 => bytes.truncate(at),
            4 => {
                let again = bytes[at..end].to_vec();
                drop(bytes.splice(at..at, again));
            }
            _ => {
                let telling = TELLING[dice.random_range(0..TELLING.len())];
                drop(bytes.splice(at..at, telling.iter().copied()));
            }
        }
    }
    bytes
}

/// The random numbers for the mutations of one target.
#[must_use]
pub fn dice(number: u64) -> RandomStream {
    RandomStream::derive(5, Purpose::Jitter, number)
}

fn files(folder: &str, extension: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
    let mut paths: Vec<_> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    paths.retain(|path| path.extension().is_some_and(|found| found == extension));
    paths.sort();
    paths.iter().map(|path| fs::read(path).unwrap()).collect()
}

/// The database of a completed campaign of 12 individuals in 3 generations, with a label log.
fn exported() -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap();
    let spec = CampaignSpec::from_toml(include_str!("../exported.toml")).unwrap();
    let id = store.create_campaign(&spec, Weight::default(), 0).unwrap();
    for generation in 0..3 {
        let individuals = (0..4).map(|place| individual(&spec, generation, place));
        let individuals: Vec<_> = individuals.collect();
        let record = GenerationRecord::of(generation, &[0.25; 4], 1);
        let committed = store.commit_generation(&id, &record, &individuals, &Provenance::default());
        committed.unwrap();
    }
    for (place, class) in ["ring", "clump", "not sure"].into_iter().enumerate() {
        let answer = Change {
            annotator: Annotator::known("ana").unwrap(),
            time_ms: 5,
            action: Action::Answer {
                index: place as u64,
                answer: class.parse().unwrap(),
            },
        };
        let request = format!("request {place}").parse().unwrap();
        store.add_labels(&id, &request, vec![answer]).unwrap();
    }
    let taxonomy = Clustering {
        medoids: vec![0, 1],
        clusters: (0..12).map(|index| index % 2).collect(),
        loss: 1.0,
    };
    let measures = [ClusterMeasures::default(); 2];
    assert!(store.complete(&id, &taxonomy, &measures, &[1; 12], &[]).unwrap());
    let checkpoints = Checkpoints::open(store.clone(), folder.path(), None).unwrap();
    let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
    let file = runtime.block_on(export(&store, &checkpoints, folder.path(), &id));
    let mut bytes = Vec::new();
    file.unwrap().read_to_end(&mut bytes).unwrap();
    bytes
}

fn individual(spec: &CampaignSpec, generation: u32, place: u64) -> ArchivedIndividual {
    let index = u64::from(generation) * 4 + place;
    let controller = Controller::new(spec.model(), &[0.5, -0.5, 1.0, 0.1 * place as f64]).unwrap();
    let trial = Trial {
        features: [0.5, 0.25, 0.0, 1.0, index as f64],
        image: Some(vec![place as u8; spec.image().bytes()]),
        verdict: Verdict::all().next(),
        ..Trial::default()
    };
    ArchivedIndividual {
        seed: RandomStream::derive(spec.seed(), Purpose::Start, index).random(),
        trials: vec![trial; 2],
        novelty: 0.25,
        ..ArchivedIndividual::unmeasured(index, generation, controller)
    }
}

/// The study files of the repository, and a table of classes.
fn study_files() -> Vec<Vec<u8>> {
    let classes = b"cell,index,class,by\nc,1,milling,ana\nc,2,random,judge\n".to_vec();
    files("../studies", "toml").into_iter().chain([classes]).collect()
}

/// The example files: with every field filled in, and as written.
fn campaign_files() -> Vec<Vec<u8>> {
    let short = files("../examples", "toml");
    let whole = specs().into_iter().map(|spec| spec.to_toml().into_bytes());
    whole.chain(short.clone()).collect()
}

fn specs() -> Vec<CampaignSpec> {
    let texts = files("../examples", "toml").into_iter();
    texts
        .map(|text| CampaignSpec::from_toml(from_utf8(&text).unwrap()).unwrap())
        .collect()
}

fn encoded() -> Vec<Vec<u8>> {
    let of = |kind: u8, bytes: Vec<u8>| [vec![kind], bytes].concat();
    let spec = specs().into_iter().map(|spec| v1::CampaignSpec::from(&spec));
    let mut seeds: Vec<_> = spec
        .flat_map(|spec| {
            let feedback = spec
                .feedback
                .as_ref()
                .map(|feedback| of(4, feedback.encode_to_vec()));
            let world = spec.world.as_ref().map(|world| of(3, world.encode_to_vec()));
            let search = spec.search.as_ref().map(|search| of(5, search.encode_to_vec()));
            [Some(of(0, spec.encode_to_vec())), feedback, world, search]
        })
        .flatten()
        .collect();
    let checkpoint = v1::Checkpoint {
        digest: "0".repeat(64),
        size: 5,
        metrics: [("loss".to_owned(), 0.5)].into(),
        ..v1::Checkpoint::default()
    };
    seeds.push(of(1, checkpoint.encode_to_vec()));
    let replay = v1::Replay {
        steps: vec![0, 4],
        poses: vec![0.5; 12],
        agents: 2,
    };
    seeds.push(of(2, replay.encode_to_vec()));
    for genes in [4, 9] {
        let individual = v1::Individual {
            controller: vec![0.5; genes],
            ..v1::Individual::default()
        };
        seeds.push(of(6, individual.encode_to_vec()));
    }
    seeds
}

fn films() -> Vec<Vec<u8>> {
    let texts = [
        "frame,robot,x,y,heading\n0,0,1.5,2,0.1\n0,1,20,30,-3\n1,0,2,2,0.2\n3,0,4,2.5,6\n3,1,21,30,3\n",
        "x,y,frame,robot,time\r\n1,2,7,4,0.1\r\n1,3,20,4,0.2\r\n",
    ];
    texts.map(|text| text.as_bytes().to_vec()).into()
}

fn tables() -> Vec<Vec<u8>> {
    let texts = [
        "id,class,annotator,time\n3,ring,ana,2023-11-14T22:13:20Z\n3,\"clump, loose\",ben,2023-11-14T22:13:20.001Z\n\n4,not sure,ana,\n",
        "x,class,id,annotator\r\n1,ring,7,ana\r\n2,,8,\r\n",
    ];
    texts.map(|text| text.as_bytes().to_vec()).into()
}
