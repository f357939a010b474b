//! Behaviours with and without labels, and what is known of them.

use super::Error;
use murmuration_proto::{
    CapabilityModel, Controller, ControllerSpace, ImageFormat, Purpose, SeenPictures, Stream, World,
    training::Configuration, v1,
};
use murmuration_trainer::{network::Network, onnx, pictures::Pictures, training::Training};
use murmuration_worker::{evaluate::Evaluator, simulate::Start};
use rayon::prelude::*;
use std::{env::temp_dir, fs, io::BufReader, path::Path};

const PIXELS: usize = 2500;
const CONTROLLERS: usize = 10_000;
const STARTS: usize = 2;

/// A training without labels, as a campaign would do it.
pub struct Pretraining {
    pub model: CapabilityModel,
    pub seed: u64,
    pub configuration: Configuration,
}

impl Pretraining {
    /// Two pictures of each of ten thousand random controllers.
    pub fn pictures(&self) -> Result<Pictures, Error> {
        let space = ControllerSpace::for_model(v1::ControllerSpace::default(), self.model)?;
        let controllers = (0..CONTROLLERS)
            .map(|index| space.sample(&mut Stream::derive(self.seed, Purpose::Propose, index as u64)));
        let controllers: Vec<Controller> = controllers.collect();
        let starts: Result<Vec<Vec<u8>>, Error> = (0..STARTS)
            .map(|start| {
                let name = format!("{}-{CONTROLLERS}-{}-{start}", self.model.name(), self.seed);
                let kept = temp_dir().join(format!("murmuration-{name}.pictures"));
                if let Ok(bytes) = fs::read(&kept) {
                    return Ok(bytes);
                }
                let bytes = simulate(&controllers, self.seed, start)?;
                fs::write(kept, &bytes)?;
                Ok(bytes)
            })
            .collect();
        let starts = starts?;
        let views =
            (0..CONTROLLERS).flat_map(|i| starts.iter().map(move |start| &start[i * PIXELS..][..PIXELS]));
        Ok(Pictures::new(50, STARTS, views.collect::<Vec<_>>().concat())?)
    }

    /// The embedder that it comes to.
    pub fn network(&self, pictures: &Pictures) -> Result<Network, Error> {
        let key = blake3::hash(format!("{}{}", self.model, self.configuration.to_toml()).as_bytes());
        let kept = temp_dir().join(format!("murmuration-{}.onnx", key.to_hex()));
        if let Ok(file) = fs::read(&kept) {
            return Ok(onnx::import(&file, self.configuration.architecture(50)?)?);
        }
        let mut training = Training::new(&self.configuration, pictures.clone().into())?;
        while training.step().is_some() {}
        let network = training.embedder();
        fs::write(kept, onnx::export(&network))?;
        Ok(network)
    }
}

/// One picture of each controller.
fn simulate(controllers: &[Controller], seed: u64, start: usize) -> Result<Vec<u8>, Error> {
    let world = World::try_from(v1::World::default())?;
    let pictures: Result<Vec<Vec<u8>>, Error> = controllers
        .par_iter()
        .enumerate()
        .map(|(index, controller)| {
            let index = (start * controllers.len() + index) as u64;
            let start = Start::seeded(Stream::derive(seed, Purpose::Start, index).bits());
            let mut evaluator = Evaluator::new(&world, &ImageFormat::default())?;
            Ok(evaluator.evaluate(controller, &start)?.into_image())
        })
        .collect();
    Ok(pictures?.concat())
}

/// Behaviours whose classes are known.
pub struct Behaviours {
    classes: Vec<String>,
    pictures: Vec<Vec<u8>>,
}

impl Behaviours {
    pub fn read(folder: &Path, name: &str) -> Result<Self, Error> {
        let text = fs::read_to_string(folder.join(name).with_extension("csv"))?;
        let mut lines = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
        let header = lines.next().ok_or("an empty file of labels")?;
        let column = |name: &str| {
            let at = header.iter().position(|&column| column == name);
            at.ok_or_else(|| format!("there is no column {name}"))
        };
        let (id, class) = (column("id")?, column("class")?);
        let mut behaviours = Self {
            classes: Vec::new(),
            pictures: Vec::new(),
        };
        for line in lines.filter(|line| !line[class].is_empty()) {
            behaviours.classes.push(line[class].to_owned());
            let picture = grey(&folder.join(format!("images/{}.png", line[id])))?;
            behaviours.pictures.push(picture);
        }
        Ok(behaviours)
    }

    /// All pictures whose classes are known.
    pub fn seen(&self) -> SeenPictures {
        SeenPictures::of(self.pictures.iter().map(Vec::as_slice))
    }

    /// How many of the pictures are among those that something else has seen.
    pub fn known_to(&self, seen: &SeenPictures) -> usize {
        self.pictures.iter().filter(|picture| seen.has(picture)).count()
    }

    pub fn count(&self) -> usize {
        self.classes.len()
    }

    /// Pictures and classes of some behaviours.
    pub fn labelled(&self, which: &[usize]) -> (Vec<u8>, Vec<u32>) {
        let mut names: Vec<&String> = self.classes.iter().collect();
        names.sort();
        names.dedup();
        let pictures = which.iter().map(|&i| self.pictures[i].as_slice());
        let class = |&i: &usize| names.binary_search(&&self.classes[i]).unwrap_or_default() as u32;
        let classes = which.iter().map(class);
        (pictures.collect::<Vec<_>>().concat(), classes.collect())
    }

    /// Correct triplets of some behaviours in percent: anchors not random, and of every class.
    pub fn accuracy(&self, embedder: &Network, which: &[usize]) -> [f64; 2] {
        let pictures: Vec<&[u8]> = which.iter().map(|&i| self.pictures[i].as_slice()).collect();
        let embeddings = embedder.embed(&pictures.concat());
        let embeddings: Vec<&[f32]> = embeddings.chunks(embedder.architecture().dimensions()).collect();
        let squared = |a: usize, b: usize| -> f64 {
            let differences = embeddings[a].iter().zip(embeddings[b]);
            differences
                .map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2))
                .sum()
        };
        let mut tallies = [[0, 0]; 2];
        for anchor in 0..which.len() {
            let class = |other: usize| &self.classes[which[other]];
            let others = (0..which.len()).filter(|&other| other != anchor);
            let (own, negatives) = others.partition::<Vec<_>, _>(|&other| class(other) == class(anchor));
            let mut negatives: Vec<f64> = negatives
                .into_iter()
                .map(|other| squared(anchor, other))
                .collect();
            negatives.sort_by(f64::total_cmp);
            for positive in own.into_iter().map(|other| squared(anchor, other)) {
                let correct = negatives.len() - negatives.partition_point(|&negative| negative <= positive);
                let first = usize::from(class(anchor) == "random");
                for [correct_sum, sum] in &mut tallies[first..] {
                    *correct_sum += correct;
                    *sum += negatives.len();
                }
            }
        }
        tallies.map(|[correct, all]| 100.0 * correct as f64 / all as f64)
    }
}

fn grey(file: &Path) -> Result<Vec<u8>, Error> {
    let mut reader = png::Decoder::new(BufReader::new(fs::File::open(file)?)).read_info()?;
    let mut pixels = vec![0; reader.output_buffer_size().ok_or("a picture too large")?];
    let frame = reader.next_frame(&mut pixels)?;
    match (frame.width, frame.height, frame.color_type) {
        (50, 50, png::ColorType::Grayscale) => Ok(pixels),
        _ => Err(format!("{} is not a grey picture of 50 x 50", file.display()).into()),
    }
}
