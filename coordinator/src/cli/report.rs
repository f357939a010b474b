//! `report`: has what the report shows gathered from the coordinator, and written.

use super::{CliError, Global, connection::Connection, error::report_folder};
use crate::{gather, local::Crew, report};
use murmuration_proto::v1;
use std::path::{Path, PathBuf};

/// Arguments of `report`.
#[derive(Debug, clap::Args)]
pub(super) struct ReportCommand {
    /// Campaign id, or `latest`
    campaign: String,
    /// Folder to write it to [default: reports/CAMPAIGN in the data directory]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

impl ReportCommand {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let mut connection = Connection::open(
            global,
            Crew {
                workers: 1,
                trainers: 0,
            },
        )
        .await?;
        let written = self.write(&mut connection, global).await;
        connection.close().await?;
        let page = written?.display().to_string();
        if global.json {
            super::json::print(&serde_json::json!({ "schema": 1, "report": page }));
        } else {
            println!("{page}");
        }
        Ok(())
    }

    async fn write(&self, connection: &mut Connection, global: &Global) -> Result<PathBuf, CliError> {
        let request = v1::GetCampaignRequest {
            campaign: self.campaign.clone(),
        };
        let id = connection.client.get_campaign(request).await?.into_inner().id;
        let folder = self
            .out
            .clone()
            .unwrap_or_else(|| report_folder(&global.data, &id));
        write_report(connection, &id, &folder).await
    }
}

/// Writes the report of a completed campaign into `folder`; the path of its page.
pub(super) async fn write_report(
    connection: &mut Connection,
    campaign: &str,
    folder: &Path,
) -> Result<PathBuf, CliError> {
    let names = gather::names(&mut connection.labels, campaign).await?;
    let report = gather::report(&mut connection.client, campaign, names).await?;
    let folder = folder.to_owned();
    let written = tokio::task::spawn_blocking(move || report::write(&report, &folder)).await;
    match written {
        Ok(files) => Ok(files?.page),
        Err(_) => Err(CliError::Failed(
            "the report broke off unexpectedly (this is a bug)".to_owned(),
        )),
    }
}
