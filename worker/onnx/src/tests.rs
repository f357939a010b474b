//! Tests of writing and reading messages of model files.

use super::*;
use prost::Message as _;

/// A tensor as Python's `onnx.helper.make_tensor("w", TensorProto.FLOAT, [2], [1.0, -2.0])` writes it.
#[test]
fn a_tensor_written_by_the_reference_library_is_read() {
    let bytes = b"\x08\x02\x10\x01\x22\x08\x00\x00\x80\x3f\x00\x00\x00\xc0\x42\x01w";
    let tensor = TensorProto::decode(bytes.as_slice()).unwrap();
    assert_eq!(tensor.float_data, [1.0, -2.0]);
    assert_eq!(
        (tensor.name.as_str(), tensor.dims.as_slice()),
        ("w", [2].as_slice())
    );
    assert_eq!(tensor.data_type, DataType::Float as i32);
    assert_eq!(tensor.raw_data, None);
}

#[test]
fn an_open_batch_is_a_named_dimension() {
    let value = ValueInfoProto::batch_of_floats("images", "batch", &[1, 50, 50]);
    let read = ValueInfoProto::decode(value.encode_to_vec().as_slice()).unwrap();
    let dim = read.r#type.unwrap().tensor_type.unwrap().shape.unwrap().dim;
    assert_eq!(dim[0].value, Some(Value::DimParam("batch".to_owned())));
    assert_eq!(dim[3].value, Some(Value::DimValue(50)));
}

#[test]
fn what_is_not_declared_is_skipped_and_what_is_no_message_refused() {
    // Field 6, `doc_string`, is not declared.
    let model = ModelProto::decode(b"\x08\x0a\x32\x02hi".as_slice()).unwrap();
    assert_eq!(model.ir_version, 10);
    assert!(ModelProto::decode(b"not a model".as_slice()).is_err());
}
