//! An ONNX model that is known to be an embedder and may be stored, sent and executed.
//!
//! A file is decoded, every node is checked from the images to the embedding, and the checked model is encoded again. The
//! runtime loads only the result, never the original bytes.

use super::{
    EMBEDDING_DIMENSIONS, GraphProto, IMAGE_SIDES, ImageShape, MAX_MODEL_BYTES, MAX_NODES, ModelProto,
    NodeProto, TypeProto, ValueInfoProto,
    batches::keeps_images_apart,
    budget::Budget,
    operators::{self, Operation},
    tensor,
    tensor_proto::DataType,
    tensor_shape_proto::dimension,
    value::{Element, Value},
};
use murmuration_proto::wire::MessageShapes;
use murmuration_swarm::{PictureShape, counted};
use prost::Message as _;
use std::{collections::BTreeMap, ops::RangeInclusive, sync::LazyLock};

/// Oldest accepted version of ONNX's operators. The operators of this version broadcast as today's operators do.
const OLDEST_OPSET: i64 = 9;
/// The protobuf messages of a model file.
static MODEL: LazyLock<MessageShapes> =
    LazyLock::new(|| MessageShapes::read(include_bytes!(concat!(env!("OUT_DIR"), "/descriptors.bin"))));
/// Maximum number of messages, texts and lists in a model file: enough for 1024 nodes with 90 parts each.
const MAX_PARTS: usize = 100_000;

/// An embedder as an ONNX model. The model turns B x C x H x W raw grey values (0 to 255, as floats) into B x N numbers. C is 1
/// to 4. B is any number if the model [takes batches](Self::takes_batches), and 1 otherwise.
///
/// Each image's embedding depends on that image alone.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EmbedderModel {
    encoded: Vec<u8>,
    input: String,
    output: String,
    images: ImageShape,
    dimensions: usize,
    largest_value: usize,
    takes_batches: bool,
}

/// Error in a file that should be an embedder.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ModelError {
    /// The file is longer than [`MAX_MODEL_BYTES`].
    #[error("the model has {0} bytes: at most {MAX_MODEL_BYTES} are allowed")]
    TooLarge(usize),
    /// The file is not an ONNX model.
    #[error("this is not an ONNX model: {0}")]
    NotOnnx(String),
    /// The model's input is not a batch of images, or the model has several inputs.
    #[error(
        "the model's input {0}: an embedder takes floats of shape batch x channels x height x width, batch open or 1, \
         1 to 4 channels"
    )]
    Input(String),
    /// The model's output is not a batch of vectors, or the model has several outputs.
    #[error("the model's output {0}: an embedder makes floats of shape batch x N, N from 1 to 1024")]
    Output(String),
    /// A constant that cannot be used.
    #[error("the model's constant {name:?} {problem}")]
    Constant {
        /// The constant's name in the graph.
        name: String,
        problem: String,
    },
    /// A node that cannot be executed.
    #[error("the model's node {node}: {problem}")]
    Node {
        /// The node's operator and output.
        node: String,
        problem: String,
    },
}

impl EmbedderModel {
    /// Reads and checks a model file.
    ///
    /// # Errors
    /// Fails if the file is not ONNX, does anything but embed images, needs another file, or has an operator that is not allowed.
    /// Fails if the model needs too much memory or time per image ([`MAX_VALUE_ELEMENTS`](super::MAX_VALUE_ELEMENTS),
    /// [`MAX_ELEMENTS`](super::MAX_ELEMENTS), [`MAX_PRODUCTS`](super::MAX_PRODUCTS)).
    pub fn read(file: &[u8]) -> Result<Self, ModelError> {
        let model = decode(file)?;
        let (graph, opset) = graph(&model)?;
        let constants = constants(graph)?;
        let input = single_input(graph, &constants)?;
        let (images, is_open) = image_shape(input)?;
        let output = single_output(graph)?;
        let sizes = vec![1, images.channels, images.height, images.width];
        let image = Value::new(sizes, Element::Float, true);
        let followed = follow(graph, opset, constants, &input.name, image)?;
        let values = &followed.values;
        Ok(Self {
            images,
            dimensions: dimensions(&output.name, values.get(&output.name))?,
            largest_value: values.values().map(Value::elements).max().unwrap_or(0),
            takes_batches: is_open && followed.keeps_images_apart,
            input: input.name.clone(),
            output: output.name.clone(),
            encoded: model.encode_to_vec(),
        })
    }

    /// The encoded model, without the other contents of its file. The checkpoint's digest is the digest of the file, not of these
    /// bytes.
    #[must_use]
    pub fn encoded(&self) -> &[u8] {
        &self.encoded
    }

    /// Name of the input.
    #[must_use]
    pub fn input(&self) -> &str {
        &self.input
    }

    /// Name of the output.
    #[must_use]
    pub fn output(&self) -> &str {
        &self.output
    }

    /// The shape of the images that the model takes.
    #[must_use]
    pub const fn images(&self) -> ImageShape {
        self.images
    }

    /// Number of dimensions of an embedding, 1 to 1024.
    #[must_use]
    pub const fn dimensions(&self) -> usize {
        self.dimensions
    }

    /// Whether the model embeds any number of images at once, with the same bits as each image alone. Other models embed one image
    /// at a time.
    #[must_use]
    pub const fn takes_batches(&self) -> bool {
        self.takes_batches
    }

    /// Number of elements of the largest value, constants included, per image. The memory of a batch grows with this number.
    #[must_use]
    pub const fn largest_value(&self) -> usize {
        self.largest_value
    }
}

/// The messages of a model file.
pub(super) fn decode(file: &[u8]) -> Result<ModelProto, ModelError> {
    if file.len() > MAX_MODEL_BYTES {
        return Err(ModelError::TooLarge(file.len()));
    }
    let parts = MODEL.check::<ModelProto>(file, MAX_PARTS);
    parts.map_err(|refused| ModelError::NotOnnx(refused.to_string()))?;
    ModelProto::decode(file).map_err(|error| ModelError::NotOnnx(error.to_string()))
}

/// The model's graph and the version of its operators, if the model computes nothing else and its version and size are allowed.
fn graph(model: &ModelProto) -> Result<(&GraphProto, i64), ModelError> {
    let Some(graph) = &model.graph else {
        return Err(ModelError::NotOnnx("it holds no graph".to_owned()));
    };
    let opset = model
        .opset_import
        .iter()
        .find(|set| is_standard(&set.domain))
        .map_or(0, |set| set.version);
    let problem = if opset < OLDEST_OPSET {
        format!("its operators are of version {opset}: {OLDEST_OPSET} or newer is needed")
    } else if !model.functions.is_empty() {
        "it defines operators of its own: export it with a newer PyTorch, or inline its functions with onnx.inliner"
            .to_owned()
    } else if !graph.sparse_initializer.is_empty() {
        "it has sparse constants".to_owned()
    } else if graph.node.len() > MAX_NODES {
        format!(
            "it has {} nodes: at most {MAX_NODES} are allowed",
            graph.node.len()
        )
    } else {
        return Ok((graph, opset));
    };
    Err(ModelError::NotOnnx(problem))
}

fn is_standard(domain: &str) -> bool {
    domain.is_empty() || domain == "ai.onnx"
}

fn constants(graph: &GraphProto) -> Result<BTreeMap<String, Value>, ModelError> {
    let mut constants = BTreeMap::new();
    for initializer in &graph.initializer {
        let refused = |problem| ModelError::Constant {
            name: initializer.name.clone(),
            problem,
        };
        let constant = tensor::constant(initializer).map_err(refused)?;
        if constants.insert(initializer.name.clone(), constant).is_some() {
            return Err(refused("occurs twice".to_owned()));
        }
    }
    Ok(constants)
}

/// The only input that is not a constant (old files list their constants among the inputs).
fn single_input<'a>(
    graph: &'a GraphProto,
    constants: &BTreeMap<String, Value>,
) -> Result<&'a ValueInfoProto, ModelError> {
    let mut inputs = graph
        .input
        .iter()
        .filter(|input| !constants.contains_key(&input.name));
    match (inputs.next(), inputs.count()) {
        (Some(input), 0) => Ok(input),
        (first, more) => Err(ModelError::Input(format!(
            "must be one, not {}",
            more + usize::from(first.is_some())
        ))),
    }
}

fn single_output(graph: &GraphProto) -> Result<&ValueInfoProto, ModelError> {
    match graph.output.as_slice() {
        [output] => Ok(output),
        outputs => Err(ModelError::Output(format!("must be one, not {}", outputs.len()))),
    }
}

/// The shape of the images that `input` takes, and whether their number is open; otherwise it is 1.
fn image_shape(input: &ValueInfoProto) -> Result<(ImageShape, bool), ModelError> {
    let refused = |problem: &str| Err(ModelError::Input(format!("{:?} {problem}", input.name)));
    let Some(tensor) = input
        .r#type
        .as_ref()
        .and_then(|TypeProto { tensor_type }| tensor_type.as_ref())
    else {
        return refused("is not a tensor");
    };
    if tensor.elem_type != DataType::Float as i32 {
        return refused("is not of 32-bit floats");
    }
    let sizes: Vec<Option<i64>> = tensor
        .shape
        .iter()
        .flat_map(|shape| &shape.dim)
        .map(|dimension| match dimension.value {
            Some(dimension::Value::DimValue(size)) => Some(size),
            Some(dimension::Value::DimParam(_)) | None => None,
        })
        .collect();
    match sizes[..] {
        [
            batch @ (None | Some(1)),
            Some(channels),
            Some(height),
            Some(width),
        ] => {
            let within = |size, sizes: RangeInclusive<usize>| {
                let size = usize::try_from(size).ok();
                size.filter(|size| sizes.contains(size))
            };
            let Some(channels) = within(channels, 1..=PictureShape::MAX_CHANNELS) else {
                return refused(&format!("has the shape {}", shown(&sizes)));
            };
            match (within(height, IMAGE_SIDES), within(width, IMAGE_SIDES)) {
                (Some(height), Some(width)) => {
                    let images = ImageShape {
                        channels,
                        height,
                        width,
                    };
                    Ok((images, batch.is_none()))
                }
                _ => refused(&format!(
                    "is of {height} x {width} pixels, a side not from 1 to 1000"
                )),
            }
        }
        [Some(batch), _, _, _] => refused(&format!("has the fixed batch size {batch}")),
        _ => refused(&format!("has the shape {}", shown(&sizes))),
    }
}

/// A declared shape as text, with `?` for an open size.
fn shown(sizes: &[Option<i64>]) -> String {
    let sizes: Vec<String> = sizes
        .iter()
        .map(|size| size.map_or("?".to_owned(), |size| size.to_string()))
        .collect();
    format!("[{}]", sizes.join(", "))
}

/// The values of a graph, computed from its input to its last node.
struct Followed {
    /// Every value by name: the constants, the images, and the outputs of all nodes.
    values: BTreeMap<String, Value>,
    /// Whether every node treats the images of a batch separately.
    keeps_images_apart: bool,
}

fn follow(
    graph: &GraphProto,
    opset: i64,
    constants: BTreeMap<String, Value>,
    input: &str,
    image: Value,
) -> Result<Followed, ModelError> {
    let mut followed = Followed {
        values: constants,
        keeps_images_apart: true,
    };
    followed.values.insert(input.to_owned(), image);
    let mut budget = Budget::full();
    for node in &graph.node {
        let refused = |problem| ModelError::Node {
            node: format!("{} ({})", node.op_type, node.output.join(", ")),
            problem,
        };
        followed.add(node, opset, &mut budget).map_err(refused)?;
    }
    Ok(followed)
}

impl Followed {
    /// Adds the outputs of a node.
    fn add(&mut self, node: &NodeProto, opset: i64, budget: &mut Budget) -> Result<(), String> {
        if !is_standard(&node.domain) {
            return Err(format!("operators of {:?} are not allowed", node.domain));
        }
        let taken = |name: &String| match self.values.get(name) {
            _ if name.is_empty() => Ok(None),
            Some(value) => Ok(Some(value)),
            None => Err(format!("no earlier node makes {name:?}")),
        };
        let inputs = node.input.iter().map(taken).collect::<Result<Vec<_>, _>>()?;
        let operation = Operation::new(node, inputs, opset);
        let outputs = operators::outputs(&operation, budget)?;
        if node.output.first().is_none_or(String::is_empty) {
            return Err("its first output must have a name".to_owned());
        }
        let further: Vec<_> = node
            .output
            .iter()
            .skip(outputs.len())
            .filter(|name| !name.is_empty())
            .collect();
        if node.op_type == "LayerNormalization" {
            // PyTorch's exporters name the mean and the deviation too, which no node uses. They are smaller than the input.
            for name in further {
                budget.keep(outputs[0].elements())?;
                if self.values.contains_key(name) {
                    return Err("its output has the name of another value".to_owned());
                }
            }
        } else if !further.is_empty() {
            return Err(format!(
                "only its first {} can be used",
                counted(outputs.len() as u64, "output")
            ));
        }
        let keeps_apart = outputs
            .iter()
            .all(|output| keeps_images_apart(&operation, output));
        for (name, output) in node
            .output
            .iter()
            .zip(outputs)
            .filter(|(name, _)| !name.is_empty())
        {
            budget.keep(output.elements())?;
            if self.values.insert(name.clone(), output).is_some() {
                return Err("its output has the name of another value".to_owned());
            }
        }
        self.keeps_images_apart &= keeps_apart;
        Ok(())
    }
}

fn dimensions(name: &str, output: Option<&Value>) -> Result<usize, ModelError> {
    let made = match output {
        None => "is made by no node".to_owned(),
        Some(output) if !output.of_image => "does not depend on the image".to_owned(),
        Some(output) => match output.sizes[..] {
            _ if output.element != Element::Float => "is not of 32-bit floats".to_owned(),
            [1, dimensions] if EMBEDDING_DIMENSIONS.contains(&dimensions) => return Ok(dimensions),
            _ => format!("has the shape {:?} for one image", output.sizes),
        },
    };
    Err(ModelError::Output(format!("{name:?} {made}")))
}

#[cfg(test)]
mod tests;
