//! Tests of the store as its users see it: it has only committed data, and its errors name bad files.

mod size;
mod switches;
mod taxonomies;

use super::*;
use murmuration_model::{CampaignId, CampaignState, MachineId, Maker, Quarantined, SavedTraining, Weight};
use murmuration_search::medoids::Clustering;
use murmuration_swarm::{CampaignSpec, CheckpointDigest, Controller, EmbeddingKind, Preset, Verdict};
use std::{ffi::OsStr, fs, os::unix::ffi::OsStrExt as _};

const MODEL: Preset = Preset::SingleSensor;

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
        controller: Controller::new(MODEL, &[0.1, -0.2, 0.3, (index % 10) as f64 / 10.0]).unwrap(),
        seed: u64::MAX - index,
        trials: vec![trial(index, Vec::new())],
        novelty: 0.1 * index as f64,
    }
}

fn trial(index: u64, embedding: Vec<f32>) -> Trial {
    Trial {
        features: [index as f64, 1e-300, -0.0, f64::MAX, 0.1 + 0.2],
        embedding,
        image: Some(vec![index as u8; 2500]),
        verdict: Verdict::try_from(1 + (index % 11) as i32).ok(),
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
    store.commit_generation(
        id,
        &record,
        &[individual(first), individual(first + 1)],
        &Provenance::default(),
    )
}

/// A store with two checkpoints and a latent campaign of one generation, which the first checkpoint embeds.
fn embedded() -> (tempfile::TempDir, Store, CampaignId, [CheckpointDigest; 2]) {
    let (folder, store) = open();
    let checkpoints = [b"one", b"two"].map(|bytes| CheckpointRecord::of(bytes));
    for checkpoint in &checkpoints {
        store.add_checkpoint(checkpoint).unwrap();
    }
    let digests = checkpoints.map(|checkpoint| checkpoint.digest);
    let text = format!(
        "model = \"single-sensor\"\nmethod = \"latent\"\ncheckpoint = \"{}\"",
        digests[0]
    );
    let id = store
        .create_campaign(&CampaignSpec::from_toml(&text).unwrap(), Weight::default(), 0)
        .unwrap();
    store.switch(&id, &unchanged(&[])).unwrap();
    let record = GenerationRecord::of(0, &[0.1, 0.2], 0);
    let individuals =
        [0, 1].map(|index| individual(index).with_trial(trial(index, vec![index as f32, -0.5])));
    store
        .commit_generation(&id, &record, &individuals, &Provenance::default())
        .unwrap();
    (folder, store, id, digests)
}

fn unchanged(novelty: &[f64]) -> Switch {
    Switch {
        novelty: novelty.to_vec(),
        generations: Vec::new(),
    }
}

#[test]
fn words_that_were_stored_as_they_came_are_cleaned_when_they_are_read() {
    let (_folder, store) = open();
    let id = store.create_campaign(&spec(), Weight::default(), 7).unwrap();
    let hostile = format!("a\u{1b}[2J\u{202e}{}", "x".repeat(1 << 20));
    let provenance = Provenance {
        notices: vec![hostile.clone()],
        ..Provenance::default()
    };
    let record = GenerationRecord::of(0, &[0.0], 0);
    store
        .commit_generation(&id, &record, &[individual(0), individual(1)], &provenance)
        .unwrap();
    store.set_state(&id, CampaignState::Failed, &hostile).unwrap();
    let error = store.campaigns().unwrap().remove(0).error;
    let notice = store.notices(&id).unwrap().remove(0).text;
    for words in [error, notice] {
        assert!(
            words.starts_with("a[2Jxxx") && words.len() < 3000,
            "{} bytes",
            words.len()
        );
    }
}

#[test]
fn a_committed_generation_reads_back_to_the_bit() {
    let (_folder, store) = open();
    let id = store.create_campaign(&spec(), Weight::default(), 7).unwrap();
    commit(&store, &id, 0).unwrap();
    commit(&store, &id, 1).unwrap();
    let read = store.individuals(&id, &MODEL.into(), 1..100, true).unwrap();
    assert_eq!(read, [individual(1), individual(2), individual(3)]);
    assert!(read[0].features()[2].is_sign_negative());
    assert_eq!(store.generations(&id).unwrap().len(), 2);
    let record = store.campaign("latest").unwrap();
    assert_eq!(
        (record.spec, record.generations_done, record.created_ms),
        (spec(), 2, 7)
    );
    assert_eq!(record.last_novelty, Some((2.0, 1.0)));
}

#[test]
fn the_most_novel_are_each_of_another_generation() {
    let (_folder, store) = open();
    let id = store.create_campaign(&spec(), Weight::default(), 7).unwrap();
    assert_eq!(store.most_novel(&id, 3).unwrap(), []);
    for generation in 0..3 {
        commit(&store, &id, generation).unwrap();
    }
    // Equally novel generations are in their order, and each gives the more novel of its individuals.
    assert_eq!(store.most_novel(&id, 2).unwrap(), [(1, 0, 2.0), (3, 1, 2.0)]);
}

#[test]
fn the_most_novel_are_found_where_each_generation_is_more_novel() {
    let (_folder, store) = open();
    let id = store.create_campaign(&spec(), Weight::default(), 7).unwrap();
    for generation in 0..50 {
        let individuals = [0, 1].map(|place| ArchivedIndividual {
            novelty: f64::from(generation) - place as f64,
            ..ArchivedIndividual::still(2 * u64::from(generation) + place, generation)
        });
        let record = GenerationRecord::of(generation, &[f64::from(generation)], 0);
        store
            .commit_generation(&id, &record, &individuals, &Provenance::default())
            .unwrap();
    }
    assert_eq!(
        store.most_novel(&id, 2).unwrap(),
        [(98, 49, 49.0), (96, 48, 48.0)]
    );
    assert_eq!(store.most_novel(&id, 99).unwrap().len(), 50);
}

#[test]
fn a_generation_is_committed_whole_or_not_at_all() {
    let (_folder, store) = open();
    let id = store.create_campaign(&spec(), Weight::default(), 0).unwrap();
    let record = GenerationRecord {
        generation: 0,
        best_novelty: 0.0,
        mean_novelty: 0.0,
        filtered: 0,
    };
    let twice = [individual(0), individual(1), individual(0)];
    assert!(
        store
            .commit_generation(&id, &record, &twice, &Provenance::default())
            .is_err()
    );
    assert_eq!(store.archive_len(&id).unwrap(), 0);
    assert_eq!(store.generations(&id).unwrap(), []);
}

#[test]
fn every_trial_of_an_individual_comes_back_to_the_bit() {
    let (_folder, store) = open();
    let spec = CampaignSpec::from_toml(&format!(
        "{}[evaluation]\nstarts = 3",
        spec().to_toml().replace("[evaluation]\nstarts = 1\n", "")
    ))
    .unwrap();
    let id = store.create_campaign(&spec, Weight::default(), 0).unwrap();
    let individuals = [0, 1].map(|index| ArchivedIndividual {
        trials: [7, 8, 9].map(|other| trial(index * other, Vec::new())).into(),
        ..individual(index)
    });
    let record = GenerationRecord::of(0, &[0.1, 0.1], 0);
    store
        .commit_generation(&id, &record, &individuals, &Provenance::default())
        .unwrap();
    assert_eq!(
        store.individuals(&id, spec.model(), 0..2, true).unwrap(),
        individuals
    );
    let without = store.individuals(&id, spec.model(), 1..2, false).unwrap();
    assert_eq!(without[0].trials.len(), 3);
    assert!(without[0].trials.iter().all(|trial| trial.image.is_none()));
    assert_eq!(individuals[1].features()[0], 8.0);
}

#[test]
fn a_taxonomy_completes_its_campaign() {
    let (_folder, store) = open();
    let id = store.create_campaign(&spec(), Weight::default(), 0).unwrap();
    commit(&store, &id, 0).unwrap();
    assert_eq!(store.taxonomy(&id).unwrap(), None);
    let clustering = Clustering {
        medoids: vec![1, 0],
        clusters: vec![1, 0],
        loss: 0.5,
    };
    let measures = [(0.25, 4.0), (0.0, 3.5)].map(|(mean_distance, novelty)| ClusterMeasures {
        mean_distance,
        novelty,
    });
    store.complete(&id, &clustering, &measures, &[3, 0], &[]).unwrap();
    let stored = StoredTaxonomy {
        medoids: vec![1, 0],
        clusters: vec![1, 0],
        loss: 0.5,
        measures: measures.into(),
        robust_trials: vec![3, 0],
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
    let id = store.create_campaign(&spec(), Weight::default(), 0).unwrap();
    let error = store.campaign("nobody-7").unwrap_err().to_string();
    assert!(error.contains("no campaign \"nobody-7\""), "{error}");
    let error = store.individual(&id, &MODEL.into(), 5).unwrap_err().to_string();
    assert!(error.contains("no individual 5: its archive holds 0"), "{error}");
}

#[test]
fn a_held_directory_is_refused_with_its_holder() {
    let folder = tempfile::tempdir().unwrap();
    let held = DataDirectory::hold(folder.path()).unwrap();
    held.announce("http://127.0.0.1:1", "node-7").unwrap();
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
fn check_unusable(prepare: impl FnOnce(&std::path::Path), expected: &str) {
    let (folder, store) = open();
    drop(store);
    let path = folder.path().join(Store::FILE);
    prepare(&path);
    let before = fs::read(&path).unwrap();
    let error = Store::open(&DataDirectory::hold(folder.path()).unwrap())
        .unwrap_err()
        .to_string();
    assert!(error.contains(expected) && error.contains(Store::FILE), "{error}");
    assert!(fs::read(&path).unwrap() == before, "the file was changed");
}

#[test]
fn a_database_of_a_newer_version_is_left_alone() {
    let newer = |path: &std::path::Path| {
        let connection = Connection::open(path).unwrap();
        connection.pragma_update(None, "journal_mode", "DELETE").unwrap();
        connection.pragma_update(None, "user_version", 99).unwrap();
    };
    check_unusable(newer, "schema version 99, this murmuration (");
}

#[test]
fn a_file_that_is_no_database_is_named() {
    check_unusable(
        |path| fs::write(path, b"certainly not a database ".repeat(100)).unwrap(),
        "is damaged (file is not a database)",
    );
}

#[test]
fn a_database_that_cannot_be_found_out_about_is_not_made_anew() {
    use std::os::unix::fs::symlink;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(Store::FILE);
    let volume = folder.path().join("volume");
    // The first link leads to a volume that is not mounted; the system cannot follow the second link at all.
    for (target, expected) in [
        (volume.join(Store::FILE), "does not exist: mount its volume"),
        (path.clone(), "oo many"),
    ] {
        symlink(&target, &path).unwrap();
        let opened = Store::open(&DataDirectory::hold(folder.path()).unwrap()).map(drop);
        let held = DataDirectory::hold_existing(folder.path()).map(drop);
        let looked = Store::look(folder.path(), true).map(drop);
        for error in [opened, held, looked].map(Result::unwrap_err) {
            let error = error.to_string();
            assert!(
                error.contains(expected) && error.contains(&target.display().to_string()),
                "{error}"
            );
        }
        assert_eq!(fs::read_link(&path).unwrap(), target);
        assert!(!volume.exists());
        fs::remove_file(&path).unwrap();
    }
}

#[test]
fn a_new_database_takes_the_place_of_no_other() {
    let (folder, store) = open();
    let id = store.create_campaign(&spec(), Weight::default(), 7).unwrap();
    // This creates a database as if the existing database had not been found.
    let error = open::create(folder.path()).unwrap_err().to_string();
    assert!(error.contains(Store::FILE), "{error}");
    drop(store);
    let store = Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap();
    assert_eq!(store.campaign("latest").unwrap().id, id);
}

#[test]
fn another_program_that_locks_the_database_is_awaited_and_then_named() {
    let (folder, store) = open();
    let id = store.create_campaign(&spec(), Weight::default(), 0).unwrap();
    let path = folder.path().join(Store::FILE);
    let other = Connection::open(&path).unwrap();
    let (stop, stopped) = std::sync::mpsc::channel::<()>();
    // A replication tool empties the log again and again.
    let replication = std::thread::spawn(move || {
        while stopped.recv_timeout(std::time::Duration::from_millis(1)).is_err() {
            let emptied = other.query_row("PRAGMA wal_checkpoint(TRUNCATE)", [], |_| Ok(()));
            assert!(emptied.is_ok() || emptied.is_err_and(|error| error.to_string().contains("locked")));
        }
        other
    });
    for generation in 0..100 {
        commit(&store, &id, generation).unwrap();
    }
    stop.send(()).unwrap();
    let other = replication.join().unwrap();
    other.execute_batch("BEGIN IMMEDIATE").unwrap();
    let error = commit(&store, &id, 100).unwrap_err();
    assert!(
        matches!(error, StoreError::Locked { .. }) && error.may_pass(),
        "{error}"
    );
    other.execute_batch("COMMIT").unwrap();
    commit(&store, &id, 100).unwrap();
}

#[test]
fn a_full_disk_is_called_that_and_loses_nothing() {
    let (_folder, store) = open();
    let id = store.create_campaign(&spec(), Weight::default(), 0).unwrap();
    commit(&store, &id, 0).unwrap();
    let pages: u32 = store
        .read(|c| Ok(c.pragma_query_value(None, "page_count", |row| row.get(0))?))
        .unwrap();
    store
        .write(|c| Ok(c.pragma_update(None, "max_page_count", pages)?))
        .unwrap();
    // Commits as many generations as the existing pages have room for.
    let (refused, error) = (1..1000)
        .find_map(|generation| Some(generation).zip(commit(&store, &id, generation).err()))
        .unwrap();
    assert!(matches!(error, StoreError::DiskFull { .. }), "{error}");
    assert_eq!(store.archive_len(&id).unwrap(), u64::from(refused) * 2);
    store
        .write(|c| Ok(c.pragma_update(None, "max_page_count", pages + 100)?))
        .unwrap();
    commit(&store, &id, refused).unwrap();
    assert_eq!(store.archive_len(&id).unwrap(), u64::from(refused) * 2 + 2);
}

#[test]
fn a_campaign_cannot_have_a_checkpoint_that_is_not_there() {
    let (_folder, store, id, [digest, _]) = embedded();
    let absent = CheckpointDigest::of(b"absent");
    assert!(matches!(
        store.move_to(&id, absent),
        Err(StoreError::NoCheckpoint(_))
    ));
    let text = format!("model = \"single-sensor\"\nmethod = \"latent\"\ncheckpoint = \"{absent}\"");
    let spec = CampaignSpec::from_toml(&text).unwrap();
    assert!(matches!(
        store.create_campaign(&spec, Weight::default(), 0),
        Err(StoreError::NoCheckpoint(_))
    ));
    assert_eq!(
        store.campaign(id.as_str()).unwrap().embedder.checkpoint(),
        Some(digest)
    );
    assert_eq!(store.campaigns().unwrap().len(), 1);
}

#[test]
fn individuals_are_found_by_their_indices_without_their_pictures() {
    let (_folder, store) = open();
    let id = store.create_campaign(&spec(), Weight::default(), 0).unwrap();
    (0..2).for_each(|generation| commit(&store, &id, generation).unwrap());
    let found = store.measured_individuals(&id, spec().model(), &[3, 0, 99].into());
    let found = found.unwrap();
    assert_eq!(found.iter().map(|one| one.index).collect::<Vec<_>>(), [0, 3]);
    let whole = store.individual(&id, spec().model(), 3).unwrap();
    assert_eq!(found[1].features(), whole.features());
    assert!(whole.image().is_some() && found[1].image().is_none());
}

#[test]
fn a_dataset_and_its_training_read_back() {
    let (_folder, store) = open();
    let id = store.create_campaign(&spec(), Weight::default(), 0).unwrap();
    let picture = |index: u64| Picture {
        features: Some([index as f64, 0.0, 0.0, 0.0, -1.0]),
        controller: individual(0).controller,
        seed: u64::MAX - index,
        image: vec![index as u8; 2500],
    };
    store
        .add_pictures(&id, 0, &[picture(0), picture(1)], &Provenance::default())
        .unwrap();
    store
        .add_pictures(&id, 2, &[picture(2)], &Provenance::default())
        .unwrap();
    assert!(
        store
            .add_pictures(&id, 2, &[picture(3)], &Provenance::default())
            .is_err()
    );
    assert_eq!(store.campaign(id.as_str()).unwrap().pictures_done, 3);
    let images = [vec![1; 2500], vec![2; 2500]].concat();
    assert_eq!(store.dataset_images(&id, 1..9).unwrap(), images);
    assert_eq!(store.picture(&id, spec().model(), 1).unwrap(), picture(1));
    // Each controller has two starts, and its features come from the first.
    let features = store.dataset_features(&id, 2, 0..5).unwrap();
    assert_eq!(
        features,
        [picture(0), picture(2)].map(|picture| picture.features.unwrap())
    );

    assert_eq!(store.saved_training(&id).unwrap(), None);
    let training = |epoch: u64| SavedTraining {
        epoch,
        bytes: vec![epoch as u8],
    };
    for epoch in [1, 3, 2] {
        store.save_training(&id, &training(epoch)).unwrap();
    }
    assert_eq!(store.saved_training(&id).unwrap(), Some(training(2)));
}

#[test]
fn an_id_that_is_almost_that_of_a_campaign_is_answered_with_that() {
    let (_folder, store) = open();
    let id = store.create_campaign(&spec(), Weight::default(), 7).unwrap();
    let message = |id: &str| store.campaign(id).unwrap_err().to_string();
    let typed = id.as_str().replace('-', "_");
    assert!(
        message(&typed).contains(&format!("did you mean \"{id}\"?")),
        "{}",
        message(&typed)
    );
    for other in ["nothing-like-it-9", &id.as_str().repeat(100)] {
        assert!(!message(other).contains("did you mean"), "{}", message(other));
    }
    store.decide(&id, Decision::Cancel, false).unwrap();
    store.delete_campaign(&id, None, false).unwrap();
    assert!(!message(id.as_str()).contains("did you mean"));
}

#[test]
fn a_data_directory_whose_name_is_no_text_is_looked_at() {
    let parent = tempfile::tempdir().unwrap();
    // A file system may accept only text.
    let folder = parent.path().join(OsStr::from_bytes(b"odd \xff%?#"));
    if fs::create_dir(&folder).is_err() {
        return;
    }
    drop(Store::open(&DataDirectory::hold(&folder).unwrap()).unwrap());
    let path = folder.join(Store::FILE);
    let (connection, _) = crate::open::to_look(&path, true).unwrap();
    let campaigns: i64 = connection
        .query_row("SELECT count(*) FROM campaigns", [], |row| row.get(0))
        .unwrap();
    assert_eq!(campaigns, 0);
}

/// Another process may be copying the database, or have its own log at the same path.
#[test]
fn on_a_shared_file_system_neither_a_commit_nor_a_close_writes_the_database_or_removes_its_log() {
    let (folder, store) = open();
    drop(store);
    let path = folder.path().join(Store::FILE);
    let log = folder.path().join(format!("{}-wal", Store::FILE));
    let before = fs::read(&path).unwrap();
    let nfs = FileSystem::of_kind("nfs4".to_owned());
    let connection = open::to_write(&path, &nfs, &|| Ok(())).unwrap();
    let reader = open::to_read(&path, &nfs).unwrap();
    connection
        .execute_batch("CREATE TABLE notes (note BLOB)")
        .unwrap();
    // More pages than SQLite lets a log have before it writes them into the database by itself.
    for _ in 0..10 {
        let insert = "INSERT INTO notes VALUES (zeroblob(1 << 20))";
        connection.execute_batch(insert).unwrap();
    }
    let count = |connection: &Connection| -> i64 {
        let count = "SELECT count(*) FROM notes";
        connection.query_row(count, [], |row| row.get(0)).unwrap()
    };
    assert_eq!(count(&reader), 10);
    reader.close().unwrap();
    connection.close().unwrap();
    assert!(fs::read(&path).unwrap() == before && log.metadata().unwrap().len() > 10 << 20);
    let again = open::to_write(&path, &nfs, &|| Ok(())).unwrap();
    assert_eq!(count(&again), 10);
}
