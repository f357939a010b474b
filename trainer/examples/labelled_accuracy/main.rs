//! Pretrains without labels, fine-tunes on labels, and says how accurate the embedding is on other labels.
//!
//!     cargo run --release -p murmuration-trainer --example labelled_accuracy -- \
//!         --labelled LABELLED/two_sensor --model two-sensor --seeds 1 2 3 --labels 0 100 1000
//!
//! Prints triplet accuracies in percent, anchors not random / of every class: on validation.csv, or by
//! cross-validation within train.csv. Simulated pictures and pretrained networks are kept in the folder for temporary
//! files.

mod behaviours;

use behaviours::{Behaviours, Pretraining};
use clap::Parser;
use murmuration_proto::{CapabilityModel, Purpose, Stream, training::Configuration};
use murmuration_trainer::{
    labelled_pictures::LabelledPictures,
    network::Network,
    pictures::Pictures,
    training::{FineTuning, Training},
};
use rayon::prelude::*;
use std::{path::PathBuf, sync::Arc, time::Instant};

/// Index of the stream that orders the labels: 0 is a training's own.
const ORDER: u64 = 7;

type Error = Box<dyn std::error::Error + Send + Sync>;

/// Training on labels, judged by other labels
#[derive(Debug, Parser)]
struct Arguments {
    /// Folder with train.csv, validation.csv and images/ID.png
    #[arg(long)]
    labelled: PathBuf,
    /// The robots' capability model
    #[arg(long, default_value = "single-sensor")]
    model: CapabilityModel,
    /// Seeds; pictures, pretraining, fine-tuning and which labels are drawn depend on them
    #[arg(long, num_args = 1.., default_values_t = [1])]
    seeds: Vec<u64>,
    /// Configuration of the pretraining, TOML
    #[arg(long, default_value = "")]
    pretraining: String,
    /// Configurations of the fine-tuning, TOML
    #[arg(long, num_args = 1.., default_value = "recipe = { labelled = {} }")]
    fine_tuning: Vec<String>,
    /// Numbers of labels, drawn from train.csv (at most all of them)
    #[arg(long, num_args = 1.., default_values_t = [100_000])]
    labels: Vec<usize>,
    /// Cross-validate within train.csv by so many folds (0: judge on validation.csv)
    #[arg(long, default_value_t = 0)]
    folds: usize,
}

/// What is learned from, and what judges.
struct Case {
    seed: u64,
    parent: Network,
    pictures: Arc<Pictures>,
    train: Vec<usize>,
    judge: Vec<usize>,
}

fn main() -> Result<(), Error> {
    let arguments = Arguments::parse();
    let train = Behaviours::read(&arguments.labelled, "train")?;
    let validation = Behaviours::read(&arguments.labelled, "validation")?;
    let known = validation.known_to(&train.seen());
    if known > 0 {
        return Err(format!("{known} pictures of validation.csv are in train.csv too").into());
    }
    let judge = if arguments.folds == 0 { &validation } else { &train };
    let cases: Result<Vec<_>, _> = arguments
        .seeds
        .iter()
        .map(|&seed| cases(&arguments, &train, judge, seed))
        .collect();
    let cases: Vec<Case> = cases?.into_iter().flatten().collect();
    for configuration in &arguments.fine_tuning {
        for &labels in &arguments.labels {
            let begun = Instant::now();
            let accuracies: Result<Vec<[f64; 2]>, Error> = cases
                .par_iter()
                .map(|case| {
                    let embedder = fine_tuned(case, &train, labels, configuration)?;
                    Ok(judge.accuracy(&embedder, &case.judge))
                })
                .collect();
            let accuracies = accuracies?;
            let seconds = begun.elapsed().as_secs_f64() / cases.len() as f64;
            println!(
                "{} {labels:4} labels, {seconds:5.1} s each: {} | {configuration}",
                arguments.model,
                summary(&accuracies),
            );
        }
    }
    Ok(())
}

fn cases(
    arguments: &Arguments,
    train: &Behaviours,
    judge: &Behaviours,
    seed: u64,
) -> Result<Vec<Case>, Error> {
    let pretraining = Pretraining {
        model: arguments.model,
        seed,
        configuration: Configuration::from_toml(&format!("seed = {seed}\n{}", arguments.pretraining))?,
    };
    let pictures = Arc::new(pretraining.pictures()?);
    let parent = pretraining.network(&pictures)?;
    let mut stream = Stream::derive(seed, Purpose::HeldOut, ORDER);
    let mut order: Vec<usize> = (0..train.count()).collect();
    for i in (1..order.len()).rev() {
        order.swap(i, stream.below(i as u64 + 1) as usize);
    }
    let case = |train: Vec<usize>, judge: Vec<usize>| Case {
        seed,
        parent: parent.clone(),
        pictures: Arc::clone(&pictures),
        train,
        judge,
    };
    let folds = arguments.folds;
    Ok(match folds {
        0 => vec![case(order, (0..judge.count()).collect())],
        _ => (0..folds)
            .map(|fold| {
                let (judge, train) = (0..order.len()).partition::<Vec<_>, _>(|i| i % folds == fold);
                let of = |places: Vec<usize>| places.into_iter().map(|place| order[place]).collect();
                case(of(train), of(judge))
            })
            .collect(),
    })
}

fn fine_tuned(case: &Case, train: &Behaviours, labels: usize, configuration: &str) -> Result<Network, Error> {
    if labels == 0 {
        return Ok(case.parent.clone());
    }
    let drawn = &case.train[..labels.min(case.train.len())];
    let (bytes, classes) = train.labelled(drawn);
    let fine_tuning = FineTuning {
        parent: case.parent.clone(),
        labelled: Arc::new(LabelledPictures::new(50, bytes, classes)?),
    };
    let configuration = Configuration::from_toml(&format!("seed = {}\n{configuration}", case.seed))?;
    let mut training = Training::fine_tune(&configuration, Arc::clone(&case.pictures), fine_tuning)?;
    while training.step().is_some() {}
    Ok(training.embedder())
}

/// Mean and standard deviation of both accuracies, then each of them.
fn summary(accuracies: &[[f64; 2]]) -> String {
    let count = accuracies.len() as f64;
    let parts = [0, 1].map(|which| {
        let mean = accuracies.iter().map(|both| both[which]).sum::<f64>() / count;
        let squares = accuracies.iter().map(|both| (both[which] - mean).powi(2));
        let deviation = (squares.sum::<f64>() / (count - 1.0).max(1.0)).sqrt();
        format!("{mean:.2} ± {deviation:.2}")
    });
    parts.join(" / ")
}
