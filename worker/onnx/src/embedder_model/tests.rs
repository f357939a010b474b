//! Tests of models that are embedders, and of models that are not. The small model is `tests/models/small.onnx`, written by
//! Python's onnx package.

use super::*;
use crate::{
    AttributeProto, StringStringEntryProto, TensorProto,
    tensor_proto::DataLocation,
    tensor_shape_proto::{Dimension, dimension::Value::DimValue},
};
use proptest::prelude::*;

/// A model that turns 1 x 12 x 8 images into 3 numbers: Div, Conv, GroupNormalization, LeakyRelu, AveragePool, Flatten, Gemm,
/// Relu, Gemm.
const SMALL: &[u8] = include_bytes!("../../../../tests/models/small.onnx");

fn small() -> ModelProto {
    ModelProto::decode(SMALL).unwrap()
}

fn graph(model: &mut ModelProto) -> &mut GraphProto {
    model.graph.as_mut().unwrap()
}

/// Changes the small model's graph and expects an error that contains `expected`.
#[track_caller]
fn check_refused(expected: &str, change: impl FnOnce(&mut GraphProto)) {
    let mut model = small();
    change(graph(&mut model));
    let error = EmbedderModel::read(&model.encode_to_vec())
        .unwrap_err()
        .to_string();
    assert!(error.contains(expected), "{error}\nnot {expected:?}");
}

/// The node that makes `output`.
fn node<'a>(graph: &'a mut GraphProto, output: &str) -> &'a mut NodeProto {
    graph
        .node
        .iter_mut()
        .find(|node| node.output == [output])
        .unwrap()
}

fn constant<'a>(graph: &'a mut GraphProto, name: &str) -> &'a mut TensorProto {
    graph
        .initializer
        .iter_mut()
        .find(|tensor| tensor.name == name)
        .unwrap()
}

fn shape(value: &mut ValueInfoProto) -> &mut Vec<Dimension> {
    let tensor = value.r#type.as_mut().unwrap().tensor_type.as_mut().unwrap();
    &mut tensor.shape.as_mut().unwrap().dim
}

/// Adds a node between the last node and the output.
fn append(graph: &mut GraphProto, op_type: &str, inputs: &[&str], attribute: Vec<AttributeProto>) {
    graph.node.push(NodeProto {
        op_type: op_type.to_owned(),
        input: inputs.iter().map(ToString::to_string).collect(),
        output: vec!["last".to_owned()],
        attribute,
        ..NodeProto::default()
    });
    graph.output[0].name = "last".to_owned();
}

#[test]
fn an_embedder_is_read() {
    let model = EmbedderModel::read(SMALL).unwrap();
    assert_eq!(
        (model.images().to_string().as_str(), model.dimensions()),
        ("12 x 8", 3)
    );
    assert_eq!((model.input(), model.output()), ("images", "embedding"));
    // The largest value is a constant of 8 x 24 weights. The images have 96 values; the convolution makes 4 x 6 x 4 values.
    assert_eq!(model.largest_value(), 192);
}

#[test]
fn what_was_read_is_an_embedder_again() {
    let model = EmbedderModel::read(SMALL).unwrap();
    assert_eq!(EmbedderModel::read(model.encoded()).unwrap(), model);
}

#[test]
fn what_is_no_model_is_refused() {
    let check = |bytes: &[u8], expected: &str| {
        let error = EmbedderModel::read(bytes).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}\nnot {expected:?}");
    };
    check(b"", "it holds no graph");
    check(b"\x89PNG\r\n\x1a\n", "not an ONNX model");
    check(&SMALL[..SMALL.len() - 1], "not an ONNX model");
    check(&vec![0; MAX_MODEL_BYTES + 1], "has 67108865 bytes");
    let nodes = vec![NodeProto::default(); MAX_NODES + 1];
    check_refused("1025 nodes", |graph| graph.node = nodes);
}

#[test]
fn old_operators_and_operators_of_its_own_are_refused() {
    let check = |expected: &str, change: fn(&mut ModelProto)| {
        let mut model = small();
        change(&mut model);
        let error = EmbedderModel::read(&model.encode_to_vec())
            .unwrap_err()
            .to_string();
        assert!(error.contains(expected), "{error}\nnot {expected:?}");
    };
    check("of version 8", |model| model.opset_import[0].version = 8);
    check("of version 0", |model| {
        model.opset_import[0].domain = "elsewhere".to_owned()
    });
    check("operators of its own", |model| model.functions.push(Vec::new()));
    check("sparse", |model| graph(model).sparse_initializer.push(Vec::new()));
}

#[test]
fn it_takes_one_batch_of_grey_images() {
    check_refused("must be one, not 2", |graph| {
        graph
            .input
            .push(ValueInfoProto::batch_of_floats("more", "batch", &[1]));
    });
    check_refused("must be one, not 0", |graph| graph.input.clear());
    check_refused("fixed batch size 2", |graph| {
        shape(&mut graph.input[0])[0].value = Some(DimValue(2))
    });
    for channels in [0, 5] {
        check_refused(&format!("shape [?, {channels}, 12, 8]"), |graph| {
            shape(&mut graph.input[0])[1].value = Some(DimValue(channels))
        });
    }
    check_refused("node Conv", |graph| {
        shape(&mut graph.input[0])[1].value = Some(DimValue(3))
    });
    check_refused("shape [?, 1, 12, ?]", |graph| {
        shape(&mut graph.input[0])[3].value = None
    });
    check_refused("shape [?, 1, 12]", |graph| drop(shape(&mut graph.input[0]).pop()));
    check_refused("of 1001 x 8 pixels", |graph| {
        shape(&mut graph.input[0])[2].value = Some(DimValue(1001))
    });
    check_refused("of -1 x 8 pixels", |graph| {
        shape(&mut graph.input[0])[2].value = Some(DimValue(-1))
    });
    check_refused("is not a tensor", |graph| graph.input[0].r#type = None);
    check_refused("not of 32-bit floats", |graph| {
        let tensor = graph.input[0]
            .r#type
            .as_mut()
            .unwrap()
            .tensor_type
            .as_mut()
            .unwrap();
        tensor.elem_type = DataType::Uint8 as i32;
    });
}

#[test]
fn constants_among_the_inputs_are_no_inputs() {
    let mut model = small();
    let listed = ValueInfoProto {
        name: "w1".to_owned(),
        r#type: None,
    };
    graph(&mut model).input.push(listed);
    EmbedderModel::read(&model.encode_to_vec()).unwrap();
}

#[test]
fn it_makes_one_batch_of_vectors() {
    check_refused("must be one, not 0", |graph| graph.output.clear());
    check_refused("is made by no node", |graph| {
        graph.output[0].name = "elsewhere".to_owned()
    });
    check_refused("the shape [1, 4, 3, 2] for one image", |graph| {
        graph.output[0].name = "p".to_owned()
    });
    check_refused("does not depend on the image", |graph| {
        graph.output[0].name = "w2".to_owned()
    });
    check_refused("the shape [1, 1025]", |graph| {
        graph
            .initializer
            .push(TensorProto::floats("wide", &[3, 1025], &[0.0; 3 * 1025]));
        append(graph, "MatMul", &["embedding", "wide"], Vec::new());
    });
}

#[test]
fn constants_are_whole_and_in_the_file() {
    let key = |key: &str| StringStringEntryProto {
        key: key.to_owned(),
        value: "x".to_owned(),
    };
    check_refused("\"w1\" is in another file", |graph| {
        constant(graph, "w1").external_data.push(key("location"))
    });
    check_refused("is in another file", |graph| {
        constant(graph, "w1").data_location = DataLocation::External as i32
    });
    check_refused("shape [4, 1, 3, 4] and 36 numbers", |graph| {
        constant(graph, "w1").dims[3] = 4
    });
    check_refused("has the size -3", |graph| constant(graph, "w1").dims[3] = -3);
    check_refused("neither floats nor whole numbers", |graph| {
        constant(graph, "w1").data_type = DataType::Uint8 as i32
    });
    check_refused("does not hold whole numbers", |graph| {
        constant(graph, "w1").raw_data.as_mut().unwrap().pop();
    });
    check_refused("\"b1\" occurs twice", |graph| {
        let again = constant(graph, "b1").clone();
        graph.initializer.push(again);
    });
}

#[test]
fn outputs_of_a_normalisation_that_nothing_uses_are_allowed() {
    let normalised = |used: &str| {
        let mut model = small();
        let graph = graph(&mut model);
        let scale = TensorProto {
            name: "size".to_owned(),
            dims: vec![3],
            data_type: 1,
            float_data: vec![1.0; 3],
            ..TensorProto::default()
        };
        graph.initializer.push(scale);
        let embedding = graph.output[0].name.clone();
        append(graph, "LayerNormalization", &[&embedding, "size"], Vec::new());
        let last = graph.node.last_mut().unwrap();
        last.output.extend(["mean".to_owned(), "deviation".to_owned()]);
        graph.output[0].name = used.to_owned();
        model.opset_import[0].version = 17;
        EmbedderModel::read(&model.encode_to_vec()).map_err(|error| error.to_string())
    };
    assert_eq!(normalised("last").unwrap().dimensions(), 3);
    let refused = normalised("mean").unwrap_err();
    assert!(refused.contains("is made by no node"), "{refused}");
}

#[test]
fn only_known_operators_with_fitting_inputs() {
    check_refused("Loop (e): this operator is not among those", |graph| {
        node(graph, "e").op_type = "Loop".to_owned()
    });
    check_refused("operators of \"com.example\"", |graph| {
        node(graph, "e").domain = "com.example".to_owned()
    });
    check_refused("it cannot have 2 inputs", |graph| {
        node(graph, "e").input.push("d".to_owned())
    });
    check_refused("only its first 1 output can be used", |graph| {
        node(graph, "e").output.push("mask".to_owned())
    });
    check_refused("its first output must have a name", |graph| {
        node(graph, "e").output[0].clear()
    });
    check_refused("no earlier node makes \"e\"", |graph| {
        node(graph, "e").input[0] = "e".to_owned()
    });
    check_refused("the name of another value", |graph| {
        node(graph, "e").output[0] = "f".to_owned()
    });
    check_refused("casts to type 2", |graph| cast_at_the_end(graph, DataType::Uint8));
    check_refused("is not of 32-bit floats", |graph| {
        cast_at_the_end(graph, DataType::Double)
    });
}

fn cast_at_the_end(graph: &mut GraphProto, to: DataType) {
    let to = AttributeProto::integer("to", to as i64);
    append(graph, "Cast", &["embedding"], vec![to]);
}

/// Whether the small model takes batches after a change of its graph.
fn takes_batches(change: impl FnOnce(&mut GraphProto)) -> bool {
    let mut model = small();
    change(graph(&mut model));
    EmbedderModel::read(&model.encode_to_vec())
        .unwrap()
        .takes_batches()
}

#[test]
fn only_nodes_that_keep_images_apart_see_batches() {
    assert!(takes_batches(|_| ()));
    assert!(!takes_batches(|graph| {
        shape(&mut graph.input[0])[0].value = Some(DimValue(1))
    }));
    assert!(!takes_batches(|graph| append(
        graph,
        "Softmax",
        &["embedding"],
        Vec::new()
    )));
    // These would normalise over the images of a batch, and spread one image's numbers over the others.
    let over_images = vec![AttributeProto::integers("axes", &[0])];
    assert!(!takes_batches(|graph| append(
        graph,
        "ReduceMean",
        &["embedding"],
        over_images
    )));
    assert!(!takes_batches(|graph| {
        graph.initializer.push(TensorProto::integers("fixed", &[1, 3]));
        append(graph, "Reshape", &["embedding", "fixed"], Vec::new());
    }));
    assert!(takes_batches(|graph| {
        graph.initializer.push(TensorProto::integers("open", &[-1, 3]));
        append(graph, "Reshape", &["embedding", "open"], Vec::new());
    }));
}

#[test]
fn shapes_that_a_model_computes_are_followed() {
    let of_length = |start, end| {
        vec![
            AttributeProto::integer("start", start),
            AttributeProto::integer("end", end),
        ]
    };
    let mut model = small();
    let graph = graph(&mut model);
    graph.initializer.push(TensorProto::integers("rest", &[-1]));
    append(graph, "Shape", &["images"], of_length(0, 1));
    graph.node.last_mut().unwrap().output[0] = "batch".to_owned();
    append(
        graph,
        "Concat",
        &["batch", "rest"],
        vec![AttributeProto::integer("axis", 0)],
    );
    graph.node.last_mut().unwrap().output[0] = "target".to_owned();
    append(graph, "Reshape", &["p", "target"], Vec::new());
    let read = EmbedderModel::read(&model.encode_to_vec()).unwrap();
    assert_eq!((read.dimensions(), read.takes_batches()), (24, false));
}

#[test]
fn shapes_are_followed_with_the_numbers_that_the_runtime_has() {
    // A value whose size is the sum of two numbers.
    let read = |data_type: DataType, numbers: [i64; 2]| {
        let mut model = small();
        let graph = graph(&mut model);
        for (name, number) in ["one", "other"].into_iter().zip(numbers) {
            graph.initializer.push(TensorProto::integers(name, &[number]));
            append(
                graph,
                "Cast",
                &[name],
                vec![AttributeProto::integer("to", data_type as i64)],
            );
            graph.node.last_mut().unwrap().output[0] = format!("{name} cast");
        }
        append(graph, "Add", &["one cast", "other cast"], Vec::new());
        graph.node.last_mut().unwrap().output[0] = "sum".to_owned();
        append(
            graph,
            "Cast",
            &["sum"],
            vec![AttributeProto::integer("to", DataType::Int64 as i64)],
        );
        graph.node.last_mut().unwrap().output[0] = "sizes".to_owned();
        append(graph, "ConstantOfShape", &["sizes"], Vec::new());
        graph.node.last_mut().unwrap().output[0] = "made".to_owned();
        append(graph, "Identity", &["embedding"], Vec::new());
        let read = EmbedderModel::read(&model.encode_to_vec());
        read.map(drop).map_err(|error| error.to_string())
    };
    let largest = i64::from(i32::MAX);
    for (data_type, numbers) in [
        (DataType::Int64, [1000, -489]),
        (DataType::Int64, [(1 << 53) - 1, 1 - (1 << 53)]),
        (DataType::Int32, [largest, 10 - largest]),
        (DataType::Float, [1000, -489]),
    ] {
        assert_eq!(read(data_type, numbers), Ok(()), "{numbers:?}");
    }
    for (data_type, numbers) in [
        (DataType::Int64, [(1 << 62) + 511, -(1 << 62)]),
        (DataType::Int32, [largest, 5]),
        (DataType::Float16, [1, 2]),
    ] {
        let refused = read(data_type, numbers).unwrap_err();
        assert!(refused.contains("not constant"), "{numbers:?}: {refused}");
    }
}

#[test]
fn shapes_have_to_fit() {
    check_refused("Conv (c): weights of [4, 1, 3, 3] in 2 groups", |graph| {
        node(graph, "c")
            .attribute
            .push(AttributeProto::integer("group", 2));
    });
    check_refused("kernel_shape differs from", |graph| {
        node(graph, "c").attribute[0].ints = vec![5, 5]
    });
    check_refused("strides = [0, 2]", |graph| {
        node(graph, "c").attribute[2].ints = vec![0, 2]
    });
    check_refused("pads = [1, 1]: must be 4 numbers", |graph| {
        node(graph, "c").attribute[1].ints = vec![1, 1]
    });
    check_refused("do not make 3 groups", |graph| {
        let groups = node(graph, "n")
            .attribute
            .iter_mut()
            .find(|of| of.name == "num_groups");
        groups.unwrap().i = 3;
    });
    check_refused("Gemm (d): matrices of [1, 24] and [8, 24]", |graph| {
        node(graph, "d").attribute.clear()
    });
    check_refused("Gemm (d): shapes [1, 8] and [3] do not fit", |graph| {
        node(graph, "d").input[2] = "b3".to_owned()
    });
    check_refused("flattens from an axis that is not there", |graph| {
        node(graph, "f").attribute[0].i = 5
    });
    check_refused("a window", |graph| {
        node(graph, "p").attribute[0].ints = vec![7, 2]
    });
}

#[test]
fn memory_and_time_of_an_image_are_bounded() {
    check_refused("makes 12000000 numbers", |graph| {
        graph
            .initializer
            .push(TensorProto::floats("many", &[1000, 1, 1], &[0.0; 1000]));
        graph
            .initializer
            .push(TensorProto::floats("wide", &[8, 1000], &[0.0; 8000]));
        append(graph, "Add", &["images", "many"], Vec::new());
        append(graph, "MatMul", &["last", "wide"], Vec::new());
        graph.node.last_mut().unwrap().output[0] = "wider".to_owned();
    });
    check_refused(
        "AveragePool (p): with its 4032060000000 multiplications, the model needs more than 2147483648",
        |graph| {
            node(graph, "p").attribute = vec![
                AttributeProto::integers("kernel_shape", &[1000; 2]),
                AttributeProto::integers("pads", &[999; 4]),
            ];
        },
    );
}

#[test]
fn memory_and_time_of_all_nodes_together_are_bounded() {
    let many = |graph: &mut GraphProto, operator, attributes: &[AttributeProto]| {
        graph
            .initializer
            .push(TensorProto::floats("many", &[40_000, 1, 1], &[0.0; 40_000]));
        append(graph, "Add", &["images", "many"], Vec::new());
        for place in 0..30 {
            let input = if operator == "Abs" { "last" } else { "images" };
            append(graph, operator, &[input], attributes.to_vec());
            graph.node.last_mut().unwrap().output[0] = format!("copy {place}");
        }
    };
    check_refused(
        "numbers, the model makes more than 67108864 for an image",
        |graph| {
            many(graph, "Abs", &[]);
        },
    );
    let window = [
        AttributeProto::integers("kernel_shape", &[99; 2]),
        AttributeProto::integers("pads", &[98; 4]),
    ];
    check_refused("multiplications, the model needs more than 2147483648", |graph| {
        many(graph, "AveragePool", &window);
    });
}

proptest! {
    #[test]
    fn arbitrary_bytes_are_refused(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        prop_assert!(EmbedderModel::read(&bytes).is_err());
    }

    #[test]
    fn a_truncated_model_is_refused(length in 0..SMALL.len()) {
        prop_assert!(EmbedderModel::read(&SMALL[..length]).is_err());
    }

    #[test]
    fn whatever_is_read_is_read_again_as_the_same(
        changes in prop::collection::vec((0..SMALL.len(), any::<u8>()), 1..6),
    ) {
        let mut bytes = SMALL.to_vec();
        for (at, byte) in changes {
            bytes[at] = byte;
        }
        if let Ok(model) = EmbedderModel::read(&bytes) {
            prop_assert_eq!(EmbedderModel::read(model.encoded()), Ok(model));
        }
    }
}
