//! `checkpoints`: published embedders, listed, shown, exported and imported.

use super::{
    CliError, Global,
    connection::{CheckpointClient, Connection},
    json,
};
use crate::{local::Crew, store::DataDirectory};
use murmuration_proto::{CheckpointDigest, Lineage, v1};
use std::{
    fs,
    path::{Path, PathBuf},
};

/// What to do with checkpoints.
#[derive(Debug, clap::Subcommand)]
pub(super) enum CheckpointsCommand {
    /// List the checkpoints
    List,
    /// Show where a checkpoint came from, and its figures
    Show {
        /// Digest, or enough of its beginning
        digest: String,
    },
    /// Write a checkpoint as an ONNX file
    Export {
        /// Digest, or enough of its beginning
        digest: String,
        /// File to write
        file: PathBuf,
    },
    /// Store an ONNX file as a checkpoint
    Import {
        /// File to read
        file: PathBuf,
    },
}

impl CheckpointsCommand {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let mut connection = match &self {
            Self::Import { .. } if global.coordinator.is_none() && !global.data.exists() => {
                Connection::start(global, DataDirectory::hold(&global.data)?, Crew::NONE).await?
            }
            _ => Connection::open(global, Crew::NONE).await?,
        };
        let done = self.with(&mut connection.checkpoints, global.json).await;
        connection.close().await?;
        done
    }

    async fn with(self, client: &mut CheckpointClient, as_json: bool) -> Result<(), CliError> {
        match self {
            Self::List => list(client, as_json).await,
            Self::Show { digest } => {
                let checkpoint = find(client, &digest).await?;
                print_whole(&checkpoint, as_json);
                Ok(())
            }
            Self::Export { digest, file } => export(client, &digest, &file).await,
            Self::Import { file } => import(client, &file, as_json).await,
        }
    }
}

async fn list(client: &mut CheckpointClient, as_json: bool) -> Result<(), CliError> {
    let checkpoints = all(client).await?;
    if as_json {
        checkpoints
            .iter()
            .map(json::checkpoint)
            .for_each(|checkpoint| json::print(&checkpoint));
        return Ok(());
    }
    println!("{:<64} {:>9}  PARENT", "CHECKPOINT", "BYTES");
    for checkpoint in checkpoints {
        let parent: String = checkpoint.parent.chars().take(12).collect();
        println!("{} {:>9}  {parent}", checkpoint.digest, checkpoint.size);
    }
    Ok(())
}

fn print_whole(checkpoint: &v1::Checkpoint, as_json: bool) {
    if as_json {
        json::print(&json::checkpoint(checkpoint));
        return;
    }
    println!("# checkpoint {}, {} bytes", checkpoint.digest, checkpoint.size);
    for (what, digest) in [
        ("trained on from", &checkpoint.parent),
        ("images", &checkpoint.data_digest),
        ("labels", &checkpoint.label_digest),
    ] {
        if !digest.is_empty() {
            println!("# {what}: {digest}");
        }
    }
    let mut metrics: Vec<_> = checkpoint.metrics.iter().collect();
    metrics.sort_by_key(|(name, _)| *name);
    for (name, value) in metrics {
        println!("# {name}: {value}");
    }
    print!("{}", checkpoint.configuration);
}

async fn export(client: &mut CheckpointClient, digest: &str, file: &Path) -> Result<(), CliError> {
    let bytes = fetch(client, digest).await?;
    fs::write(file, bytes).map_err(|error| CliError::unwritable(file, &error))?;
    eprintln!("wrote {}", file.display());
    Ok(())
}

/// The model of the one checkpoint whose digest begins like this.
pub(super) async fn fetch(client: &mut CheckpointClient, beginning: &str) -> Result<Vec<u8>, CliError> {
    let digest = find(client, beginning).await?.digest;
    let request = v1::FetchCheckpointRequest {
        digest: digest.clone(),
    };
    let mut chunks = client.fetch_checkpoint(request).await?.into_inner();
    let mut bytes = Vec::new();
    while let Some(chunk) = chunks.message().await? {
        bytes.extend(chunk.data);
    }
    if CheckpointDigest::of(&bytes).to_string() != digest {
        return Err(CliError::Failed(format!(
            "the bytes that came are not those of checkpoint {digest}"
        )));
    }
    Ok(bytes)
}

async fn import(client: &mut CheckpointClient, file: &Path, as_json: bool) -> Result<(), CliError> {
    let bytes = fs::read(file).map_err(|error| CliError::unreadable(file, &error))?;
    let parts = Lineage::default().publish_requests(&bytes);
    let checkpoint = client
        .publish_checkpoint(tokio_stream::iter(parts))
        .await?
        .into_inner();
    if as_json {
        json::print(&json::checkpoint(&checkpoint));
    } else {
        println!("{}", checkpoint.digest);
    }
    Ok(())
}

async fn all(client: &mut CheckpointClient) -> Result<Vec<v1::Checkpoint>, CliError> {
    Ok(client
        .list_checkpoints(v1::ListCheckpointsRequest {})
        .await?
        .into_inner()
        .checkpoints)
}

/// The one checkpoint whose digest begins like this.
pub(super) async fn find(client: &mut CheckpointClient, beginning: &str) -> Result<v1::Checkpoint, CliError> {
    let mut found = all(client).await?;
    found.retain(|checkpoint| checkpoint.digest.starts_with(beginning));
    match (found.pop(), found.len()) {
        (Some(one), 0) => Ok(one),
        (None, _) => Err(CliError::Input(format!(
            "there is no checkpoint \"{beginning}\": `murmuration checkpoints list` shows those there are"
        ))),
        (Some(_), others) => {
            let count = others + 1;
            Err(CliError::Input(format!(
                "\"{beginning}\" is the beginning of {count} checkpoints: give more of it"
            )))
        }
    }
}
