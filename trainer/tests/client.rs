//! Tests how a trainer with a fake coordinator publishes checkpoints, and how its trainings survive disturbances. The tests need
//! ONNX Runtime (`make runtime`).
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

mod coordinator;

use coordinator::Fake;
use murmuration_onnx::EmbedderModel;
use murmuration_proto::v1::{self, batch_result::Outcome, worker_message::Message};
use murmuration_swarm::{CheckpointDigest, Lineage, PictureShape, training::Configuration};
use murmuration_train::{onnx, pictures::Pictures, training::Training};
use murmuration_trainer::client::TrainerError;
use std::sync::Arc;

const SIDE: usize = 9;
const VIEWS: usize = 2;
const BEHAVIOURS: usize = 40;
const SHORT: &str = "[recipe.in-batch]\nbatch = 12\nepochs = 6\n";
/// A recipe that shows every behaviour equally often, and so needs no features.
const EQUALLY: &str = "[recipe.in-batch]\nbatch = 12\nepochs = 6\nflattening = 0\n";
/// A training that outlasts any test.
const LONG: &str = "[recipe.in-batch]\nbatch = 12\nepochs = 100000\npatience = 100000\n";

/// Pictures of bars: each behaviour has one width, one brightness, and two places.
fn bars() -> Vec<u8> {
    let bar = |behaviour: usize, view: usize| {
        let columns = 3 * view..3 * view + 1 + behaviour % 5;
        let grey = move |i: usize| match columns.contains(&(i % SIDE)) {
            true => 80 + 4 * behaviour as u8,
            false => 0,
        };
        (0..SIDE * SIDE).map(grey)
    };
    let bars = (0..BEHAVIOURS).flat_map(|behaviour| (0..VIEWS).map(move |view| (behaviour, view)));
    bars.flat_map(|(behaviour, view)| bar(behaviour, view)).collect()
}

fn features() -> Vec<[f64; 5]> {
    let features = |behaviour: usize| [behaviour as f64, (behaviour % 5) as f64, 0.0, 0.0, 0.0];
    (0..BEHAVIOURS).map(features).collect()
}

fn pictures() -> Arc<Pictures> {
    let pictures = Pictures::new(PictureShape::new(1, SIDE).unwrap(), VIEWS, bars()).unwrap();
    Arc::new(pictures.with_features(features()).unwrap())
}

fn task(configuration: &str) -> v1::TrainingTask {
    v1::TrainingTask {
        configuration: configuration.to_owned(),
        channels: 1,
        side: SIDE as u32,
        views: VIEWS as u32,
        behaviours: BEHAVIOURS as u32,
        parent: String::new(),
        labelled: 0,
        labels: 0,
    }
}

/// The checkpoint of the same training, run in this process without interruption.
fn expected(configuration: &str) -> CheckpointDigest {
    let configuration = Configuration::from_toml(configuration).unwrap();
    let mut training = Training::new(&configuration, pictures()).unwrap();
    while training.step().is_some() {}
    CheckpointDigest::of(&onnx::export(&training.embedder()))
}

fn checkpoint(digest: CheckpointDigest) -> Outcome {
    Outcome::Checkpoint(digest.to_string())
}

#[track_caller]
fn check_failure(outcome: Outcome, class: v1::FailureClass, expected: &str) {
    let Outcome::Failure(failure) = outcome else {
        panic!("not a failure: {outcome:?}")
    };
    assert_eq!(failure.class(), class, "{}", failure.message);
    assert!(
        failure.message.contains(expected),
        "{:?} does not say {expected:?}",
        failure.message
    );
}

#[tokio::test]
async fn a_training_is_reported_and_published() {
    let mut fake = Fake::start(bars(), features().concat()).await;
    let mut session = fake.welcome().await;
    session.lease(1, task(SHORT)).await;
    let begun = session.report(1).await;
    let before = v1::TrainingProgress {
        epoch: 0,
        epochs: 6,
        ..Default::default()
    };
    assert_eq!(begun, before);
    let first = session.report(1).await;
    assert_eq!((first.epoch, first.epochs), (1, 6));
    assert!(first.loss.is_some() && first.triplets_per_second > Some(0.0) && first.seconds_left > Some(0.0));
    let (outcome, reports, snapshots) = session.result(1).await;
    assert_eq!(outcome, checkpoint(expected(SHORT)));
    assert!(
        reports == 5 && snapshots >= 1,
        "{reports} reports, {snapshots} snapshots"
    );

    let (description, bytes) = fake.published();
    assert_eq!(EmbedderModel::read(&bytes).unwrap().dimensions(), 5);
    let lineage = Lineage::try_from(description).unwrap();
    assert_eq!((lineage.parent, lineage.data_digest), (None, pictures().digest()));
    let configuration = Configuration::from_toml(&lineage.configuration).unwrap();
    assert_eq!(configuration, Configuration::from_toml(SHORT).unwrap());
    assert_eq!(lineage.metrics["epochs"], 6.0);
    assert!(lineage.metrics["spread"] > 0.0 && lineage.metrics["onnx_difference"] <= 1e-5);
    // The trainer is ready for the next training.
    session.lease(2, task(SHORT)).await;
    assert_eq!(session.result(2).await.0, checkpoint(expected(SHORT)));
}

#[tokio::test]
async fn an_untrained_network_is_published_as_it_is() {
    for network in ["compact", "paper"] {
        let configuration = format!("seed = 2\nrecipe = \"untrained\"\n[network]\nname = \"{network}\"\n");
        let mut fake = Fake::start(bars(), Vec::new()).await;
        let mut session = fake.welcome().await;
        session.lease(1, task(&configuration)).await;
        assert_eq!(
            session.result(1).await,
            (checkpoint(expected(&configuration)), 1, 0)
        );
    }
}

#[tokio::test]
async fn a_training_that_is_cut_off_goes_on_from_its_snapshot_to_the_same_checkpoint() {
    let mut fake = Fake::start(bars(), features().concat()).await;
    let mut session = fake.welcome().await;
    session.lease(1, task(SHORT)).await;
    let (epoch, saved) = session.snapshot(1).await;
    assert_eq!(epoch, 1);
    drop(session);

    fake.keep(saved);
    let mut session = fake.welcome().await;
    session.lease(2, task(SHORT)).await;
    assert_eq!(session.report(2).await.epoch, 1, "it began anew");
    let (outcome, reports, _) = session.result(2).await;
    assert_eq!((outcome, reports), (checkpoint(expected(SHORT)), 5));
}

#[tokio::test]
async fn a_snapshot_that_is_damaged_or_of_another_training_is_left() {
    let mut fake = Fake::start(bars(), features().concat()).await;
    let mut session = fake.welcome().await;
    let other = Configuration::from_toml(LONG).unwrap();
    let other = Training::new(&other, pictures()).unwrap().save();
    for (number, saved) in [(1, vec![7; 5000]), (2, other)] {
        fake.keep(saved);
        session.lease(number, task(SHORT)).await;
        assert_eq!(session.report(number).await.epoch, 0);
        assert_eq!(session.result(number).await.0, checkpoint(expected(SHORT)));
    }
}

#[tokio::test]
async fn a_training_that_is_withdrawn_stops_and_makes_room() {
    let mut fake = Fake::start(bars(), features().concat()).await;
    let mut session = fake.welcome().await;
    session.lease(1, task(LONG)).await;
    while session.report(1).await.epoch < 2 {}
    session.withdraw(7).await;
    session.withdraw(1).await;
    while !matches!(session.hear().await, Message::Credits(_)) {}
    // If the trainer sent an outcome of the first lease, the checks of the second lease would fail.
    session.lease_for_credit(2, task(SHORT)).await;
    assert_eq!(session.report(2).await.epoch, 0);
    assert_eq!(session.result(2).await.0, checkpoint(expected(SHORT)));
}

#[tokio::test]
async fn a_trainer_that_leaves_hands_its_training_back() {
    let mut fake = Fake::start(bars(), features().concat()).await;
    let mut session = fake.welcome().await;
    session.lease(1, task(LONG)).await;
    while session.report(1).await.epoch < 3 {}
    fake.stop();
    while !matches!(session.hear().await, Message::Drain(_)) {}
    let mut last = None;
    let outcome = loop {
        match session.hear().await {
            Message::Snapshot(part) => last = Some(part),
            Message::Result(result) => break result.outcome.unwrap(),
            Message::Training(_) => {}
            other => panic!("{other:?}"),
        }
    };
    check_failure(outcome, v1::FailureClass::Retryable, "the trainer is leaving");
    let last = last.unwrap();
    assert!(last.last, "a snapshot in one part");
    let configuration = Configuration::from_toml(LONG).unwrap();
    let restored = Training::new(&configuration, pictures()).unwrap();
    let restored = restored.taken_up(&last.data).unwrap();
    assert!(restored.epoch() == last.epoch && last.epoch >= 3);
    drop(session);
    fake.end().await.unwrap();
}

#[tokio::test]
async fn a_trainer_without_work_leaves_at_once() {
    let mut fake = Fake::start(bars(), features().concat()).await;
    let mut session = fake.welcome().await;
    assert!(matches!(session.hear().await, Message::Credits(_)));
    fake.stop();
    assert!(matches!(session.hear().await, Message::Drain(_)));
    drop(session);
    fake.end().await.unwrap();
}

#[tokio::test]
async fn what_cannot_be_trained_fails_for_good() {
    let mut fake = Fake::start(vec![0; bars().len()], Vec::new()).await;
    let mut session = fake.welcome().await;
    let fatal = v1::FailureClass::Fatal;
    session.lease(1, task(EQUALLY)).await;
    check_failure(session.result(1).await.0, fatal, "the embedding collapsed");
    session.lease(2, task("sed = 1")).await;
    check_failure(session.result(2).await.0, fatal, "unknown field `sed`");
    session
        .lease(
            3,
            v1::TrainingTask {
                behaviours: 41,
                ..task(EQUALLY)
            },
        )
        .await;
    check_failure(
        session.result(3).await.0,
        fatal,
        "received 6480 bytes of pictures, not 6642",
    );
    session
        .lease(
            4,
            v1::TrainingTask {
                side: 3,
                behaviours: 360,
                ..task(EQUALLY)
            },
        )
        .await;
    check_failure(session.result(4).await.0, fatal, "does not fit pictures of 3 x 3");
    assert!(fake.has_none());
}

#[tokio::test]
async fn a_trainer_that_is_refused_gives_up() {
    let error = Fake::refusing().await.end().await.unwrap_err();
    assert!(matches!(&error, TrainerError::Refused { .. }), "{error}");
    assert_eq!(
        error.to_string(),
        "the coordinator refused this trainer: run another version"
    );
}
