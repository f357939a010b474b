//! Tests that damage rows one by one, and check the problems and the whole amounts that the doctor finds.

use super::*;
use crate::{
    ArchivedIndividual, ClusterMeasures, GenerationRecord, Picture, Provenance, chunks::tests::edit,
};
use murmuration_model::{
    CampaignId, Weight,
    labels::{Action, Answer, Change, RequestId},
};
use murmuration_search::medoids::Clustering;
use murmuration_swarm::CampaignSpec;
use rusqlite::Connection;

/// A data directory with a completed campaign of three generations of two individuals, and three labels.
fn data() -> (tempfile::TempDir, CampaignId) {
    let folder = tempfile::tempdir().unwrap();
    let held = DataDirectory::hold(folder.path()).unwrap();
    let store = Store::open(&held).unwrap();
    let text = "model = \"single-sensor\"\nmethod = \"random\"\n[search]\npopulation = 2\ngenerations = 3\nneighbours = 1\n\
                [taxonomy]\nmedoids = 1";
    let id = store
        .create_campaign(&CampaignSpec::from_toml(text).unwrap(), Weight::default(), 0)
        .unwrap();
    for generation in 0..3 {
        let individuals = [0, 1].map(|place| {
            ArchivedIndividual::pictured(u64::from(generation) * 2 + place, generation, vec![7; 2500])
        });
        let record = GenerationRecord::of(generation, &[0.1, 0.1], 0);
        store
            .commit_generation(&id, &record, &individuals, &Provenance::default())
            .unwrap();
    }
    for index in 0..3 {
        let change = Change {
            annotator: "ana".parse().unwrap(),
            time_ms: 0,
            action: Action::Answer {
                index,
                answer: "ring".parse::<Answer>().unwrap(),
            },
        };
        let request: RequestId = index.to_string().parse().unwrap();
        store.add_labels(&id, &request, vec![change]).unwrap();
    }
    let taxonomy = Clustering {
        medoids: vec![0],
        clusters: vec![0; 6],
        loss: 1.0,
    };
    store
        .complete(&id, &taxonomy, &[ClusterMeasures::default()], &[], &[])
        .unwrap();
    store.close();
    (folder, id)
}

/// The doctor's findings after the SQL statements `damage`.
async fn examined(damage: &str) -> Findings {
    examined_after(|connection| connection.execute_batch(damage).unwrap()).await
}

async fn examined_after(damage: impl FnOnce(&Connection)) -> Findings {
    let (folder, _) = data();
    let connection = Connection::open(folder.path().join(Store::FILE)).unwrap();
    damage(&connection);
    drop(connection);
    examine(folder.path(), None).await.unwrap()
}

/// Checks which parts are whole after `damage`: generations, entries of the label log, the taxonomy.
async fn check(damage: &str, expected: &str, whole: (u32, u64, bool)) {
    check_found(&examined(damage).await, expected, whole);
}

#[track_caller]
fn check_found(found: &Findings, expected: &str, whole: (u32, u64, bool)) {
    assert!(!found.is_healthy());
    let campaign = &found.campaigns[0];
    assert_eq!(campaign.condition, CampaignCondition::Damaged);
    assert!(
        campaign.problems.iter().any(|problem| problem.contains(expected)),
        "{:?}",
        campaign.problems
    );
    let found = &campaign.whole;
    assert_eq!(
        (found.generations, found.labels, found.taxonomy),
        whole,
        "{expected}"
    );
}

#[tokio::test]
async fn a_sound_directory_is_healthy() {
    let found = examined("").await;
    assert!(found.is_healthy(), "{found:?}");
    let campaign = &found.campaigns[0];
    assert_eq!(campaign.condition, CampaignCondition::Whole);
    assert_eq!(campaign.whole, campaign.stored);
}

#[tokio::test]
async fn an_archive_is_whole_up_to_the_first_generation_that_is_damaged() {
    let damaged = |generations| (generations, 3, false);
    check(
        "DELETE FROM image_chunks WHERE first = 2",
        "individual 2: its picture is missing",
        damaged(1),
    )
    .await;
    type Change = fn(&mut Vec<u8>);
    let faults: [(Change, &str); 4] = [
        (|image| *image = vec![0], "not of 2500 pixels"),
        // The beginning of a frame of one pixel.
        (
            |image| *image = vec![0x28, 0xb5, 0x2f, 0xfd, 0x24, 0x01],
            "damaged",
        ),
        (|image| image.truncate(image.len() - 1), "damaged"),
        (|image| *image.last_mut().unwrap() = 0, "damaged"),
    ];
    for (change, fault) in faults {
        let found = examined_after(|connection| edit(connection, "images", 3, change)).await;
        check_found(
            &found,
            &format!("individual 3: its picture is {fault}"),
            damaged(1),
        );
    }
    check(
        "DELETE FROM individual_chunks WHERE first = 0",
        "individual 0: it is missing",
        damaged(0),
    )
    .await;
    let found =
        examined_after(|connection| edit(connection, "controllers", 5, |genes| genes.fill(0xff))).await;
    check_found(&found, "individual 5: ", damaged(2));
    check(
        "UPDATE individual_chunks SET generation = 7 WHERE first = 2",
        "individual 2: it is of another",
        damaged(1),
    )
    .await;
    for (chunk, fault, generations) in [
        (
            "individual_chunks SET seeds = x'00'",
            "individuals 2 to 3: values whose lengths",
            1,
        ),
        (
            "image_chunks SET ends = x'00'",
            "individuals 2 to 3: values whose lengths",
            1,
        ),
        ("individual_chunks SET individuals = 1", "individual 2: ", 1),
        (
            "individual_chunks SET first = 3",
            "individual 2: it is missing",
            1,
        ),
        (
            "individual_chunks SET first = 1",
            "individual 3: it is missing",
            1,
        ),
        (
            "image_chunks SET first = 1",
            "individual 3: its picture is missing",
            1,
        ),
    ] {
        check(
            &format!("UPDATE {chunk} WHERE first = 2"),
            fault,
            damaged(generations),
        )
        .await;
    }
    check(
        "DROP TRIGGER image_chunks_overlap;
         INSERT INTO image_chunks SELECT campaign, 3, individuals, ends, images FROM image_chunks WHERE first = 2",
        "individual 3: it is in two chunks of image_chunks",
        damaged(1),
    )
    .await;
    check(
        "DELETE FROM generations WHERE generation = 1",
        "generation 1 is missing",
        damaged(1),
    )
    .await;
}

#[tokio::test]
async fn a_damaged_picture_of_a_dataset_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let held = DataDirectory::hold(folder.path()).unwrap();
    let store = Store::open(&held).unwrap();
    let text = "model = \"single-sensor\"\nmethod = \"latent\"";
    let id = store
        .create_campaign(&CampaignSpec::from_toml(text).unwrap(), Weight::default(), 0)
        .unwrap();
    let pictures = [1, 2, 3, 4].map(|grey| Picture {
        features: None,
        controller: ArchivedIndividual::still(0, 0).controller,
        seed: 0,
        image: vec![grey; 2500],
    });
    store
        .add_pictures(&id, 0, &pictures, &Provenance::default())
        .unwrap();
    drop((store, held));
    let connection = Connection::open(folder.path().join(Store::FILE)).unwrap();
    let damage = "UPDATE pictures SET image = substr(image, 1, length(image) - 1) WHERE place = 2";
    connection.execute_batch(damage).unwrap();
    drop(connection);
    let found = examine(folder.path(), None).await.unwrap();
    assert_eq!(
        found.campaigns[0].problems,
        ["picture 2 of its dataset: it is damaged"]
    );
    assert_eq!(found.campaigns[0].whole.pictures, 2);
}

#[tokio::test]
async fn labels_and_taxonomy_are_examined_too() {
    let labels = "DROP TRIGGER labels_stay; UPDATE labels SET action = 'shout' WHERE entry = 1";
    check(labels, "entry 1 of its label log", (3, 1, true)).await;
    let damaged = (3, 3, false);
    check("DELETE FROM taxonomies", "its taxonomy is missing", damaged).await;
    check(
        "UPDATE taxonomies SET clusters = x'00000000'",
        "its taxonomy is of another archive",
        damaged,
    )
    .await;
    check(
        "UPDATE taxonomies SET robust_trials = zeroblob(length(clusters) / 4)",
        "its taxonomy has counts of robust trials that do not fit the campaign's starts",
        damaged,
    )
    .await;
    check(
        "UPDATE taxonomies SET measures = x''",
        "its taxonomy cannot be read: the taxonomy of campaign",
        damaged,
    )
    .await;
    let former = |damage: &str| {
        format!(
            "INSERT INTO taxonomies SELECT campaign, 7, 0, made_ms, checkpoint, rounds, generations, medoids, clusters, loss,
                 measures, robust_trials, points FROM taxonomies;
             UPDATE taxonomies SET {damage} WHERE version = 7"
        )
    };
    for (damage, expected) in [
        ("measures = x''", "version 7 of its taxonomy cannot be read"),
        (
            "medoids = x'ffffffffffffff7f'",
            "version 7 of its taxonomy has medoids",
        ),
        (
            "clusters = zeroblob(4000)",
            "version 7 of its taxonomy is about individuals",
        ),
    ] {
        check(&former(damage), expected, (3, 3, true)).await;
    }
}

#[tokio::test]
async fn a_campaign_without_a_specification_is_unreadable() {
    let found = examined("UPDATE campaigns SET spec = 'nonsense'").await;
    assert_eq!(found.campaigns[0].condition, CampaignCondition::Unreadable);
}

#[tokio::test]
async fn looking_changes_nothing() {
    let (folder, _) = data();
    let listing = || {
        let mut names = Vec::new();
        for folder in [folder.path().to_path_buf(), folder.path().join("lease")] {
            names.extend(fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()));
        }
        names.retain(|path| path.is_file());
        names.sort();
        let contents: Vec<_> = names.iter().map(|path| fs::read(path).unwrap()).collect();
        (names, contents)
    };
    let before = listing();
    examine(folder.path(), None).await.unwrap();
    assert_eq!(listing(), before);
    let held = DataDirectory::hold(folder.path()).unwrap();
    let refused = examine(folder.path(), None).await.unwrap_err();
    assert!(
        matches!(refused, CheckpointError::Store(StoreError::InUse { .. })),
        "{refused}"
    );
    drop(held);
}

#[tokio::test]
async fn others_go_on_while_the_doctor_looks() {
    let (folder, _) = data();
    let turns = std::sync::Arc::new(std::sync::atomic::AtomicU64::new(0));
    let others = tokio::spawn({
        let turns = turns.clone();
        async move {
            loop {
                turns.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                tokio::task::yield_now().await;
            }
        }
    });
    assert!(examine(folder.path(), None).await.unwrap().is_healthy());
    others.abort();
    // The runtime has one thread, so other tasks run only while the doctor does not block that thread.
    let turns = turns.load(std::sync::atomic::Ordering::Relaxed);
    assert!(turns > 20, "{turns}");
}
