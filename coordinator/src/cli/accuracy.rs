//! `accuracy`: how well an embedding agrees with classes that people gave.

use super::{
    CliError, Global, checkpoints,
    connection::{self, Connection},
    files::{is_there, read, synthetic, tell_counted},
    json,
};
use crate::local::InProcess;
use murmuration_accuracy::{Accuracy, Labels, Summary, Tally};
use murmuration_embed::{EmbedError, Embedder, Runtime, RuntimeError};
use murmuration_link::{InputKind, OutputError, outln};
use murmuration_proto::{
    CheckpointDigest, ImageFormat, SeenPictures, counted, onnx::EmbedderModel, training::Architecture, v1,
};
use murmuration_trainer::network::Network;
use serde_json::{Map, Value, json};
use std::{num::NonZeroU32, path::Path, path::PathBuf};

/// Length of an untrained network's embeddings, as many as there are features.
const DIMENSIONS: usize = 5;

/// Arguments of `accuracy`.
#[derive(Debug, clap::Args)]
#[command(
    group = clap::ArgGroup::new("embedding").required(true),
    after_help = "\
Of all triplets of behaviours (a, p, n) with a and p of one class and n of another: how often is a nearer to p than to n? \
Counted with anchors a of every class, and with anchors of every class but `random`.

A file has columns id and class; with --features the five features too; to have pictures simulated again seed, v1, ... as \
well. Rows without a class, `not sure` and `skip` are passed over (docs/labels.md). What the synthetic annotator answered \
is left out: it is no person.

Examples:
  murmuration labels latest --csv labels.csv && murmuration accuracy --labels labels.csv --features
  murmuration accuracy --labels single_sensor/validation.csv --features
  murmuration accuracy --labels two_sensor/validation.csv --labels rare/validation.csv --checkpoint 1f0c
  murmuration accuracy --labels two_sensor/validation.csv --untrained 30 --network paper"
)]
pub(super) struct AccuracyCommand {
    /// Labelled behaviours, such as `murmuration labels --csv` writes; repeat it to join sets
    #[arg(long, required = true, value_name = "CSV")]
    labels: Vec<PathBuf>,
    /// Folder of the images ID.png, one for each --labels [default: `images` beside the CSV, or simulated again]
    #[arg(long, value_name = "DIR", conflicts_with = "features")]
    images: Vec<PathBuf>,
    /// Compare embeddings by this ONNX file, or by the checkpoint of this digest (or enough of its beginning)
    #[arg(long, value_name = "FILE|DIGEST", group = "embedding")]
    checkpoint: Option<String>,
    /// Compare absolute values of the five hand-crafted features, which are columns of the CSV
    #[arg(long, group = "embedding")]
    features: bool,
    /// Compare embeddings by this many networks as they are initialised, with seeds from 1: mean and deviation
    #[arg(long, value_name = "N", group = "embedding")]
    untrained: Option<NonZeroU32>,
    /// The network that is not trained
    #[arg(long, value_parser = ["compact", "paper"], default_value = "compact", requires = "untrained")]
    network: String,
}

impl AccuracyCommand {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let sets = self
            .labels
            .iter()
            .map(Labels::read)
            .collect::<Result<Vec<_>, _>>()?;
        if let Some(networks) = self.untrained {
            return self.untrained(&sets, networks, global.json);
        }
        let (embedding, vectors) = match &self.checkpoint {
            None => ("features".to_owned(), features(&sets)?),
            Some(named) => {
                let Named {
                    digest,
                    seen,
                    embedder,
                } = checkpoint(named, global).await?;
                (digest, self.embeddings(&sets, embedder, &seen)?)
            }
        };
        let accuracy = measure(&sets, vectors);
        if global.json {
            let mut value = self.to_json(&embedding, &sets);
            value.insert(
                "anchor_not_random".to_owned(),
                tally_json(accuracy.anchor_not_random()),
            );
            value.insert("every_anchor".to_owned(), tally_json(accuracy.every_anchor()));
            let classes = accuracy.classes();
            let classes: Map<String, Value> = classes
                .map(|(class, tally)| (class.to_owned(), tally_json(tally)))
                .collect();
            value.insert("by_class_of_anchor".to_owned(), classes.into());
            json::print(&value.into())?;
        } else {
            print_table(&accuracy)?;
            tell_counted(&sets);
        }
        Ok(())
    }

    /// What networks that nobody trained make of the sets.
    fn untrained(&self, sets: &[Labels], networks: NonZeroU32, as_json: bool) -> Result<(), CliError> {
        let side = ImageFormat::default().resolution() as usize;
        let architecture = Architecture::named(&self.network, side, DIMENSIONS)
            .map_err(|error| CliError::Input(error.to_string()))?;
        let images = self.images(sets, side, side)?.concat();
        let accuracies: Vec<Accuracy> = (1..=networks.get())
            .map(|seed| {
                let network = Network::<f32>::initialise(architecture.clone(), u64::from(seed));
                let embeddings = network.embed(&images);
                let each = embeddings.chunks_exact(DIMENSIONS).map(exactly);
                measure(sets, each.collect())
            })
            .collect();
        let over = |tally: fn(&Accuracy) -> Tally| {
            let percents = accuracies.iter().filter_map(|accuracy| tally(accuracy).percent());
            Summary::of(&percents.collect::<Vec<_>>())
        };
        let [not_random, every] = [over(Accuracy::anchor_not_random), over(Accuracy::every_anchor)];
        if as_json {
            let mut value = self.to_json("untrained", sets);
            value.insert("network".to_owned(), self.network.clone().into());
            value.insert("networks".to_owned(), networks.get().into());
            value.insert("anchor_not_random".to_owned(), summary_json(not_random));
            value.insert("every_anchor".to_owned(), summary_json(every));
            json::print(&value.into())?;
        } else {
            outln!(
                "{:<24}{:>14}{:>14}{:>12}",
                "ANCHORS",
                "NETWORKS",
                "ACCURACY",
                "DEVIATION"
            )?;
            for (anchors, summary) in [("all but random", not_random), ("all", every)] {
                let percent =
                    |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.2} %"));
                let mean = percent(summary.map(|summary| summary.mean));
                let deviation = percent(summary.and_then(|summary| summary.deviation));
                outln!("{anchors:<24}{networks:>14}{mean:>14}{deviation:>12}")?;
            }
            tell_counted(sets);
        }
        Ok(())
    }

    fn embeddings(
        &self,
        sets: &[Labels],
        mut embedder: Embedder,
        seen: &SeenPictures,
    ) -> Result<Vec<Vec<f64>>, CliError> {
        let images = self.images(sets, embedder.model().height(), embedder.model().width())?;
        let images: Vec<&[u8]> = images.iter().map(Vec::as_slice).collect();
        let known = images.iter().filter(|image| seen.has(image)).count();
        if known > 0 {
            return Err(CliError::Input(format!(
                "the checkpoint, or one that it goes on from, was told the classes of {known} of the {}: judge it by others",
                counted(images.len() as u64, "picture")
            )));
        }
        let embeddings = embedder.embed(&images)?;
        Ok(embeddings.iter().map(|embedding| exactly(embedding)).collect())
    }

    /// The grey pixels of every labelled behaviour.
    fn images(&self, sets: &[Labels], height: usize, width: usize) -> Result<Vec<Vec<u8>>, CliError> {
        let mut images = Vec::new();
        for (set, folder) in sets.iter().zip(self.image_folders()?) {
            let simulates = self.images.is_empty() && set.can_be_simulated() && !is_there(&folder)?;
            images.extend(match simulates {
                true => set.simulated_images(height, width)?,
                false => set.images(&folder, height, width)?,
            });
        }
        Ok(images)
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

    /// What every answer says.
    fn to_json(&self, embedding: &str, sets: &[Labels]) -> Map<String, Value> {
        let labels = self.labels.iter().map(|labels| labels.display().to_string());
        Map::from_iter([
            ("schema".to_owned(), json::SCHEMA.into()),
            ("labels".to_owned(), labels.collect::<Vec<_>>().into()),
            ("embedding".to_owned(), embedding.into()),
            ("behaviours".to_owned(), behaviours(sets).into()),
            ("synthetic_left_out".to_owned(), synthetic(sets).into()),
        ])
    }
}

fn behaviours(sets: &[Labels]) -> usize {
    sets.iter().map(|set| set.classes().count()).sum()
}

fn measure(sets: &[Labels], vectors: Vec<Vec<f64>>) -> Accuracy {
    let classes = sets.iter().flat_map(Labels::classes);
    Accuracy::measure(&classes.zip(vectors).collect::<Vec<_>>())
}

fn exactly(embedding: &[f32]) -> Vec<f64> {
    embedding.iter().map(|&value| f64::from(value)).collect()
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

/// A checkpoint that was named.
struct Named {
    digest: String,
    /// The pictures whose classes it was told; of a file nobody knows.
    seen: SeenPictures,
    embedder: Embedder,
}

/// A checkpoint by its file, or else by its digest.
async fn checkpoint(named: &str, global: &Global) -> Result<Named, CliError> {
    let path = Path::new(named);
    let is_digest = named.len() <= 64 && named.bytes().all(|byte| byte.is_ascii_hexdigit());
    let (file, seen) = if is_digest && !is_there(path)? {
        let fetch = async |connection: &mut Connection| fetch(connection, named).await;
        connection::with(global, InProcess::NONE, fetch).await?
    } else {
        let file = read(path, InputKind::Checkpoint)?;
        (file, SeenPictures::default())
    };
    let model = EmbedderModel::read(&file).map_err(|error| CliError::Input(format!("{named}: {error}")))?;
    let embedder = Embedder::open(&Runtime::load()?, model)?;
    Ok(Named {
        digest: CheckpointDigest::of(&file).to_string(),
        seen,
        embedder,
    })
}

/// The bytes of a checkpoint, and what it has seen.
async fn fetch(connection: &mut Connection, named: &str) -> Result<(Vec<u8>, SeenPictures), CliError> {
    let file = checkpoints::fetch(&mut connection.checkpoints, named).await?;
    let request = v1::GetCheckpointRequest {
        digest: CheckpointDigest::of(&file).to_string(),
    };
    let described = connection.checkpoints.get_checkpoint(request).await?.into_inner();
    Ok((file, SeenPictures::from_bytes(&described.labelled)?))
}

fn tally_json(tally: Tally) -> Value {
    json!({ "correct": tally.correct, "triplets": tally.triplets, "percent": tally.percent() })
}

fn summary_json(summary: Option<Summary>) -> Value {
    json!({
        "mean_percent": summary.map(|summary| summary.mean),
        "deviation_percent": summary.and_then(|summary| summary.deviation),
    })
}

fn print_table(accuracy: &Accuracy) -> Result<(), OutputError> {
    outln!(
        "{:<24}{:>14}{:>14}{:>12}",
        "ANCHORS",
        "TRIPLETS",
        "CORRECT",
        "ACCURACY"
    )?;
    let totals = [
        ("all but random", accuracy.anchor_not_random()),
        ("all", accuracy.every_anchor()),
    ];
    for (anchors, Tally { correct, triplets }) in totals.into_iter().chain(accuracy.classes()) {
        let percent = Tally { correct, triplets }.percent();
        let percent = percent.map_or("-".to_owned(), |percent| format!("{percent:.2} %"));
        outln!("{anchors:<24}{triplets:>14}{correct:>14}{percent:>12}")?;
    }
    Ok(())
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
