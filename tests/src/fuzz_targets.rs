//! Every parser of outside input, as a function of bytes that must not panic. Fuzzers call them, and so does a short test in
//! every build.
//!
//! Limits: a parser may refuse any input. An accepted input must be the same after it is written and read again.

use murmuration_model::{
    ExportedCampaign,
    labels::{Labelled, Table, to_csv},
};
use murmuration_proto::{
    CampaignSpec, CheckpointDigest, Controller, Feedback, Invalid, Lineage, Preset, Purpose, RandomStream,
    Replay, SIMULATOR_VERSION, Search, World, onnx::EmbedderModel, training::Configuration, v1,
};
use murmuration_study::{Corrections, Study};
use murmuration_tracks::{Filmed, Tracks};
use murmuration_worker::case::Case;
use prost::Message;
use serde_json::Value;
use std::{fmt::Debug, fs, io::Write as _, path::Path, str::from_utf8};

/// A parser and its name.
#[derive(Debug, Clone, Copy)]
pub struct Edge {
    /// Name of its fuzz target.
    pub name: &'static str,
    /// Parses, and panics if there is a bug.
    pub parse: fn(&[u8]),
    /// Valid inputs to begin with.
    pub seeds: fn() -> Vec<Vec<u8>>,
}

/// All of them.
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
        name: "export_tables",
        parse: export_tables,
        seeds: exported_tables,
    },
];

/// A campaign file, and the configuration of a training, which checkpoints contain.
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

/// Messages: the first byte selects the message, the rest is its encoding.
pub fn messages(bytes: &[u8]) {
    let Some((kind, bytes)) = bytes.split_first() else {
        return;
    };
    match kind % 8 {
        0 => read_back(bytes, |spec: &CampaignSpec| v1::CampaignSpec::from(spec)),
        1 => read_back(bytes, |lineage: &Lineage| {
            lineage.describe(CheckpointDigest::of(b""), 0, 0)
        }),
        2 => read_back(bytes, |replay: &Replay| v1::Replay::from(replay.clone())),
        3 => read_back(bytes, |world: &World| v1::World::from(world.clone())),
        4 => read_back(bytes, |feedback: &Feedback| v1::Feedback::from(feedback)),
        5 => read_back(bytes, |&search: &Search| v1::Search::from(search)),
        7 => read_back(bytes, |campaign: &ExportedCampaign| {
            v1::ExportedCampaign::from(campaign.clone())
        }),
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

/// A reference case.
pub fn case_json(bytes: &[u8]) {
    let Ok(text) = from_utf8(bytes) else { return };
    if let Ok(case) = Case::from_json(text) {
        let written = serde_json::from_str::<Value>(text).unwrap().to_string();
        let again = Case::from_json(&written).unwrap();
        assert_eq!(format!("{again:?}"), format!("{case:?}"));
    }
}

/// A published or imported checkpoint.
pub fn checkpoint(bytes: &[u8]) {
    if let Ok(model) = EmbedderModel::read(bytes) {
        let again = EmbedderModel::read(model.encoded()).unwrap();
        assert_eq!(format!("{again:?}"), format!("{model:?}"));
        assert!(again.encoded() == model.encoded(), "other bytes the second time");
    }
}

/// A label file.
pub fn labels_csv(bytes: &[u8]) {
    let parse = |bytes| Table::parse(Path::new("labels.csv"), bytes, None).map(Table::into_answers);
    if let Ok(answers) = parse(bytes.to_vec()) {
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
        assert_eq!(parse(written).as_ref(), Ok(&answers));
    }
}

/// A study file, and a table of the classes that people gave.
pub fn studies(bytes: &[u8]) {
    let Ok(text) = from_utf8(bytes) else { return };
    for quick in [false, true] {
        if let Ok(study) = Study::from_toml(text, Path::new("/"), quick) {
            let rows = study.rows();
            assert_eq!(rows.len() * study.seeds().len(), study.cells().len());
        }
    }
    let _ = Corrections::parse(text);
}

/// A table of an export: the number of rows that its campaign says, in eight bytes, then the file.
pub fn export_tables(bytes: &[u8]) {
    let Some((rows, file)) = bytes.split_first_chunk() else {
        return;
    };
    let mut table = tempfile::NamedTempFile::new().unwrap();
    table.write_all(file).unwrap();
    let rows = u64::from_le_bytes(*rows);
    let spec = CampaignSpec::from_toml(EXPORTED).unwrap();
    let _ = murmuration_export::read_any_table(table.path(), rows, &spec);
}

/// Tracks of robots.
pub fn tracks_csv(bytes: &[u8]) {
    const STEPS: u32 = 100;
    let parse = |bytes| Tracks::parse(Path::new("tracks.csv"), bytes);
    let world = World::default();
    let filmed = Filmed::new(&world);
    let Ok(Ok(frames)) = parse(bytes.to_vec()).map(|tracks| tracks.ending(STEPS, &filmed)) else {
        return;
    };
    // Places may be so far apart that the way between them is infinite; nothing is computed of those.
    let numbers = frames.iter().flatten().flatten();
    if numbers.copied().all(f64::is_finite) {
        let again = parse(murmuration_tracks::to_csv(&frames, &[]).into_bytes()).unwrap();
        assert_eq!(again.ending(STEPS, &filmed).as_ref(), Ok(&frames));
    }
}

/// A mutation of an input, of the kinds that break parsers; the same for the same stream.
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
    for _ in 0..=dice.below(4) {
        let at = dice.below(bytes.len() as u64 + 1) as usize;
        let end = bytes.len().min(at + 1 + dice.below(16) as usize);
        match dice.below(6) {
            0 if at < bytes.len() => bytes[at] ^= 1 << dice.below(8),
            1 if at < bytes.len() => bytes[at] = dice.bits() as u8,
            2 => drop(bytes.drain(at..end)),
            3 => bytes.truncate(at),
            4 => {
                let again = bytes[at..end].to_vec();
                drop(bytes.splice(at..at, again));
            }
            _ => {
                let telling = TELLING[dice.below(TELLING.len() as u64) as usize];
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

/// The specification of the campaign in `tests/exports`.
const EXPORTED: &str = include_str!("../exports/spec.toml");

/// The tables of an export of 12 individuals, 3 generations, 4 entries of a label log and 2 medoids.
fn exported_tables() -> Vec<Vec<u8>> {
    let tables = [12_u64, 3, 4, 2].into_iter();
    let names = ["individuals", "generations", "labels", "taxonomy"];
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("exports");
    let table = |(rows, name): (u64, &str)| {
        let file = fs::read(folder.join(format!("{name}.parquet"))).unwrap();
        [rows.to_le_bytes().to_vec(), file].concat()
    };
    tables.zip(names).map(table).collect()
}

/// The studies, and a table of classes.
fn study_files() -> Vec<Vec<u8>> {
    let classes = b"cell,index,class,by\nc,1,milling,ana\nc,2,random,judge\n".to_vec();
    files("../studies", "toml").into_iter().chain([classes]).collect()
}

/// The examples, as written and with every field.
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
    let campaign = v1::ExportedCampaign {
        id: "small-7".to_owned(),
        spec: Some(v1::CampaignSpec::from(
            &CampaignSpec::from_toml(EXPORTED).unwrap(),
        )),
        state: v1::CampaignState::Completed.into(),
        weight: 100,
        simulator_version: SIMULATOR_VERSION.to_owned(),
        rounds_done: 1,
        last_label_cutoff: 3,
        label_cutoff: Some(4),
        generations: 3,
        label_entries: 4,
        digest: "0".repeat(64),
        ..v1::ExportedCampaign::default()
    };
    assert!(ExportedCampaign::try_from(campaign.clone()).is_ok());
    seeds.push(of(7, campaign.encode_to_vec()));
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
