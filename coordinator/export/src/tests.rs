//! Tests that an export is complete and can be imported, and that a changed folder is refused.

use super::*;
use arrow_array::{Array as _, cast::AsArray as _, types::UInt64Type};
use murmuration_model::{
    CampaignId, Weight,
    labels::{Action, Annotator, Change},
};
use murmuration_store::{
    ArchivedIndividual, DataDirectory, GenerationRecord, Provenance, Store, Switch, Trial,
    checkpoints::Checkpoints, transfer::export,
};
use murmuration_swarm::{
    CampaignSpec, Controller, Lineage, PictureShape, Preset, Purpose, RandomStream, training::Architecture,
};
use murmuration_train::{network::Network, onnx};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use rand::RngExt as _;
use std::{
    fs::{self, File},
    io::Read as _,
    path::{Path, PathBuf},
};

/// The database of a running campaign of 8 embedded individuals, with a label.
fn database() -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap();
    let checkpoints = Checkpoints::open(store.clone(), folder.path(), None).unwrap();
    let architecture = Architecture::compact(PictureShape::PAPER, 5).unwrap();
    let model = onnx::export(&Network::<f32>::initialise(architecture, 1));
    let runtime = tokio::runtime::Builder::new_multi_thread().build().unwrap();
    let record = runtime
        .block_on(checkpoints.publish(Lineage::default(), model.into()))
        .unwrap();
    let id = campaign(&store, &record.digest.to_string());
    let answer = Change {
        annotator: Annotator::known("ana").unwrap(),
        time_ms: 5,
        action: Action::Answer {
            index: 3,
            answer: "=ring".parse().unwrap(),
        },
    };
    store
        .add_labels(&id, &"request".parse().unwrap(), vec![answer])
        .unwrap();
    let file = runtime.block_on(export(&store, &checkpoints, folder.path(), &id));
    let mut bytes = Vec::new();
    file.unwrap().read_to_end(&mut bytes).unwrap();
    bytes
}

fn campaign(store: &Store, checkpoint: &str) -> CampaignId {
    let text = format!(
        "model = \"single-sensor\"\nmethod = \"latent\"\ncheckpoint = \"{checkpoint}\"\n\
         [search]\npopulation = 4\ngenerations = 3\n[taxonomy]\nmedoids = 2"
    );
    let spec = CampaignSpec::from_toml(&text).unwrap();
    let id = store.create_campaign(&spec, Weight::default(), 0).unwrap();
    let switch = Switch {
        novelty: Vec::new(),
        generations: Vec::new(),
    };
    store.switch(&id, &switch).unwrap();
    for generation in 0..2 {
        let individuals: Vec<_> = (0..4)
            .map(|place| individual(&spec, generation, u64::from(generation) * 4 + place))
            .collect();
        let record = GenerationRecord::of(generation, &[0.5; 4], 0);
        let committed = store.commit_generation(&id, &record, &individuals, &Provenance::default());
        committed.unwrap();
    }
    id
}

fn individual(spec: &CampaignSpec, generation: u32, index: u64) -> ArchivedIndividual {
    let controller = Controller::new(Preset::SingleSensor, &[0.1, 0.2, 0.3, -0.5]).unwrap();
    ArchivedIndividual {
        seed: RandomStream::derive(spec.seed(), Purpose::Start, index).random(),
        novelty: 0.5,
        ..ArchivedIndividual::unmeasured(index, generation, controller)
    }
    .with_trial(Trial {
        features: [index as f64 / 1000.0; 5],
        embedding: vec![0.5; 5],
        image: Some(vec![index as u8; 2500]),
        verdict: None,
    })
}

fn write(target: &Path, database: &[u8], with_csv: bool) -> Exported {
    let mut folder = NewFolder::create(target, with_csv, false).unwrap();
    database.chunks(1000).for_each(|part| folder.add(part).unwrap());
    folder.finish().unwrap()
}

/// Writes the list of digests again, as a person would who changed a file on purpose.
fn list_again(folder: &Path, exported: &Exported) {
    let mut listed = digests::Digests::default();
    for name in exported.files.iter().filter(|name| *name != digests::FILE) {
        listed.add(folder, name).unwrap();
    }
    fs::write(folder.join(digests::FILE), listed.to_text()).unwrap();
}

#[test]
fn a_folder_has_every_file_and_the_database_as_it_came() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path().join("export");
    let database = database();
    let exported = write(&folder, &database, true);
    assert!(exported.files.len() > 12, "{:?}", exported.files);
    assert!(exported.files.iter().all(|name| folder.join(name).is_file()));
    let mut checked = CheckedExport::open(&folder).unwrap();
    assert_eq!(checked.campaign(), &exported.campaign.record.id);
    let mut read = Vec::new();
    while let Some(part) = Some(checked.next(1000).unwrap()).filter(|part| !part.is_empty()) {
        read.extend(part);
    }
    assert!(read == database);

    let table = File::open(folder.join(INDIVIDUALS)).unwrap();
    let mut rows = ParquetRecordBatchReaderBuilder::try_new(table)
        .unwrap()
        .build()
        .unwrap();
    let rows = rows.next().unwrap().unwrap();
    let indices = rows.column(0).as_primitive::<UInt64Type>().values().to_vec();
    assert_eq!(indices, (0..8).collect::<Vec<_>>());
    let classes = rows.column(6).as_string::<i32>();
    assert_eq!((classes.value(3), classes.null_count()), ("=ring", 7));
}

#[test]
fn one_changed_byte_of_any_file_is_found() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path().join("export");
    let exported = write(&folder, &database(), false);
    for name in &exported.files {
        let path = folder.join(name);
        let bytes = fs::read(&path).unwrap();
        for place in [0, bytes.len() / 2, bytes.len() - 2] {
            let mut changed = bytes.clone();
            changed[place] ^= 1;
            fs::write(&path, changed).unwrap();
            assert!(CheckedExport::open(&folder).is_err(), "byte {place} of {name}");
        }
        fs::write(&path, bytes).unwrap();
    }
    CheckedExport::open(&folder).unwrap();
}

#[test]
fn a_database_that_was_exchanged_on_purpose_is_refused() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path().join("export");
    let database = database();
    let exported = write(&folder, &database, false);
    for (other, reason) in [
        (&database[..5000], "campaign.sqlite: "),
        (b"thesis", "campaign.sqlite: it is not a SQLite database"),
    ] {
        fs::write(folder.join(DATABASE), other).unwrap();
        list_again(&folder, &exported);
        let message = CheckedExport::open(&folder).unwrap_err().to_string();
        assert!(message.contains(reason), "{message}");
        let mut answer = NewFolder::create(&place.path().join("other"), false, false).unwrap();
        answer.add(other).unwrap();
        let message = answer.finish().unwrap_err().to_string();
        assert!(
            message.contains("the coordinator's answer is invalid"),
            "{message}"
        );
        assert!(!place.path().join("other").exists());
    }
    fs::remove_file(folder.join(DATABASE)).unwrap();
    fs::write(folder.join(digests::FILE), "").unwrap();
    let message = CheckedExport::open(&folder).unwrap_err().to_string();
    assert!(message.contains("it does not list campaign.sqlite"), "{message}");
}

#[test]
fn only_an_export_is_replaced_and_only_if_asked() {
    let place = tempfile::tempdir().unwrap();
    let target: PathBuf = place.path().join("export");
    write(&target, &database(), false);
    let create = |target: &Path, replaces| NewFolder::create(target, false, replaces).map(drop);
    assert!(matches!(create(&target, false), Err(ExportError::NotEmpty(_))));
    assert!(create(&target, true).is_ok());
    let other = place.path().join("other");
    fs::create_dir(&other).unwrap();
    fs::write(other.join("thesis.tex"), "").unwrap();
    assert!(matches!(create(&other, true), Err(ExportError::NoExport(_))));
    let names: Vec<_> = fs::read_dir(place.path())
        .unwrap()
        .map(|entry| entry.unwrap().file_name())
        .collect();
    assert_eq!(names.len(), 2, "nothing half-written stays: {names:?}");
}
