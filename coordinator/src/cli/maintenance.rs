//! `backup`, `restore`, `doctor`: what is kept in a data directory of this machine, without its coordinator.

use super::{CliError, Global, json};
use murmuration_link::{OutputError, errln, outln};
use murmuration_proto::counted;
use murmuration_store::{
    StoreError,
    backup::{self, Manifest},
    checkpoints::Condition,
    doctor::{self, CampaignFindings, Findings, Prospect, Salvaged},
};
use std::path::{Path, PathBuf};

/// How a data directory is examined that another process holds.
const WHILE_IN_USE: &str = "stop that process first; or, while it runs, make a checked copy with `murmuration backup NEW_DIR` and \
                            examine that with `murmuration doctor --data NEW_DIR`";

/// Arguments of `backup`.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Safe while a coordinator runs: the copy is of one instant, checked, and appears under its name once it is on disk. Run it on \
the machine of the data directory. Reports and caches are left out: they are made anew. The folder must not be in the data \
directory: what is lost with that would be lost with it.

Example:
  murmuration backup /backups/$(date +%F)")]
pub(super) struct Backup {
    /// Folder to write, which does not exist yet
    folder: PathBuf,
}

/// Arguments of `restore`.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Puts a backup back as the data directory (--data), which must be empty or not exist. Campaigns that were running go on with \
the next `murmuration serve`, or `murmuration resume`.

Example:
  murmuration restore /backups/2026-11-21 --data murmuration-data")]
pub(super) struct Restore {
    /// Folder that `murmuration backup` has written
    folder: PathBuf,
}

/// Arguments of `doctor`.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Looks at everything and changes nothing. Exit code 0: all is well; 1: something is damaged, or cannot be examined. With \
--salvage, 0: what is whole was copied, and what is lost was named; 1: nothing could be saved, and no new folder was made. \
What is lost of an archive is made anew when its campaign is resumed from what was saved.

Example:
  murmuration doctor || murmuration doctor --salvage saved-data")]
pub(super) struct Doctor {
    /// Copy what is whole into this new data directory
    #[arg(long, value_name = "NEW_DIR")]
    salvage: Option<PathBuf>,
}

impl Backup {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        of_this_machine(global)?;
        let manifest = backup::backup(&global.data, global.checkpoint_store.as_deref(), &self.folder).await?;
        Ok(tell(global, &manifest, &self.folder, "backed up")?)
    }
}

impl Restore {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        of_this_machine(global)?;
        let manifest = backup::restore(&self.folder, &global.data).await?;
        Ok(tell(global, &manifest, &global.data, "restored")?)
    }
}

fn tell(global: &Global, manifest: &Manifest, folder: &Path, done: &str) -> Result<(), OutputError> {
    if global.json {
        json::print(&json::backup(&folder.display().to_string(), manifest))?;
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
        errln!("checkpoints are kept at {bucket}: back that up where it is (--checkpoint-store names it)");
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
                "nothing of {} can be read ({reason}): `murmuration restore` puts a backup back",
                path.display()
            )),
            error => error.into(),
        };
        match &self.salvage {
            Some(target) => {
                let salvaged = doctor::salvage(&global.data, location, target).await;
                let salvaged = salvaged.map_err(|error| match error {
                    doctor::SalvageError::Store(error) => held(error),
                    error => CliError::Failed(error.to_string()),
                })?;
                show(global, &salvaged.findings, Some(&salvaged))?;
                tell_saved(&salvaged, &global.data, target)
            }
            None => {
                let found = doctor::examine(&global.data, location).await;
                let found = found.map_err(|error| match error {
                    murmuration_store::checkpoints::CheckpointError::Store(error) => held(error),
                    error => CliError::Failed(error.to_string()),
                })?;
                show(global, &found, None)?;
                if found.is_healthy() {
                    return Ok(());
                }
                Err(CliError::Failed(format!(
                    "{} is damaged: `murmuration doctor --salvage NEW_DIR` copies what is whole into a new data directory",
                    global.data.display()
                )))
            }
        }
    }
}

fn show(global: &Global, found: &Findings, salvaged: Option<&Salvaged>) -> Result<(), OutputError> {
    if global.json {
        json::print(&json::findings(found, salvaged))
    } else {
        print(found)
    }
}

/// Says what is in the new data directory, what is not, and what to type next.
fn tell_saved(salvaged: &Salvaged, data: &Path, target: &Path) -> Result<(), CliError> {
    let found = &salvaged.findings;
    for (campaign, why) in &salvaged.lost {
        errln!("lost: campaign {campaign} ({why})");
    }
    if salvaged.is_empty() {
        if found.is_healthy() {
            errln!(
                "there is nothing to save: {} holds no campaign and no checkpoint",
                data.display()
            );
            return Ok(());
        }
        let why = found.faults.first().map_or("", String::as_str);
        let said = format!("nothing of {} could be saved", found.database.display());
        let remedy = "`murmuration restore` puts a backup back";
        return Err(CliError::Failed(match why {
            "" => format!("{said}: {remedy}"),
            why => format!("{said} ({why}): {remedy}"),
        }));
    }
    errln!(
        "saved {} of {} and {} of {}; next: murmuration list --data {}",
        salvaged.campaigns.len(),
        counted(found.campaigns.len() as u64, "campaign"),
        salvaged.checkpoints.len(),
        counted(found.checkpoints.len() as u64, "checkpoint"),
        target.display()
    );
    Ok(())
}

pub(super) fn of_this_machine(global: &Global) -> Result<(), CliError> {
    match &global.coordinator {
        Some(url) => Err(CliError::Input(format!(
            "this reads a data directory, not the coordinator at {url}: run it on that machine, with --data DIR"
        ))),
        None => Ok(()),
    }
}

fn print(found: &Findings) -> Result<(), OutputError> {
    let state = if found.faults.is_empty() {
        "sound"
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
    let CampaignFindings { stored, remains, .. } = campaign;
    let state = campaign.state.map_or("unreadable", |state| state.name());
    let generations = counted(stored.generations.into(), "generation");
    let entries = format!("{} of the label log", counted(stored.labels, "entry"));
    let amount = format!(
        "{} of {generations} and {} of {entries} are whole",
        remains.generations, remains.labels,
    );
    let verdict = match campaign.prospect {
        Prospect::Whole => format!("whole ({generations}, {entries})"),
        Prospect::LacksCheckpoint => "whole, but it cannot go on without its checkpoint".to_owned(),
        Prospect::Partly => {
            format!("damaged: {amount}, and can be saved; resumed, it makes the other generations anew")
        }
        Prospect::Lost => "lost: nobody knows any more what it was asked to do".to_owned(),
    };
    outln!("campaign {} ({state}): {verdict}", campaign.id)?;
    for problem in campaign.problems.iter().chain(&campaign.note) {
        outln!("  {problem}")?;
    }
    Ok(())
}

/// How a checkpoint is, in a word or two.
pub(super) fn condition_name(condition: &Condition) -> &str {
    match condition {
        Condition::Whole => "whole",
        Condition::Missing => "missing: `murmuration checkpoints import` brings it back from a copy",
        Condition::Damaged => "damaged: remove the file, and import a copy",
        Condition::Unread(why) => why,
    }
}
