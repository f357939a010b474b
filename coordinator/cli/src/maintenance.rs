//! `backup`, `restore`, `doctor`: commands that use a data directory of this machine without its coordinator.

use super::{CliError, Global, json};
use murmuration_link::{OutputError, errln, outln, termination};
use murmuration_search::interrupt::Interrupt;
use murmuration_store::{
    StoreError,
    backup::{self, BackupError, Manifest},
    checkpoints::{CheckpointError, Condition},
    doctor::{self, CampaignCondition, CampaignFindings, Findings},
};
use murmuration_swarm::{counted, text::masked_url};
use std::{
    path::{Path, PathBuf},
    pin::pin,
};

/// Advice on a data directory that another process holds.
const WHILE_IN_USE: &str = "stop that process first; or back up the data directory while it is in use (`murmuration backup NEW_DIR`) \
                            and check the backup (`murmuration doctor --data NEW_DIR`)";

#[derive(Debug, clap::Args)]
#[command(after_help = "\
A backup is safe while a coordinator runs: it is a consistent copy, is checked, and appears under its name only once it is \
complete. Run the command on the machine of the data directory. Reports and caches are not copied, since they are written \
again when needed. The folder must be outside the data directory.

Example:
  murmuration backup /backups/$(date +%F)")]
pub struct Backup {
    /// New folder for the backup
    folder: PathBuf,
}

#[derive(Debug, clap::Args)]
#[command(after_help = "\
The command copies a backup to the data directory (--data), which must be empty or absent. `murmuration serve` or \
`murmuration resume` then continues the campaigns that were running.

Example:
  murmuration restore /backups/2026-11-21 --data murmuration-data")]
pub struct Restore {
    /// Folder of the backup
    folder: PathBuf,
}

#[derive(Debug, clap::Args)]
#[command(after_help = "\
The command checks the database, the checkpoints and the campaigns, and changes nothing. Exit code 0 means that everything \
is undamaged, 1 that something is damaged or cannot be checked.

Example:
  murmuration doctor")]
pub struct Doctor {}

impl Backup {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        of_this_machine(global)?;
        let location = global.checkpoint_store.as_deref();
        let manifest = until_told(async |interrupt| {
            backup::backup(&global.data, location, &self.folder, interrupt).await
        })
        .await?;
        Ok(tell(global, &manifest, &self.folder, "backed up")?)
    }
}

impl Restore {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        of_this_machine(global)?;
        let manifest =
            until_told(async |interrupt| backup::restore(&self.folder, &global.data, interrupt).await)
                .await?;
        Ok(tell(global, &manifest, &global.data, "restored")?)
    }
}

/// Runs `work`, and interrupts it at a termination signal. Interrupted work removes the files that it has written.
async fn until_told(
    work: impl AsyncFnOnce(&Interrupt) -> Result<Manifest, BackupError>,
) -> Result<Manifest, CliError> {
    let interrupt = Interrupt::default();
    let mut work = pin!(work(&interrupt));
    tokio::select! {
        done = &mut work => return Ok(done?),
        _ = termination() => interrupt.raise(),
    }
    Ok(work.await?)
}

fn tell(global: &Global, manifest: &Manifest, folder: &Path, done: &str) -> Result<(), OutputError> {
    if global.json {
        json::print(json::Backup::new(folder.display().to_string(), manifest))?;
    } else {
        outln!("{}", folder.display())?;
        errln!(
            "{done}: the database, and {}",
            counted(
                match manifest.checkpoint_store {
                    Some(_) => 0,
                    None => manifest.checkpoints.len() as u64,
                },
                "checkpoint"
            )
        );
    }
    if let Some(bucket) = &manifest.checkpoint_store {
        errln!(
            "the checkpoints at {} (--checkpoint-store) are not part of the backup: back them up there",
            masked_url(bucket)
        );
    }
    Ok(())
}

impl Doctor {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        of_this_machine(global)?;
        let location = global.checkpoint_store.as_deref();
        let held = |error: StoreError| match error {
            StoreError::InUse { .. } => CliError::busy(error, WHILE_IN_USE),
            StoreError::Damaged { path, reason } => CliError::Failed(format!(
                "{} cannot be read ({reason}): restore a backup with `murmuration restore`",
                path.display()
            )),
            error => error.into(),
        };
        let found = doctor::examine(&global.data, location).await;
        let found = found.map_err(|error| match error {
            CheckpointError::Store(error) => held(error),
            error => CliError::Failed(error.to_string()),
        })?;
        if global.json {
            json::print(json::Doctor::new(&found))?;
        } else {
            print(&found)?;
        }
        if found.is_healthy() {
            return Ok(());
        }
        Err(CliError::Failed(format!(
            "{} is damaged: restore a backup with `murmuration restore BACKUP --data NEW_DIR`",
            global.data.display()
        )))
    }
}

pub(super) fn of_this_machine(global: &Global) -> Result<(), CliError> {
    match &global.coordinator {
        Some(url) => Err(CliError::Input(format!(
            "this command reads a data directory, not the coordinator at {}: run it on that machine with --data DIR",
            masked_url(url)
        ))),
        None => Ok(()),
    }
}

fn print(found: &Findings) -> Result<(), OutputError> {
    let state = if found.faults.is_empty() {
        "undamaged"
    } else {
        "damaged"
    };
    outln!(
        "database {}: {state}, schema {}",
        found.database.display(),
        found.schema
    )?;
    for fault in &found.faults {
        outln!("  {fault}")?;
    }
    for (digest, condition) in &found.checkpoints {
        outln!("checkpoint {digest}: {}", condition_name(condition))?;
    }
    for campaign in &found.campaigns {
        print_campaign(campaign)?;
    }
    Ok(())
}

fn print_campaign(campaign: &CampaignFindings) -> Result<(), OutputError> {
    let CampaignFindings { stored, whole, .. } = campaign;
    let state = campaign.state.map_or("unreadable", |state| state.name());
    let generations = counted(stored.generations.into(), "generation");
    let entries = format!("{} of the label log", counted(stored.labels, "entry"));
    let amount = format!(
        "{} of {generations} and {} of {entries} are undamaged",
        whole.generations, whole.labels,
    );
    let verdict = match campaign.condition {
        CampaignCondition::Whole => format!("undamaged ({generations}, {entries})"),
        CampaignCondition::LacksCheckpoint => {
            "undamaged, but its checkpoint is missing or damaged".to_owned()
        }
        CampaignCondition::Damaged => format!("damaged: {amount}"),
        CampaignCondition::Unreadable => "its specification cannot be read".to_owned(),
    };
    outln!("campaign {} ({state}): {verdict}", campaign.id)?;
    for problem in campaign.problems.iter().chain(&campaign.note) {
        outln!("  {problem}")?;
    }
    Ok(())
}

/// The condition of a checkpoint in a word or two.
pub(super) fn condition_name(condition: &Condition) -> &str {
    match condition {
        Condition::Whole => "undamaged",
        Condition::Missing => "missing: import a copy with `murmuration checkpoints import`",
        Condition::Damaged => {
            "damaged: remove the file, and import a copy with `murmuration checkpoints import`"
        }
        Condition::Unread(why) => why,
    }
}
