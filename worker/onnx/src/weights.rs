//! Weights that a model keeps in files beside its own.

use super::{
    MAX_MODEL_BYTES, ModelError, StringStringEntryProto, TensorProto, embedder_model::decode,
    tensor_proto::DataLocation,
};
use prost::Message as _;
use std::{
    borrow::Cow,
    collections::{BTreeMap, btree_map::Entry},
    path::{Component, Path},
};

/// The model in `file` with all its weights inside. `read` reads a file beside the model's by its name. PyTorch's exporter writes
/// weights to `NAME.onnx.data`.
///
/// # Errors
/// Fails if the file is not ONNX, if it names a file in another folder, if `read` fails, or if the whole has over
/// [`MAX_MODEL_BYTES`] bytes. Does not check what the model does.
pub fn with_weights(
    file: &[u8],
    mut read: impl FnMut(&str) -> Result<Vec<u8>, String>,
) -> Result<Cow<'_, [u8]>, ModelError> {
    let mut model = decode(file)?;
    let outside = |tensor: &&mut TensorProto| tensor.data_location == DataLocation::External as i32;
    let initializers = model.graph.iter_mut().flat_map(|graph| &mut graph.initializer);
    let mut files: BTreeMap<String, Vec<u8>> = BTreeMap::new();
    let mut bytes = file.len();
    let mut is_whole = true;
    for tensor in initializers.filter(outside) {
        is_whole = false;
        let name = tensor.name.clone();
        let refused = |problem| ModelError::Constant {
            name: name.clone(),
            problem,
        };
        let at = Place::read(&tensor.external_data).map_err(refused)?;
        let held = match files.entry(at.file.to_owned()) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(room) => room.insert(read(at.file).map_err(refused)?),
        };
        let part = at.of(held).ok_or_else(|| {
            refused(format!(
                "is beyond the end of {:?}, which has {} bytes",
                at.file,
                held.len()
            ))
        })?;
        bytes = bytes.saturating_add(part.len());
        if bytes > MAX_MODEL_BYTES {
            return Err(ModelError::TooLarge(bytes));
        }
        tensor.raw_data = Some(part.to_vec());
        tensor.data_location = DataLocation::Default as i32;
        tensor.external_data.clear();
    }
    Ok(match is_whole {
        true => Cow::Borrowed(file),
        false => Cow::Owned(model.encode_to_vec()),
    })
}

/// Where a tensor's elements are.
struct Place<'a> {
    file: &'a str,
    offset: usize,
    /// `None` up to the end of the file.
    length: Option<usize>,
}

impl<'a> Place<'a> {
    fn read(entries: &'a [StringStringEntryProto]) -> Result<Self, String> {
        let find = |key: &str| {
            let entry = entries.iter().find(|entry| entry.key == key);
            entry.map(|entry| entry.value.as_str())
        };
        let number = |key: &str| {
            let number = find(key).map(str::parse::<usize>).transpose();
            number.map_err(|_| format!("has the {key} {:?}", find(key).unwrap_or_default()))
        };
        let file = find("location").ok_or("is in another file without a name")?;
        let mut components = Path::new(file).components();
        match (components.next(), components.next()) {
            (Some(Component::Normal(name)), None) if name == file => {}
            _ => {
                return Err(format!(
                    "is in the file {file:?}: only a file in the folder of the model is read"
                ));
            }
        }
        Ok(Self {
            file,
            offset: number("offset")?.unwrap_or(0),
            length: number("length")?,
        })
    }

    fn of<'b>(&self, held: &'b [u8]) -> Option<&'b [u8]> {
        let rest = held.get(self.offset..)?;
        rest.get(..self.length.unwrap_or(rest.len()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{EmbedderModel, ModelProto};

    const SMALL: &[u8] = include_bytes!("../../../tests/models/small.onnx");

    /// The small model with its first weights in another file, and that file.
    fn parted(location: &str, more: &[(&str, &str)]) -> (Vec<u8>, Vec<u8>) {
        let mut model = ModelProto::decode(SMALL).unwrap();
        let initializers = &mut model.graph.as_mut().unwrap().initializer;
        let tensor = initializers
            .iter_mut()
            .find(|tensor| tensor.name == "w1")
            .unwrap();
        let held = tensor.raw_data.take().unwrap();
        tensor.data_location = DataLocation::External as i32;
        tensor.external_data = [("location", location)]
            .iter()
            .chain(more)
            .map(|(key, value)| StringStringEntryProto {
                key: (*key).to_owned(),
                value: (*value).to_owned(),
            })
            .collect();
        (model.encode_to_vec(), held)
    }

    #[test]
    fn weights_beside_the_model_come_in() {
        let whole = EmbedderModel::read(SMALL).unwrap();
        let (model, weights) = parted("small.onnx.data", &[("offset", "4"), ("length", "144")]);
        let held = [b"else".as_slice(), &weights, b"more"].concat();
        let read = |name: &str| {
            assert_eq!(name, "small.onnx.data");
            Ok(held.clone())
        };
        let gathered = with_weights(&model, read).unwrap();
        assert_eq!(EmbedderModel::read(&gathered), Ok(whole));
        let unread = |_: &str| -> Result<Vec<u8>, String> { unreachable!() };
        assert_eq!(with_weights(SMALL, unread), Ok(SMALL.into()));
    }

    #[test]
    fn only_whole_files_in_the_folder_of_the_model_are_read() {
        let check = |location, more: &[(&str, &str)], expected: &str| {
            let (model, weights) = parted(location, more);
            let error = with_weights(&model, |_| Ok(weights.clone()))
                .unwrap_err()
                .to_string();
            assert!(error.contains(expected), "{error}");
        };
        for place in [
            "../weights",
            "/etc/passwd",
            "a/b",
            ".",
            "..",
            "",
            "./weights",
            "weights/",
        ] {
            check(place, &[], "only a file in the folder of the model is read");
        }
        check(
            "weights",
            &[("offset", "1"), ("length", "144")],
            "is beyond the end of \"weights\", which has 144 bytes",
        );
        check("weights", &[("offset", "-1")], "has the offset \"-1\"");
        let (model, _) = parted("weights", &[]);
        let error = with_weights(&model, |_| Err("cannot be read".to_owned())).unwrap_err();
        assert!(error.to_string().ends_with("cannot be read"), "{error}");
        let error = with_weights(&model, |_| Ok(vec![0; MAX_MODEL_BYTES])).unwrap_err();
        assert!(matches!(error, ModelError::TooLarge(_)), "{error}");
    }
}
