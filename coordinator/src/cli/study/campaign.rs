//! A campaign of a study: found again by its specification or begun, and followed to its end.

use super::{
    super::{
        CliError,
        connection::{CheckpointClient, Client},
        heard::{Heard as _, heard},
    },
    progress::CellProgress,
};
use murmuration_proto::{CampaignSpec, parts::whole, v1};
use murmuration_study::cell_digest;
use std::collections::BTreeMap;

/// The campaigns that a coordinator has, by what they are cells of.
#[derive(Debug, Default)]
pub(super) struct KnownCampaigns(BTreeMap<String, Vec<v1::Campaign>>);

/// How a coordinator is asked; cheap to clone.
#[derive(Clone)]
pub(super) struct Clients {
    pub(super) campaigns: Client,
    pub(super) checkpoints: CheckpointClient,
}

impl KnownCampaigns {
    pub(super) async fn list(client: &mut Client) -> Result<Self, CliError> {
        let listed = client.list_campaigns(v1::ListCampaignsRequest {}).await?;
        let listed = whole(listed.into_inner()).await?.campaigns.heard()?;
        let mut known: BTreeMap<String, Vec<v1::Campaign>> = BTreeMap::new();
        for campaign in listed {
            if let Some(Ok(spec)) = campaign.spec.clone().map(CampaignSpec::try_from) {
                known.entry(cell_digest(&spec)).or_default().push(campaign);
            }
        }
        Ok(Self(known))
    }

    /// The campaigns with this specification, oldest first.
    pub(super) fn of(&self, spec: &CampaignSpec) -> Vec<v1::Campaign> {
        self.0.get(&cell_digest(spec)).cloned().unwrap_or_default()
    }
}

/// The campaign of a specification: one of `known`, which have this specification, or a new one.
pub(super) async fn begin(
    client: &mut Client,
    spec: &CampaignSpec,
    known: Vec<v1::Campaign>,
) -> Result<v1::Campaign, CliError> {
    if let Some(campaign) = usable(client, known).await? {
        return Ok(campaign);
    }
    let request = v1::CreateCampaignRequest {
        spec: Some(spec.into()),
        weight: None,
    };
    heard(client.create_campaign(request).await?)
}

/// Brings a campaign to its end, wherever it is; its last status.
pub(super) async fn to_end(
    client: &mut Client,
    begun: v1::Campaign,
    progress: &CellProgress,
) -> Result<v1::Campaign, CliError> {
    progress.begin(&begun.id);
    let last = match begun.state() {
        v1::CampaignState::Completed => begun,
        v1::CampaignState::Running if begun.active => follow(client, &begun.id, progress).await?,
        _ => {
            let request = v1::ResumeCampaignRequest {
                campaign: begun.id.clone(),
            };
            let resumed = heard(client.resume_campaign(request).await?)?;
            follow(client, &resumed.id, progress).await?
        }
    };
    match last.state() {
        v1::CampaignState::Completed => Ok(last),
        v1::CampaignState::Failed => {
            let said = format!("campaign {} failed: {}", last.id, last.error);
            Err(CliError::Failed(said))
        }
        _ => {
            let said = format!("campaign {} was stopped by another command", last.id);
            Err(CliError::Failed(said))
        }
    }
}

/// The first campaign that is, or will be, what its specification says: one that nobody cancelled, taught or moved to another
/// checkpoint.
async fn usable(client: &mut Client, known: Vec<v1::Campaign>) -> Result<Option<v1::Campaign>, CliError> {
    for campaign in known {
        if campaign.state() == v1::CampaignState::Cancelled {
            continue;
        }
        let request = v1::GetDigestRequest {
            campaign: campaign.id.clone(),
        };
        let digest = heard(client.get_digest(request).await?)?;
        // Before the first checkpoint there is nothing that could have been adopted.
        let adopted = digest.adopted && !campaign.checkpoint.is_empty();
        if !digest.attended && !adopted {
            return Ok(Some(campaign));
        }
    }
    Ok(None)
}

/// Follows a campaign until it stops; its last status.
async fn follow(
    client: &mut Client,
    campaign: &str,
    progress: &CellProgress,
) -> Result<v1::Campaign, CliError> {
    let request = v1::WatchCampaignRequest {
        campaign: campaign.to_owned(),
    };
    let mut statuses = client.watch_campaign(request).await?.into_inner();
    let mut last = None;
    while let Some(status) = statuses.message().await? {
        let status = status.heard()?;
        progress.draw(&status);
        last = Some(status);
    }
    last.ok_or_else(|| CliError::Failed(format!("the coordinator sent no status of campaign {campaign}")))
}
