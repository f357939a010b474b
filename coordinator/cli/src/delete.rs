//! `delete`: lists the data of a campaign, and deletes it.

use super::{
    CliError, Global,
    connection::{self, Connection},
    json,
};
use murmuration_coordinator::local::InProcess;
use murmuration_link::{errln, outln};
use murmuration_proto::v1;
use murmuration_store::Deletion;

#[derive(Debug, clap::Args)]
#[command(after_help = "\
Without --yes the command only says what would be deleted. Checkpoints stay: other campaigns may use them. A deleted campaign \
cannot be restored, except from a backup or an export.

Examples:
  murmuration delete two-sensor-3
  murmuration delete two-sensor-3 --yes")]
pub struct Delete {
    /// Campaign id; not `latest`, which becomes another campaign when a new campaign starts
    campaign: String,
    /// Delete the campaign; without this option, the command only lists the data
    #[arg(long)]
    yes: bool,
    /// Name of the study that the campaign belongs to, if it belongs to one
    #[arg(long, value_name = "NAME", default_value = "", hide_default_value = true)]
    study: String,
}

impl Delete {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let delete = async |connection: &mut Connection| {
            let request = v1::DeleteCampaignRequest {
                campaign: self.campaign.clone(),
                study: self.study.clone(),
                preview: !self.yes,
            };
            let deletion = connection.client.delete_campaign(request).await?.into_inner();
            // Deleting a campaign of a study requires the name of the study.
            let study = match self.yes {
                true => String::new(),
                false => {
                    let campaign = self.campaign.clone();
                    let request = v1::GetCampaignRequest { campaign };
                    connection.client.get_campaign(request).await?.into_inner().study
                }
            };
            Ok((deletion, study))
        };
        let (deletion, study) = connection::with(global, InProcess::NONE, delete).await?;
        if global.json {
            return Ok(json::print(json::Deletion {
                deleted: self.yes,
                deletion: json::Document(&deletion),
            })?);
        }
        let id = &deletion.campaign;
        let what = what(&deletion).in_words();
        if self.yes {
            outln!("{id}")?;
            errln!("deleted campaign {id}: {what}");
            return Ok(());
        }
        outln!("campaign {id} would be deleted: {what}")?;
        let study = match study.as_str() {
            "" => String::new(),
            study => format!(" --study {study}"),
        };
        let next = global.next(&format!("delete {id} --yes{study}"));
        errln!("nothing was deleted; to delete it: {next}");
        Ok(())
    }
}

const fn what(deletion: &v1::DeleteCampaignResponse) -> Deletion {
    Deletion {
        individuals: deletion.individuals,
        pictures: deletion.pictures,
        labelled: deletion.labelled,
        taxonomy: deletion.taxonomy,
    }
}
