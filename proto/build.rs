//! Compiles the `.proto` files with protox, so that no `protoc` binary is needed.

use prost::Message as _;
use protox::prost_reflect::{
    DescriptorPool, EnumDescriptor, EnumValueDescriptor, FieldDescriptor, Kind, MessageDescriptor,
};
use std::{error::Error, fs, path::PathBuf};
use tonic_prost_build::Builder;

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
const FIELDS: [(&str, &str); 10] = [
    ("Sensor.sees", "crate::toml_forms::sees"),
    ("StartShape.poses", "crate::toml_forms::poses"),
    ("CampaignSpec.training", "crate::toml_forms::training"),
    ("Feedback.recipe", "crate::toml_forms::recipe"),
    ("Network.layers", "crate::toml_forms::layers"),
    ("InBatch.crop", "crate::toml_forms::pair"),
    ("RandomTriplets.crop", "crate::toml_forms::pair"),
    ("Labelled.crop", "crate::toml_forms::pair"),
    ("Labelled.unlabelled_crop", "crate::toml_forms::pair"),
    ("PaperLabelled.crop", "crate::toml_forms::pair"),
];

/// Tables that a message holds as TOML text, each with the message of its fields.
const TEXTS: [(&str, &str); 2] = [("CampaignSpec.training", "Training"), ("Feedback.recipe", RECIPE)];

/// The recipes of the two tables `training.recipe` and `feedback.recipe`.
const RECIPE: &str = "Recipe";

/// The recipes that belong in `feedback.recipe`. All other recipes belong in `training.recipe`.
const LABELLED: [&str; 2] = ["labelled", "paper_labelled"];

fn main() -> Result<(), Box<dyn Error>> {
    let files = protox::compile(
        [
            "murmuration/v1/campaign.proto",
            "murmuration/v1/training.proto",
            "murmuration/v1/worker.proto",
            "murmuration/v1/checkpoint.proto",
            "murmuration/v1/trainer.proto",
            "murmuration/v1/label.proto",
            "murmuration/v1/evaluation.proto",
            "murmuration/v1/transfer.proto",
            "murmuration/v1/study.proto",
            "murmuration/v1/node.proto",
            "keda/externalscaler.proto",
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
    fs::write(out.join("sections.rs"), listed(&sections)?)?;
    let mut messages: Vec<_> = sections.into_iter().map(|(_, message)| message).collect();
    messages.sort_by(|one, other| one.full_name().cmp(other.full_name()));
    messages.dedup();
    let choices = messages.iter().filter(|message| is_choice(message));
    fs::write(out.join("choices.rs"), choices.map(written).collect::<String>())?;

    let methods = contract
        .get_enum_by_name("murmuration.v1.Method")
        .ok_or("the contract has no enum Method")?;
    fs::write(out.join("methods.rs"), format!("&{:?}", names(&methods)))?;

    // A message finds its descriptor by its name.
    let mut named = prost_build::Config::new();
    named.enable_type_names();
    let config = tonic_prost_build::configure()
        .build_transport(true)
        .codec_path("crate::codec::BoundedCodec");
    with_forms(config, &messages).compile_fds_with_config(files, named)?;
    println!("cargo:rerun-if-changed=murmuration");
    println!("cargo:rerun-if-changed=keda");
    Ok(())
}

/// The configuration that also makes the messages readable from TOML and writable to TOML.
fn with_forms(mut config: Builder, messages: &[MessageDescriptor]) -> Builder {
    let choices = messages.iter().filter(|message| is_choice(message));
    let alternatives: Vec<_> = choices
        .flat_map(MessageDescriptor::fields)
        .filter_map(|field| table(&field))
        .collect();
    for message in messages {
        for (place, attribute) in type_attributes(message, alternatives.contains(message)) {
            config = config.type_attribute(place, attribute);
        }
        for field in message.fields().filter(|_| !is_choice(message)) {
            for attribute in attributes(&field) {
                config = config.field_attribute(field.full_name(), attribute);
            }
        }
    }
    config
}

/// Names of the values of an enum from 1 on, as files write them: `hand-crafted` for `METHOD_HAND_CRAFTED`.
fn names(of: &EnumDescriptor) -> Vec<String> {
    let prefix = format!("{}_", of.name().to_uppercase());
    let mut values: Vec<_> = of.values().filter(|value| value.number() > 0).collect();
    values.sort_by_key(|value| value.number());
    let name = |value: &EnumValueDescriptor| value.name().trim_start_matches(&prefix).to_lowercase();
    values.iter().map(|value| name(value).replace('_', "-")).collect()
}

/// The tables of a campaign file: the path of each, with its message. A message that is the form of several tables is the section
/// of its first path. Only the message of the recipes has two sections.
fn sections(campaign: MessageDescriptor) -> Vec<(String, MessageDescriptor)> {
    let mut sections = vec![(String::new(), campaign)];
    let mut place = 0;
    while let Some((path, message)) = sections.get(place).cloned() {
        place += 1;
        for field in message.fields().filter(|field| belongs(field, &path)) {
            let Some(inner) = table(&field) else {
                continue;
            };
            if inner.name() == RECIPE || sections.iter().all(|(_, known)| *known != inner) {
                let path = format!("{path}.{}", name(&field));
                sections.push((path.trim_start_matches('.').to_owned(), inner));
            }
        }
    }
    sections
}

/// Whether the section at `path` has the field. The recipes are in two sections.
fn belongs(field: &FieldDescriptor, path: &str) -> bool {
    field.parent_message().name() != RECIPE
        || LABELLED.contains(&field.name()) == path.starts_with("feedback.")
}

/// The message of a field that is a table in a campaign file, or a list of tables.
fn table(field: &FieldDescriptor) -> Option<MessageDescriptor> {
    let text = TEXTS.iter().find(|(known, _)| *known == path(field));
    match (text, field.kind()) {
        (Some((_, message)), _) => {
            let package = field.parent_message().package_name().to_owned();
            let pool = field.parent_message().parent_pool().clone();
            pool.get_message_by_name(&format!("{package}.{message}"))
        }
        (None, Kind::Message(inner)) => {
            let is_value = VALUES.iter().any(|(value, _)| *value == inner.name());
            (!is_value).then_some(inner)
        }
        (None, _) => None,
    }
}

/// A field with its message, such as `Feedback.recipe`.
fn path(field: &FieldDescriptor) -> String {
    format!("{}.{}", field.parent_message().name(), field.name())
}

/// The name of a field in a campaign file. The alternatives of a choice have hyphens: `in-batch` for `in_batch`.
fn name(field: &FieldDescriptor) -> String {
    match is_choice(field.parent_message()) {
        true => field.name().replace('_', "-"),
        false => field.name().to_owned(),
    }
}

/// Whether a message has exactly one of its fields. A campaign file writes such a message as a table of one name, or as the name
/// alone.
fn is_choice(message: &MessageDescriptor) -> bool {
    message.oneofs().any(|oneof| !oneof.is_synthetic())
}

/// The serde attributes of a message, each with its type. Fields of an alternative of a choice must be given, except optional
/// fields and lists.
fn type_attributes(message: &MessageDescriptor, is_alternative: bool) -> Vec<(String, &'static str)> {
    let of = |attribute| (message.full_name().to_owned(), attribute);
    let mut attributes = vec![of("#[derive(serde::Serialize, serde::Deserialize)]")];
    if is_choice(message) {
        let kind = format!("{}.kind", message.full_name());
        attributes.push(of("#[serde(transparent)]"));
        attributes.push((kind.clone(), "#[derive(serde::Deserialize)]"));
        attributes.push((kind, "#[serde(rename_all = \"kebab-case\")]"));
    } else if is_alternative {
        attributes.push(of("#[serde(deny_unknown_fields)]"));
    } else {
        attributes.push(of("#[serde(default, deny_unknown_fields)]"));
    }
    attributes
}

/// The code that writes the oneof `kind` of a choice. An alternative without fields is written as its name alone.
fn written(choice: &MessageDescriptor) -> String {
    let mut code = format!(
        "impl serde::Serialize for crate::v1::{}::Kind {{ \
         fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {{ match self {{",
        choice.name().to_lowercase()
    );
    for (place, field) in choice.fields().enumerate() {
        let name = name(&field);
        let variant: String = field.name().split('_').map(capital).collect();
        code += &match table(&field).is_some_and(|inner| inner.fields().len() > 0) {
            true => format!(
                "Self::{variant}(inner) => serializer.serialize_newtype_variant(\"Kind\", {place}, {name:?}, inner),"
            ),
            false => format!(
                "Self::{variant}(_) => serializer.serialize_unit_variant(\"Kind\", {place}, {name:?}),"
            ),
        };
    }
    code + "} } }\n"
}

/// The word with a capital letter.
fn capital(word: &str) -> String {
    let (first, rest) = word.split_at(word.len().min(1));
    first.to_uppercase() + rest
}

/// The serde attributes of a field of a campaign file.
fn attributes(field: &FieldDescriptor) -> Vec<String> {
    let kind = match field.kind() {
        Kind::Message(message) => message.name().to_owned(),
        Kind::Enum(values) => values.name().to_owned(),
        _ => String::new(),
    };
    let name = path(field);
    let mut modules = VALUES.iter().chain(&FIELDS);
    let module = modules.find(|(known, _)| *known == kind || *known == name);
    let mut attributes: Vec<String> = Vec::new();
    attributes.extend(module.map(|(_, module)| format!("#[serde(with = \"{module}\")]")));
    if field.is_list() {
        attributes.push("#[serde(default, skip_serializing_if = \"Vec::is_empty\")]".to_owned());
    } else if module.is_some() && field.supports_presence() {
        attributes.push("#[serde(skip_serializing_if = \"Option::is_none\")]".to_owned());
    }
    attributes
}

/// The sections that have fields, as a Rust list of `Section`.
fn listed(sections: &[(String, MessageDescriptor)]) -> Result<String, Box<dyn Error>> {
    let mut list = String::from("&[");
    for (path, message) in sections.iter().filter(|(_, message)| message.fields().len() > 0) {
        list += &format!("Section {{ path: {path:?}, fields: &[");
        for field in message.fields().filter(|field| belongs(field, path)) {
            list += &format!(
                "Field {{ name: {:?}, explanation: {:?} }}, ",
                name(&field),
                comment(&field)?
            );
        }
        list += "] }, ";
    }
    Ok(list + "]")
}

/// The comment on a field, on one line.
fn comment(field: &FieldDescriptor) -> Result<String, Box<dyn Error>> {
    let file = field.parent_file().file_descriptor_proto().clone();
    let locations = file.source_code_info.map_or_else(Vec::new, |info| info.location);
    let location = locations.iter().find(|location| location.path == field.path());
    let words = location
        .map_or("", |location| location.leading_comments())
        .split_whitespace();
    match words.collect::<Vec<_>>().join(" ") {
        empty if empty.is_empty() => Err(format!("the field {} has no comment", field.full_name()).into()),
        comment => Ok(comment),
    }
}
