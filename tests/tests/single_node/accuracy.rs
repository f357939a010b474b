//! Tests `murmuration lab accuracy` on the command line. These tests need ONNX Runtime (`make runtime`).

use murmuration_tests::{Finished, Murmuration, binary};
use serde_json::Value;
use std::{fs, fs::File, path::PathBuf, process::Command};
use tempfile::TempDir;

/// The tests' small embedder of pictures of 12 x 8 pixels.
const SMALL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/models/small.onnx");

/// A labelled set of three images. The first two images have the same class, and the small embedder puts them closest to each
/// other.
struct Set {
    folder: TempDir,
}

impl Set {
    fn new() -> Self {
        Self::of_images(12, 8)
    }

    fn of_images(height: u32, width: u32) -> Self {
        let set = Self {
            folder: tempfile::tempdir().unwrap(),
        };
        fs::write(set.labels(), "id,class\n0,ring\n1,ring\n2,clump\n").unwrap();
        fs::create_dir(set.path("images")).unwrap();
        for k in 0..3 {
            let file = File::create(set.path(&format!("images/{k}.png"))).unwrap();
            let mut encoder = png::Encoder::new(file, width, height);
            encoder.set_color(png::ColorType::Grayscale);
            let pixels: Vec<u8> = (0..height * width)
                .map(|pixel| (pixel * (7 + 4 * k) + 31 * k) as u8)
                .collect();
            encoder.write_header().unwrap().write_image_data(&pixels).unwrap();
        }
        set
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn labels(&self) -> PathBuf {
        self.path("labels.csv")
    }

    fn run(&self, arguments: &[&str]) -> Finished {
        let labels = self.labels().display().to_string();
        let arguments = [&["lab", "accuracy", "--labels", &labels], arguments].concat();
        Murmuration::over(self.folder.path()).run(&arguments)
    }

    #[track_caller]
    fn check_refused(&self, arguments: &[&str], expected: &str) {
        let Finished { code, stdout, stderr } = self.run(arguments);
        assert!(
            code == Some(2) && stderr.contains(expected),
            "exit code {code:?}\n{stderr}\nnot {expected:?}"
        );
        assert!(
            stdout.is_empty() && !stderr.contains("panicked"),
            "{stdout}{stderr}"
        );
    }
}

fn json(finished: &Finished) -> Value {
    assert_eq!(finished.code, Some(0), "{}", finished.stderr);
    serde_json::from_str(&finished.stdout).unwrap()
}

#[test]
fn sets_are_joined_and_told_of_in_json() {
    let set = |name| format!("{}/labelled/{name}/validation.csv", env!("CARGO_MANIFEST_DIR"));
    let murmuration = Murmuration::over(&std::env::temp_dir());
    let one = json(&murmuration.run(&[
        "lab",
        "accuracy",
        "--labels",
        &set("two_sensor"),
        "--features",
        "--json",
    ]));
    assert_eq!(
        (&one["behaviours"], &one["every_anchor"]["correct"]),
        (&200.into(), &856_806.into())
    );
    assert_eq!(one["by_class_of_anchor"]["milling"]["triplets"], 20_790);
    let both = [
        "lab",
        "accuracy",
        "--labels",
        &set("two_sensor"),
        "--labels",
        &set("rare"),
        "--features",
        "--json",
    ];
    let both = json(&murmuration.run(&both));
    assert_eq!(both["behaviours"], 241);
    assert!(
        both["by_class_of_anchor"]["concave_path"]["percent"]
            .as_f64()
            .unwrap()
            > 90.0
    );
}

#[test]
fn images_are_embedded_by_a_checkpoint() {
    let set = Set::new();
    let accuracy = json(&set.run(&["--checkpoint", SMALL, "--json"]));
    assert_eq!(
        accuracy["every_anchor"],
        serde_json::json!({ "correct": 2, "triplets": 2, "percent": 100.0 })
    );
    assert_eq!(accuracy["embedding"].as_str().unwrap().len(), 64, "no digest");
    let elsewhere = set.path("elsewhere");
    fs::rename(set.path("images"), &elsewhere).unwrap();
    let images = elsewhere.display().to_string();
    let named = set.run(&["--checkpoint", SMALL, "--images", &images]);
    assert!(
        named.code == Some(0) && named.stdout.contains("100.00 %"),
        "{}{}",
        named.stdout,
        named.stderr
    );
    set.check_refused(&["--checkpoint", SMALL], "images/0.png: No such file");
    set.check_refused(
        &["--checkpoint", SMALL, "--images", &images, "--images", &images],
        "for each --labels",
    );
}

#[test]
fn a_checkpoint_is_named_by_the_beginning_of_its_digest_too() {
    let set = Set::new();
    let murmuration = Murmuration::over(&set.path("data"));
    let imported = json(&murmuration.run(&["checkpoints", "import", SMALL, "--json"]));
    let digest = imported["digest"].as_str().unwrap();
    let labels = set.labels().display().to_string();
    let accuracy = |checkpoint| {
        let arguments = [
            "lab",
            "accuracy",
            "--labels",
            &labels,
            "--checkpoint",
            checkpoint,
            "--json",
        ];
        json(&murmuration.run(&arguments))
    };
    assert_eq!(accuracy(&digest[..8]), accuracy(SMALL));
    let unknown = murmuration.run(&["lab", "accuracy", "--labels", &labels, "--checkpoint", "ffff"]);
    assert_eq!(unknown.code, Some(2), "{}", unknown.stderr);
    assert!(
        unknown.stderr.contains("no checkpoint \"ffff\""),
        "{}",
        unknown.stderr
    );
}

#[test]
fn untrained_networks_are_summed_up() {
    let set = Set::of_images(50, 50);
    let untrained = |arguments: &[&str]| json(&set.run(&[&["--json", "--untrained"], arguments].concat()));
    let four = untrained(&["4"]);
    assert_eq!(
        (&four["networks"], &four["network"]),
        (&4.into(), &"compact".into())
    );
    let every = &four["every_anchor"];
    assert!(
        (0.0..=100.0).contains(&every["mean_percent"].as_f64().unwrap()),
        "{every}"
    );
    assert!(every["deviation_percent"].as_f64().is_some());
    assert_eq!(four, untrained(&["4"]));
    let one = untrained(&["1", "--network", "paper"]);
    assert!(one["every_anchor"]["deviation_percent"].is_null());
    set.check_refused(&["--untrained", "0"], "--untrained");
    set.check_refused(&["--untrained", "1", "--features"], "cannot be used with");
    Set::new().check_refused(&["--untrained", "1"], "images/0.png");
}

#[test]
fn what_is_no_embedder_is_refused() {
    let set = Set::new();
    let labels = set.labels().display().to_string();
    set.check_refused(
        &["--checkpoint", &labels],
        "labels.csv: this is not an ONNX model",
    );
    set.check_refused(&["--checkpoint", "nowhere.onnx"], "cannot read nowhere.onnx");
    set.check_refused(&["--checkpoint", SMALL, "--features"], "cannot be used with");
    set.check_refused(&[], "required");
}

#[test]
fn a_library_that_does_not_load_is_named() {
    let set = Set::new();
    let output = Command::new(binary("murmuration"))
        .args(["lab", "accuracy", "--checkpoint", SMALL, "--labels"])
        .arg(set.labels())
        .env("ORT_DYLIB_PATH", set.labels())
        .output()
        .unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(
        message.contains("labels.csv cannot be used as ONNX Runtime") && !message.contains("panicked"),
        "{message}"
    );
    assert_eq!(output.status.code(), Some(1));
}

#[test]
fn a_device_that_the_library_lacks_is_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().display().to_string();
    let spec = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../examples/single-sensor-latent.toml"
    );
    let coordinator = ["--coordinator", "http://127.0.0.1:1"];
    for (program, arguments) in [
        ("murmuration", vec!["run", spec, "--data", &data]),
        ("murmuration", vec!["serve", "--data", &data]),
        ("murmuration-worker", coordinator.to_vec()),
    ] {
        let output = Command::new(binary(program))
            .args(arguments)
            .args(["--embed-on", "cuda"])
            .output()
            .unwrap();
        let message = String::from_utf8(output.stderr).unwrap();
        assert!(message.contains("is built without CUDA"), "{program}: {message}");
        assert_eq!(output.status.code(), Some(1), "{program}: {message}");
    }
}
