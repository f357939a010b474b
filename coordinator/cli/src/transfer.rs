//! `export` and `import`: write a campaign as a folder of files, and read it from such a folder.

use super::{
    CliError, Global,
    connection::{self, Connection},
    files::{expect_outside_data, is_there},
    json,
    validation::validated,
};
use murmuration_coordinator::local::InProcess;
use murmuration_export::{CheckedExport, ExportError, Exported, NewFolder};
use murmuration_link::{errln, outln, termination};
use murmuration_model::CampaignState;
use murmuration_proto::{PART_BYTES, v1};
use murmuration_store::{DataDirectory, Store, StoreError, remove_new};
use murmuration_swarm::counted;
use std::{
    mem,
    path::{Path, PathBuf},
};
use tokio::sync::mpsc;
use tokio_stream::{StreamExt as _, wrappers::ReceiverStream};
use tonic::Code;

/// Arguments of `export`.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
The folder has the campaign as one SQLite database, which `murmuration import` reads. For other programs, it has the individuals, \
labels and generations as Parquet, the pictures as NPZ, the embedders as ONNX, the specification, a README.md about every column, and \
a datasheet. An export of a running campaign has everything that is on disk at this moment.

Examples:
  murmuration export latest my-campaign
  murmuration export latest my-campaign --csv --force")]
pub struct Export {
    /// Campaign id, or `latest`
    campaign: String,
    /// New folder for the files
    folder: PathBuf,
    /// Add every table as CSV
    #[arg(long)]
    csv: bool,
    /// Replace an export that is in the folder
    #[arg(long)]
    force: bool,
}

/// Arguments of `import`.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Every file is checked against its digest, every value is checked, and the archive must have the digest that it was exported with; \
otherwise nothing is imported. The campaign keeps its id. One that was running is paused: `murmuration resume` continues it.

Examples:
  murmuration import my-campaign
  murmuration import my-campaign --data other-data")]
pub struct Import {
    /// Folder that `murmuration export` wrote
    folder: PathBuf,
}

impl Export {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        expect_outside_data(&self.folder)?;
        // A command that is interrupted removes its unfinished files.
        let export = async |connection: &mut Connection| {
            tokio::select! {
                exported = self.export(connection) => exported,
                signal = termination() => Err(CliError::Failed(signal.to_owned())),
            }
        };
        let exported = connection::with(global, InProcess::NONE, export).await?;
        let record = &exported.campaign.record;
        errln!(
            "exported: campaign {} ({}), {} of {}, and {} of its label log",
            record.id,
            record.state.name(),
            counted(record.individuals(), "individual"),
            counted(record.generations_done.into(), "generation"),
            counted(exported.campaign.label_entries, "entry")
        );
        if record.state == CampaignState::Running {
            errln!("the campaign is running: later generations are not in the export");
        }
        if global.json {
            json::print(json::Export::from(&exported))?;
        } else {
            outln!("{}", self.folder.display())?;
        }
        Ok(())
    }

    async fn export(&self, connection: &mut Connection) -> Result<Exported, CliError> {
        let request = v1::ExportCampaignRequest {
            campaign: self.campaign.clone(),
        };
        let mut parts = connection.transfers.export_campaign(request).await?.into_inner();
        let (target, csv, force) = (self.folder.clone(), self.csv, self.force);
        let mut folder = on_disk(move || NewFolder::create(&target, csv, force)).await?;
        while let Some(part) = parts.next().await.transpose()? {
            folder = on_disk(move || folder.add(&part.data).map(|()| folder)).await?;
        }
        on_disk(move || folder.finish()).await
    }
}

impl Import {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let folder = self.folder.clone();
        // The command checks the whole export before it creates a data directory or contacts a coordinator.
        let export = on_disk(move || CheckedExport::open(&folder)).await?;
        let id = export.campaign().clone();
        let import = async |connection: &mut Connection| {
            tokio::select! {
                imported = import(connection, export) => imported,
                signal = termination() => Err(CliError::Failed(signal.to_owned())),
            }
        };
        let is_new = !global.names_coordinator() && !is_there(&global.data)?;
        let imported = connection::with_new(global, InProcess::NONE, import).await;
        if imported.is_err() && is_new {
            remove_empty(&global.data);
        }
        let campaign = imported?;
        let state = CampaignState::try_from(campaign.state())?;
        let next = match state {
            CampaignState::Completed => global.next(&format!("show {id}")),
            _ => global.next(&format!("resume {id}")),
        };
        errln!("imported: campaign {id} ({}); next: {next}", state.name());
        if global.json {
            json::print(json::Document(&campaign))?;
        } else {
            outln!("{id}")?;
        }
        Ok(())
    }
}

/// Removes a data directory that this command created, if it has no campaigns.
fn remove_empty(data: &Path) {
    let Ok(_held) = DataDirectory::watch(data) else {
        return;
    };
    let is_empty = match Store::look(data, true) {
        Ok((store, _)) => store.campaigns().is_ok_and(|campaigns| campaigns.is_empty()),
        Err(StoreError::NoDirectory(_)) => true,
        Err(_) => false,
    };
    if is_empty {
        remove_new(data);
    }
}

/// Sends the database of an export to the coordinator. The coordinator keeps the campaign after it has checked the whole
/// database.
async fn import(connection: &mut Connection, export: CheckedExport) -> Result<v1::Campaign, CliError> {
    let (parts, stream) = mpsc::channel::<v1::CampaignPart>(2);
    let reading = on_disk(move || send(export, &parts));
    let importing = connection.transfers.import_campaign(ReceiverStream::new(stream));
    match tokio::join!(reading, importing) {
        (Err(unread), _) => Err(unread),
        (_, Err(status)) if status.code() == Code::AlreadyExists => {
            Err(CliError::Input(status.message().to_owned()))
        }
        (_, Err(status)) => Err(status.into()),
        (Ok(()), Ok(campaign)) => validated(campaign),
    }
}

/// Sends a database part by part, until all of it is sent or the receiver stops.
fn send(mut export: CheckedExport, parts: &mpsc::Sender<v1::CampaignPart>) -> Result<(), ExportError> {
    let mut campaign = export.campaign().to_string();
    loop {
        let part = v1::CampaignPart {
            campaign: mem::take(&mut campaign),
            data: export.next(PART_BYTES)?,
        };
        if part.data.is_empty() || parts.blocking_send(part).is_err() {
            return Ok(());
        }
    }
}

async fn on_disk<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, ExportError> + Send + 'static,
) -> Result<T, CliError> {
    let done = tokio::task::spawn_blocking(work).await;
    let broken = |_| CliError::Failed("the files could not be written or read because of a bug".to_owned());
    Ok(done.map_err(broken)??)
}
