//! Tests of whole trainings.

use super::*;
use crate::{onnx, pictures::tests::grey};
use rand::RngExt as _;

pub(super) const SMALL: &str = "
    [network]
    layers = [
        { convolution = { channels = 4, kernel = 3, stride = 2, padding = 1 } },
        { group-normalisation = { groups = 2 } },
        { leaky-relu = { slope = 0.01 } },
        { dense = { units = 3 } },
    ]
";
const IN_BATCH: &str = "[recipe.in-batch]\nbatch = 20\nepochs = 4\n";
const PAPER: &str = "[recipe.paper]\nbatch = 100\nsteps = 2\nepochs = 4\nlearning_rate = 0.01\n";

/// Pictures of sixty behaviours, with two views each. A behaviour is a bar of one width and one brightness.
pub(super) fn bars() -> Arc<Pictures> {
    let mut stream = RandomStream::derive(5, Purpose::Train, 0);
    let mut bytes = Vec::new();
    for behaviour in 0..60 {
        for _ in 0..2 {
            let start = stream.random_range(0..5);
            let bar = start..start + 1 + behaviour % 6;
            bytes.extend((0..144).map(|i| {
                if bar.contains(&(i % 12)) {
                    70 + 3 * behaviour as u8
                } else {
                    0
                }
            }));
        }
    }
    let features = (0..60).map(|behaviour| [f64::from(behaviour % 6), f64::from(behaviour), 0.0, 0.0, 0.0]);
    let pictures = Pictures::new(grey(12), 2, bytes).unwrap();
    Arc::new(pictures.with_features(features.collect()).unwrap())
}

fn training(text: &str) -> Training {
    Training::new(&configuration(text), bars()).unwrap()
}

pub(super) fn configuration(text: &str) -> Configuration {
    Configuration::from_toml(&format!("{SMALL}{text}")).unwrap()
}

pub(super) fn finished(mut training: Training) -> Training {
    while training.step().is_some() {}
    training
}

fn on_threads<R: Send>(threads: usize, work: impl FnOnce() -> R + Send) -> R {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .unwrap();
    pool.install(work)
}

/// Checks that the bytes of a whole training do not depend on the number of threads.
#[track_caller]
pub(super) fn check_threads(training: impl Fn() -> Training + Sync) {
    let bytes = |threads| {
        on_threads(threads, || {
            let training = finished(training());
            (training.save(), onnx::export(&training.embedder()))
        })
    };
    let one = bytes(1);
    assert!(one == bytes(2) && one == bytes(4));
}

/// Checks that a training saved and resumed after any of its four epochs ends like an uninterrupted one.
#[track_caller]
pub(super) fn check_interruption(training: impl Fn() -> Training) {
    let whole = finished(training());
    assert_eq!((whole.epoch(), whole.ending()), (4, Some(Ending::LastEpoch)));
    for epochs in 0..4 {
        let mut first = training();
        for _ in 0..epochs {
            first.step();
        }
        let second = training().taken_up(&first.save()).unwrap();
        assert_eq!(second.epoch(), epochs);
        assert!(finished(second).save() == whole.save());
    }
}

#[test]
fn the_bytes_do_not_depend_on_the_number_of_threads() {
    for recipe in [IN_BATCH, PAPER] {
        check_threads(|| training(recipe));
    }
}

#[test]
fn a_training_that_was_interrupted_ends_as_one_that_was_not() {
    for recipe in [IN_BATCH, PAPER] {
        check_interruption(|| training(recipe));
    }
}

#[test]
fn another_seed_is_another_training() {
    let loss = |seed: &str| {
        let configuration = Configuration::from_toml(&format!("seed = {seed}\n{SMALL}{IN_BATCH}")).unwrap();
        Training::new(&configuration, bars())
            .unwrap()
            .step()
            .unwrap()
            .loss
    };
    assert_ne!(loss("1"), loss("2"));
    assert_eq!(loss("2"), loss("2"));
}

#[test]
pub(super) fn bars_are_told_apart() {
    let text = "[recipe.in-batch]\nbatch = 40\nepochs = 100\npatience = 100\ncrop = [0.9, 1.0]";
    let configuration = Configuration::from_toml(&format!("held_out = 0.3\n{SMALL}{text}")).unwrap();
    let mut training = Training::new(&configuration, bars()).unwrap();
    let first = training.step().unwrap();
    let last = std::iter::from_fn(|| training.step()).last().unwrap();
    assert_eq!((last.epoch, training.ending()), (100, Some(Ending::LastEpoch)));
    assert!(first.quality.triplet_accuracy < 0.8, "{first:?}");
    assert!(last.quality.triplet_accuracy > 0.9, "{last:?}");
    assert!(last.learning_rate < first.learning_rate / 50.0);
}

#[test]
fn an_embedder_has_mean_zero_and_spread_one() {
    let training = finished(training(IN_BATCH));
    let embedder = training.embedder();
    let plain = embedder.embed(training.held_out.plain());
    let quality = Quality::of(&[], &[], &plain, 3);
    assert!((quality.spread - 1.0).abs() < 1e-5);
    assert!(Moments::of(&plain, 3).mean.iter().all(|mean| mean.abs() < 1e-6));
    let before = training.quality();
    assert!((quality.rank - before.rank).abs() < 1e-4);
}

#[test]
fn the_untrained_recipe_publishes_the_first_weights() {
    let configuration = Configuration::from_toml(&format!("recipe = \"untrained\"\n{SMALL}")).unwrap();
    let mut training = Training::new(&configuration, bars()).unwrap();
    assert_eq!(
        (training.ending(), training.epoch()),
        (Some(Ending::LastEpoch), 0)
    );
    assert_eq!(training.step(), None);
    let quality = training.quality();
    assert!((0.0..=1.0).contains(&quality.triplet_accuracy) && quality.spread > 0.0 && quality.rank >= 1.0);
    let architecture = configuration.architecture(grey(12)).unwrap();
    let first =
        Network::<f32>::initialise(architecture, configuration.seed()).embed(training.held_out.plain());
    let published = training.embedder().embed(training.held_out.plain());
    let mean = Moments::of(&first, 3).mean;
    for (first, published) in first.chunks_exact(3).zip(published.chunks_exact(3)) {
        for ((first, published), mean) in first.iter().zip(published).zip(&mean) {
            let scaled = (f64::from(*first) - mean) / quality.spread;
            assert!(
                (scaled - f64::from(*published)).abs() < 1e-4,
                "{scaled} is not {published}"
            );
        }
    }
}

#[test]
fn training_stops_when_held_out_triplets_get_no_better() {
    let text = "[recipe.in-batch]\nbatch = 54\nepochs = 1000\npatience = 3\nlearning_rate = 1e-9";
    let training = finished(training(text));
    assert_eq!(training.ending(), Some(Ending::NoBetter));
    assert_eq!(training.epoch(), training.state.best.epoch + 3);
}

#[test]
fn the_papers_training_stops_at_a_low_loss_or_when_it_diverges() {
    let low = finished(training(
        "[recipe.paper]\nbatch = 10\nsteps = 1\nenough = 1e9\nenough_over = 2",
    ));
    assert_eq!((low.ending(), low.epoch()), (Some(Ending::LowLoss), 2));
    let mut wild = training("[recipe.paper]\nbatch = 10\nsteps = 1");
    wild.state.network.parameters_mut()[0] = f32::NAN;
    let wild = finished(wild);
    assert_eq!(wild.ending(), Some(Ending::Diverged));
    assert!(
        wild.embedder()
            .parameters()
            .iter()
            .all(|weight| weight.is_finite())
    );
}

#[test]
fn what_was_saved_of_another_training_is_refused() {
    let refusal = |text: &str, saved: &[u8]| {
        let taken_up = training(text).taken_up(saved);
        taken_up.unwrap_err().to_string()
    };
    let saved = training(IN_BATCH).save();
    assert!(refusal(PAPER, &saved).contains("another configuration"));
    assert!(refusal(IN_BATCH, &saved[1..]).contains("not a saved training"));
    assert!(refusal(IN_BATCH, &saved[..saved.len() / 2]).contains("not a saved training"));
    let mut flipped = saved.clone();
    let middle = flipped.len() / 2;
    flipped[middle] ^= 1;
    assert!(refusal(IN_BATCH, &flipped).contains("bytes have changed"));
    let other = Pictures::new(grey(12), 1, vec![3; 144 * 8]).unwrap();
    let error = Training::new(&configuration(IN_BATCH), Arc::new(other.clone())).unwrap_err();
    assert!(matches!(error, TrainingError::NoFeatures("in-batch")), "{error}");
    let other = Arc::new(other.with_features(vec![[0.0; 5]; 8]).unwrap());
    let other = Training::new(&configuration(IN_BATCH), other).unwrap();
    let error = other.taken_up(&saved).unwrap_err();
    assert!(matches!(error, TrainingError::Other("set of pictures")));
}

#[test]
fn a_network_must_fit_the_pictures() {
    let paper = Configuration::from_toml("[network]\nname = \"paper\"").unwrap();
    let tiny = Arc::new(Pictures::new(grey(5), 1, vec![0; 250]).unwrap());
    let error = Training::new(&paper, tiny).unwrap_err().to_string();
    assert!(
        error.contains("pictures of 5 x 5: layer 4: kernel = 3"),
        "{error}"
    );
}
