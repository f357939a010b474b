//! `accuracy`: how well an embedding agrees with classes that annotators gave.

use crate::json;
use murmuration_accuracy::{Accuracy, LabelledSet, Summary, Tally};
use murmuration_cli::{
    CliError, Global,
    connection::{self, CheckpointClient, Connection},
    fetch_checkpoint,
    files::{is_there, read},
    table::{Table, left, right},
};
use murmuration_coordinator::local::InProcess;
use murmuration_embed::{Embedder, Runtime};
use murmuration_files::InputKind;
use murmuration_link::{OutputError, errln};
use murmuration_onnx::{EmbedderModel, ImageShape};
use murmuration_proto::v1;
use murmuration_swarm::{
    CheckpointDigest, PictureShape, SeenPictures, counted, grouped, training::Architecture,
};
use murmuration_train::network::Network;
use std::{num::NonZeroU32, path::Path, path::PathBuf};

/// Length of an untrained network's embeddings: the number of features.
const DIMENSIONS: usize = 5;

#[derive(Debug, clap::Args)]
#[command(
    group = clap::ArgGroup::new("embedding").required(true),
    after_help = "\
Accuracy is the share of correct triplets. A triplet (a, p, n) has an anchor a and a positive p of one class, and a negative \
n of another class; it is correct if a is nearer to p than to n. Triplets are counted with anchors of every class, and with \
anchors of every class except `random`.

The file needs the columns index (or id) and class. --features also needs the five features; simulating the pictures also needs seed, \
left_0, ... (docs/labels.md). Rows without a class, `not sure`, `skip` and the answers of the synthetic annotator are skipped.

Examples:
  murmuration labels latest --csv labels.csv
  murmuration lab accuracy --labels labels.csv --features
  murmuration lab accuracy --labels single_sensor/validation.csv --features
  murmuration lab accuracy --labels two_sensor/validation.csv --checkpoint 1f0c
  murmuration lab accuracy --labels two_sensor/validation.csv --untrained 30 --network paper"
)]
pub struct AccuracyCommand {
    /// Labelled behaviours, as `murmuration labels --csv` writes them; repeat the option to join sets
    #[arg(long, required = true, value_name = "CSV")]
    labels: Vec<PathBuf>,
    /// Folder of the pictures ID.png, one folder for each --labels [default: `images` beside the CSV, or else simulated pictures,
    /// with starts from the column seed or `starts.csv`]
    #[arg(long, value_name = "DIR", conflicts_with = "features")]
    images: Vec<PathBuf>,
    /// Measure the embeddings of this ONNX file or checkpoint (the first digits of its digest suffice)
    #[arg(long, value_name = "FILE|DIGEST", group = "embedding")]
    checkpoint: Option<String>,
    /// Measure the absolute values of the five hand-crafted features, which are columns of the CSV
    #[arg(long, group = "embedding")]
    features: bool,
    /// Measure the embeddings of N untrained networks with the seeds 1 to N: mean and deviation
    #[arg(long, value_name = "N", group = "embedding")]
    untrained: Option<NonZeroU32>,
    /// Network of --untrained
    #[arg(long, value_parser = ["compact", "paper"], default_value = "compact", requires = "untrained")]
    network: String,
}

impl AccuracyCommand {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let sets = self
            .labels
            .iter()
            .map(LabelledSet::read)
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
        if accuracy.every_anchor().triplets == 0 {
            return Err(CliError::Input(
                "there is no triplet to measure by: it takes two behaviours of one class and one of another"
                    .to_owned(),
            ));
        }
        if global.json {
            let classes = accuracy.classes();
            json::print(json::Accuracy {
                set: document(&self.labels, &sets),
                embedding,
                anchor_not_random: accuracy.anchor_not_random().into(),
                every_anchor: accuracy.every_anchor().into(),
                by_class_of_anchor: classes
                    .map(|(class, tally)| (class.to_owned(), tally.into()))
                    .collect(),
            })?;
        } else {
            print_table(&accuracy)?;
            tell_counted(&sets);
        }
        Ok(())
    }

    /// The accuracy of untrained networks on the sets.
    fn untrained(&self, sets: &[LabelledSet], networks: NonZeroU32, as_json: bool) -> Result<(), CliError> {
        let pictures = PictureShape::PAPER;
        let architecture = Architecture::named(&self.network, pictures, DIMENSIONS)
            .map_err(|error| CliError::Input(error.to_string()))?;
        let images = self.images(sets, pictures.into())?.concat();
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
            json::print(json::UntrainedAccuracy {
                set: document(&self.labels, sets),
                embedding: "untrained".to_owned(),
                network: self.network.clone(),
                networks: networks.get(),
                anchor_not_random: not_random.into(),
                every_anchor: every.into(),
            })?;
        } else {
            print_spread(networks, [("all but random", not_random), ("all", every)])?;
            tell_counted(sets);
        }
        Ok(())
    }

    fn embeddings(
        &self,
        sets: &[LabelledSet],
        mut embedder: Embedder,
        seen: &SeenPictures,
    ) -> Result<Vec<Vec<f64>>, CliError> {
        let images = self.images(sets, embedder.model().images())?;
        embeddings(&mut embedder, &images, seen)
    }

    /// The image of every labelled behaviour.
    fn images(&self, sets: &[LabelledSet], shape: ImageShape) -> Result<Vec<Vec<u8>>, CliError> {
        let mut images = Vec::new();
        for (set, folder) in sets.iter().zip(self.image_folders()?) {
            images.extend(match self.images.is_empty() {
                true => images_beside(set, shape)?,
                false => set.images(&folder, shape)?,
            });
        }
        Ok(images)
    }

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
                "{} --images for {} --labels: give one --images for each --labels, in the same order",
                self.images.len(),
                self.labels.len()
            )));
        }
        Ok(self.images.clone())
    }
}

/// Document about the label files and the behaviours read from them.
pub(crate) fn document(labels: &[PathBuf], sets: &[LabelledSet]) -> json::Set {
    let labels = labels.iter().map(|labels| labels.display().to_string());
    json::Set {
        labels: labels.collect(),
        behaviours: behaviours(sets),
        synthetic_left_out: synthetic(sets),
    }
}

/// The file of starts beside a file of labels.
pub(crate) fn starts_file(labels: &Path) -> PathBuf {
    labels.with_file_name("starts.csv")
}

/// The file of starts beside the label file of a set, if that file exists and the set has no seeds.
pub(crate) fn starts_beside(set: &LabelledSet) -> Result<Option<PathBuf>, CliError> {
    let starts = starts_file(set.path());
    Ok((!set.can_be_simulated() && is_there(&starts)?).then_some(starts))
}

/// The images of a set: from the folder `images` beside the label file, or else simulated. If the label file has no seeds, the
/// simulation uses the starts in `starts.csv` beside the label file.
pub(super) fn images_beside(set: &LabelledSet, shape: ImageShape) -> Result<Vec<Vec<u8>>, CliError> {
    let folder = set.path().with_file_name("images");
    let starts = starts_beside(set)?;
    let simulates = !is_there(&folder)? && (set.can_be_simulated() || starts.is_some());
    Ok(match simulates {
        true => set.simulated_images(shape, starts.as_deref())?,
        false => set.images(&folder, shape)?,
    })
}

/// The embeddings of images. Fails if the embedder has learned the class of one of the images.
pub(super) fn embeddings(
    embedder: &mut Embedder,
    images: &[Vec<u8>],
    seen: &SeenPictures,
) -> Result<Vec<Vec<f64>>, CliError> {
    let images: Vec<&[u8]> = images.iter().map(Vec::as_slice).collect();
    let known = images.iter().filter(|image| seen.has(image)).count();
    if known > 0 {
        return Err(CliError::Input(format!(
            "the checkpoint, or a checkpoint that it was trained from, learned the classes of {known} of the {}: measure it by \
             other behaviours",
            counted(images.len() as u64, "picture")
        )));
    }
    let embeddings = embedder.embed(&images)?;
    Ok(embeddings.iter().map(|embedding| exactly(embedding)).collect())
}

/// The accuracy of the vectors of labelled behaviours.
pub(super) fn measure(sets: &[LabelledSet], vectors: Vec<Vec<f64>>) -> Accuracy {
    let classes = sets.iter().flat_map(LabelledSet::classes);
    Accuracy::measure(&classes.zip(vectors).collect::<Vec<_>>())
}

fn exactly(embedding: &[f32]) -> Vec<f64> {
    embedding.iter().map(|&value| f64::from(value)).collect()
}

/// The absolute features of labelled behaviours.
pub(super) fn features(sets: &[LabelledSet]) -> Result<Vec<Vec<f64>>, CliError> {
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

/// A checkpoint named on the command line.
struct Named {
    digest: String,
    /// The pictures whose classes the checkpoint has learned; none for a file, where they are unknown.
    seen: SeenPictures,
    embedder: Embedder,
}

/// Reads a checkpoint from its file, or else fetches it by its digest.
async fn checkpoint(named: &str, global: &Global) -> Result<Named, CliError> {
    let path = Path::new(named);
    let is_digest = named.len() <= 64 && named.bytes().all(|byte| byte.is_ascii_hexdigit());
    let (file, seen) = if is_digest && !is_there(path)? {
        let fetch = async |connection: &mut Connection| fetch(&mut connection.checkpoints, named).await;
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

/// The bytes of a checkpoint, and the pictures whose classes it has learned.
pub(super) async fn fetch(
    client: &mut CheckpointClient,
    named: &str,
) -> Result<(Vec<u8>, SeenPictures), CliError> {
    let file = fetch_checkpoint(client, named).await?;
    let request = v1::GetCheckpointRequest {
        digest: CheckpointDigest::of(&file).to_string(),
    };
    let described = client.get_checkpoint(request).await?.into_inner();
    Ok((file, SeenPictures::from_bytes(&described.labelled)?))
}

fn print_table(accuracy: &Accuracy) -> Result<(), OutputError> {
    let mut table = Table::new([
        left("ANCHORS"),
        right("TRIPLETS"),
        right("CORRECT"),
        right("ACCURACY"),
    ]);
    let totals = [
        ("all but random", accuracy.anchor_not_random()),
        ("all", accuracy.every_anchor()),
    ];
    for (anchors, tally) in totals.into_iter().chain(accuracy.classes()) {
        table.row([
            anchors.to_owned(),
            grouped(tally.triplets),
            grouped(tally.correct),
            percent(tally.percent()),
        ]);
    }
    table.print()
}

/// Means and deviations over several networks.
fn print_spread(networks: NonZeroU32, rows: [(&str, Option<Summary>); 2]) -> Result<(), OutputError> {
    let mut table = Table::new([
        left("ANCHORS"),
        right("NETWORKS"),
        right("ACCURACY"),
        right("DEVIATION"),
    ]);
    for (anchors, summary) in rows {
        table.row([
            anchors.to_owned(),
            grouped(networks.get().into()),
            percent(summary.map(|summary| summary.mean)),
            percent(summary.and_then(|summary| summary.deviation)),
        ]);
    }
    table.print()
}

fn percent(percent: Option<f64>) -> String {
    percent.map_or_else(|| "-".to_owned(), |percent| format!("{percent:.2} %"))
}

/// Prints the number of labelled behaviours, and the number of ignored rows.
pub(crate) fn tell_counted(sets: &[LabelledSet]) {
    errln!(
        "{} with a class given by an annotator",
        counted(behaviours(sets), "behaviour")
    );
    if let rows @ 1.. = synthetic(sets) {
        errln!(
            "skipped: {} by the synthetic annotator, which is the rule-based judge",
            counted(rows, "answer")
        );
    }
}

/// Number of behaviours with a class from an annotator other than the synthetic one.
fn behaviours(sets: &[LabelledSet]) -> u64 {
    sets.iter().map(|set| set.classes().count() as u64).sum()
}

/// Number of answers of the synthetic annotator, which are ignored.
fn synthetic(sets: &[LabelledSet]) -> u64 {
    sets.iter().map(LabelledSet::synthetic).sum()
}
