//! Publishes a finished training, after a test of its checkpoint on ONNX Runtime.

use murmuration_embed::{EmbedError, Embedder, Runtime};
use murmuration_onnx::{EmbedderModel, ModelError};
use murmuration_proto::v1;
use murmuration_swarm::{CheckpointDigest, Lineage, training::Configuration};
use murmuration_train::{
    network::Network,
    onnx,
    pictures::Pictures,
    quality::Quality,
    training::{FineTuned, Training},
};
use std::collections::BTreeMap;

/// Number of pictures that both the network and ONNX Runtime embed.
const COMPARED: usize = 256;
/// Maximum difference, caused by rounding, between a number of the network's embedding and the same number of ONNX Runtime's.
/// Embeddings have spread 1. If the sums in the last layer are larger than the embeddings, the limit is proportional to these
/// sums. Embeddings of an untrained network, or of a network trained with the paper's learning rate, can lie close together and
/// far from 0. The last digits of such embeddings are all rounding.
const MOST_DIFFERENCE: f32 = 1e-5;
/// Upper bound of the limit, when the limit is proportional to the sums in the last layer.
const MOST_SCALED_DIFFERENCE: f32 = 1e-2;
/// Spread below which an embedding counts as collapsed: scaling it to 1 would make rounding errors large.
const LEAST_SPREAD: f64 = 1e-6;

/// A checkpoint ready to be published.
#[derive(Debug)]
pub(crate) struct Publication {
    bytes: Vec<u8>,
    lineage: Lineage,
}

/// Why the result of a training cannot be published.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Unpublishable {
    #[error(
        "the embedding collapsed: held-out pictures have spread {0:.1e}, so the network does not distinguish \
         pictures. Lower the recipe's learning_rate, or raise its margin"
    )]
    Collapsed(f64),
    #[error("the exported network cannot be read: {0}")]
    Model(#[from] ModelError),
    #[error("the exported network cannot be run: {0}")]
    Embed(#[from] EmbedError),
    #[error(
        "the exported network differs from the trained one: embeddings, scaled from spread {spread:.1e} to 1, by up to \
         {difference:.1e}; at most {allowed:.1e} is allowed"
    )]
    Differs {
        difference: f32,
        allowed: f32,
        spread: f64,
    },
}

impl Publication {
    /// The embedder after the last epoch of a training on `pictures` with `configuration`.
    pub(crate) fn of(
        training: &Training,
        configuration: &Configuration,
        pictures: &Pictures,
        runtime: &Runtime,
    ) -> Result<Self, Unpublishable> {
        let quality = training.quality();
        if !quality.spread.is_finite() || quality.spread < LEAST_SPREAD {
            return Err(Unpublishable::Collapsed(quality.spread));
        }
        let network = training.embedder();
        let bytes = onnx::export(&network);
        let mut embedder = Embedder::open(runtime, EmbedderModel::read(&bytes)?)?;
        let difference = difference(&network, &mut embedder, pictures)?;
        let allowed = allowed_difference(&network);
        // `difference > allowed` alone would be false for NaN, which must count as a difference.
        if !matches!(difference, 0.0..) || difference > allowed {
            return Err(Unpublishable::Differs {
                difference,
                allowed,
                spread: quality.spread,
            });
        }
        let Quality {
            triplet_accuracy,
            spread,
            rank,
        } = quality;
        let metrics = [
            ("triplet_accuracy", triplet_accuracy),
            ("spread", spread),
            ("rank", rank),
            ("epochs", training.epoch() as f64),
            ("behaviours", pictures.behaviours() as f64),
            ("views", pictures.views() as f64),
            ("weights", network.parameters().len() as f64),
            ("onnx_difference", f64::from(difference)),
        ];
        let mut metrics: BTreeMap<_, _> = metrics.map(|(name, value)| (name.to_owned(), value)).into();
        let mut lineage = Lineage {
            data_digest: pictures.digest(),
            configuration: configuration.to_toml(),
            ..Lineage::default()
        };
        if let Some(FineTuned { labelled, parent }) = training.fine_tuned() {
            lineage.parent = Some(*parent);
            lineage.label_digest = labelled.digest();
            lineage.labelled = labelled.seen();
            metrics.insert("labels".to_owned(), labelled.labels() as f64);
            metrics.insert("labelled_pictures".to_owned(), labelled.count() as f64);
            metrics.insert("classes".to_owned(), labelled.class_count() as f64);
        }
        Ok(Self {
            bytes,
            lineage: Lineage { metrics, ..lineage },
        })
    }

    pub(crate) fn digest(&self) -> CheckpointDigest {
        CheckpointDigest::of(&self.bytes)
    }

    pub(crate) fn requests(&self) -> Vec<v1::PublishCheckpointRequest> {
        self.lineage.publish_requests(&self.bytes)
    }
}

/// The allowed difference is proportional to the biases of the last layer, which are the network's last parameters. Sums that are
/// larger than the embeddings are as large as these biases.
fn allowed_difference(network: &Network) -> f32 {
    let biases = network.parameters().len() - network.architecture().dimensions();
    let largest = network.parameters()[biases..]
        .iter()
        .fold(1.0, |most: f32, bias| most.max(bias.abs()));
    (MOST_DIFFERENCE * largest).min(MOST_SCALED_DIFFERENCE)
}

/// The largest difference between the embeddings by `network` and by `embedder`, over evenly chosen pictures.
fn difference(network: &Network, embedder: &mut Embedder, pictures: &Pictures) -> Result<f32, Unpublishable> {
    let count = pictures.behaviours().min(COMPARED);
    let compared = (0..count).map(|i| i * pictures.behaviours() / count);
    let images: Vec<&[u8]> = compared
        .map(|behaviour| pictures.picture(behaviour, behaviour % pictures.views()))
        .collect();
    let ours = network.embed(&images.concat());
    let theirs = embedder.embed(&images)?.concat();
    let differences = ours.iter().zip(&theirs).map(|(a, b)| (a - b).abs());
    // `f32::max` would ignore NaN.
    let larger = |most: f32, difference: f32| match difference > most || difference.is_nan() {
        true => difference,
        false => most,
    };
    Ok(differences.fold(0.0, larger))
}

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_swarm::{PictureShape, Purpose, RandomStream};
    use rand::RngExt as _;
    use std::sync::Arc;

    /// Pictures of bars in one of two channels; neighbouring behaviours differ only in the channel.
    fn bars(shape: PictureShape) -> Pictures {
        let mut stream = RandomStream::derive(5, Purpose::Train, 0);
        let mut bytes = Vec::new();
        for behaviour in 0..60 {
            let start = stream.random_range(0..5);
            let bar = start..start + 1 + behaviour / 2 % 6;
            let lit =
                move |i: usize| i / shape.pixels() == behaviour % 2 && bar.contains(&(i % shape.side()));
            bytes.extend((0..shape.bytes()).map(|i| if lit(i) { 70 + 3 * behaviour as u8 } else { 0 }));
        }
        Pictures::new(shape, 1, bytes).unwrap()
    }

    #[test]
    fn a_network_of_two_channels_is_published_and_read_back() {
        let shape = PictureShape::new(2, 12).unwrap();
        let pictures = Arc::new(bars(shape));
        for network in ["name = \"compact\"", "layers = [{ dense = { units = 3 } }]"] {
            let text = format!(
                "[network]\n{network}\n[recipe.in-batch]\nbatch = 20\nepochs = 3\nlearning_rate = 0.001\nflattening = 0"
            );
            let configuration = Configuration::from_toml(&text).unwrap();
            let mut training = Training::new(&configuration, Arc::clone(&pictures)).unwrap();
            while training.step().is_some() {}
            let runtime = Runtime::load().unwrap();
            let publication = Publication::of(&training, &configuration, &pictures, &runtime).unwrap();
            let model = EmbedderModel::read(&publication.bytes).unwrap();
            assert_eq!(model.images(), shape.into(), "{network}");
            let read = |shape| {
                let architecture = configuration.architecture(shape).unwrap();
                onnx::import(&publication.bytes, architecture)
            };
            let imported = read(shape).unwrap();
            assert_eq!(
                imported.parameters(),
                training.embedder().parameters(),
                "{network}"
            );
            assert!(read(PictureShape::new(1, 12).unwrap()).is_err(), "{network}");
            // ONNX Runtime receives the channels in the same order as the network.
            let [mut one, mut other] = [vec![0; shape.bytes()], vec![0; shape.bytes()]];
            one[..24].fill(200);
            other[shape.pixels()..][..24].fill(200);
            let mut embedder = Embedder::open(&runtime, model).unwrap();
            let theirs = embedder.embed(&[&one, &other]).unwrap();
            assert_ne!(theirs[0], theirs[1], "{network}");
            let ours = imported.embed(&[one, other].concat());
            for (ours, theirs) in ours.iter().zip(theirs.concat()) {
                assert!((ours - theirs).abs() < 1e-4, "{network}: {ours} {theirs}");
            }
        }
    }
}
