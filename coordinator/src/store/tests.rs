//! The store as its users see it: what was committed is there, what was not is not, and bad files are named.

use super::*;
use crate::{
    campaign::{CampaignId, CampaignState},
    medoids::Clustering,
};
use murmuration_proto::{CampaignSpec, CapabilityModel, Controller};
use std::fs;

const MODEL: CapabilityModel = CapabilityModel::SingleSensor;

fn open() -> (tempfile::TempDir, Store) {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap();
    (folder, store)
}

fn spec() -> CampaignSpec {
    CampaignSpec::from_toml("model = \"single-sensor\"\nmethod = \"random\"").unwrap()
}

fn individual(index: u64) -> ArchivedIndividual {
    ArchivedIndividual {
        index,
        generation: (index / 2) as u32,
        controller: Controller::new(MODEL, &[0.1, -0.2, 0.3, index as f64 / 10.0]).unwrap(),
        seed: u64::MAX - index,
        features: [index as f64, 1e-300, -0.0, f64::MAX, 0.1 + 0.2],
        novelty: 0.1 * index as f64,
        image: Some(vec![index as u8; 2500]),
    }
}

fn commit(store: &Store, id: &CampaignId, generation: u32) -> Result<(), StoreError> {
    let record = GenerationRecord {
        generation,
        best_novelty: 2.0,
        mean_novelty: 1.0,
        filtered: 3,
    };
    let first = u64::from(generation) * 2;
    store.commit_generation(id, &record, &[individual(first), individual(first + 1)])
}

#[test]
fn a_committed_generation_reads_back_to_the_bit() {
    let (_folder, store) = open();
    let id = store.create_campaign(&spec(), 7).unwrap();
    commit(&store, &id, 0).unwrap();
    commit(&store, &id, 1).unwrap();
    let read = store.individuals(&id, MODEL, 1..100, true).unwrap();
    assert_eq!(read, [individual(1), individual(2), individual(3)]);
    assert!(read[0].features[2].is_sign_negative());
    assert_eq!(store.generations(&id).unwrap().len(), 2);
    let record = store.campaign("latest").unwrap();
    assert_eq!(
        (record.spec, record.generations_done, record.created_ms),
        (spec(), 2, 7)
    );
    assert_eq!(record.last_novelty, Some((2.0, 1.0)));
}

#[test]
fn a_generation_is_committed_whole_or_not_at_all() {
    let (_folder, store) = open();
    let id = store.create_campaign(&spec(), 0).unwrap();
    let record = GenerationRecord {
        generation: 0,
        best_novelty: 0.0,
        mean_novelty: 0.0,
        filtered: 0,
    };
    let twice = [individual(0), individual(1), individual(0)];
    assert!(store.commit_generation(&id, &record, &twice).is_err());
    assert_eq!(store.archive_len(&id).unwrap(), 0);
    assert_eq!(store.generations(&id).unwrap(), []);
}

#[test]
fn a_taxonomy_completes_its_campaign() {
    let (_folder, store) = open();
    let id = store.create_campaign(&spec(), 0).unwrap();
    commit(&store, &id, 0).unwrap();
    assert_eq!(store.taxonomy(&id).unwrap(), None);
    let clustering = Clustering {
        medoids: vec![1, 0],
        clusters: vec![1, 0],
        loss: 0.5,
    };
    store.complete(&id, &clustering).unwrap();
    let stored = StoredTaxonomy {
        medoids: vec![1, 0],
        clusters: vec![1, 0],
        loss: 0.5,
    };
    assert_eq!(store.taxonomy(&id).unwrap(), Some(stored));
    assert_eq!(
        store.campaign(id.as_str()).unwrap().state,
        CampaignState::Completed
    );
}

#[test]
fn what_is_not_there_is_named() {
    let (_folder, store) = open();
    let id = store.create_campaign(&spec(), 0).unwrap();
    let error = store.campaign("nobody-7").unwrap_err().to_string();
    assert!(error.contains("no campaign \"nobody-7\""), "{error}");
    let error = store.individual(&id, MODEL, 5).unwrap_err().to_string();
    assert!(error.contains("no individual 5: its archive holds 0"), "{error}");
}

#[test]
fn a_held_directory_is_refused_with_its_holder() {
    let folder = tempfile::tempdir().unwrap();
    let held = DataDirectory::hold(folder.path()).unwrap();
    held.announce("http://127.0.0.1:1").unwrap();
    let error = DataDirectory::hold(folder.path()).unwrap_err().to_string();
    let process = std::process::id();
    assert!(
        error.contains(&format!("in use by process {process} at http://127.0.0.1:1")),
        "{error}"
    );
    drop(held);
    assert!(DataDirectory::hold(folder.path()).is_ok());
}

#[track_caller]
fn check_unusable(prepare: impl FnOnce(&std::path::Path), said: &str) {
    let (folder, store) = open();
    drop(store);
    let path = folder.path().join(Store::FILE);
    prepare(&path);
    let before = fs::read(&path).unwrap();
    let error = Store::open(&DataDirectory::hold(folder.path()).unwrap())
        .unwrap_err()
        .to_string();
    assert!(error.contains(said) && error.contains(Store::FILE), "{error}");
    assert!(fs::read(&path).unwrap() == before, "the file was changed");
}

#[test]
fn a_database_of_a_newer_version_is_left_alone() {
    let newer = |path: &std::path::Path| {
        let connection = Connection::open(path).unwrap();
        connection.pragma_update(None, "journal_mode", "DELETE").unwrap();
        connection.pragma_update(None, "user_version", 99).unwrap();
    };
    check_unusable(newer, "schema version 99, this murmuration knows up to");
}

#[test]
fn a_file_that_is_no_database_is_named() {
    check_unusable(
        |path| fs::write(path, b"certainly not a database ".repeat(100)).unwrap(),
        "not a sound database",
    );
}

#[test]
fn a_full_disk_is_called_that_and_loses_nothing() {
    let (_folder, store) = open();
    let id = store.create_campaign(&spec(), 0).unwrap();
    commit(&store, &id, 0).unwrap();
    let pages: u32 = store
        .read(|c| Ok(c.pragma_query_value(None, "page_count", |row| row.get(0))?))
        .unwrap();
    store
        .read(|c| Ok(c.pragma_update(None, "max_page_count", pages)?))
        .unwrap();
    assert!(matches!(commit(&store, &id, 1), Err(StoreError::DiskFull { .. })));
    assert_eq!(store.archive_len(&id).unwrap(), 2);
    store
        .read(|c| Ok(c.pragma_update(None, "max_page_count", pages + 100)?))
        .unwrap();
    commit(&store, &id, 1).unwrap();
    assert_eq!(store.archive_len(&id).unwrap(), 4);
}
