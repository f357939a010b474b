//! `accuracy`: how well an embedding agrees with classes that people gave.

use super::{CliError, json};
use crate::accuracy::{Accuracy, Labels, LabelsError, Tally};
use murmuration_embed::{EmbedError, Embedder, Runtime, RuntimeError};
use murmuration_proto::onnx::EmbedderModel;
use serde_json::{Map, Value, json};
use std::{
    fs,
    path::{Path, PathBuf},
};

/// Arguments of `accuracy`.
#[derive(Debug, clap::Args)]
#[command(
    group = clap::ArgGroup::new("embedding").required(true),
    after_help = "\
Of all triplets of behaviours (a, p, n) with a and p of one class and n of another: how often is a nearer to p than to n?
Counted with anchors a of every class, and with anchors of every class but `random`.

Examples:
  murmuration accuracy --labels single_sensor/validation.csv --features
  murmuration accuracy --labels two_sensor/validation.csv --labels rare/validation.csv --checkpoint embedder.onnx"
)]
pub(super) struct AccuracyCommand {
    /// Labelled behaviours (columns id and class, rows without a class are skipped); repeat it to join sets
    #[arg(long, required = true, value_name = "CSV")]
    labels: Vec<PathBuf>,
    /// Folder of the images ID.png, one for each --labels [default: `images` beside the CSV]
    #[arg(long, value_name = "DIR", conflicts_with = "features")]
    images: Vec<PathBuf>,
    /// Compare embeddings by this ONNX model
    #[arg(long, value_name = "FILE", group = "embedding")]
    checkpoint: Option<PathBuf>,
    /// Compare absolute values of the five hand-crafted features, which are columns of the CSV
    #[arg(long, group = "embedding")]
    features: bool,
}

impl AccuracyCommand {
    pub(super) fn execute(self, as_json: bool) -> Result<(), CliError> {
        let sets = self
            .labels
            .iter()
            .map(Labels::read)
            .collect::<Result<Vec<_>, _>>()?;
        let (embedding, vectors) = match &self.checkpoint {
            None => ("features".to_owned(), features(&sets)?),
            Some(path) => {
                let (digest, embedder) = checkpoint(path)?;
                (digest, embeddings(&sets, &self.image_folders()?, embedder)?)
            }
        };
        let classes = sets.iter().flat_map(Labels::classes);
        let behaviours: Vec<(&str, Vec<f64>)> = classes.zip(vectors).collect();
        let accuracy = Accuracy::measure(&behaviours);
        if as_json {
            json::print(&self.to_json(&embedding, behaviours.len(), &accuracy));
        } else {
            print_table(behaviours.len(), &accuracy);
        }
        Ok(())
    }

    /// A folder for each set.
    fn image_folders(&self) -> Result<Vec<PathBuf>, CliError> {
        if self.images.is_empty() {
            return Ok(self
                .labels
                .iter()
                .map(|labels| labels.with_file_name("images"))
                .collect());
        }
        if self.images.len() != self.labels.len() {
            return Err(CliError::Input(format!(
                "{} --images for {} --labels: give one for each, in the same order",
                self.images.len(),
                self.labels.len()
            )));
        }
        Ok(self.images.clone())
    }

    fn to_json(&self, embedding: &str, behaviours: usize, accuracy: &Accuracy) -> Value {
        let classes: Map<String, Value> = accuracy
            .classes()
            .map(|(class, tally)| (class.to_owned(), tally_json(tally)))
            .collect();
        json!({
            "schema": 1,
            "labels": self.labels.iter().map(|labels| labels.display().to_string()).collect::<Vec<_>>(),
            "embedding": embedding,
            "behaviours": behaviours,
            "anchor_not_random": tally_json(accuracy.anchor_not_random()),
            "every_anchor": tally_json(accuracy.every_anchor()),
            "by_class_of_anchor": classes,
        })
    }
}

fn features(sets: &[Labels]) -> Result<Vec<Vec<f64>>, CliError> {
    let mut vectors = Vec::new();
    for set in sets {
        vectors.extend(
            set.absolute_features()?
                .into_iter()
                .map(|features| features.to_vec()),
        );
    }
    Ok(vectors)
}

/// The digest of a checkpoint's file, and an embedder of it.
fn checkpoint(path: &Path) -> Result<(String, Embedder), CliError> {
    let file = fs::read(path).map_err(|error| CliError::unreadable(path, &error))?;
    let model = EmbedderModel::read(&file)
        .map_err(|error| CliError::Input(format!("{}: {error}", path.display())))?;
    let embedder = Embedder::open(&Runtime::load()?, model)?;
    Ok((blake3::hash(&file).to_string(), embedder))
}

fn embeddings(
    sets: &[Labels],
    folders: &[PathBuf],
    mut embedder: Embedder,
) -> Result<Vec<Vec<f64>>, CliError> {
    let mut vectors = Vec::new();
    for (set, folder) in sets.iter().zip(folders) {
        let images = set.images(folder, embedder.model().height(), embedder.model().width())?;
        let images: Vec<&[u8]> = images.iter().map(Vec::as_slice).collect();
        let exactly = |embedding: Vec<f32>| embedding.into_iter().map(f64::from).collect();
        vectors.extend(embedder.embed(&images)?.into_iter().map(exactly));
    }
    Ok(vectors)
}

fn tally_json(tally: Tally) -> Value {
    json!({ "correct": tally.correct, "triplets": tally.triplets, "percent": tally.percent() })
}

fn print_table(behaviours: usize, accuracy: &Accuracy) {
    println!(
        "{:<24}{:>14}{:>14}{:>12}",
        "ANCHORS", "TRIPLETS", "CORRECT", "ACCURACY"
    );
    let totals = [
        ("all but random", accuracy.anchor_not_random()),
        ("all", accuracy.every_anchor()),
    ];
    for (anchors, Tally { correct, triplets }) in totals.into_iter().chain(accuracy.classes()) {
        let percent = Tally { correct, triplets }.percent();
        let percent = percent.map_or("-".to_owned(), |percent| format!("{percent:.2} %"));
        println!("{anchors:<24}{triplets:>14}{correct:>14}{percent:>12}");
    }
    eprintln!("{behaviours} labelled behaviours");
}

impl From<LabelsError> for CliError {
    fn from(error: LabelsError) -> Self {
        Self::Input(error.to_string())
    }
}

impl From<RuntimeError> for CliError {
    fn from(error: RuntimeError) -> Self {
        Self::Failed(error.to_string())
    }
}

impl From<EmbedError> for CliError {
    fn from(error: EmbedError) -> Self {
        Self::Failed(error.to_string())
    }
}
