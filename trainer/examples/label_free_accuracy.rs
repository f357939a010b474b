//! Trains without labels on random controllers, and says how accurate the embedding is on labelled behaviours.
//!
//!     cargo run --release -p murmuration-trainer --example label_free_accuracy -- \
//!         --labelled LABELLED/two_sensor --model two-sensor --seeds 1 2 3
//!
//! Prints triplet accuracies in percent, anchors not random / of every class.

use clap::Parser;
use murmuration_proto::{
    CapabilityModel, ControllerSpace, ImageFormat, Purpose, Stream, World, training::Configuration, v1,
};
use murmuration_trainer::{
    accuracy::TripletAccuracy, network::Network, onnx, pictures::Pictures, training::Training,
};
use murmuration_worker::{evaluate::Evaluator, simulate::Start};
use rayon::prelude::*;
use std::{error::Error, fs, io::BufReader, path::Path, path::PathBuf, sync::Arc};

/// Label-free training, judged by labels
#[derive(Debug, Parser)]
struct Arguments {
    /// Folder with train.csv, validation.csv and images/ID.png
    #[arg(long)]
    labelled: PathBuf,
    /// The robots' capability model
    #[arg(long, default_value = "single-sensor")]
    model: CapabilityModel,
    /// Random controllers to train on
    #[arg(long, default_value_t = 10_000)]
    controllers: usize,
    /// Random starts of each, and so pictures
    #[arg(long, default_value_t = 2)]
    starts: usize,
    /// Training configuration, TOML; its seed is replaced
    #[arg(long, default_value = "")]
    configuration: String,
    /// Seeds of the trainings; controllers and starts depend on them too
    #[arg(long, num_args = 1.., default_values_t = [1])]
    seeds: Vec<u64>,
    /// Say how accurate the network is after every so many epochs (0: only the embedder)
    #[arg(long, default_value_t = 0)]
    every: u64,
    /// Write the last embedder here, as ONNX
    #[arg(long)]
    onnx: Option<PathBuf>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments = Arguments::parse();
    let judges = [
        Labelled::read(&arguments.labelled, "validation")?,
        Labelled::read(&arguments.labelled, "train")?,
    ];
    for judge in &judges {
        println!("hand-crafted {}", judge.accuracy(&judge.features, 5));
    }
    for &seed in &arguments.seeds {
        let pictures = Arc::new(simulate(&arguments, seed)?);
        let configuration = format!("seed = {seed}\n{}", arguments.configuration);
        let configuration = Configuration::from_toml(&configuration)?;
        let mut training = Training::new(&configuration, pictures)?;
        let mut seconds = 0.0;
        while let Some(progress) = training.step() {
            seconds += progress.seconds;
            if arguments.every > 0 && progress.epoch % arguments.every == 0 {
                let quality = progress.quality;
                let judged = judges.each_ref().map(|judge| judge.judge(training.network()));
                println!(
                    "seed {seed} epoch {:3} {seconds:6.1} s loss {:.4} rate {:.5} held out {:.4} spread {:.2} rank {:.2} | {}",
                    progress.epoch,
                    progress.loss,
                    progress.learning_rate,
                    quality.triplet_accuracy,
                    quality.spread,
                    quality.rank,
                    judged.join(" | "),
                );
            }
        }
        let judged = judges.each_ref().map(|judge| judge.judge(&training.embedder()));
        let ending = training.ending();
        println!(
            "seed {seed} embedder after {seconds:.0} s ({ending:?}, {:?}): {}",
            training.quality(),
            judged.join(" | ")
        );
        if let Some(file) = &arguments.onnx {
            fs::write(file, onnx::export(&training.embedder()))?;
            write_embeddings(file, &judges[0], &training.embedder())?;
        }
    }
    Ok(())
}

/// Writes the judge's pictures and embeddings beside the model, as raw bytes and little-endian floats.
fn write_embeddings(model: &Path, judge: &Labelled, embedder: &Network) -> Result<(), Box<dyn Error>> {
    fs::write(model.with_extension("pictures"), &judge.pictures)?;
    let embeddings = embedder.embed(&judge.pictures);
    let bytes: Vec<u8> = embeddings.iter().flat_map(|value| value.to_le_bytes()).collect();
    Ok(fs::write(model.with_extension("embeddings"), bytes)?)
}

/// The pictures of random controllers, as a campaign's dataset stage would have them.
fn simulate(arguments: &Arguments, seed: u64) -> Result<Pictures, Box<dyn Error>> {
    let starts: Result<Vec<Vec<u8>>, _> = (0..arguments.starts)
        .map(|start| from_one_start(arguments, seed, start))
        .collect();
    let starts = starts?;
    let mut bytes = Vec::new();
    for picture in 0..arguments.controllers {
        for start in &starts {
            bytes.extend(&start[picture * 2500..][..2500]);
        }
    }
    Ok(Pictures::new(50, arguments.starts, bytes)?)
}

/// One picture of each controller; kept on disk from one experiment to the next.
fn from_one_start(arguments: &Arguments, seed: u64, start: usize) -> Result<Vec<u8>, Box<dyn Error>> {
    let Arguments {
        model, controllers, ..
    } = *arguments;
    let name = format!(
        "murmuration-{}-{controllers}-{seed}-{start}.pictures",
        model.name()
    );
    let kept = std::env::temp_dir().join(name);
    if let Ok(bytes) = fs::read(&kept)
        && bytes.len() == controllers * 2500
    {
        return Ok(bytes);
    }
    let world = World::try_from(v1::World::default())?;
    let format = ImageFormat::default();
    let space = ControllerSpace::for_model(v1::ControllerSpace::default(), model)?;
    let pictures: Result<Vec<Vec<u8>>, _> = (0..controllers)
        .into_par_iter()
        .map(|index| {
            let controller = space.sample(&mut Stream::derive(seed, Purpose::Propose, index as u64));
            let from = Stream::derive(seed, Purpose::Start, (start * controllers + index) as u64).bits();
            let mut evaluator = Evaluator::new(&world, &format)?;
            Ok::<_, murmuration_proto::Invalid>(
                evaluator
                    .evaluate(&controller, &Start::seeded(from))?
                    .into_image(),
            )
        })
        .collect();
    let bytes = pictures?.concat();
    fs::write(kept, &bytes)?;
    Ok(bytes)
}

/// Behaviours whose classes are known.
struct Labelled {
    name: &'static str,
    pictures: Vec<u8>,
    classes: Vec<usize>,
    class_names: Vec<String>,
    /// Absolute values of the five features.
    features: Vec<f64>,
}

impl Labelled {
    fn read(folder: &Path, name: &'static str) -> Result<Self, Box<dyn Error>> {
        let text = fs::read_to_string(folder.join(name).with_extension("csv"))?;
        let mut lines = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
        let header = lines.next().ok_or("an empty file of labels")?;
        let column = |name: &str| {
            header
                .iter()
                .position(|&column| column == name)
                .ok_or("a column is missing")
        };
        let (id, class) = (column("id")?, column("class")?);
        let first_feature = column("average_speed")?;
        let mut labelled = Self {
            name,
            pictures: Vec::new(),
            classes: Vec::new(),
            class_names: Vec::new(),
            features: Vec::new(),
        };
        for line in lines.filter(|line| !line[class].is_empty()) {
            labelled.take_class(line[class]);
            labelled
                .pictures
                .extend(grey(&folder.join(format!("images/{}.png", line[id])))?);
            for value in &line[first_feature..first_feature + 5] {
                labelled.features.push(value.parse::<f64>()?.abs());
            }
        }
        Ok(labelled)
    }

    fn take_class(&mut self, name: &str) {
        let known = self.class_names.iter().position(|known| known == name);
        let class = known.unwrap_or_else(|| {
            self.class_names.push(name.to_owned());
            self.class_names.len() - 1
        });
        self.classes.push(class);
    }

    fn judge(&self, network: &Network) -> String {
        let embeddings: Vec<f64> = network.embed(&self.pictures).into_iter().map(f64::from).collect();
        self.accuracy(&embeddings, network.architecture().dimensions())
    }

    fn accuracy(&self, vectors: &[f64], dimensions: usize) -> String {
        let accuracy = TripletAccuracy::of(vectors, dimensions, &self.classes);
        let percent = |share: Option<f64>| 100.0 * share.unwrap_or(f64::NAN);
        let not_random = percent(accuracy.over(|class| self.class_names[class] != "random"));
        let every = percent(accuracy.over(|_| true));
        format!("{} {not_random:.2} / {every:.2}", self.name)
    }
}

fn grey(file: &Path) -> Result<Vec<u8>, Box<dyn Error>> {
    let mut reader = png::Decoder::new(BufReader::new(fs::File::open(file)?)).read_info()?;
    let mut pixels = vec![0; reader.output_buffer_size().ok_or("a picture too large")?];
    let frame = reader.next_frame(&mut pixels)?;
    match (frame.width, frame.height, frame.color_type) {
        (50, 50, png::ColorType::Grayscale) => Ok(pixels),
        _ => Err(format!("{} is not a grey picture of 50 x 50", file.display()).into()),
    }
}
