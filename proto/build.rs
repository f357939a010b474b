//! Compiles the `.proto` files with protox, so that no `protoc` binary is needed.

use prost::Message as _;
use protox::prost_reflect::{
    DescriptorPool, EnumDescriptor, EnumValueDescriptor, FieldDescriptor, Kind, MessageDescriptor,
};
use std::{error::Error, fs, path::PathBuf};

/// The message of a campaign file. This message and the messages in it can also be read from TOML and written to TOML.
const CAMPAIGN: &str = "murmuration.v1.CampaignSpec";

/// Messages and enums that a campaign file writes as one value, each with the module that reads and writes such a value.
const VALUES: [(&str, &str); 4] = [
    ("SensorAngle", "crate::toml_forms::angle"),
    ("Ratio", "crate::toml_forms::ratios"),
    ("Genes", "crate::toml_forms::genes"),
    ("Method", "crate::toml_forms::method"),
];

/// Other fields whose form in a campaign file differs from their type, each with its module.
const FIELDS: [(&str, &str); 3] = [
    ("StartShape.poses", "crate::toml_forms::poses"),
    ("CampaignSpec.training", "crate::toml_forms::table"),
    ("Feedback.recipe", "crate::toml_forms::table"),
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
            "murmuration/v1/study.proto",
        ],
        ["."],
    )?;
    let out = PathBuf::from(std::env::var("OUT_DIR")?);
    fs::write(out.join("descriptors.bin"), files.encode_to_vec())?;
    let contract = DescriptorPool::from_file_descriptor_set(files.clone())?;
    let campaign = contract
        .get_message_by_name(CAMPAIGN)
        .ok_or_else(|| format!("the contract has no message {CAMPAIGN}"))?;
    let sections = sections(campaign);
    fs::write(out.join("sections.rs"), listed(&sections))?;

    let methods = contract
        .get_enum_by_name("murmuration.v1.Method")
        .ok_or("the contract has no enum Method")?;
    fs::write(out.join("methods.rs"), format!("&{:?}", names(&methods)))?;

    // A message finds its descriptor by its name.
    let mut named = prost_build::Config::new();
    named.enable_type_names();
    let mut config = tonic_prost_build::configure()
        .build_transport(true)
        .codec_path("crate::codec::BoundedCodec");
    for (_, message) in &sections {
        config = config
            .type_attribute(
                message.full_name(),
                "#[derive(serde::Serialize, serde::Deserialize)]",
            )
            .type_attribute(message.full_name(), "#[serde(default, deny_unknown_fields)]");
        for field in message.fields() {
            for attribute in attributes(&field) {
                config = config.field_attribute(field.full_name(), attribute);
            }
        }
    }
    config.compile_fds_with_config(files, named)?;
    println!("cargo:rerun-if-changed=murmuration");
    Ok(())
}

/// Names of the values of an enum from 1 on, as files write them: `hand-crafted` for `METHOD_HAND_CRAFTED`.
fn names(of: &EnumDescriptor) -> Vec<String> {
    let prefix = format!("{}_", of.name().to_uppercase());
    let mut values: Vec<_> = of.values().filter(|value| value.number() > 0).collect();
    values.sort_by_key(|value| value.number());
    let name = |value: &EnumValueDescriptor| value.name().trim_start_matches(&prefix).to_lowercase();
    values.iter().map(|value| name(value).replace('_', "-")).collect()
}

/// Each message of a campaign file once, with the path of its table.
fn sections(campaign: MessageDescriptor) -> Vec<(String, MessageDescriptor)> {
    let mut sections = vec![(String::new(), campaign)];
    let mut place = 0;
    while let Some((path, message)) = sections.get(place).cloned() {
        place += 1;
        for field in message.fields() {
            let Kind::Message(inner) = field.kind() else {
                continue;
            };
            let is_value = VALUES.iter().any(|(value, _)| *value == inner.name());
            if !is_value && sections.iter().all(|(_, known)| *known != inner) {
                let path = format!("{path}.{}", field.name());
                sections.push((path.trim_start_matches('.').to_owned(), inner));
            }
        }
    }
    sections
}

/// The serde attributes of a field of a campaign file.
fn attributes(field: &FieldDescriptor) -> Vec<String> {
    let kind = match field.kind() {
        Kind::Message(message) => message.name().to_owned(),
        Kind::Enum(values) => values.name().to_owned(),
        _ => String::new(),
    };
    let name = format!("{}.{}", field.parent_message().name(), field.name());
    let mut modules = VALUES.iter().chain(&FIELDS);
    let module = modules.find(|(known, _)| *known == kind || *known == name);
    let mut attributes: Vec<String> = Vec::new();
    attributes.extend(module.map(|(_, module)| format!("#[serde(with = \"{module}\")]")));
    if field.is_list() {
        attributes.push("#[serde(skip_serializing_if = \"Vec::is_empty\")]".to_owned());
    } else if module.is_some() && field.supports_presence() {
        attributes.push("#[serde(skip_serializing_if = \"Option::is_none\")]".to_owned());
    }
    attributes
}

/// The sections as a Rust list of `Section`.
fn listed(sections: &[(String, MessageDescriptor)]) -> String {
    let mut list = String::from("&[");
    for (path, message) in sections {
        list += &format!("Section {{ path: {path:?}, fields: Cow::Borrowed(&[");
        for field in message.fields() {
            let explanation = comment(&field);
            list += &format!(
                "Field {{ name: {:?}, explanation: {explanation:?} }}, ",
                field.name()
            );
        }
        list += "]) }, ";
    }
    list + "]"
}

/// The comment on a field, on one line.
fn comment(field: &FieldDescriptor) -> Option<String> {
    let file = field.parent_file().file_descriptor_proto().clone();
    let locations = file.source_code_info.map_or_else(Vec::new, |info| info.location);
    let location = locations.iter().find(|location| location.path == field.path())?;
    let words: Vec<&str> = location.leading_comments().split_whitespace().collect();
    Some(words.join(" "))
}
