//! Benchmark: images that one thread embeds per second, by batch size. The networks are the paper's and the compact network, with
//! arbitrary weights.
#![expect(clippy::unwrap_used, reason = "a figure that cannot be had is a bug")]

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use murmuration_embed::{Embedder, Runtime};
use murmuration_onnx::{
    AttributeProto, EmbedderModel, GraphProto, ModelProto, NodeProto, OperatorSetIdProto, TensorProto,
    ValueInfoProto,
};
use murmuration_swarm::{Purpose, RandomStream};
use prost::Message as _;
use rand::RngExt as _;

/// A graph as a chain: the input of every node is the output of the node before.
struct Chain {
    graph: GraphProto,
    weights: RandomStream,
}

impl Chain {
    fn new() -> Self {
        let graph = GraphProto {
            name: "chain".to_owned(),
            input: vec![ValueInfoProto::batch_of_floats("0", "batch", &[1, 50, 50])],
            initializer: vec![TensorProto::floats("white", &[], &[255.0])],
            ..GraphProto::default()
        };
        let weights = RandomStream::derive(1, Purpose::Start, 0);
        Self { graph, weights }.then("Div", &[], Vec::new(), &["white"])
    }

    /// Appends a node to the chain. The node's inputs are the chain's last output, new parameters with these `shapes`, and the
    /// `named` constants.
    fn then(
        mut self,
        op_type: &str,
        shapes: &[&[usize]],
        attribute: Vec<AttributeProto>,
        named: &[&str],
    ) -> Self {
        let number = self.graph.node.len();
        let mut input = vec![number.to_string()];
        input.extend(named.iter().map(ToString::to_string));
        for (i, shape) in shapes.iter().enumerate() {
            let name = format!("{number}.{i}");
            let spread = 1.0 / f64::from(shape[1..].iter().product::<usize>().max(1) as u32).sqrt();
            let values: Vec<f32> = (0..shape.iter().product())
                .map(|_| self.weights.random_range(-spread..spread) as f32)
                .collect();
            self.graph
                .initializer
                .push(TensorProto::floats(&name, shape, &values));
            input.push(name);
        }
        self.graph.node.push(NodeProto {
            op_type: op_type.to_owned(),
            input,
            output: vec![(number + 1).to_string()],
            attribute,
            ..NodeProto::default()
        });
        self
    }

    fn convolution(self, channels: [usize; 2], stride: usize, padding: usize) -> Self {
        let attributes = vec![
            AttributeProto::integers("strides", &[stride; 2]),
            AttributeProto::integers("pads", &[padding; 4]),
        ];
        let [from, to] = channels;
        self.then("Conv", &[&[to, from, 3, 3], &[to]], attributes, &[])
    }

    fn dense(self, from: usize, to: usize) -> Self {
        let attributes = vec![AttributeProto::integer("transB", 1)];
        self.then("Gemm", &[&[to, from], &[to]], attributes, &[])
    }

    fn simple(self, op_type: &str) -> Self {
        self.then(op_type, &[], Vec::new(), &[])
    }

    fn embedder(mut self, runtime: &Runtime) -> Embedder {
        let last = self.graph.node.len().to_string();
        self.graph.output = vec![ValueInfoProto::batch_of_floats(&last, "batch", &[5])];
        let model = ModelProto {
            ir_version: 10,
            graph: Some(self.graph),
            opset_import: vec![OperatorSetIdProto {
                domain: String::new(),
                version: 21,
            }],
            ..ModelProto::default()
        };
        Embedder::open(runtime, EmbedderModel::read(&model.encode_to_vec()).unwrap()).unwrap()
    }
}

fn paper() -> Chain {
    let mut chain = Chain::new();
    for _ in 0..3 {
        chain = chain.convolution([1, 1], 1, 0).simple("LeakyRelu");
    }
    let chain = chain.simple("Flatten").dense(1936, 256).simple("Relu");
    chain.dense(256, 64).simple("Relu").dense(64, 5)
}

fn compact() -> Chain {
    let mut chain = Chain::new();
    for channels in [[1, 16], [16, 32], [32, 64]] {
        let groups = vec![AttributeProto::integer("num_groups", 4)];
        chain = chain
            .convolution(channels, 2, 1)
            .then(
                "GroupNormalization",
                &[&[channels[1]], &[channels[1]]],
                groups,
                &[],
            )
            .simple("LeakyRelu");
    }
    let pooling = vec![
        AttributeProto::integers("kernel_shape", &[4, 4]),
        AttributeProto::integers("strides", &[3, 3]),
    ];
    let chain = chain.then("AveragePool", &[], pooling, &[]).simple("Flatten");
    chain.dense(256, 64).simple("Relu").dense(64, 5)
}

fn embed(criterion: &mut Criterion) {
    let runtime = Runtime::load().unwrap();
    let mut stream = RandomStream::derive(2, Purpose::Start, 0);
    let images: Vec<Vec<u8>> = (0..64)
        .map(|_| (0..2500).map(|_| stream.random()).collect())
        .collect();
    let images: Vec<&[u8]> = images.iter().map(Vec::as_slice).collect();
    for (network, chain) in [("paper", paper()), ("compact", compact())] {
        let mut embedder = chain.embedder(&runtime);
        let mut group = criterion.benchmark_group(format!("embed/{network}"));
        for batch in [1, 8, 32, 64] {
            group.throughput(Throughput::Elements(batch as u64));
            group.bench_function(BenchmarkId::from_parameter(batch), |bencher| {
                bencher.iter(|| embedder.embed(&images[..batch]).unwrap());
            });
        }
    }
}

criterion_group!(benches, embed);
criterion_main!(benches);
