//! The operators that an embedder may use, and the shapes of their outputs for one image.
//!
//! No operator here reads anything outside the model, keeps state between runs, draws random numbers, or makes a value whose shape
//! depends on the image.

mod layout;
mod normalisation;
mod products;
mod windows;

use super::{
    NodeProto,
    attribute_proto::AttributeType,
    attributes::Attributes,
    budget::Budget,
    shape::{broadcast, reduce},
    tensor,
    value::{Element, Value},
};

/// Operators that map each number by itself.
const OF_ONE: &[&str] = &[
    "Abs",
    "Ceil",
    "Celu",
    "Clip",
    "Cos",
    "Elu",
    "Erf",
    "Exp",
    "Floor",
    "Gelu",
    "HardSigmoid",
    "HardSwish",
    "Identity",
    "LeakyRelu",
    "Log",
    "Mish",
    "Neg",
    "Reciprocal",
    "Relu",
    "Round",
    "Selu",
    "Sigmoid",
    "Sign",
    "Sin",
    "Softplus",
    "Softsign",
    "Sqrt",
    "Swish",
    "Tanh",
    "ThresholdedRelu",
];
/// Operators that combine the numbers at the same place of several values.
const OF_SEVERAL: &[&str] = &[
    "Add",
    "And",
    "Div",
    "Equal",
    "Greater",
    "GreaterOrEqual",
    "Less",
    "LessOrEqual",
    "Max",
    "Mean",
    "Min",
    "Mod",
    "Mul",
    "Or",
    "PRelu",
    "Pow",
    "Sub",
    "Sum",
    "Where",
];
/// Operators that reduce axes to one number.
const REDUCTIONS: &[&str] = &[
    "ReduceL1",
    "ReduceL2",
    "ReduceLogSum",
    "ReduceLogSumExp",
    "ReduceMax",
    "ReduceMean",
    "ReduceMin",
    "ReduceProd",
    "ReduceSum",
    "ReduceSumSquare",
];
/// All other operators of [`outputs`].
const OTHERS: &[&str] = &[
    "Attention",
    "AveragePool",
    "BatchNormalization",
    "Cast",
    "CastLike",
    "Concat",
    "Constant",
    "ConstantOfShape",
    "Conv",
    "DepthToSpace",
    "Dropout",
    "Expand",
    "Flatten",
    "Gather",
    "Gemm",
    "GlobalAveragePool",
    "GlobalLpPool",
    "GlobalMaxPool",
    "GroupNormalization",
    "InstanceNormalization",
    "LRN",
    "LayerNormalization",
    "LogSoftmax",
    "LpNormalization",
    "LpPool",
    "MatMul",
    "MaxPool",
    "Not",
    "Pad",
    "RMSNormalization",
    "Range",
    "Reshape",
    "Resize",
    "Shape",
    "Size",
    "Slice",
    "Softmax",
    "SpaceToDepth",
    "Split",
    "Squeeze",
    "Tile",
    "Transpose",
    "Unsqueeze",
];

/// Error text for an operator that is in none of these lists.
const NOT_ALLOWED: &str =
    "this operator is not among those that an embedder may use (docs/embedders.md lists them)";

/// A node with its inputs.
pub(super) struct Operation<'a> {
    pub(super) operator: &'a str,
    pub(super) attributes: Attributes<'a>,
    /// `None` for an optional input that is left out.
    inputs: Vec<Option<&'a Value>>,
    /// Number of outputs that other nodes can use.
    outputs: usize,
    /// Version of the operators.
    opset: i64,
}

impl<'a> Operation<'a> {
    pub(super) fn new(node: &'a NodeProto, inputs: Vec<Option<&'a Value>>, opset: i64) -> Self {
        Self {
            operator: &node.op_type,
            attributes: Attributes(&node.attribute),
            inputs,
            outputs: node.output.len(),
            opset,
        }
    }

    /// All inputs that are not left out.
    pub(super) fn inputs(&self) -> impl Iterator<Item = &'a Value> + use<'_, 'a> {
        self.inputs.iter().copied().flatten()
    }

    pub(super) fn optional(&self, place: usize) -> Option<&'a Value> {
        self.inputs.get(place).copied().flatten()
    }

    pub(super) fn input(&self, place: usize) -> Result<&'a Value, String> {
        let missing = || format!("it has no input {place}");
        self.optional(place).ok_or_else(missing)
    }

    /// The first input, if it is of real numbers.
    pub(super) fn x(&self) -> Result<&'a Value, String> {
        self.input(0)?.real()
    }

    /// A value of `sizes` with the first input's type.
    pub(super) fn like_x(&self, sizes: Vec<usize>) -> Result<Value, String> {
        Ok(Value::new(sizes, self.input(0)?.element, self.is_of_image()))
    }

    /// Whole numbers that are an attribute in older versions of an operator and an input in newer ones; `None` if neither is there.
    pub(super) fn integers(&self, name: &str, place: usize) -> Result<Option<Vec<i64>>, String> {
        match self.optional(place) {
            Some(input) => input.integers().map(Some),
            None => Ok(self.attributes.integers(name)?.map(<[i64]>::to_vec)),
        }
    }

    fn is_of_image(&self) -> bool {
        self.inputs().any(|input| input.of_image)
    }

    fn expect_inputs(&self, least: usize, most: usize) -> Result<(), String> {
        let given = self.inputs.len();
        match (least..=most).contains(&given) && self.inputs().take(least).count() == least {
            true => Ok(()),
            false => Err(format!("it cannot have {given} inputs here")),
        }
    }
}

/// The outputs of an operation. Subtracts the operation's cost from `budget`.
pub(super) fn outputs(operation: &Operation<'_>, budget: &mut Budget) -> Result<Vec<Value>, String> {
    if operation.operator == "Split" {
        return layout::split(operation);
    }
    output(operation, budget).map(|output| vec![output])
}

fn output(operation: &Operation<'_>, budget: &mut Budget) -> Result<Value, String> {
    let operator = operation.operator;
    let (least, most) = match operator {
        "Constant" => (0, 0),
        "Clip" | "Dropout" => (1, 3),
        "Where" | "Range" => (3, 3),
        "Max" | "Mean" | "Min" | "Sum" | "Concat" => (1, usize::MAX),
        "Conv" | "Gemm" | "InstanceNormalization" | "GroupNormalization" => (2, 3),
        "LayerNormalization" => (2, 3),
        "BatchNormalization" => (5, 5),
        "Attention" => (3, 4),
        "Pad" | "Resize" => (1, 4),
        "Slice" => (1, 5),
        "Reshape" | "Expand" | "Tile" | "Gather" | "MatMul" | "CastLike" | "RMSNormalization" => (2, 2),
        "Squeeze" | "Unsqueeze" => (1, 2),
        _ if OF_SEVERAL.contains(&operator) => (2, 2),
        _ if REDUCTIONS.contains(&operator) => (1, 2),
        _ if OF_ONE.contains(&operator) || OTHERS.contains(&operator) => (1, 1),
        _ => return Err(NOT_ALLOWED.to_owned()),
    };
    operation.expect_inputs(least, most)?;
    match operator {
        "Constant" => constant(operation),
        "Cast" => cast(operation),
        "CastLike" => Ok(operation.input(0)?.cast(operation.input(1)?.element)),
        "Not" => Ok(operation.input(0)?.with(operation.input(0)?.sizes.clone(), None)),
        "Dropout" => dropout(operation),
        "Conv" => windows::convolution(operation, budget),
        "AveragePool" | "LpPool" | "MaxPool" => windows::pooling(operation, budget),
        "GlobalAveragePool" | "GlobalLpPool" | "GlobalMaxPool" => {
            let [channels, _, _] = windows::image(operation.x()?)?;
            operation.like_x(vec![1, channels, 1, 1])
        }
        "BatchNormalization" | "GroupNormalization" | "InstanceNormalization" => {
            normalisation::by_channel(operation)
        }
        "LRN" => windows::image(operation.x()?).and_then(|_| operation.like_x(operation.x()?.sizes.clone())),
        "LayerNormalization" | "RMSNormalization" => normalisation::by_layer(operation),
        "LpNormalization" | "Softmax" | "LogSoftmax" => normalisation::along_axis(operation),
        "Gemm" => products::dense(operation, budget),
        "MatMul" => products::matrices(operation, budget),
        "Attention" => products::attention(operation, budget),
        _ if REDUCTIONS.contains(&operator) => reduction(operation),
        _ if OF_ONE.contains(&operator) => of_one(operation),
        _ if OF_SEVERAL.contains(&operator) => of_several(operation),
        _ => layout::output(operation),
    }
}

fn of_one(operation: &Operation<'_>) -> Result<Value, String> {
    let x = operation.input(0)?;
    if operation
        .inputs()
        .skip(1)
        .any(|bound| bound.elements() != 1 || bound.of_image)
    {
        return Err("its bounds must be single constants".to_owned());
    }
    let mapped = |map: fn(f64) -> f64| {
        let numbers = x.exact()?.into_iter();
        numbers.map(|number| x.element.held(map(number))).collect()
    };
    let numbers = match operation.operator {
        // A number may be beyond what is exact, such as the end of a slice.
        "Identity" => x.numbers().map(<[f64]>::to_vec),
        "Neg" => mapped(|number| -number),
        "Floor" => mapped(f64::floor),
        "Ceil" => mapped(f64::ceil),
        _ => None,
    };
    Ok(x.with(x.sizes.clone(), numbers))
}

fn of_several(operation: &Operation<'_>) -> Result<Value, String> {
    let mut sizes = Vec::new();
    for input in operation.inputs() {
        sizes = broadcast(&sizes, &input.sizes)?;
    }
    let values: Vec<&Value> = operation.inputs().collect();
    if operation.operator == "PRelu" && sizes != values[0].sizes {
        return Err("its slopes do not fit".to_owned());
    }
    let element = match operation.operator {
        "And" | "Equal" | "Greater" | "GreaterOrEqual" | "Less" | "LessOrEqual" | "Or" => Element::Truth,
        "Where" => values[1].element,
        _ => values[0].element,
    };
    let value = Value::new(sizes.clone(), element, operation.is_of_image());
    let numbers = combined(operation.operator, element, &values);
    Ok(value.with(sizes, numbers))
}

/// The numbers of an operation on constants; `None` if an input is unknown or no model computes shapes in this way.
fn combined(operator: &str, element: Element, values: &[&Value]) -> Option<Vec<f64>> {
    let numbers: Vec<Vec<f64>> = values.iter().map(|value| value.exact()).collect::<Option<_>>()?;
    let count = numbers.iter().map(Vec::len).max()?;
    if numbers.iter().any(|numbers| ![1, count].contains(&numbers.len())) {
        return None;
    }
    let compute = |at: usize| {
        let operand = |place: usize| numbers.get(place).map(|numbers| numbers[at % numbers.len()]);
        let (a, b) = (operand(0)?, operand(1)?);
        element.held(match operator {
            "Add" => a + b,
            "Sub" => a - b,
            "Mul" => a * b,
            "Div" if element.is_whole() => (b != 0.0).then(|| (a / b).trunc())?,
            "Div" => a / b,
            // The remainder has the sign of the divisor.
            "Mod" if element.is_whole() => (b != 0.0).then(|| a - b * (a / b).floor())?,
            "Equal" => f64::from(a == b),
            "Max" if numbers.len() == 2 => a.max(b),
            "Min" if numbers.len() == 2 => a.min(b),
            "Where" => {
                if a == 0.0 {
                    operand(2)?
                } else {
                    b
                }
            }
            _ => return None,
        })
    };
    (0..count).map(compute).collect()
}

fn reduction(operation: &Operation<'_>) -> Result<Value, String> {
    let x = operation.input(0)?;
    let keeps = operation.attributes.integer("keepdims", 1)? != 0;
    let axes = operation.integers("axes", 1)?.unwrap_or_default();
    if axes.is_empty() && operation.attributes.integer("noop_with_empty_axes", 0)? != 0 {
        return Ok(x.clone());
    }
    let all: Vec<i64> = (0..x.rank() as i64).collect();
    let sizes = reduce(&x.sizes, if axes.is_empty() { &all } else { &axes }, keeps)?;
    let is_product = operation.operator == "ReduceProd" && x.rank() == 1 && x.element.is_whole();
    let numbers = x.exact().filter(|_| is_product);
    let product = numbers.and_then(|numbers| x.element.held(numbers.iter().product()));
    Ok(x.with(sizes, product.map(|product| vec![product])))
}

fn cast(operation: &Operation<'_>) -> Result<Value, String> {
    let to = operation.attributes.integer("to", 0)?;
    let element = i32::try_from(to).ok().and_then(Element::of);
    let element = element.ok_or_else(|| format!("it casts to type {to}, which is not allowed"))?;
    Ok(operation.input(0)?.cast(element))
}

fn dropout(operation: &Operation<'_>) -> Result<Value, String> {
    let trains = operation.optional(2).map(Value::numbers);
    match trains {
        None | Some(Some([0.0])) => Ok(operation.x()?.clone()),
        Some(_) => Err("it is in training mode".to_owned()),
    }
}

fn constant(operation: &Operation<'_>) -> Result<Value, String> {
    let [value] = operation.attributes.0 else {
        return Err("it must have one attribute".to_owned());
    };
    let reals = |numbers: &[f32]| numbers.iter().copied().map(f64::from).collect::<Vec<_>>();
    let wholes = |numbers: &[i64]| numbers.iter().map(|&number| number as f64).collect::<Vec<_>>();
    match (value.name.as_str(), value.r#type(), &value.t) {
        ("value", AttributeType::Tensor, Some(held)) => {
            tensor::constant(held).map_err(|problem| format!("it {problem}"))
        }
        ("value_float", AttributeType::Float, _) => {
            Ok(Value::constant(Vec::new(), Element::Float, reals(&[value.f])))
        }
        ("value_floats", AttributeType::Floats, _) => Ok(Value::constant(
            vec![value.floats.len()],
            Element::Float,
            reals(&value.floats),
        )),
        ("value_int", AttributeType::Int, _) => {
            Ok(Value::constant(Vec::new(), Element::Integer, wholes(&[value.i])))
        }
        ("value_ints", AttributeType::Ints, _) => Ok(Value::constant(
            vec![value.ints.len()],
            Element::Integer,
            wholes(&value.ints),
        )),
        (name, _, _) => Err(format!("a constant {name:?} is not allowed")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_documentation_lists_all_operators() {
        let mut names = [OF_ONE, OF_SEVERAL, REDUCTIONS, OTHERS].concat();
        names.sort_unstable();
        let documented = include_str!("../../../docs/embedders.md");
        let (_, list) = documented.split_once("<!-- operators -->\n").unwrap();
        let (list, _) = list.split_once("\n\n").unwrap();
        let listed: Vec<&str> = list
            .split([',', '\n', '`', ' '])
            .filter(|name| !name.is_empty())
            .collect();
        assert_eq!(listed, names);
    }
}
