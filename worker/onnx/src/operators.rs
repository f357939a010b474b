//! The operators that an embedder may use, and the shapes of their outputs.
//!
//! No operator mixes the images of a batch, reads anything outside the model, or keeps state between runs.

use super::{
    AttributeProto, NodeProto,
    attribute_proto::AttributeType,
    budget::Budget,
    shape::{Value, Window, broadcast, product, reduce, reshape, slide},
    tensor,
    tensor_proto::DataType,
};

/// Every operator that [`output`] accepts, for error messages.
const ALLOWED: &str = "Abs, Add, AveragePool, BatchNormalization, Cast, Constant, Conv, Div, Elu, Flatten, Gemm, \
    GlobalAveragePool, GlobalMaxPool, GroupNormalization, Identity, InstanceNormalization, LeakyRelu, MatMul, MaxPool, \
    Mul, Neg, ReduceMean, Relu, Reshape, Sigmoid, Softplus, Sqrt, Sub, Tanh";

/// The output of `node` for `inputs`. Subtracts the node's cost from `budget`.
pub(super) fn output(node: &NodeProto, inputs: &[&Value], budget: &mut Budget) -> Result<Value, String> {
    let attributes = Attributes(&node.attribute);
    match (node.op_type.as_str(), inputs) {
        ("Constant", []) => constant(&node.attribute),
        (
            "Abs" | "Elu" | "Identity" | "LeakyRelu" | "Neg" | "Relu" | "Sigmoid" | "Softplus" | "Sqrt"
            | "Tanh",
            [x],
        ) => floats(x),
        ("Cast", [x]) => match attributes.integer("to", 0)? {
            to if to == i64::from(DataType::Float as i32) => floats(x),
            to => Err(format!("it casts to type {to}: only floats are allowed")),
        },
        ("Add" | "Sub" | "Mul" | "Div", [a, b]) => broadcast(a, b),
        ("Conv", [x, weights, bias @ ..]) if bias.len() <= 1 => {
            convolution(attributes, x, weights, bias, budget)
        }
        ("AveragePool" | "MaxPool", [x]) => pooling(attributes, x, budget),
        ("GlobalAveragePool" | "GlobalMaxPool", [x]) => {
            let [channels, _, _] = image(x)?;
            Ok(Value::Batched(vec![channels, 1, 1]))
        }
        ("BatchNormalization", [x, parameters @ ..]) if parameters.len() == 4 => {
            normalised(attributes, x, parameters)
        }
        ("GroupNormalization" | "InstanceNormalization", [x, parameters @ ..]) if parameters.len() == 2 => {
            normalised(attributes, x, parameters)
        }
        ("Gemm", [x, weights, bias @ ..]) if bias.len() <= 1 => dense(attributes, x, weights, bias, budget),
        ("MatMul", [x, weights]) => product_with(x.batched()?, weights.floats()?, budget),
        // The axes became an input with version 18 of the operators.
        ("ReduceMean", [x]) => mean(attributes, x, attributes.integers("axes")?),
        ("ReduceMean", [x, axes]) => mean(attributes, x, axes.integers()?),
        ("Flatten", [x]) => match attributes.integer("axis", 1)? {
            1 => Ok(Value::Batched(vec![product(x.batched()?)])),
            axis => Err(format!(
                "it flattens from axis {axis}, which does not keep the batch"
            )),
        },
        ("Reshape", [x, target]) => match attributes.integer("allowzero", 0)? {
            0 => reshape(x.batched()?, target.integers()?).map(Value::Batched),
            _ => Err("allowzero is not allowed".to_owned()),
        },
        (operator, _) if ALLOWED.split(", ").any(|allowed| allowed == operator) => {
            Err(format!("it cannot have {} inputs here", inputs.len()))
        }
        _ => Err(format!("this operator is not allowed, only {ALLOWED}")),
    }
}

/// A value of floats with the shape of `x`.
fn floats(x: &Value) -> Result<Value, String> {
    if let Value::Constant { .. } = x {
        x.floats()?;
    }
    Ok(x.clone())
}

fn constant(attributes: &[AttributeProto]) -> Result<Value, String> {
    let [value] = attributes else {
        return Err("it must have one attribute".to_owned());
    };
    let floats = |sizes| Value::Constant {
        sizes,
        integers: None,
    };
    match (value.name.as_str(), value.r#type(), &value.t) {
        ("value", AttributeType::Tensor, Some(held)) => {
            tensor::constant(held).map_err(|problem| format!("it {problem}"))
        }
        ("value_float", AttributeType::Float, _) => Ok(floats(Vec::new())),
        ("value_floats", AttributeType::Floats, _) => Ok(floats(vec![value.floats.len()])),
        ("value_int", AttributeType::Int, _) => Ok(Value::Constant {
            sizes: Vec::new(),
            integers: Some(vec![value.i]),
        }),
        ("value_ints", AttributeType::Ints, _) => Ok(Value::Constant {
            sizes: vec![value.ints.len()],
            integers: Some(value.ints.clone()),
        }),
        (name, _, _) => Err(format!("a constant {name:?} is not allowed")),
    }
}

/// Channels, height and width of the images `x`.
fn image(x: &Value) -> Result<[usize; 3], String> {
    let sizes = x.batched()?;
    <[usize; 3]>::try_from(sizes).map_err(|_| format!("it takes {sizes:?}, not channels x height x width"))
}

fn convolution(
    attributes: Attributes<'_>,
    x: &Value,
    weights: &Value,
    bias: &[&Value],
    budget: &mut Budget,
) -> Result<Value, String> {
    let [channels, height, width] = image(x)?;
    let sizes = weights.floats()?;
    let &[filters, depth, kernel_height, kernel_width] = sizes else {
        return Err(format!("its weights have the shape {sizes:?}, not 4 sizes"));
    };
    let groups = usize::try_from(attributes.integer("group", 1)?).unwrap_or(0);
    if groups == 0 || depth.checked_mul(groups) != Some(channels) || !filters.is_multiple_of(groups) {
        return Err(format!(
            "weights of {sizes:?} in {groups} groups do not fit {channels} channels"
        ));
    }
    for bias in bias {
        if bias.floats()? != [filters] {
            return Err(format!(
                "its bias is not one number for each of {filters} filters"
            ));
        }
    }
    let kernel = [kernel_height, kernel_width];
    if attributes
        .pair("kernel_shape")?
        .is_some_and(|stated| stated != kernel)
    {
        return Err("its kernel_shape differs from the shape of its weights".to_owned());
    }
    let [height, width] = slid(attributes, [height, width], kernel, false)?;
    let made = [filters, height, width];
    budget.pay(&[product(&made), depth, kernel_height, kernel_width])?;
    Ok(Value::Batched(made.to_vec()))
}

fn pooling(attributes: Attributes<'_>, x: &Value, budget: &mut Budget) -> Result<Value, String> {
    let [channels, height, width] = image(x)?;
    let kernel = attributes.pair("kernel_shape")?.ok_or("it has no kernel_shape")?;
    let round_up = attributes.integer("ceil_mode", 0)? != 0;
    let [height, width] = slid(attributes, [height, width], kernel, round_up)?;
    budget.pay(&[channels, height, width, kernel[0], kernel[1]])?;
    Ok(Value::Batched(vec![channels, height, width]))
}

/// Sizes of an image after a window of `kernel` has slid over it, according to the attributes.
fn slid(
    attributes: Attributes<'_>,
    sizes: [usize; 2],
    kernel: [usize; 2],
    round_up: bool,
) -> Result<[usize; 2], String> {
    if attributes
        .find("auto_pad")
        .is_some_and(|padding| padding.s != b"NOTSET")
    {
        return Err("auto_pad is not allowed: state the padding".to_owned());
    }
    let strides = attributes.pair("strides")?.unwrap_or([1; 2]);
    let dilations = attributes.pair("dilations")?.unwrap_or([1; 2]);
    let pads = attributes.list::<4>("pads", 0)?.unwrap_or([0; 4]);
    let along = |axis: usize| {
        let window = Window {
            kernel: kernel[axis],
            stride: strides[axis],
            dilation: dilations[axis],
            before: pads[axis],
            after: pads[axis + 2],
        };
        slide(sizes[axis], &window, round_up)
            .filter(|&places| places > 0)
            .ok_or_else(|| format!("a window {window:?} does not fit into {} pixels", sizes[axis]))
    };
    Ok([along(0)?, along(1)?])
}

fn normalised(attributes: Attributes<'_>, x: &Value, parameters: &[&Value]) -> Result<Value, String> {
    if attributes.integer("training_mode", 0)? != 0 {
        return Err("it is in training mode".to_owned());
    }
    let sizes = x.batched()?;
    let groups = usize::try_from(attributes.integer("num_groups", 1)?).unwrap_or(0);
    let channels = *sizes.first().ok_or("it has no channels")?;
    if groups == 0 || !channels.is_multiple_of(groups) {
        return Err(format!("{channels} channels do not make {groups} groups"));
    }
    for parameter in parameters {
        let sizes = parameter.floats()?;
        // Before version 21 of the operators, a group normalisation has one parameter per group.
        if sizes != [channels] && sizes != [groups] {
            return Err(format!(
                "its parameters are of shape {sizes:?} for {channels} channels"
            ));
        }
    }
    Ok(Value::Batched(sizes.to_vec()))
}

fn mean(attributes: Attributes<'_>, x: &Value, axes: &[i64]) -> Result<Value, String> {
    let keeps = attributes.integer("keepdims", 1)? != 0;
    reduce(x.batched()?, axes, keeps).map(Value::Batched)
}

fn dense(
    attributes: Attributes<'_>,
    x: &Value,
    weights: &Value,
    bias: &[&Value],
    budget: &mut Budget,
) -> Result<Value, String> {
    if attributes.integer("transA", 0)? != 0 {
        return Err("it transposes the batch".to_owned());
    }
    let sizes = weights.floats()?;
    let &[rows, columns] = sizes else {
        return Err(format!("its weights have the shape {sizes:?}, not 2 sizes"));
    };
    let sizes = if attributes.integer("transB", 0)? == 0 {
        [rows, columns]
    } else {
        [columns, rows]
    };
    let x = x.batched()?;
    if x.len() != 1 {
        return Err(format!("it takes images of {x:?}, not rows"));
    }
    let made = product_with(x, &sizes, budget)?;
    match bias {
        [bias] if broadcast(&made, bias)? != made => Err("its bias does not fit".to_owned()),
        _ => Ok(made),
    }
}

/// Product of the rows of `x` and a matrix of `weights`.
fn product_with(x: &[usize], weights: &[usize], budget: &mut Budget) -> Result<Value, String> {
    match (x, weights) {
        ([outer @ .., inner], [rows, columns]) if inner == rows => {
            let made = [outer, &[*columns]].concat();
            budget.pay(&[product(&made), *inner])?;
            Ok(Value::Batched(made))
        }
        _ => Err(format!("weights of shape {weights:?} do not fit {x:?}")),
    }
}

/// A node's parameters by name.
#[derive(Clone, Copy)]
struct Attributes<'a>(&'a [AttributeProto]);

impl<'a> Attributes<'a> {
    fn find(self, name: &str) -> Option<&'a AttributeProto> {
        self.0.iter().find(|attribute| attribute.name == name)
    }

    fn integer(self, name: &str, default: i64) -> Result<i64, String> {
        match self.find(name) {
            None => Ok(default),
            Some(attribute) if attribute.r#type() == AttributeType::Int => Ok(attribute.i),
            Some(_) => Err(format!("{name} is not a whole number")),
        }
    }

    /// The attribute `name` as a list of whole numbers; empty if the node has no such attribute.
    fn integers(self, name: &str) -> Result<&'a [i64], String> {
        match self.find(name) {
            None => Ok(&[]),
            Some(attribute) if attribute.r#type() == AttributeType::Ints => Ok(&attribute.ints),
            Some(_) => Err(format!("{name} is not a list of whole numbers")),
        }
    }

    /// The attribute `name` as `N` sizes from `least` to 1000; `None` if the node has no such attribute.
    fn list<const N: usize>(self, name: &str, least: usize) -> Result<Option<[usize; N]>, String> {
        let Some(attribute) = self.find(name) else {
            return Ok(None);
        };
        let sizes = attribute
            .ints
            .iter()
            .map(|&size| usize::try_from(size).unwrap_or(usize::MAX));
        let sizes: Vec<usize> = sizes.filter(|size| (least..=1000).contains(size)).collect();
        let refused = || {
            format!(
                "{name} = {:?}: must be {N} numbers from {least} to 1000",
                attribute.ints
            )
        };
        if sizes.len() != attribute.ints.len() || attribute.r#type() != AttributeType::Ints {
            return Err(refused());
        }
        <[usize; N]>::try_from(sizes).map(Some).map_err(|_| refused())
    }

    fn pair(self, name: &str) -> Result<Option<[usize; 2]>, String> {
        self.list(name, 1)
    }
}
