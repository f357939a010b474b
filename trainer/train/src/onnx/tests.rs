//! Tests of exported models.

use super::*;
use murmuration_onnx::EmbedderModel;
use murmuration_swarm::{PictureShape, training::Architecture};

fn graph(architecture: Architecture) -> GraphProto {
    let bytes = export(&Network::initialise(architecture, 1));
    ModelProto::decode(bytes.as_slice()).unwrap().graph.unwrap()
}

#[test]
fn what_is_exported_is_an_embedder() {
    for network in [Architecture::compact, Architecture::paper] {
        let bytes = export(&Network::initialise(network(PictureShape::PAPER, 5).unwrap(), 1));
        assert_eq!(EmbedderModel::read(&bytes).unwrap().dimensions(), 5);
    }
}

#[test]
fn every_value_is_made_before_it_is_taken_and_the_last_is_the_output() {
    let graph = graph(Architecture::compact(PictureShape::PAPER, 5).unwrap());
    let mut made: Vec<&str> = graph
        .initializer
        .iter()
        .map(|tensor| tensor.name.as_str())
        .collect();
    made.push("images");
    for node in &graph.node {
        for input in &node.input {
            assert!(
                made.contains(&input.as_str()),
                "{input} is not made before {}",
                node.name
            );
        }
        made.extend(node.output.iter().map(String::as_str));
    }
    assert_eq!(made.last(), Some(&"embeddings"));
}

#[test]
fn constants_have_as_many_values_as_their_shapes_say() {
    let graph = graph(Architecture::compact(PictureShape::PAPER, 5).unwrap());
    for tensor in graph.initializer.iter().filter(|tensor| tensor.data_type == 1) {
        let values: i64 = tensor.dims.iter().product();
        assert_eq!(
            tensor.raw_data.as_ref().unwrap().len() as i64,
            4 * values,
            "{}",
            tensor.name
        );
    }
}

#[test]
fn channels_come_first_outside() {
    let rows = [1.0, 10.0, 2.0, 20.0, 3.0, 30.0];
    assert_eq!(channels_first(&rows, 3, 2), [1.0, 2.0, 3.0, 10.0, 20.0, 30.0]);
}
