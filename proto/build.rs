//! Compiles the `.proto` files with protox, so that no `protoc` binary is needed.

use prost::Message as _;
use std::{error::Error, fs, path::PathBuf};

/// Messages that people write in campaign files: they also read from and write to TOML.
const WRITTEN_BY_PEOPLE: [&str; 15] = [
    "Sensor",
    "Robot",
    "Species",
    "Obstacle",
    "StartShape",
    "Noise",
    "World",
    "ImageFormat",
    "ControllerSpace",
    "Search",
    "EvaluationParams",
    "TaxonomyFormat",
    "Dataset",
    "Feedback",
    "CampaignSpec",
];

fn main() -> Result<(), Box<dyn Error>> {
    let files = protox::compile(
        [
            "murmuration/v1/campaign.proto",
            "murmuration/v1/worker.proto",
            "murmuration/v1/checkpoint.proto",
            "murmuration/v1/trainer.proto",
            "murmuration/v1/label.proto",
            "murmuration/v1/evaluation.proto",
            "murmuration/v1/transfer.proto",
        ],
        ["."],
    )?;
    let out = PathBuf::from(std::env::var("OUT_DIR")?);
    fs::write(out.join("descriptors.bin"), files.encode_to_vec())?;
    fs::write(out.join("comments.rs"), comments(&files))?;

    let onnx = protox::compile(["onnx/onnx.proto"], ["."])?;
    tonic_prost_build::configure().compile_fds(onnx)?;

    // With its name, a message finds its descriptor.
    let mut named = prost_build::Config::new();
    named.enable_type_names();
    let mut config = tonic_prost_build::configure().build_transport(true);
    for message in WRITTEN_BY_PEOPLE {
        config = config
            .type_attribute(
                format!("murmuration.v1.{message}"),
                "#[derive(serde::Serialize, serde::Deserialize)]",
            )
            .type_attribute(
                format!("murmuration.v1.{message}"),
                "#[serde(default, deny_unknown_fields)]",
            );
    }
    for list in [
        "ControllerSpace.angles",
        "Sensor.angle_range",
        "Sensor.angles",
        "Sensor.sees",
        "CampaignSpec.species",
        "World.obstacles",
    ] {
        let skip = "#[serde(skip_serializing_if = \"Vec::is_empty\")]";
        config = config.field_attribute(format!("murmuration.v1.{list}"), skip);
    }
    config
        .field_attribute(
            "murmuration.v1.Sensor.angle",
            "#[serde(with = \"crate::robot::toml_names::angle\", skip_serializing_if = \"Option::is_none\")]",
        )
        .field_attribute(
            "murmuration.v1.StartShape.poses",
            "#[serde(with = \"crate::toml_names::poses\", skip_serializing_if = \"Vec::is_empty\")]",
        )
        .field_attribute(
            "murmuration.v1.CampaignSpec.ratios",
            "#[serde(with = \"crate::robot::toml_names::ratios\", skip_serializing_if = \"Vec::is_empty\")]",
        )
        .field_attribute(
            "murmuration.v1.ControllerSpace.initial",
            "#[serde(with = \"crate::toml_names::genes\", skip_serializing_if = \"Vec::is_empty\")]",
        )
        .field_attribute(
            "murmuration.v1.CampaignSpec.method",
            "#[serde(with = \"crate::toml_names::method\")]",
        )
        .field_attribute(
            "murmuration.v1.CampaignSpec.training",
            "#[serde(with = \"crate::toml_names::table\", skip_serializing_if = \"Option::is_none\")]",
        )
        .field_attribute(
            "murmuration.v1.Feedback.recipe",
            "#[serde(with = \"crate::toml_names::table\", skip_serializing_if = \"Option::is_none\")]",
        )
        .compile_fds_with_config(files, named)?;
    println!("cargo:rerun-if-changed=murmuration");
    println!("cargo:rerun-if-changed=onnx");
    Ok(())
}

/// The comments on the fields that people write in campaign files, as a Rust list of message, field and comment.
fn comments(files: &protox::prost_reflect::prost_types::FileDescriptorSet) -> String {
    /// The numbers of `message_type` in a file and of `field` in a message, of which paths in a file are made.
    const MESSAGE: i32 = 4;
    const FIELD: i32 = 2;

    let mut list = String::from("&[");
    for file in &files.file {
        let locations = file.source_code_info.iter().flat_map(|info| &info.location);
        for location in locations {
            let [MESSAGE, message, FIELD, field] = location.path[..] else {
                continue;
            };
            let message = &file.message_type[message as usize];
            if !WRITTEN_BY_PEOPLE.contains(&message.name()) {
                continue;
            }
            let words: Vec<&str> = location.leading_comments().split_whitespace().collect();
            let (field, comment) = (message.field[field as usize].name(), words.join(" "));
            list += &format!("({:?}, {field:?}, {comment:?}), ", message.name());
        }
    }
    list + "]"
}
