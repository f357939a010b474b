//! Runs checkpoints on Python's ONNX Runtime.

use murmuration_swarm::{
    PictureShape, Purpose, RandomStream,
    training::{Architecture, ArchitectureError},
};
use murmuration_train::{network::Network, onnx};
use rand::RngExt as _;
use std::{fs, path::Path, process::Command};

const PICTURES: usize = 300;

/// Pictures of random bytes: half of the pictures are fully random, the other half mostly black.
fn pictures(shape: PictureShape) -> Vec<u8> {
    let mut stream = RandomStream::derive(1, Purpose::Augment, 0);
    let mut grey = |picture: usize| {
        let bits = stream.random::<u64>();
        match picture.is_multiple_of(2) || bits & 7 == 0 {
            true => (bits >> 8) as u8,
            false => 0,
        }
    };
    (0..PICTURES * shape.bytes())
        .map(|i| grey(i / shape.bytes()))
        .collect()
}

fn python_embeds(model: &[u8], pictures: &[u8]) -> Vec<f32> {
    let folder = tempfile::tempdir().unwrap();
    let [model_file, pictures_file, embeddings] =
        ["model.onnx", "pictures", "embeddings"].map(|name| folder.path().join(name));
    fs::write(&model_file, model).unwrap();
    fs::write(&pictures_file, pictures).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/machine/python/onnxruntime_embed.py");
    let status = Command::new("python3")
        .arg(script)
        .args([&model_file, &pictures_file, &embeddings])
        .status()
        .unwrap();
    assert!(status.success(), "{status}");
    let bytes = fs::read(embeddings).unwrap();
    let (quads, rest) = bytes.as_chunks::<4>();
    assert!(rest.is_empty());
    quads.iter().map(|&quad| f32::from_le_bytes(quad)).collect()
}

fn check_same(
    channels: usize,
    architecture: fn(PictureShape, usize) -> Result<Architecture, ArchitectureError>,
) {
    let shape = PictureShape::new(channels, 50).unwrap();
    let network = Network::<f32>::initialise(architecture(shape, 5).unwrap(), 3);
    let pictures = pictures(shape);
    let ours = network.embed(&pictures);
    let theirs = python_embeds(&onnx::export(&network), &pictures);
    assert_eq!(theirs.len(), 5 * PICTURES);
    let pairs = ours.iter().zip(&theirs);
    let farthest = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(
        ours.iter().zip(&theirs).all(|(a, b)| (a - b).abs() <= 1e-5),
        "{farthest}"
    );
}

pub fn python_runs_the_compact_network() {
    check_same(1, Architecture::compact);
    check_same(3, Architecture::compact);
}

pub fn python_runs_the_papers_network() {
    check_same(1, Architecture::paper);
    check_same(2, Architecture::paper);
}
