//! Tests of trainings on labels.

use super::*;
use crate::{
    labelled_pictures::LabelledPictures,
    pictures::tests::grey,
    training::tests::{SMALL, bars, check_interruption, check_threads, configuration, finished},
};
use murmuration_swarm::{Purpose, RandomStream};
use rand::RngExt as _;

const LABELLED: &str =
    "[recipe.labelled]\nper_class = 5\nunlabelled = 10\nenough_labels = 40\nsteps = 3\nepochs = 4\n";
const PAPER: &str = "[recipe.paper-labelled]\nbatch = 100\nsteps = 2\nepochs = 4\nlearning_rate = 0.01\n";

/// Labelled pictures of bars. The class determines the width of a bar; its brightness and place are random.
fn labelled(classes: &[u32]) -> Arc<LabelledPictures> {
    let mut stream = RandomStream::derive(6, Purpose::Train, 0);
    let mut bytes = Vec::new();
    for &class in classes {
        let start = stream.random_range(0..5);
        let (bar, level) = (start..start + 1 + class as usize, stream.random_range(70..250));
        bytes.extend((0..144).map(|i| if bar.contains(&(i % 12)) { level } else { 0 }));
    }
    Arc::new(LabelledPictures::new(grey(12), bytes, classes.to_vec()).unwrap())
}

fn fine_tuning(seed: u64) -> FineTuning {
    let classes: Vec<u32> = (0..40).map(|i| [0, 0, 0, 1, 2, 2, 5][i % 7]).collect();
    FineTuning {
        parent: Network::initialise(configuration("").architecture(grey(12)).unwrap(), seed),
        labelled: labelled(&classes),
    }
}

fn training(text: &str) -> Training {
    Training::fine_tune(&configuration(text), bars(), fine_tuning(1)).unwrap()
}

#[test]
fn the_bytes_do_not_depend_on_the_number_of_threads() {
    for recipe in [LABELLED, PAPER] {
        check_threads(|| training(recipe));
    }
}

#[test]
fn a_training_that_was_interrupted_ends_as_one_that_was_not() {
    for recipe in [LABELLED, PAPER] {
        check_interruption(|| training(recipe));
    }
}

#[test]
fn it_begins_with_the_parent_and_ends_with_the_last_weights() {
    for recipe in [LABELLED, PAPER] {
        let mut training = training(recipe);
        assert_eq!(
            training.network().parameters(),
            fine_tuning(1).parent.parameters()
        );
        while training.step().is_some() {
            assert_eq!(training.state.best.parameters, training.network().parameters());
        }
        assert_eq!(training.state.best.epoch, 4);
    }
}

/// Share of triplets of labelled pictures whose anchor is nearer to the picture of its own class.
fn accuracy(network: &Network, labelled: &LabelledPictures) -> f64 {
    let embedded: Vec<Vec<f32>> = labelled
        .by_class()
        .iter()
        .map(|&picture| network.embed(labelled.picture(picture)))
        .collect();
    let near = |a: usize, b: usize| -> f32 {
        let differences = embedded[a].iter().zip(&embedded[b]);
        differences.map(|(a, b)| (a - b) * (a - b)).sum()
    };
    let (mut correct, mut all) = (0, 0);
    for own in labelled.ranges() {
        for (anchor, positive) in own.clone().flat_map(|a| own.clone().map(move |p| (a, p))) {
            for negative in (0..embedded.len()).filter(|other| anchor != positive && !own.contains(other)) {
                all += 1;
                correct += usize::from(near(anchor, positive) < near(anchor, negative));
            }
        }
    }
    f64::from(correct as u32) / f64::from(all as u32)
}

#[test]
fn labelled_bars_are_told_apart_by_what_the_labels_say() {
    let others = labelled(&[0, 2, 5, 2, 0, 0, 5, 1, 1, 2, 1, 5]);
    let before = accuracy(&fine_tuning(1).parent, &others);
    let recipe = "[recipe.labelled]\nper_class = 8\nunlabelled = 10\nenough_labels = 40\nepochs = 30\nlearning_rate = 0.01";
    let after = accuracy(&finished(training(recipe)).embedder(), &others);
    assert!(before < 0.7 && after > 0.9, "{before}, then {after}");
}

#[test]
fn a_class_of_one_picture_and_more_classes_than_a_step_takes_are_learned_from() {
    for recipe in [LABELLED, "[recipe.labelled]\nclasses = 2\nepochs = 2", PAPER] {
        let few = FineTuning {
            labelled: labelled(&[0, 1, 2, 3]),
            ..fine_tuning(1)
        };
        let mut training = Training::fine_tune(&configuration(recipe), bars(), few).unwrap();
        let progress = training.step().unwrap();
        assert!(progress.loss > 0.0 && progress.loss.is_finite(), "{progress:?}");
    }
}

#[test]
fn what_does_not_go_together_is_refused() {
    let refusal = |text: &str, fine_tuning| {
        let training = Training::fine_tune(&configuration(text), bars(), fine_tuning);
        training.unwrap_err().to_string()
    };
    let in_batch = refusal("[recipe.in-batch]", fine_tuning(1));
    assert!(in_batch.contains("\"in-batch\" takes no labels"), "{in_batch}");
    let error = Training::new(&configuration(LABELLED), bars()).unwrap_err();
    assert!(matches!(error, TrainingError::NoLabels("labelled")));
    let large = FineTuning {
        labelled: Arc::new(LabelledPictures::new(grey(13), vec![0; 338], vec![0, 1]).unwrap()),
        ..fine_tuning(1)
    };
    assert!(refusal(LABELLED, large).contains("of 13 x 13, unlabelled ones of 12 x 12"));
    let compact = Configuration::from_toml(LABELLED).unwrap();
    let error = Training::fine_tune(&compact, bars(), fine_tuning(1)).unwrap_err();
    assert!(matches!(error, TrainingError::OtherParent), "{error}");
}

#[test]
fn what_was_saved_of_another_training_is_refused() {
    let saved = training(LABELLED).save();
    let refusal = |fine_tuning| {
        let other = Training::fine_tune(&configuration(LABELLED), bars(), fine_tuning).unwrap();
        other.taken_up(&saved).unwrap_err().to_string()
    };
    assert!(refusal(fine_tuning(2)).contains("another parent"));
    let other = FineTuning {
        labelled: labelled(&[0, 1, 1, 0]),
        ..fine_tuning(1)
    };
    assert!(refusal(other).contains("another set of labels"));
    let unlabelled = Configuration::from_toml(&format!("{SMALL}[recipe.in-batch]")).unwrap();
    let unlabelled = Training::new(&unlabelled, bars()).unwrap();
    let error = unlabelled.taken_up(&saved).unwrap_err();
    assert!(matches!(error, TrainingError::Other("configuration")));
}
