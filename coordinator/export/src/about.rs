//! `README.md`: what the files and their columns mean. The code that writes a table describes its columns.

use crate::{
    CHECKPOINTS, DATABASE, DATASHEET, GENERATIONS, INDIVIDUALS, LABELS, PICTURES, TAXONOMY,
    columns::metadata, description, digests, individuals, labels, pictures, small_tables,
};
use arrow_schema::{DataType, Schema};
use murmuration_model::{CampaignState, ExportedCampaign};
use murmuration_store::CheckpointRecord;
use std::fmt::Write as _;

/// The page of an export.
pub(crate) fn page(campaign: &ExportedCampaign, has_csv: bool, checkpoints: &[CheckpointRecord]) -> String {
    let record = &campaign.record;
    let id = &record.id;
    let mut page = format!(
        "# Campaign {id}\n\n\
         Everything that Murmuration {version} had on disk of this campaign, {individuals} individuals of {generations} \
         generations, when it was exported. Its state was: {state}.\n\n\
         - `murmuration import DIR` takes the folder back, to the same digest: `{digest}`.\n\
         - `murmuration run spec.toml` runs the campaign again.\n\
         - `b3sum --check {sums}` checks the files. `import` refuses a folder in which one was changed.\n\
         - [{DATASHEET}]({DATASHEET}) says where the data come from, and what they are for.\n\n\
         | file | contents |\n|---|---|\n\
         | `{DATABASE}` | everything, as one SQLite database: what `murmuration import` reads. Its numbers are packed; read the other files for anything else |\n\
         | `spec.toml` | the specification, with every default |\n\
         | `campaign.json` | everything else of the campaign itself |\n\
         | `{INDIVIDUALS}` | a row for each individual |\n\
         | `{PICTURES}` | its array `pictures` has the pictures of the individuals, in the same order |\n\
         | `{GENERATIONS}` | a row for each generation |\n\
         | `{LABELS}` | a row for each entry of the label log |\n",
        version = env!("CARGO_PKG_VERSION"),
        individuals = record.individuals(),
        generations = record.generations_done,
        state = record.state.name(),
        digest = campaign.digest,
        sums = digests::FILE,
    );
    if record.state == CampaignState::Completed {
        let _ = writeln!(
            page,
            "| `{TAXONOMY}` | a row for each medoid of the newest version of the taxonomy; former versions are not exported |"
        );
    }
    if !checkpoints.is_empty() {
        let _ = writeln!(
            page,
            "| `{CHECKPOINTS}/DIGEST.onnx` | embedders, as ONNX, each with its origin in the `.json` beside it |"
        );
    }
    if has_csv {
        page += "| `*.csv` | the same tables as CSV, but without `robust_trials` and the trials of individuals; that of labels has the \
                 answers that stand |\n";
    }
    page += &embedder(campaign);
    page += &pictures_section(campaign);
    page += &table(INDIVIDUALS, &individuals::columns(&record.spec));
    page += &table(GENERATIONS, &small_tables::generation_columns());
    page += &table(LABELS, &labels::columns());
    if record.state == CampaignState::Completed {
        page += &table(TAXONOMY, &small_tables::taxonomy_columns());
    }
    page
}

fn embedder(campaign: &ExportedCampaign) -> String {
    match campaign.record.embedder.checkpoint() {
        None => String::new(),
        Some(digest) => format!(
            "\nThe embeddings are those of `{}`. It reads pictures with an axis for channels, as float32 \
             from 0 to 255, column by column: `pictures.reshape(-1, channels, side, side).swapaxes(-1, -2).astype(\"float32\")`.\n",
            description::onnx(digest)
        ),
    }
}

fn pictures_section(campaign: &ExportedCampaign) -> String {
    let spec = &campaign.record.spec;
    let shape = pictures::shape(spec, campaign.record.individuals());
    let mut axes = vec!["individuals"];
    axes.extend((spec.starts().get() > 1).then_some("starts"));
    axes.extend((spec.image().shape().channels() > 1).then_some("channels"));
    axes.extend(["rows from the top down", "columns"]);
    format!(
        "\n## {PICTURES}\n\n```python\nimport numpy as np\n\npictures = np.load(\"{PICTURES}\")[\"pictures\"]  # uint8 {shape:?}\n```\n\n\
         Grey values, 0 to 255; the axes are {}. A picture shows where the robots were in the last {} steps.\n",
        axes.join(", "),
        spec.image().window(),
    )
}

/// A Markdown table of the columns of a data table.
fn table(name: &str, schema: &Schema) -> String {
    let mut text = format!("\n## {name}\n\n| column | kind | about | unit |\n|---|---|---|---|\n");
    for field in schema.fields() {
        let names = metadata(field, "names");
        let about = match names.as_str() {
            "" => metadata(field, "about"),
            names => format!("{}: {names}", metadata(field, "about")),
        };
        let kind = kind(field.data_type());
        let _ = writeln!(
            text,
            "| `{}` | {kind} | {about} | {} |",
            field.name(),
            metadata(field, "unit")
        );
    }
    text
}

/// The kind of a column, for people.
fn kind(of: &DataType) -> String {
    match of {
        DataType::List(item) => format!("list of {}", kind(item.data_type())),
        DataType::Struct(fields) => {
            let fields: Vec<&str> = fields.iter().map(|field| field.name().as_str()).collect();
            format!("({})", fields.join(", "))
        }
        DataType::Utf8 => "text".to_owned(),
        DataType::Boolean => "boolean".to_owned(),
        DataType::Timestamp(..) => "time".to_owned(),
        other => other.to_string().to_lowercase(),
    }
}
