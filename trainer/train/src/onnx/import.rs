//! Reads a checkpoint back as a network, to train it further.

use super::{channels_first, constant_names, export, stage_name};
use crate::{
    layers::Operation,
    network::{Network, Stage},
};
use murmuration_onnx::{EmbedderModel, GraphProto, ModelError, ModelProto};
use murmuration_swarm::training::Architecture;
use prost::Message as _;

/// Why a file is not a trainable network.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ImportError {
    #[error(transparent)]
    NotAnEmbedder(#[from] ModelError),
    /// Weights of the architecture are missing, have the wrong number, or are not finite.
    #[error("the checkpoint belongs to another network: {name:?} {problem}")]
    Weights { name: String, problem: String },
    /// The weights are right, but the graph differs from the graph that this trainer exports.
    #[error(
        "the checkpoint was not exported from this network by this trainer: it cannot be trained further"
    )]
    OtherGraph,
}

/// The network of an [`export`]ed file, with the same bits: exporting it again gives the same bytes.
///
/// # Errors
/// If the file is not an embedder, has another architecture, or comes from another program.
pub fn import(file: &[u8], architecture: Architecture) -> Result<Network, ImportError> {
    let model = EmbedderModel::read(file)?;
    let graph = ModelProto::decode(model.encoded()).unwrap_or_default().graph;
    let graph = graph.unwrap_or_default();
    let mut network = Network::initialise(architecture, 0);
    let weights: Result<Vec<_>, _> = network
        .stages()
        .iter()
        .enumerate()
        .map(|(index, stage)| weights(&graph, index, stage))
        .collect();
    network.parameters_mut().copy_from_slice(&weights?.concat());
    match export(&network) == file {
        true => Ok(network),
        false => Err(ImportError::OtherGraph),
    }
}

/// The weights of a stage, in the layout of this crate. The number of weights is checked.
fn weights(graph: &GraphProto, index: usize, stage: &Stage) -> Result<Vec<f32>, ImportError> {
    let (biases, pixels, channels) = match &stage.operation {
        Operation::Convolution(layer) => {
            let pixels = layer.kernel * layer.kernel;
            (layer.output.channels, pixels, layer.input.channels)
        }
        Operation::GroupNormalisation(layer) => (layer.shape.channels, 1, 1),
        Operation::Dense(layer) => (layer.units, layer.input.pixels(), layer.input.channels),
        Operation::AveragePooling(_) => return Ok(Vec::new()),
    };
    let [weights_name, biases_name] = constant_names(&stage_name(index, &stage.operation));
    let rows = floats(graph, weights_name, stage.parameters.len() - biases)?;
    // The file has rows of channels x pixels; this crate has pixels x channels.
    let rows = channels_first(&rows, channels, pixels);
    Ok([rows, floats(graph, biases_name, biases)?].concat())
}

fn floats(graph: &GraphProto, name: String, count: usize) -> Result<Vec<f32>, ImportError> {
    let wrong = |problem: String| ImportError::Weights {
        name: name.clone(),
        problem,
    };
    let tensor = graph.initializer.iter().find(|tensor| tensor.name == name);
    let bytes = tensor.and_then(|tensor| tensor.raw_data.as_deref());
    let (quads, _) = bytes
        .ok_or_else(|| wrong("is not there".to_owned()))?
        .as_chunks::<4>();
    if quads.len() != count {
        return Err(wrong(format!("has {} numbers, not {count}", quads.len())));
    }
    let values: Vec<f32> = quads.iter().map(|quad| f32::from_le_bytes(*quad)).collect();
    match values.iter().all(|value| value.is_finite()) {
        true => Ok(values),
        false => Err(wrong("holds a value that is not a number".to_owned())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pictures::tests::grey;
    use murmuration_swarm::{PictureShape, training::Layer};
    use proptest::prelude::*;

    fn layers() -> impl Strategy<Value = Vec<Layer>> {
        let convolution = (1..=4usize, 1..=3usize, 1..=2usize, any::<bool>()).prop_map(
            |(channels, kernel, stride, padded)| Layer::Convolution {
                channels,
                kernel,
                stride,
                padding: usize::from(padded && kernel > 1),
            },
        );
        let picture = prop_oneof![
            convolution,
            Just(Layer::GroupNormalisation { groups: 1 }),
            (1..=3usize).prop_map(|grid| Layer::AveragePooling { grid }),
        ];
        let flat = prop_oneof![
            (1..=9usize).prop_map(|units| Layer::Dense { units }),
            Just(Layer::GroupNormalisation { groups: 1 }),
        ];
        let activations = prop_oneof![
            Just(None),
            Just(Some(Layer::Relu)),
            Just(Some(Layer::LeakyRelu { slope: 0.25 }))
        ];
        let followed = |layer| (layer, activations.clone());
        (
            prop::collection::vec(followed(picture.boxed()), 0..5),
            prop::collection::vec(followed(flat.boxed()), 0..3),
            1..=5usize,
        )
            .prop_map(|(pictures, flat, units)| {
                let followed = pictures.into_iter().chain(flat);
                let layers = followed.flat_map(|(layer, activation)| [Some(layer), activation]);
                let last = Some(Layer::Dense { units });
                layers.chain([last]).flatten().collect()
            })
    }

    fn architectures() -> impl Strategy<Value = Architecture> {
        (1..=3usize, 7..=12usize, layers()).prop_filter_map(
            "layers that do not fit",
            |(channels, side, layers)| {
                Architecture::new(PictureShape::new(channels, side).unwrap(), layers).ok()
            },
        )
    }

    proptest! {
        #[test]
        fn what_is_exported_is_imported_to_the_bit(architecture in architectures(), seed: u32) {
            let network = Network::<f32>::initialise(architecture.clone(), seed.into());
            let imported = import(&export(&network), architecture).unwrap();
            let bits = |network: &Network| -> Vec<u32> {
                network.parameters().iter().map(|weight| weight.to_bits()).collect()
            };
            prop_assert_eq!(bits(&imported), bits(&network));
        }

        #[test]
        fn another_architecture_is_refused(one in architectures(), other in architectures()) {
            prop_assume!(one != other);
            let file = export(&Network::initialise(one, 1));
            prop_assert!(import(&file, other).is_err());
        }
    }

    fn compact(dimensions: usize) -> Architecture {
        Architecture::compact(grey(20), dimensions).unwrap()
    }

    #[test]
    fn what_is_wrong_is_named() {
        let file = export(&Network::initialise(compact(5), 1));
        let refusal = |file: &[u8], architecture| import(file, architecture).unwrap_err().to_string();
        assert!(refusal(b"what?", compact(5)).contains("not an ONNX model"));
        let other = refusal(&file, compact(4));
        assert!(
            other.contains("\"dense_8.weights\" has 320 numbers, not 256"),
            "{other}"
        );
        let paper = refusal(&file, Architecture::paper(grey(20), 5).unwrap());
        assert!(paper.contains("another network"), "{paper}");

        let mut model = ModelProto::decode(file.as_slice()).unwrap();
        model.producer_name = "somebody else".to_owned();
        assert_eq!(
            import(&model.encode_to_vec(), compact(5)).unwrap_err(),
            ImportError::OtherGraph
        );
        let mut broken = Network::initialise(compact(5), 1);
        broken.parameters_mut()[0] = f32::NAN;
        assert!(refusal(&export(&broken), compact(5)).contains("not a number"));
    }
}
