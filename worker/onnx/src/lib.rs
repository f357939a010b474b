//! The protobuf messages of an ONNX model file that an embedder needs (`onnx.proto`).

mod attributes;
mod batches;
mod budget;
mod embedder_model;
mod image_shape;
mod limits;
mod operators;
mod shape;
mod tensor;
mod value;
mod weights;

pub use embedder_model::{EmbedderModel, ModelError};
pub use image_shape::ImageShape;
pub use limits::{
    EMBEDDING_DIMENSIONS, IMAGE_SIDES, MAX_ELEMENTS, MAX_MODEL_BYTES, MAX_NODES, MAX_PRODUCTS,
    MAX_VALUE_ELEMENTS,
};
pub use weights::with_weights;

/// The generated messages of the package `onnx`.
#[allow(missing_docs, clippy::all)]
mod messages {
    include!(concat!(env!("OUT_DIR"), "/onnx.rs"));
}

pub use messages::*;

use attribute_proto::AttributeType;
use tensor_proto::DataType;
use tensor_shape_proto::{Dimension, dimension::Value};

impl TensorProto {
    /// A tensor of floats under `name`; the product of `dims` must be the number of `values`.
    #[must_use]
    pub fn floats(name: impl Into<String>, dims: &[usize], values: &[f32]) -> Self {
        let bytes = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        Self::raw(name.into(), DataType::Float, dims, bytes)
    }

    /// A tensor that lists whole numbers, under `name`.
    #[must_use]
    pub fn integers(name: impl Into<String>, values: &[i64]) -> Self {
        let bytes = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        Self::raw(name.into(), DataType::Int64, &[values.len()], bytes)
    }

    fn raw(name: String, data_type: DataType, dims: &[usize], bytes: Vec<u8>) -> Self {
        Self {
            name,
            data_type: data_type as i32,
            dims: dims.iter().map(|&size| size as i64).collect(),
            raw_data: Some(bytes),
            ..Self::default()
        }
    }
}

impl AttributeProto {
    /// An attribute with a whole number.
    #[must_use]
    pub fn integer(name: &str, value: i64) -> Self {
        Self {
            i: value,
            ..Self::of(name, AttributeType::Int)
        }
    }

    /// An attribute with a real number.
    #[must_use]
    pub fn float(name: &str, value: f32) -> Self {
        Self {
            f: value,
            ..Self::of(name, AttributeType::Float)
        }
    }

    /// An attribute with a list of whole numbers.
    #[must_use]
    pub fn integers(name: &str, values: &[usize]) -> Self {
        Self {
            ints: values.iter().map(|&value| value as i64).collect(),
            ..Self::of(name, AttributeType::Ints)
        }
    }

    fn of(name: &str, attribute_type: AttributeType) -> Self {
        Self {
            name: name.to_owned(),
            r#type: attribute_type as i32,
            ..Self::default()
        }
    }
}

impl ValueInfoProto {
    /// A tensor of floats whose first dimension, the batch, is open; `sizes` are the other dimensions.
    #[must_use]
    pub fn batch_of_floats(name: &str, batch: &str, sizes: &[usize]) -> Self {
        let open = Value::DimParam(batch.to_owned());
        let known = sizes.iter().map(|&size| Value::DimValue(size as i64));
        let dimensions = std::iter::once(open).chain(known);
        let tensor = type_proto::Tensor {
            elem_type: DataType::Float as i32,
            shape: Some(TensorShapeProto {
                dim: dimensions.map(|value| Dimension { value: Some(value) }).collect(),
            }),
        };
        Self {
            name: name.to_owned(),
            r#type: Some(TypeProto {
                tensor_type: Some(tensor),
            }),
        }
    }
}

#[cfg(test)]
mod tests;
