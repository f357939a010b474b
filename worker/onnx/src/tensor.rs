//! Constant tensors, with all elements in the message.

use super::{
    TensorProto,
    tensor_proto::DataLocation,
    value::{Element, Value, product},
};

/// The constant in a tensor.
pub(super) fn constant(tensor: &TensorProto) -> Result<Value, String> {
    if tensor.data_location != DataLocation::Default as i32 || !tensor.external_data.is_empty() {
        return Err(
            "is in another file: import the model where that file is, or save it with its weights inside"
                .to_owned(),
        );
    }
    let sizes = tensor
        .dims
        .iter()
        .map(|&size| usize::try_from(size).map_err(|_| format!("has the size {size}")))
        .collect::<Result<Vec<_>, _>>()?;
    let element = Element::of(tensor.data_type).ok_or_else(|| {
        format!(
            "has elements of type {}, which are neither floats nor whole numbers",
            tensor.data_type
        )
    })?;
    let (held, numbers) = match &tensor.raw_data {
        Some(bytes) => in_bytes(tensor, element, bytes)?,
        None => in_fields(tensor, element),
    };
    if product(&sizes) != held {
        return Err(format!("has the shape {sizes:?} and {held} numbers"));
    }
    Ok(match numbers {
        Some(numbers) => Value::constant(sizes, element, numbers),
        None => Value::new(sizes, element, false),
    })
}

/// The number of elements, and the numbers of all types but half precision.
type Held = (usize, Option<Vec<f64>>);

fn in_bytes(tensor: &TensorProto, element: Element, bytes: &[u8]) -> Result<Held, String> {
    let is_twice = !(tensor.float_data.is_empty()
        && tensor.int32_data.is_empty()
        && tensor.int64_data.is_empty()
        && tensor.double_data.is_empty());
    if is_twice || !bytes.len().is_multiple_of(element.bytes()) {
        return Err("does not hold whole numbers of elements".to_owned());
    }
    let count = bytes.len() / element.bytes();
    if count > Value::MAX_NUMBERS {
        return Ok((count, None));
    }
    let numbers = match element {
        Element::Half => return Ok((count, None)),
        Element::Truth => bytes.iter().map(|&byte| f64::from(byte)).collect(),
        Element::Float => read(bytes, |bytes| f32::from_le_bytes(bytes).into()),
        Element::Integer32 => read(bytes, |bytes| i32::from_le_bytes(bytes).into()),
        Element::Double => read(bytes, f64::from_le_bytes),
        Element::Integer => read(bytes, |bytes| i64::from_le_bytes(bytes) as f64),
    };
    Ok((count, Some(numbers)))
}

fn read<const N: usize>(bytes: &[u8], number: impl Fn([u8; N]) -> f64) -> Vec<f64> {
    bytes
        .as_chunks::<N>()
        .0
        .iter()
        .map(|&bytes| number(bytes))
        .collect()
}

fn in_fields(tensor: &TensorProto, element: Element) -> Held {
    fn numbers<T: Copy>(field: &[T], number: impl Fn(T) -> f64) -> Held {
        (
            field.len(),
            Some(field.iter().map(|&held| number(held)).collect()),
        )
    }
    match element {
        Element::Float => numbers(&tensor.float_data, f64::from),
        Element::Double => numbers(&tensor.double_data, |number| number),
        Element::Integer => numbers(&tensor.int64_data, |number| number as f64),
        Element::Integer32 | Element::Truth => numbers(&tensor.int32_data, f64::from),
        Element::Half => (tensor.int32_data.len(), None),
    }
}
