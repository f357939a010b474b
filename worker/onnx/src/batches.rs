//! Whether a node treats the images of a batch separately.

use super::{operators::Operation, value::Value};

/// Whether an operation embeds an image with the same bits whatever the other images of a batch are, and however many. The first
/// size of `output`, which was computed for one image, must then be the batch's.
///
/// For operators that are not listed, ONNX Runtime may choose another kernel for another number of images.
pub(super) fn keeps_images_apart(operation: &Operation<'_>, output: &Value) -> bool {
    if !output.of_image {
        return operation.operator == "Constant";
    }
    let is_batch = |value: &Value| value.sizes.first() == Some(&1);
    let images: Vec<&Value> = operation.inputs().filter(|input| input.of_image).collect();
    if !is_batch(output) || !images.iter().all(|image| is_batch(image)) {
        return false;
    }
    let first_is_image = operation.optional(0).is_some_and(|x| x.of_image);
    match operation.operator {
        "Abs" | "Elu" | "Identity" | "LeakyRelu" | "Neg" | "Relu" | "Sigmoid" | "Softplus" | "Sqrt"
        | "Tanh" | "Cast" | "GlobalAveragePool" | "GlobalMaxPool" => true,
        // A constant with as many sizes as an image begins with the size of the batch.
        "Add" | "Sub" | "Mul" | "Div" => operation.inputs().all(|input| match input.of_image {
            true => input.rank() == output.rank(),
            false => input.rank() < output.rank() || is_batch(input),
        }),
        "Conv"
        | "AveragePool"
        | "MaxPool"
        | "BatchNormalization"
        | "GroupNormalization"
        | "InstanceNormalization" => first_is_image && images.len() == 1,
        "Gemm" => first_is_image && images.len() == 1 && operation.attributes.integer("transA", 0) == Ok(0),
        "MatMul" => {
            first_is_image && images.len() == 1 && operation.input(1).is_ok_and(|weights| weights.rank() == 2)
        }
        "ReduceMean" => operation.integers("axes", 1).ok().flatten().is_some_and(|axes| {
            let is_batch = |axis: i64| images[0].axis(axis) == Ok(0);
            !axes.is_empty() && !axes.into_iter().any(is_batch)
        }),
        "Flatten" => operation.attributes.integer("axis", 1) == Ok(1),
        "Reshape" => {
            let zero_keeps = operation.attributes.integer("allowzero", 0) == Ok(0);
            let keeps = |target: Vec<i64>| match target.first() {
                Some(0) => zero_keeps,
                Some(-1) => zero_keeps || !target.contains(&0),
                _ => false,
            };
            operation.input(1).and_then(Value::integers).is_ok_and(keeps)
        }
        _ => false,
    }
}
