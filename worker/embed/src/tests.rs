//! Tests of embedders and their cache. The model is `tests/models/small.onnx`; these tests need ONNX Runtime (`make runtime`).

use super::*;
use murmuration_onnx::{AttributeProto, EmbedderModel, ModelProto, NodeProto, ValueInfoProto, with_weights};
use murmuration_swarm::CheckpointDigest;
use proptest::prelude::*;
use prost::Message as _;
use std::{collections::HashMap, fs, path::Path, sync::Arc, thread, time::Duration};
use tempfile::TempDir;

const SMALL: &[u8] = include_bytes!("../../../tests/models/small.onnx");

fn embedder() -> Embedder {
    Embedder::open(&Runtime::load().unwrap(), EmbedderModel::read(SMALL).unwrap()).unwrap()
}

/// Image number `k`, made by the rule of `small.py`.
fn image(k: usize) -> Vec<u8> {
    (0..96)
        .map(|pixel| (pixel * (7 + 4 * k) + 31 * k) as u8)
        .collect()
}

fn images(number: usize) -> Vec<Vec<u8>> {
    (0..number).map(image).collect()
}

fn slices(images: &[Vec<u8>]) -> Vec<&[u8]> {
    images.iter().map(Vec::as_slice).collect()
}

/// Embeddings of the first three images by Python's onnxruntime 1.28.0 (printed by `small.py`).
const EMBEDDINGS: [[f32; 3]; 3] = [
    [-2.362_514_3, 2.525_938_3, -0.120_045_6],
    [-2.363_031_1, 2.542_569_6, -0.138_085_54],
    [-2.368_532_2, 2.572_437_3, -0.151_256_86],
];

#[test]
fn embeddings_are_those_of_the_python_package() {
    let embeddings = embedder().embed(&slices(&images(3))).unwrap();
    assert_eq!(embeddings.len(), 3);
    for (embedding, expected) in embeddings.iter().zip(EMBEDDINGS) {
        for (value, expected) in embedding.iter().zip(expected) {
            // The bits can differ, because ONNX Runtime's kernels depend on the kind of CPU.
            assert!((value - expected).abs() < 1e-5, "{embeddings:?}");
        }
    }
}

#[test]
fn bits_do_not_depend_on_the_batch() {
    let mut embedder = embedder();
    let images = images(100);
    let whole = embedder.embed(&slices(&images)).unwrap();
    for size in [1, 2, 7, 8, 33, 64, 99] {
        let split: Vec<_> = images
            .chunks(size)
            .flat_map(|part| embedder.embed(&slices(part)).unwrap())
            .collect();
        assert_eq!(split, whole, "in batches of {size}");
    }
    let mut backwards = slices(&images);
    backwards.reverse();
    let mut again = embedder.embed(&backwards).unwrap();
    again.reverse();
    assert_eq!(again, whole, "in another order");
    assert!(embedder.embed(&[]).unwrap().is_empty());
}

#[test]
fn images_of_another_size_are_refused() {
    let error = embedder().embed(&[&image(0), &[0; 95]]).unwrap_err();
    assert_eq!(
        error.to_string(),
        "image 1 has 95 pixels: this embedder takes 12 x 8, or smaller squares"
    );
}

#[test]
fn a_smaller_picture_is_embedded_as_its_enlargement() {
    let mut embedder = embedder();
    let picture: Vec<u8> = (0..16).map(|pixel| pixel * 16).collect();
    // Four pixels along each axis become twelve rows and eight columns.
    let enlarged: Vec<u8> = (0..96).map(|at| picture[at / 8 / 3 * 4 + at % 8 / 2]).collect();
    let embeddings = embedder.embed(&[&picture, &enlarged, &image(0)]).unwrap();
    assert_eq!(embeddings[0], embeddings[1]);
    assert_ne!(embeddings[0], embeddings[2]);
}

#[test]
fn what_is_not_finite_is_refused() {
    let mut model = ModelProto::decode(SMALL).unwrap();
    let biases = model
        .graph
        .as_mut()
        .unwrap()
        .initializer
        .iter_mut()
        .find(|tensor| tensor.name == "b3");
    biases.unwrap().raw_data.as_mut().unwrap()[..4].copy_from_slice(&f32::INFINITY.to_le_bytes());
    let model = EmbedderModel::read(&model.encode_to_vec()).unwrap();
    let error = Embedder::open(&Runtime::load().unwrap(), model)
        .unwrap()
        .embed(&slices(&images(40)))
        .unwrap_err();
    assert_eq!(
        error.to_string(),
        "image 0 is embedded as inf, not as a finite number"
    );
}

#[test]
fn what_onnx_runtime_does_not_know_is_refused() {
    let mut model = ModelProto::decode(SMALL).unwrap();
    model.opset_import[0].version = 1000;
    let model = EmbedderModel::read(&model.encode_to_vec()).unwrap();
    let error = Embedder::open(&Runtime::load().unwrap(), model).unwrap_err();
    assert!(error.to_string().starts_with("ONNX Runtime: "), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// Every accepted model either runs as declared or is refused with an error.
    #[test]
    fn a_damaged_model_does_no_harm(
        changes in prop::collection::vec((0..SMALL.len(), any::<u8>()), 1..4),
    ) {
        let mut bytes = SMALL.to_vec();
        for (at, byte) in changes {
            bytes[at] = byte;
        }
        let Ok(model) = EmbedderModel::read(&bytes) else { return Ok(()) };
        let dimensions = model.dimensions();
        let pixels = vec![100; model.images().bytes()];
        let Ok(mut embedder) = Embedder::open(&Runtime::load().unwrap(), model) else { return Ok(()) };
        match embedder.embed(&[&pixels, &pixels]) {
            Ok(embeddings) => prop_assert!(
                embeddings.len() == 2 && embeddings.iter().all(|embedding| embedding.len() == dimensions)
            ),
            Err(error) => prop_assert!(!matches!(error, EmbedError::OutputShape { .. }), "{}", error),
        }
    }
}

/// A model that passes its images through one node with these attributes, and flattens the result.
fn flattened(op_type: &str, attribute: Vec<AttributeProto>) -> Vec<u8> {
    let mut model = ModelProto::decode(SMALL).unwrap();
    let graph = model.graph.as_mut().unwrap();
    let node = |op_type: &str, input: &[&str], output: &str, attribute| NodeProto {
        op_type: op_type.to_owned(),
        input: input.iter().map(ToString::to_string).collect(),
        output: vec![output.to_owned()],
        attribute,
        ..NodeProto::default()
    };
    let inputs: &[&str] = if op_type == "Conv" {
        &["images", "w1"]
    } else {
        &["images"]
    };
    graph.node = vec![
        node(op_type, inputs, "made", attribute),
        node("Flatten", &["made"], "embedding", Vec::new()),
    ];
    graph.output = vec![ValueInfoProto::batch_of_floats("embedding", "batch", &[])];
    graph.output[0].r#type = None;
    model.encode_to_vec()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    /// `EmbedderModel` and ONNX Runtime compute the same shapes.
    #[test]
    fn windows_slide_as_in_onnx_runtime(
        op_type in prop::sample::select(vec!["AveragePool", "MaxPool", "Conv"]),
        kernel in [2usize..6, 2usize..6],
        strides in [1usize..5, 1usize..5],
        dilations in [1usize..4, 1usize..4],
        // A pooling's padding must be smaller than its kernel.
        pads in [0usize..2, 0usize..2, 0usize..2, 0usize..2],
        round_up in any::<bool>(),
    ) {
        let mut attributes = vec![
            AttributeProto::integers("kernel_shape", if op_type == "Conv" { &[3, 3] } else { &kernel }),
            AttributeProto::integers("strides", &strides),
            AttributeProto::integers("dilations", &dilations),
            AttributeProto::integers("pads", &pads),
        ];
        if op_type != "Conv" {
            attributes.push(AttributeProto::integer("ceil_mode", i64::from(round_up)));
        }
        // The model may be refused only if a window does not fit.
        let Ok(model) = EmbedderModel::read(&flattened(op_type, attributes)) else { return Ok(()) };
        let dimensions = model.dimensions();
        let mut embedder = Embedder::open(&Runtime::load().unwrap(), model).unwrap();
        prop_assert_eq!(embedder.embed(&slices(&images(2))).unwrap()[1].len(), dimensions);
    }
}

/// A cache in a temporary folder.
fn cache(max_bytes: u64) -> (TempDir, Cache) {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::open(folder.path().join("checkpoints"), max_bytes).unwrap();
    (folder, cache)
}

/// Fetches `bytes` by their digest.
fn fetch(cache: &Cache, bytes: &[u8]) {
    let fetched = cache.get_or_fetch(CheckpointDigest::of(bytes), |_| Ok::<_, String>(bytes.to_vec()));
    assert_eq!(fetched.unwrap(), bytes);
}

fn files(folder: &Path) -> usize {
    fs::read_dir(folder.join("checkpoints")).unwrap().count()
}

fn never(_: CheckpointDigest) -> Result<Vec<u8>, String> {
    panic!("fetched again")
}

#[test]
fn a_checkpoint_is_fetched_once() {
    let (folder, cache) = cache(1000);
    fetch(&cache, b"checkpoint");
    let digest = CheckpointDigest::of(b"checkpoint");
    assert_eq!(cache.get_or_fetch(digest, never).unwrap(), b"checkpoint");
    let again = Cache::open(folder.path().join("checkpoints"), 1000).unwrap();
    assert_eq!(
        again.get_or_fetch(digest, never).unwrap(),
        b"checkpoint",
        "after a restart"
    );
}

#[test]
fn threads_that_want_the_same_checkpoint_fetch_it_once() {
    let (_folder, cache) = cache(1000);
    let fetched = std::sync::atomic::AtomicUsize::new(0);
    let digest = CheckpointDigest::of(b"checkpoint");
    thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                let slow = |_| {
                    fetched.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                    thread::sleep(Duration::from_millis(20));
                    Ok::<_, String>(b"checkpoint".to_vec())
                };
                assert_eq!(cache.get_or_fetch(digest, slow).unwrap(), b"checkpoint");
            });
        }
    });
    assert_eq!(fetched.into_inner(), 1);
}

#[test]
fn a_damaged_file_counts_as_absent() {
    let (folder, cache) = cache(1000);
    fetch(&cache, b"checkpoint");
    let digest = CheckpointDigest::of(b"checkpoint");
    let file = folder.path().join(format!("checkpoints/{digest}.onnx"));
    fs::write(&file, b"chequepoint").unwrap();
    assert_eq!(cache.get(digest).unwrap(), None);
    assert!(!file.exists(), "it was left");
    fetch(&cache, b"checkpoint");
    assert_eq!(cache.get(digest).unwrap().unwrap(), b"checkpoint");
}

#[test]
fn other_bytes_than_asked_for_are_refused_and_not_kept() {
    let (folder, cache) = cache(1000);
    let digest = CheckpointDigest::of(b"checkpoint");
    let error = cache
        .get_or_fetch(digest, |_| Ok::<_, String>(b"other".to_vec()))
        .unwrap_err();
    assert!(matches!(error, FetchError::Mismatch { .. }), "{error}");
    let error = cache.get_or_fetch(digest, |_| Err("gone")).unwrap_err();
    assert_eq!(
        error.to_string(),
        format!("checkpoint {digest} cannot be fetched: gone")
    );
    assert_eq!(files(folder.path()), 0);
}

#[test]
fn what_was_used_longest_ago_goes_first() {
    let (folder, cache) = cache(100);
    let present = |bytes: &[u8]| {
        folder
            .path()
            .join(format!("checkpoints/{}.onnx", CheckpointDigest::of(bytes)))
            .exists()
    };
    let [a, b, c, large] = [
        [1; 40].to_vec(),
        [2; 40].to_vec(),
        [3; 40].to_vec(),
        [4; 400].to_vec(),
    ];
    let pause = || thread::sleep(Duration::from_millis(20));
    fetch(&cache, &a);
    pause();
    fetch(&cache, &b);
    pause();
    fetch(&cache, &a);
    pause();
    fs::write(folder.path().join("checkpoints/notes.txt"), [0; 500]).unwrap();
    fetch(&cache, &c);
    assert_eq!(
        [&a, &b, &c].map(|bytes| present(bytes)),
        [true, false, true],
        "b was used longest ago"
    );
    fetch(&cache, &large);
    assert_eq!(
        [&a, &b, &c, &large].map(|bytes| present(bytes)),
        [false, false, false, true]
    );
    assert_eq!(files(folder.path()), 2, "what is not a checkpoint is left alone");
}

#[test]
fn embedders_are_opened_once_and_only_so_many() {
    let (_folder, cache) = cache(1 << 20);
    let mut embedders = Embedders::new(Runtime::load().unwrap(), Arc::new(cache));
    // Checkpoints of one model with different digests: each has a different text field appended to the model's bytes.
    let checkpoints: Vec<Vec<u8>> = (b'a'..b'g')
        .map(|name| [SMALL, &[0x12, 1, name]].concat())
        .collect();
    let expected = embedder().embed(&[&image(0)]).unwrap();
    for bytes in &checkpoints {
        let embedder = embedders
            .get(CheckpointDigest::of(bytes), |_| Ok::<_, String>(bytes.clone()))
            .unwrap();
        assert_eq!(embedder.embed(&[&image(0)]).unwrap(), expected);
    }
    assert_eq!(embedders.open(), 4);
    embedders
        .get(CheckpointDigest::of(&checkpoints[5]), never)
        .unwrap();
    embedders
        .get(CheckpointDigest::of(&checkpoints[0]), never)
        .unwrap();
    assert_eq!(embedders.open(), 4);
}

#[test]
fn a_checkpoint_that_is_no_embedder_is_refused() {
    let (_folder, cache) = cache(1 << 20);
    let mut embedders = Embedders::new(Runtime::load().unwrap(), Arc::new(cache));
    let bytes = b"not a model";
    let error = embedders
        .get(CheckpointDigest::of(bytes), |_| Ok::<_, String>(bytes.to_vec()))
        .unwrap_err();
    assert!(matches!(error, OpenError::Model { .. }), "{error}");
}

/// Networks as PyTorch's exporters write them (`tests/models/torch_exports.py`), with the number of bytes of their images. None takes
/// batches.
const TORCH: [(&str, usize); 4] = [
    ("view", 50 * 50),
    ("channels-last", 50 * 50),
    ("attention", 50 * 50),
    ("colour", 3 * 84 * 84),
];

#[test]
fn networks_of_pytorch_embed_as_in_pytorch() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/models");
    let expected = fs::read_to_string(folder.join("torch_exports.json")).unwrap();
    let expected: HashMap<String, Vec<Vec<f32>>> = serde_json::from_str(&expected).unwrap();
    assert_eq!(expected.len(), TORCH.len());
    for (name, bytes) in TORCH {
        let file = fs::read(folder.join(format!("{name}.onnx"))).unwrap();
        let beside = |name: &str| fs::read(folder.join(name)).map_err(|error| error.to_string());
        let model = EmbedderModel::read(&with_weights(&file, beside).unwrap()).unwrap();
        assert_eq!(
            (model.images().bytes(), model.takes_batches()),
            (bytes, false),
            "{name}"
        );
        let mut embedder = Embedder::open(&Runtime::load().unwrap(), model).unwrap();
        let picture = |p: usize| (0..bytes).map(|i| ((7 * i * i + 31 * p) % 256) as u8).collect();
        let pictures: Vec<Vec<u8>> = (0..3).map(picture).collect();
        let embeddings = embedder.embed(&slices(&pictures)).unwrap();
        for (value, expected) in embeddings.concat().iter().zip(expected[name].concat()) {
            // Half precision has 11 bits.
            let tolerance = if name == "colour" { 2e-3 } else { 1e-5 };
            assert!((value - expected).abs() < tolerance, "{name}: {value} {expected}");
        }
        assert_eq!(embeddings.concat().len(), expected[name].concat().len(), "{name}");
    }
}

#[test]
fn a_grey_picture_embeds_as_three_equal_channels() {
    let file = include_bytes!("../../../tests/models/colour.onnx");
    let mut embedder = Embedder::open(&Runtime::load().unwrap(), EmbedderModel::read(file).unwrap()).unwrap();
    let grey: Vec<u8> = (0..50 * 50).map(|pixel| (pixel * pixel % 251) as u8).collect();
    let embeddings = embedder.embed(&[&grey, &grey.repeat(3)]).unwrap();
    assert_eq!(embeddings[0], embeddings[1]);
}
