//! The messages of an ONNX model file, as far as an embedder needs them.
//!
//! The field numbers are those of the ONNX format (`onnx.proto`, IR version 10 and before). Fields that are not
//! declared here are skipped when a file is read; content that a reader only needs to detect (subgraphs, functions, sparse
//! tensors) is kept as undecoded bytes.

mod budget;
mod embedder_model;
mod image_shape;
mod limits;
mod operators;
mod shape;
mod tensor;
mod wire;

pub use embedder_model::{EmbedderModel, ModelError};
pub use image_shape::ImageShape;
pub use limits::{
    EMBEDDING_DIMENSIONS, IMAGE_SIDES, MAX_ELEMENTS, MAX_MODEL_BYTES, MAX_NODES, MAX_PRODUCTS,
    MAX_VALUE_ELEMENTS,
};

use prost::Message;

/// A model file: one graph and the operator sets that it is written in.
#[derive(Clone, PartialEq, Message)]
pub struct ModelProto {
    /// Version of the format, 1 to 13 so far.
    #[prost(int64, tag = "1")]
    pub ir_version: i64,
    /// The program that wrote the file.
    #[prost(string, tag = "2")]
    pub producer_name: String,
    /// Its version.
    #[prost(string, tag = "3")]
    pub producer_version: String,
    /// The computation.
    #[prost(message, optional, tag = "7")]
    pub graph: Option<GraphProto>,
    /// Versions of the operator sets of the nodes.
    #[prost(message, repeated, tag = "8")]
    pub opset_import: Vec<OperatorSetIdProto>,
    /// Remarks by key.
    #[prost(message, repeated, tag = "14")]
    pub metadata_props: Vec<StringStringEntryProto>,
    /// Operators that the file itself defines (not decoded).
    #[prost(bytes = "vec", repeated, tag = "25")]
    pub functions: Vec<Vec<u8>>,
}

/// An operator set and its version.
#[derive(Clone, PartialEq, Eq, Message)]
pub struct OperatorSetIdProto {
    /// Empty for the standard operators.
    #[prost(string, tag = "1")]
    pub domain: String,
    /// The opset.
    #[prost(int64, tag = "2")]
    pub version: i64,
}

/// A remark.
#[derive(Clone, PartialEq, Eq, Message)]
pub struct StringStringEntryProto {
    /// Its key.
    #[prost(string, tag = "1")]
    pub key: String,
    /// Its text.
    #[prost(string, tag = "2")]
    pub value: String,
}

/// A graph of nodes, in an order in which they can be computed.
#[derive(Clone, PartialEq, Message)]
pub struct GraphProto {
    /// The operations.
    #[prost(message, repeated, tag = "1")]
    pub node: Vec<NodeProto>,
    /// The graph's name; must not be empty.
    #[prost(string, tag = "2")]
    pub name: String,
    /// Constants, mostly weights.
    #[prost(message, repeated, tag = "5")]
    pub initializer: Vec<TensorProto>,
    /// The inputs (files of IR version 3 and before list the initialisers here too).
    #[prost(message, repeated, tag = "11")]
    pub input: Vec<ValueInfoProto>,
    /// The outputs.
    #[prost(message, repeated, tag = "12")]
    pub output: Vec<ValueInfoProto>,
    /// Types of values in between; may be incomplete.
    #[prost(message, repeated, tag = "13")]
    pub value_info: Vec<ValueInfoProto>,
    /// Sparse constants (not decoded).
    #[prost(bytes = "vec", repeated, tag = "15")]
    pub sparse_initializer: Vec<Vec<u8>>,
}

/// One operation.
#[derive(Clone, PartialEq, Message)]
pub struct NodeProto {
    /// Names of the inputs; an empty name is an omitted optional input.
    #[prost(string, repeated, tag = "1")]
    pub input: Vec<String>,
    /// Names of the outputs.
    #[prost(string, repeated, tag = "2")]
    pub output: Vec<String>,
    /// The node's own name; may be empty.
    #[prost(string, tag = "3")]
    pub name: String,
    /// The operator, such as `Conv`.
    #[prost(string, tag = "4")]
    pub op_type: String,
    /// Its parameters.
    #[prost(message, repeated, tag = "5")]
    pub attribute: Vec<AttributeProto>,
    /// The operator's set; empty for the standard operators.
    #[prost(string, tag = "7")]
    pub domain: String,
}

/// A named parameter of an operation; `type` says which field holds its value.
#[derive(Clone, PartialEq, Message)]
pub struct AttributeProto {
    /// The parameter's name.
    #[prost(string, tag = "1")]
    pub name: String,
    /// A real number.
    #[prost(float, tag = "2")]
    pub f: f32,
    /// A whole number.
    #[prost(int64, tag = "3")]
    pub i: i64,
    /// Text, UTF-8.
    #[prost(bytes = "vec", tag = "4")]
    pub s: Vec<u8>,
    /// A tensor.
    #[prost(message, optional, tag = "5")]
    pub t: Option<TensorProto>,
    /// A subgraph (not decoded).
    #[prost(bytes = "vec", optional, tag = "6")]
    pub g: Option<Vec<u8>>,
    /// Real numbers.
    #[prost(float, repeated, tag = "7")]
    pub floats: Vec<f32>,
    /// Whole numbers.
    #[prost(int64, repeated, tag = "8")]
    pub ints: Vec<i64>,
    /// Texts, UTF-8.
    #[prost(bytes = "vec", repeated, tag = "9")]
    pub strings: Vec<Vec<u8>>,
    /// Subgraphs (not decoded).
    #[prost(bytes = "vec", repeated, tag = "11")]
    pub graphs: Vec<Vec<u8>>,
    /// Which field holds the value.
    #[prost(enumeration = "AttributeType", tag = "20")]
    pub r#type: i32,
}

/// Which field of an [`AttributeProto`] holds its value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, prost::Enumeration)]
#[repr(i32)]
pub enum AttributeType {
    /// None.
    Undefined = 0,
    /// `f`.
    Float = 1,
    /// `i`.
    Int = 2,
    /// `s`.
    String = 3,
    /// `t`.
    Tensor = 4,
    /// `g`.
    Graph = 5,
    /// `floats`.
    Floats = 6,
    /// `ints`.
    Ints = 7,
    /// `strings`.
    Strings = 8,
    /// `tensors` (not declared).
    Tensors = 9,
    /// `graphs`.
    Graphs = 10,
    /// `sparse_tensor` (not declared).
    SparseTensor = 11,
    /// `sparse_tensors` (not declared).
    SparseTensors = 12,
    /// `tp` (not declared).
    TypeProto = 13,
    /// `type_protos` (not declared).
    TypeProtos = 14,
}

/// A constant tensor. Its values are in `raw_data` (little-endian) or in the field of its type, or in another
/// file.
#[derive(Clone, PartialEq, Message)]
pub struct TensorProto {
    /// Its shape; empty for a scalar.
    #[prost(int64, repeated, tag = "1")]
    pub dims: Vec<i64>,
    /// Type of its elements, a [`DataType`].
    #[prost(enumeration = "DataType", tag = "2")]
    pub data_type: i32,
    /// Elements of type float.
    #[prost(float, repeated, tag = "4")]
    pub float_data: Vec<f32>,
    /// Elements of the types of up to 32 bits.
    #[prost(int32, repeated, tag = "5")]
    pub int32_data: Vec<i32>,
    /// Elements of type int64.
    #[prost(int64, repeated, tag = "7")]
    pub int64_data: Vec<i64>,
    /// The value's name in the graph.
    #[prost(string, tag = "8")]
    pub name: String,
    /// Elements of any type but string, in row-major order, little-endian.
    #[prost(bytes = "vec", optional, tag = "9")]
    pub raw_data: Option<Vec<u8>>,
    /// Elements of type double.
    #[prost(double, repeated, tag = "10")]
    pub double_data: Vec<f64>,
    /// The file and position of the elements, if `data_location` is external.
    #[prost(message, repeated, tag = "13")]
    pub external_data: Vec<StringStringEntryProto>,
    /// Whether the elements are in this message.
    #[prost(enumeration = "DataLocation", tag = "14")]
    pub data_location: i32,
}

/// Type of a tensor's elements; types that are not listed decode as their number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, prost::Enumeration)]
#[repr(i32)]
pub enum DataType {
    /// None.
    Undefined = 0,
    /// 32-bit float.
    Float = 1,
    /// 8-bit unsigned.
    Uint8 = 2,
    /// 8-bit signed.
    Int8 = 3,
    /// 16-bit unsigned.
    Uint16 = 4,
    /// 16-bit signed.
    Int16 = 5,
    /// 32-bit signed.
    Int32 = 6,
    /// 64-bit signed.
    Int64 = 7,
    /// Text.
    String = 8,
    /// A byte that is 0 or 1.
    Bool = 9,
    /// 16-bit float.
    Float16 = 10,
    /// 64-bit float.
    Double = 11,
    /// 32-bit unsigned.
    Uint32 = 12,
    /// 64-bit unsigned.
    Uint64 = 13,
    /// Two 32-bit floats.
    Complex64 = 14,
    /// Two 64-bit floats.
    Complex128 = 15,
    /// 16-bit brain float.
    Bfloat16 = 16,
}

/// Where a tensor's elements are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, prost::Enumeration)]
#[repr(i32)]
pub enum DataLocation {
    /// In the message.
    Default = 0,
    /// In another file.
    External = 1,
}

/// A value's name and type.
#[derive(Clone, PartialEq, Message)]
pub struct ValueInfoProto {
    /// The value's name in the graph.
    #[prost(string, tag = "1")]
    pub name: String,
    /// Its type.
    #[prost(message, optional, tag = "2")]
    pub r#type: Option<TypeProto>,
}

/// The type of a value. Sequences, maps, optionals and sparse tensors are only recognised as not being tensors.
#[derive(Clone, PartialEq, Message)]
pub struct TypeProto {
    /// A dense tensor; absent for every other type.
    #[prost(message, optional, tag = "1")]
    pub tensor_type: Option<TensorTypeProto>,
}

/// Element type and shape of a tensor (`TypeProto.Tensor` in the format).
#[derive(Clone, PartialEq, Message)]
pub struct TensorTypeProto {
    /// Type of its elements, a [`DataType`].
    #[prost(enumeration = "DataType", tag = "1")]
    pub elem_type: i32,
    /// Its shape; absent if unknown.
    #[prost(message, optional, tag = "2")]
    pub shape: Option<TensorShapeProto>,
}

/// A shape, as a list of dimensions.
#[derive(Clone, PartialEq, Eq, Message)]
pub struct TensorShapeProto {
    /// The dimensions, outermost first.
    #[prost(message, repeated, tag = "1")]
    pub dim: Vec<DimensionProto>,
}

/// One dimension (`TensorShapeProto.Dimension` in the format): a number, or a name, or neither if unknown.
#[derive(Clone, PartialEq, Eq, Message)]
pub struct DimensionProto {
    /// Its size, if known.
    #[prost(int64, optional, tag = "1")]
    pub dim_value: Option<i64>,
    /// Name of a size that is known only at run time.
    #[prost(string, optional, tag = "2")]
    pub dim_param: Option<String>,
}

impl TensorProto {
    /// A tensor of floats under `name`; the product of `dims` must be the number of `values`.
    #[must_use]
    pub fn floats(name: impl Into<String>, dims: &[usize], values: &[f32]) -> Self {
        let bytes = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        Self::raw(name.into(), DataType::Float, dims, bytes)
    }

    /// A list of whole numbers under `name`.
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
    /// A whole number.
    #[must_use]
    pub fn integer(name: &str, value: i64) -> Self {
        Self {
            i: value,
            ..Self::of(name, AttributeType::Int)
        }
    }

    /// A real number.
    #[must_use]
    pub fn float(name: &str, value: f32) -> Self {
        Self {
            f: value,
            ..Self::of(name, AttributeType::Float)
        }
    }

    /// A list of whole numbers.
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
        let open = DimensionProto {
            dim_param: Some(batch.to_owned()),
            dim_value: None,
        };
        let known = sizes.iter().map(|&size| DimensionProto {
            dim_value: Some(size as i64),
            dim_param: None,
        });
        let tensor = TensorTypeProto {
            elem_type: DataType::Float as i32,
            shape: Some(TensorShapeProto {
                dim: std::iter::once(open).chain(known).collect(),
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
