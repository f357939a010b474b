//! `checkpoints`: lists, shows, exports and imports published embedders.

use super::{
    CliError, Global,
    connection::{self, CheckpointClient, Connection},
    files::{Overwrite, is_there, read},
    json,
    table::{Table, left, right},
    validation::{Validated as _, validated},
};
use murmuration_coordinator::local::InProcess;
use murmuration_embed::{Embedder, Runtime};
use murmuration_files::{InputKind, expect_regular, read_bytes};
use murmuration_link::{OutputError, errln, outln, print};
use murmuration_onnx::{EmbedderModel, MAX_MODEL_BYTES, with_weights};
use murmuration_proto::{parts::whole, v1};
use murmuration_store::DataDirectory;
use murmuration_swarm::{CheckpointDigest, Lineage, check_embedding, counted, grouped};
use std::{
    fmt,
    path::{Path, PathBuf},
};

#[derive(Debug, clap::Subcommand)]
pub enum CheckpointsCommand {
    /// List the checkpoints
    List,
    /// Show the origin and the metrics of a checkpoint
    Show {
        /// Digest of the checkpoint, or its first digits
        digest: String,
    },
    /// Write a checkpoint as an ONNX file
    Export {
        /// Digest of the checkpoint, or its first digits
        digest: String,
        /// File to write
        file: PathBuf,
        #[command(flatten)]
        overwrite: Overwrite,
    },
    /// Store an ONNX file as a checkpoint
    ///
    /// The model takes a batch of pictures of 1 to 4 channels, as floats from 0 to 255, and makes a vector for each. Smaller
    /// pictures of a campaign are enlarged to the model's, and grey pictures repeated for a model of three channels. Weights may
    /// be in files beside FILE, as PyTorch's exporter writes them (NAME.onnx.data).
    Import {
        /// File to read
        file: PathBuf,
    },
}

impl CheckpointsCommand {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let makes_data =
            matches!(self, Self::Import { .. }) && !global.names_coordinator() && !is_there(&global.data)?;
        let ask =
            async |connection: &mut Connection| self.with(&mut connection.checkpoints, global.json).await;
        if makes_data {
            let data = DataDirectory::hold(&global.data)?;
            return connection::with_own(global, data, InProcess::NONE, None, ask).await;
        }
        connection::with(global, InProcess::NONE, ask).await
    }

    async fn with(self, client: &mut CheckpointClient, as_json: bool) -> Result<(), CliError> {
        match self {
            Self::List => list(client, as_json).await,
            Self::Show { digest } => {
                let checkpoint = find(client, &digest).await?;
                Ok(print_whole(&checkpoint, as_json)?)
            }
            Self::Export {
                digest,
                file,
                overwrite,
            } => {
                overwrite.check(&file)?;
                export(client, &digest, &file, overwrite).await
            }
            Self::Import { file } => import(client, &file, as_json).await,
        }
    }
}

async fn list(client: &mut CheckpointClient, as_json: bool) -> Result<(), CliError> {
    let checkpoints = all(client).await?;
    if as_json {
        return Ok(json::print_all(checkpoints.iter().map(json::Document))?);
    }
    let mut table = Table::new([left("CHECKPOINT"), right("BYTES"), left("PARENT")]);
    for checkpoint in checkpoints {
        let parent = checkpoint.parent.chars().take(12).collect();
        table.row([checkpoint.digest, grouped(checkpoint.size), parent]);
    }
    Ok(table.print()?)
}

fn print_whole(checkpoint: &v1::Checkpoint, as_json: bool) -> Result<(), OutputError> {
    if as_json {
        return json::print(json::Document(checkpoint));
    }
    outln!(
        "# checkpoint {}, {}",
        checkpoint.digest,
        counted(checkpoint.size, "byte")
    )?;
    for (what, digest) in [
        ("parent", &checkpoint.parent),
        ("images", &checkpoint.data_digest),
        ("labels", &checkpoint.label_digest),
    ] {
        if !digest.is_empty() {
            outln!("# {what}: {digest}")?;
        }
    }
    let mut metrics: Vec<_> = checkpoint.metrics.iter().collect();
    metrics.sort_by_key(|(name, _)| *name);
    for (name, value) in metrics {
        // The format `{:?}` writes very large and very small numbers with an exponent, not with hundreds of digits.
        outln!("# {name}: {value:?}")?;
    }
    print(&checkpoint.configuration)
}

async fn export(
    client: &mut CheckpointClient,
    digest: &str,
    file: &Path,
    overwrite: Overwrite,
) -> Result<(), CliError> {
    let bytes = fetch(client, digest).await?;
    overwrite.write(file, bytes)
}

/// The ONNX model of the only checkpoint whose digest begins with `beginning`.
pub async fn fetch(client: &mut CheckpointClient, beginning: &str) -> Result<Vec<u8>, CliError> {
    let digest = find(client, beginning).await?.digest;
    let request = v1::FetchCheckpointRequest {
        digest: digest.clone(),
    };
    let mut chunks = client.fetch_checkpoint(request).await?.into_inner();
    let mut bytes = Vec::new();
    while let Some(chunk) = chunks.message().await? {
        bytes.extend(chunk.data);
        if bytes.len() > MAX_MODEL_BYTES {
            let text = format!("checkpoint {digest} is longer than {MAX_MODEL_BYTES} bytes");
            return Err(CliError::Failed(text));
        }
    }
    if CheckpointDigest::of(&bytes).to_string() != digest {
        return Err(CliError::Failed(format!(
            "the bytes that the coordinator sent are not checkpoint {digest}: the coordinator's copy is damaged, or was changed in transfer"
        )));
    }
    Ok(bytes)
}

async fn import(client: &mut CheckpointClient, file: &Path, as_json: bool) -> Result<(), CliError> {
    let bytes = read(file, InputKind::Checkpoint)?;
    let beside = |name: &str| {
        let path = file.with_file_name(name);
        // A pipe would wait without end.
        let weights = expect_regular(&path).and_then(|()| read_bytes(&path, InputKind::Checkpoint));
        weights.map_err(|error| format!("is in {}: {error}", path.display()))
    };
    let refused = |error: &dyn fmt::Display| CliError::Input(format!("{}: {error}", file.display()));
    let bytes = with_weights(&bytes, beside).map_err(|error| refused(&error))?;
    let model = EmbedderModel::read(&bytes).map_err(|error| refused(&error))?;
    let takes = format!(
        "embeds pictures of {} as {} numbers",
        model.images(),
        model.dimensions()
    );
    match Runtime::load() {
        Ok(runtime) => try_out(&runtime, model, refused)?,
        Err(_) => errln!("ONNX Runtime is not installed here, so the embedder was not tried out"),
    }
    let parts = Lineage::default().publish_requests(&bytes);
    let checkpoint = client.publish_checkpoint(tokio_stream::iter(parts)).await?;
    let checkpoint = validated(checkpoint)?;
    if as_json {
        json::print(json::Document(&checkpoint))?;
    } else {
        errln!("{} {takes}", file.display());
        outln!("{}", checkpoint.digest)?;
    }
    Ok(())
}

/// Embeds a black, a white and a striped picture, to find what cannot run or makes numbers that a campaign refuses.
fn try_out(
    runtime: &Runtime,
    model: EmbedderModel,
    refused: impl Fn(&dyn fmt::Display) -> CliError,
) -> Result<(), CliError> {
    let (pixels, dimensions) = (model.images().bytes(), model.dimensions());
    let striped: Vec<u8> = (0..pixels).map(|pixel| (pixel % 7 * 42) as u8).collect();
    let pictures = [vec![0; pixels], vec![255; pixels], striped];
    let embedded = Embedder::open(runtime, model)
        .and_then(|mut embedder| embedder.embed(&pictures.each_ref().map(Vec::as_slice)));
    let embeddings = embedded.map_err(|error| refused(&error))?;
    let mut checked = embeddings
        .iter()
        .map(|embedding| check_embedding(embedding, dimensions));
    checked.try_for_each(|checked| checked.map_err(|error| refused(&error)))
}

async fn all(client: &mut CheckpointClient) -> Result<Vec<v1::Checkpoint>, CliError> {
    let parts = client.list_checkpoints(v1::ListCheckpointsRequest {}).await?;
    whole(parts.into_inner()).await?.checkpoints.validated()
}

/// The only checkpoint whose digest begins with `beginning`.
pub(super) async fn find(client: &mut CheckpointClient, beginning: &str) -> Result<v1::Checkpoint, CliError> {
    let mut found = all(client).await?;
    found.retain(|checkpoint| checkpoint.digest.starts_with(beginning));
    match (found.pop(), found.len()) {
        (Some(one), 0) => Ok(one),
        (None, _) => Err(CliError::Input(format!(
            "there is no checkpoint \"{beginning}\": `murmuration checkpoints list` lists the checkpoints"
        ))),
        (Some(_), others) => {
            let found = counted(others as u64 + 1, "checkpoint");
            Err(CliError::Input(format!(
                "\"{beginning}\" is the beginning of {found}: give more digits"
            )))
        }
    }
}
