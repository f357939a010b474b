//! Tests of the deletion of campaigns: which data goes, and which stays.

use super::*;
use crate::{ArchivedIndividual, DataDirectory, EpochRecord, GenerationRecord, Provenance, hidden::TABLES};
use murmuration_model::{
    NewCampaign, Weight,
    labels::{Action, Change, RequestId},
};
use murmuration_swarm::CampaignSpec;

fn open() -> (tempfile::TempDir, Store) {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap();
    (folder, store)
}

fn asked(study: &str, request: Option<&str>) -> NewCampaign {
    let spec =
        CampaignSpec::from_toml("name = \"one\"\nmodel = \"single-sensor\"\nmethod = \"latent\"").unwrap();
    NewCampaign {
        study: murmuration_model::study_name(study.to_owned()).unwrap(),
        request: request.map(|id| id.parse().unwrap()),
        ..spec.into()
    }
}

/// A campaign with an individual, a label, a notice and an epoch.
fn filled(store: &Store, study: &str) -> CampaignId {
    let id = store.start_campaign(&asked(study, None), 7).unwrap().id;
    let provenance = Provenance {
        notices: vec!["a notice".to_owned()],
        ..Provenance::default()
    };
    let record = GenerationRecord::of(0, &[0.0], 0);
    let individuals = [ArchivedIndividual::still(0, 0)];
    store
        .commit_generation(&id, &record, &individuals, &provenance)
        .unwrap();
    let request: RequestId = "1".parse().unwrap();
    let answer = Change {
        annotator: "ana".parse().unwrap(),
        time_ms: 7,
        action: Action::Answer {
            index: 0,
            answer: "ring".parse().unwrap(),
        },
    };
    store.add_labels(&id, &request, vec![answer]).unwrap();
    let epoch = EpochRecord {
        round: 0,
        epoch: 1,
        loss: None,
        accuracy: Some(0.5),
    };
    store.add_epoch(&id, &epoch).unwrap();
    id
}

#[test]
fn a_campaign_goes_with_all_that_is_of_it_and_its_id_is_not_given_again() {
    let (_folder, store) = open();
    let (kept, gone) = (filled(&store, ""), filled(&store, ""));
    let running = store.delete_campaign(&gone, None, false).unwrap_err();
    assert!(matches!(running, DeletionError::Running(_)), "{running}");
    store.set_state(&gone, CampaignState::Paused, "").unwrap();
    let deletion = store.deletion(&gone).unwrap();
    assert_eq!(
        deletion.in_words(),
        "100 individuals, 0 pictures of the dataset, the labels of 1 individual and its notices"
    );
    store.delete_campaign(&gone, None, false).unwrap();
    assert!(matches!(
        store.campaign(gone.as_str()),
        Err(StoreError::NoCampaign(_))
    ));
    assert!(matches!(store.labels(&gone), Err(StoreError::NoCampaign(_))));
    let left = store.read(|connection| {
        let broken: i64 = connection.query_row("SELECT count(*) FROM pragma_foreign_key_check", [], |row| row.get(0))?;
        assert_eq!(broken, 0);
        let mut tables = connection.prepare(
            "SELECT s.name FROM sqlite_schema s, pragma_table_info(s.name) c WHERE s.type = 'table' AND c.name = 'campaign'
             ORDER BY s.name",
        )?;
        let tables = tables.query_map([], |row| row.get(0))?.collect::<Result<Vec<String>, _>>()?;
        Ok(tables)
    });
    let mut named = TABLES.map(|(table, ..)| table).to_vec();
    named.sort_unstable();
    assert_eq!(left.unwrap(), named, "a table of campaigns is not emptied");
    assert_eq!(store.labels(&kept).unwrap().entries(), 1);
    assert_eq!(
        store.start_campaign(&asked("", None), 8).unwrap().id.as_str(),
        "one-3"
    );
}

#[test]
fn what_a_deletion_that_did_not_end_has_left_is_never_shown_and_is_removed_by_the_next_start() {
    let (folder, store) = open();
    let (gone, kept) = (filled(&store, ""), filled(&store, ""));
    store.set_state(&gone, CampaignState::Paused, "").unwrap();
    let run = |store: &Store, statement: &str| {
        let ran = store.write(|transaction| Ok(transaction.execute_batch(statement)?));
        ran.unwrap();
    };
    run(
        &store,
        "CREATE TRIGGER full BEFORE DELETE ON labels BEGIN SELECT RAISE (ABORT, 'the disk is full'); END",
    );
    store.delete_campaign(&gone, None, false).unwrap();
    let rows = |store: &Store| -> i64 {
        let counts = TABLES.map(|(table, ..)| format!("(SELECT count(*) FROM {table} WHERE campaign = 1)"));
        let all = format!(
            "SELECT {} + (SELECT count(*) FROM campaigns WHERE number = 1)",
            counts.join(" + ")
        );
        let counted = store.read(|connection| Ok(connection.query_row(&all, [], |row| row.get(0))?));
        counted.unwrap()
    };
    assert_eq!(rows(&store), 2, "its own row and its label");
    assert!(matches!(
        store.campaign(gone.as_str()),
        Err(StoreError::NoCampaign(_))
    ));
    assert_eq!(store.campaigns().unwrap().len(), 1);
    assert_eq!(store.count_labels().unwrap(), 1);
    run(&store, "DROP TRIGGER full");
    drop(store);
    let store = Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap();
    assert_eq!(rows(&store), 0);
    assert_eq!(store.labels(&kept).unwrap().entries(), 1);
    assert_eq!(
        store.start_campaign(&asked("", None), 8).unwrap().id.as_str(),
        "one-3"
    );
}

#[test]
fn labels_stay_while_their_campaign_does() {
    let (_folder, store) = open();
    filled(&store, "");
    let deleted = store.write(|transaction| Ok(transaction.execute("DELETE FROM labels", [])?));
    assert!(
        deleted
            .unwrap_err()
            .to_string()
            .contains("labels are never deleted")
    );
}

#[test]
fn a_campaign_of_a_study_is_not_the_latest_and_goes_only_with_the_name_of_its_study() {
    let (_folder, store) = open();
    let own = filled(&store, "");
    let cell = filled(&store, "small");
    assert_eq!(store.campaign("latest").unwrap().id, own);
    assert_eq!(
        store.campaign(cell.as_str()).unwrap().study,
        asked("small", None).study
    );
    store.set_state(&cell, CampaignState::Cancelled, "").unwrap();
    for named in [None, asked("other", None).study] {
        let refused = store.delete_campaign(&cell, named.as_ref(), false).unwrap_err();
        assert!(refused.to_string().contains("--study small"), "{refused}");
    }
    let named = asked("small", None).study;
    store.delete_campaign(&cell, named.as_ref(), false).unwrap();
}

#[test]
fn a_request_starts_one_campaign_however_often_it_comes() {
    let (_folder, store) = open();
    let first = store.start_campaign(&asked("", Some("once")), 7).unwrap();
    assert!(first.is_new);
    let again = store.start_campaign(&asked("", Some("once")), 8).unwrap();
    assert_eq!((&again.id, again.is_new), (&first.id, false));
    let second = store.start_campaign(&asked("", Some("twice")), 8).unwrap();
    assert_ne!(second.id, first.id);
    assert_eq!(store.campaigns().unwrap().len(), 2);
    // A request with the same id that asks for something else is refused.
    let once = asked("", Some("once"));
    let other = CampaignSpec::from_toml("model = \"single-sensor\"\nmethod = \"random\"").unwrap();
    for other in [
        asked("small", Some("once")),
        NewCampaign {
            weight: Weight::try_from(7_u32).unwrap(),
            ..once.clone()
        },
        NewCampaign {
            spec: other,
            ..once.clone()
        },
    ] {
        let refused = store.start_campaign(&other, 9).unwrap_err();
        assert!(matches!(refused, StoreError::OtherRequest { .. }), "{refused}");
    }
    // The id of the request is free again once the campaign is deleted.
    store.set_state(&first.id, CampaignState::Paused, "").unwrap();
    store.delete_campaign(&first.id, None, false).unwrap();
    assert!(store.start_campaign(&once, 9).unwrap().is_new);
}

#[test]
fn what_has_stopped_says_when_and_what_runs_again_does_not() {
    let (_folder, store) = open();
    let id = filled(&store, "");
    let ended = |store: &Store| store.campaign(id.as_str()).unwrap().ended_ms;
    assert_eq!(ended(&store), None);
    store.decide(&id, crate::Decision::Pause, false).unwrap();
    let paused = ended(&store);
    assert!(paused.is_some());
    store.decide(&id, crate::Decision::Resume, false).unwrap();
    assert_eq!(ended(&store), None);
}
