//! `report`: collects the data of a report from the coordinator, and writes it.

use super::{
    CliError, Global,
    connection::{self, Connection},
    error::report_folder,
    files::{expect_outside_data, replaces},
    json,
    validation::{self, get_campaign},
};
use murmuration_coordinator::local::InProcess;
use murmuration_files::{Folder, Replaces};
use murmuration_link::{errln, outln};
use murmuration_model::CampaignId;
use murmuration_proto::v1;
use murmuration_report as report;
use murmuration_service::report_data::{self, PicturesOf};
use std::{
    fs,
    path::{Path, PathBuf},
};

#[derive(Debug, clap::Args)]
pub struct ReportCommand {
    /// Campaign id, or `latest`
    campaign: String,
    /// Folder for the report [default: reports/CAMPAIGN in the data directory]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Replace files of a former report in the folder even if they have been changed since
    #[arg(long)]
    force: bool,
}

impl ReportCommand {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        if let Some(folder) = &self.out {
            expect_outside_data(folder)?;
        }
        let in_process = InProcess {
            workers: 1,
            ..InProcess::NONE
        };
        let write = async |connection: &mut Connection| self.write(connection, global).await;
        let page = connection::with(global, in_process, write)
            .await?
            .display()
            .to_string();
        if global.json {
            json::print(json::Report { report: page })?;
        } else {
            outln!("{page}")?;
        }
        Ok(())
    }

    async fn write(&self, connection: &mut Connection, global: &Global) -> Result<PathBuf, CliError> {
        let campaign = get_campaign(&mut connection.client, &self.campaign).await?;
        tell_of_missing_worker(&campaign, connection);
        let id = validation::id(&campaign)?;
        match &self.out {
            Some(folder) => write_report(connection, &id, folder, replaces(self.force)).await,
            None => {
                let folder = report_folder(&global.data, &id);
                if campaign.state() == v1::CampaignState::Completed {
                    expect_writable(&folder)?;
                }
                write_report(connection, &id, &folder, Replaces::All).await
            }
        }
    }
}

/// Checks that the folder of a data directory can hold a report, before workers simulate for the report. Leaves no new folder.
fn expect_writable(folder: &Path) -> Result<(), CliError> {
    let is_new = !folder.exists();
    let begun = Folder::create(folder, Replaces::All).map(drop);
    if is_new {
        // An empty folder does no harm.
        let _ = fs::remove_dir(folder);
    }
    begun.map_err(|error| CliError::Input(format!("{error}: name a folder for the report with --out DIR")))
}

/// Tells why a report or a figure is not written yet, if the coordinator has no worker.
pub(super) fn tell_of_missing_worker(campaign: &v1::Campaign, connection: &Connection) {
    let is_done = campaign.state() == v1::CampaignState::Completed;
    if is_done && campaign.workers == 0 && !connection.is_own() {
        errln!(
            "waiting: a worker must simulate the behaviours, and the coordinator has none: start one with `murmuration-worker \
             --access FILE`"
        );
    }
}

/// Writes the report of a completed campaign into `folder`. Returns the path of the report's page.
pub(super) async fn write_report(
    connection: &mut Connection,
    campaign: &CampaignId,
    folder: &Path,
    replaces: Replaces,
) -> Result<PathBuf, CliError> {
    let names = report_data::names(&mut connection.labels, campaign.as_str()).await?;
    let client = &mut connection.client;
    let report = report_data::report(client, campaign.as_str(), names, PicturesOf::Individuals).await?;
    let folder = folder.to_owned();
    let write = move || {
        let folder = Folder::create(&folder, replaces)?;
        report::write(&report, folder)
    };
    let written = tokio::task::spawn_blocking(write).await;
    match written {
        Ok(files) => Ok(files?.page),
        Err(_) => Err(CliError::Failed(
            "the report could not be written because of a bug".to_owned(),
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_check_of_a_folder_leaves_no_new_folder() {
        let reports = tempfile::tempdir().unwrap();
        let [new, former] = ["new-1", "former-2"].map(|name| reports.path().join(name));
        fs::create_dir(&former).unwrap();
        fs::write(reports.path().join("file"), "").unwrap();
        expect_writable(&new).unwrap();
        expect_writable(&former).unwrap();
        assert!(!new.exists() && former.exists());
        let refused = expect_writable(&reports.path().join("file")).unwrap_err();
        assert!(refused.to_string().contains("--out DIR"), "{refused}");
    }
}
