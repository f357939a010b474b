//! A network as an ONNX model, which any ONNX Runtime can run.
//!
//! The input is `images`: 32-bit floats, batch x channels x side x side, with grey values from 0 to 255. The graph scales them to
//! 0 to 1.
//! The output is `embeddings`: batch x dimensions. The model uses opset [`OPSET`], which every recent ONNX Runtime supports.
//!
//! Group normalisation is composed of simpler operators. The operator `GroupNormalization` came with opset 18 and is correct only
//! since opset 21. ONNX Runtime's kernels for `GroupNormalization` and `InstanceNormalization` sum thousands of mostly equal
//! values at once, and so lose a digit. The model computes the mean of each row and then the mean of these means, which agrees
//! with our results to 2e-6.

mod import;
#[cfg(test)]
mod tests;

pub use import::{ImportError, import};

use crate::{
    layers::{AveragePooling, Convolution, Dense, EPSILON, GroupNormalisation, Operation},
    network::{Network, Stage},
    real::Real,
};
use murmuration_onnx::{
    AttributeProto, GraphProto, ModelProto, NodeProto, OperatorSetIdProto, TensorProto, ValueInfoProto,
};
use murmuration_swarm::training::{Layer, Shape};
use prost::Message as _;

/// Version of ONNX's standard operators that the models use.
pub const OPSET: i64 = 17;
/// Version of the ONNX file format that belongs to [`OPSET`].
const IR_VERSION: i64 = 8;

/// The bytes of the network's ONNX model: equal networks have equal bytes.
#[must_use]
pub fn export(network: &Network) -> Vec<u8> {
    let pictures = network.architecture().pictures();
    let mut graph = Graph {
        last: "images".to_owned(),
        nodes: Vec::new(),
        constants: vec![TensorProto::floats("white", &[], &[255.0])],
    };
    graph.node("Div", "scaled", &["white"], Vec::new());
    for (index, stage) in network.stages().iter().enumerate() {
        let weights = &network.parameters()[stage.parameters.clone()];
        graph.stage(index, stage, weights);
    }
    graph.node("Identity", "embeddings", &[], Vec::new());
    let model = ModelProto {
        ir_version: IR_VERSION,
        producer_name: "murmuration".to_owned(),
        opset_import: vec![OperatorSetIdProto {
            domain: String::new(),
            version: OPSET,
        }],
        graph: Some(GraphProto {
            name: "embedder".to_owned(),
            node: graph.nodes,
            initializer: graph.constants,
            input: vec![ValueInfoProto::batch_of_floats(
                "images",
                "batch",
                &[pictures.channels(), pictures.side(), pictures.side()],
            )],
            output: vec![ValueInfoProto::batch_of_floats(
                "embeddings",
                "batch",
                &[network.architecture().dimensions()],
            )],
            ..GraphProto::default()
        }),
        ..ModelProto::default()
    };
    model.encode_to_vec()
}

/// A graph that is built from input to output.
struct Graph {
    /// Name of the last output.
    last: String,
    nodes: Vec<NodeProto>,
    constants: Vec<TensorProto>,
}

impl Graph {
    /// Appends a node with the last output and `others` as inputs, and `output` as output.
    fn node(&mut self, operator: &str, output: &str, others: &[&str], attributes: Vec<AttributeProto>) {
        let made = std::mem::replace(&mut self.last, output.to_owned());
        let others = others.iter().map(|&name| name.to_owned());
        self.nodes.push(NodeProto {
            input: std::iter::once(made).chain(others).collect(),
            output: vec![output.to_owned()],
            name: output.to_owned(),
            op_type: operator.to_owned(),
            attribute: attributes,
            domain: String::new(),
        });
    }

    fn constant(&mut self, name: &str, dims: &[usize], values: &[f32]) {
        self.constants.push(TensorProto::floats(name, dims, values));
    }

    fn integers(&mut self, name: &str, values: &[usize]) {
        let values: Vec<i64> = values.iter().map(|&value| value as i64).collect();
        self.constants.push(TensorProto::integers(name, &values));
    }

    fn stage(&mut self, index: usize, stage: &Stage, weights: &[f32]) {
        let name = &stage_name(index, &stage.operation);
        match &stage.operation {
            Operation::Convolution(layer) => self.convolution(name, layer, weights),
            Operation::GroupNormalisation(layer) => self.group_normalisation(name, *layer, weights),
            Operation::AveragePooling(layer) => self.average_pooling(name, *layer),
            Operation::Dense(layer) => self.dense(name, *layer, weights),
        }
        let output = format!("activation_{index}");
        match stage.activation {
            Some(Layer::LeakyRelu { slope }) => {
                let slope = AttributeProto::float("alpha", slope as f32);
                self.node("LeakyRelu", &output, &[], vec![slope]);
            }
            Some(_) => self.node("Relu", &output, &[], Vec::new()),
            None => {}
        }
    }

    fn convolution(&mut self, name: &str, layer: &Convolution, weights: &[f32]) {
        let (weights, biases) = weights.split_at(layer.output.channels * layer.patch());
        let (kernel, channels) = (layer.kernel, layer.input.channels);
        let [weights_name, biases_name] = constant_names(name);
        let weights = channels_first(weights, kernel * kernel, channels);
        self.constant(
            &weights_name,
            &[layer.output.channels, channels, kernel, kernel],
            &weights,
        );
        self.constant(&biases_name, &[layer.output.channels], biases);
        let attributes = vec![
            AttributeProto::integers("kernel_shape", &[kernel; 2]),
            AttributeProto::integers("strides", &[layer.stride; 2]),
            AttributeProto::integers("pads", &[layer.padding; 4]),
        ];
        self.node("Conv", name, &[&weights_name, &biases_name], attributes);
    }

    fn group_normalisation(&mut self, name: &str, layer: GroupNormalisation, weights: &[f32]) {
        let Shape { channels, side } = layer.shape;
        let named = |what: &str| format!("{name}.{what}");
        // A first dimension of 0 keeps the batch size.
        let by_group = [0, layer.groups, channels / layer.groups * side, side];
        let by_channel = [0, channels, side, side];
        let (by_channel, spread) = match self.is_flat(layer.shape) {
            true => (&by_channel[..2], &[channels][..]),
            false => (&by_channel[..], &[channels, 1, 1][..]),
        };
        let [weights_name, biases_name] = constant_names(name);
        let (scales, shifts) = weights.split_at(channels);
        self.integers(&named("by_group"), &by_group);
        self.integers(&named("by_channel"), by_channel);
        self.constant(&named("epsilon"), &[], &[EPSILON as f32]);
        self.constant(&weights_name, spread, scales);
        self.constant(&biases_name, spread, shifts);

        let (grouped, centred) = (named("grouped"), named("centred"));
        self.node("Reshape", &grouped, &[&named("by_group")], Vec::new());
        let mean = self.mean(&named("mean"));
        self.last = grouped;
        self.node("Sub", &centred, &[&mean], Vec::new());
        self.node("Mul", &named("squared"), &[&centred], Vec::new());
        self.mean(&named("variance"));
        self.node("Add", &named("more"), &[&named("epsilon")], Vec::new());
        self.node("Sqrt", &named("deviation"), &[], Vec::new());
        self.last = centred;
        self.node("Div", &named("normalised"), &[&named("deviation")], Vec::new());
        self.node(
            "Reshape",
            &named("ungrouped"),
            &[&named("by_channel")],
            Vec::new(),
        );
        self.node("Mul", &named("scaled"), &[&weights_name], Vec::new());
        self.node("Add", name, &[&biases_name], Vec::new());
    }

    /// The mean over the last two axes, one after the other; returns its name.
    fn mean(&mut self, name: &str) -> String {
        let over = |axis: usize| vec![AttributeProto::integers("axes", &[axis])];
        self.node("ReduceMean", &format!("{name}.of_rows"), &[], over(3));
        self.node("ReduceMean", name, &[], over(2));
        name.to_owned()
    }

    fn average_pooling(&mut self, name: &str, layer: AveragePooling) {
        let attributes = vec![
            AttributeProto::integers("kernel_shape", &[layer.window(); 2]),
            AttributeProto::integers("strides", &[layer.stride(); 2]),
        ];
        self.node("AveragePool", name, &[], attributes);
    }

    fn dense(&mut self, name: &str, layer: Dense, weights: &[f32]) {
        if !self.is_flat(layer.input) {
            self.node("Flatten", &format!("{name}.flat"), &[], Vec::new());
        }
        let Shape { channels, .. } = layer.input;
        let (weights, biases) = weights.split_at(layer.units * layer.input.len());
        let weights = channels_first(weights, layer.input.pixels(), channels);
        let [weights_name, biases_name] = constant_names(name);
        self.constant(&weights_name, &[layer.units, layer.input.len()], &weights);
        self.constant(&biases_name, &[layer.units], biases);
        let transposed = vec![AttributeProto::integer("transB", 1)];
        self.node("Gemm", name, &[&weights_name, &biases_name], transposed);
    }

    /// Whether a value of this shape is the output of a dense layer, which has no height and width in the graph.
    fn is_flat(&self, shape: Shape) -> bool {
        let dense = |node: &NodeProto| node.op_type == "Gemm";
        shape.side == 1 && self.nodes.iter().any(dense)
    }
}

/// The name of a stage's node, which is also the prefix of the names of the stage's constants.
fn stage_name(index: usize, operation: &Operation) -> String {
    let kind = match operation {
        Operation::Convolution(_) => "convolution",
        Operation::GroupNormalisation(_) => "normalisation",
        Operation::AveragePooling(_) => "pooling",
        Operation::Dense(_) => "dense",
    };
    format!("{kind}_{index}")
}

fn constant_names(name: &str) -> [String; 2] {
    ["weights", "biases"].map(|what| format!("{name}.{what}"))
}

/// Reorders rows of `pixels` x `channels` values into rows of `channels` x `pixels` values.
pub(crate) fn channels_first<T: Real>(rows: &[T], pixels: usize, channels: usize) -> Vec<T> {
    let row = |row: &[T]| -> Vec<T> {
        let place = |i: usize| row[i % pixels * channels + i / pixels];
        (0..pixels * channels).map(place).collect()
    };
    rows.chunks_exact(pixels * channels).flat_map(row).collect()
}
