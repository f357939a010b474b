//! Constant tensors of floats or 64-bit integers, with all numbers in the message.

use super::{
    TensorProto,
    shape::{Value, product},
    tensor_proto::{DataLocation, DataType},
};

/// The constant in a tensor.
pub(super) fn constant(tensor: &TensorProto) -> Result<Value, String> {
    if tensor.data_location != DataLocation::Default as i32 || !tensor.external_data.is_empty() {
        return Err("is in another file: save the model with its weights inside".to_owned());
    }
    let sizes = tensor
        .dims
        .iter()
        .map(|&size| usize::try_from(size).map_err(|_| format!("has the size {size}")))
        .collect::<Result<Vec<_>, _>>()?;
    let integers = match DataType::try_from(tensor.data_type) {
        Ok(DataType::Float) => None,
        Ok(DataType::Int64) => Some(integers(tensor)?),
        _ => return Err("is neither of 32-bit floats nor of 64-bit integers".to_owned()),
    };
    let held = match (&tensor.raw_data, &integers) {
        (_, Some(integers)) => integers.len(),
        (None, None) => tensor.float_data.len(),
        (Some(bytes), None) if bytes.len() % 4 == 0 && tensor.float_data.is_empty() => bytes.len() / 4,
        (Some(_), None) => return Err("does not hold whole numbers of floats".to_owned()),
    };
    if product(&sizes) != held {
        return Err(format!("has the shape {sizes:?} and {held} numbers"));
    }
    Ok(Value::Constant { sizes, integers })
}

fn integers(tensor: &TensorProto) -> Result<Vec<i64>, String> {
    let Some(bytes) = &tensor.raw_data else {
        return Ok(tensor.int64_data.clone());
    };
    let (integers, rest) = bytes.as_chunks::<8>();
    if !rest.is_empty() || !tensor.int64_data.is_empty() {
        return Err("does not hold whole numbers of integers".to_owned());
    }
    Ok(integers.iter().map(|bytes| i64::from_le_bytes(*bytes)).collect())
}
