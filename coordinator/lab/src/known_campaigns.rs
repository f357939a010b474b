//! Finds or begins the campaign of a specification, and follows it to its end.

use murmuration_cli::{
    CliError,
    connection::Client,
    follow::follow_with,
    validation::{Validated as _, get_campaign, get_digest, validated},
};
use murmuration_link::OutputError;
use murmuration_proto::{parts::whole, v1};
use murmuration_study::cell_digest;
use murmuration_swarm::CampaignSpec;
use std::collections::BTreeMap;
use tonic::Code;

/// The campaigns of a coordinator, by their specification.
#[derive(Debug, Default)]
pub(super) struct KnownCampaigns {
    /// Digest of each campaign's specification, by the campaign's id; `None` if this version cannot read the specification. A
    /// campaign's specification never changes.
    digests: BTreeMap<String, Option<String>>,
    /// The campaigns' ids, oldest campaign first.
    ids: Vec<String>,
}

impl KnownCampaigns {
    /// Updates the list of campaigns. Only new campaigns are examined.
    pub(super) async fn renew(&mut self, client: &mut Client) -> Result<(), CliError> {
        let listed = client.list_campaigns(v1::ListCampaignsRequest {}).await?;
        self.take(whole(listed.into_inner()).await?.campaigns.validated()?);
        Ok(())
    }

    /// Replaces the list by all present campaigns, oldest first.
    fn take(&mut self, listed: Vec<v1::Campaign>) {
        let mut digests = BTreeMap::new();
        self.ids.clear();
        for campaign in listed {
            let digest = self.digests.remove(&campaign.id).unwrap_or_else(|| {
                let spec = campaign.spec.map(CampaignSpec::try_from);
                spec.and_then(Result::ok).as_ref().map(cell_digest)
            });
            digests.insert(campaign.id.clone(), digest);
            self.ids.push(campaign.id);
        }
        self.digests = digests;
    }

    /// Finds a campaign with this specification, or begins one for `study` (empty if the campaign belongs to no study). Two
    /// callers at the same time get the same campaign.
    pub(super) async fn find_or_begin(
        &mut self,
        client: &mut Client,
        spec: &CampaignSpec,
        study: &str,
    ) -> Result<v1::Campaign, CliError> {
        self.renew(client).await?;
        let known = self.of(spec);
        let request_id = request_id(spec, &known);
        if let Some(campaign) = usable(client, known).await? {
            return Ok(campaign);
        }
        let request = v1::CreateCampaignRequest {
            campaign: Some(v1::create_campaign_request::Campaign::Spec(spec.into())),
            study: study.to_owned(),
            request_id,
            ..v1::CreateCampaignRequest::default()
        };
        match client.create_campaign(request).await {
            // Another study, or a campaign file of another name, has begun the campaign meanwhile.
            Err(status) if status.code() == Code::AlreadyExists => {
                self.renew(client).await?;
                let begun = usable(client, self.of(spec)).await?;
                begun.ok_or_else(|| status.into())
            }
            created => validated(created?),
        }
    }

    /// The ids of the campaigns with this specification, oldest first.
    pub(super) fn of(&self, spec: &CampaignSpec) -> Vec<String> {
        let digest = Some(cell_digest(spec));
        let ids = self.ids.iter();
        let same = ids.filter(|id| self.digests.get(*id) == Some(&digest));
        same.cloned().collect()
    }
}

/// Resumes a campaign if necessary, follows it until it stops, and shows each status. Returns the last status.
pub(super) async fn to_rest(
    client: &mut Client,
    begun: v1::Campaign,
    draw: impl FnMut(&v1::Campaign) -> Result<(), OutputError>,
) -> Result<v1::Campaign, CliError> {
    match begun.state() {
        v1::CampaignState::Completed => Ok(begun),
        v1::CampaignState::Running if begun.active => follow_with(client, &begun.id, draw).await,
        _ => {
            let request = v1::ResumeCampaignRequest { campaign: begun.id };
            let resumed = validated(client.resume_campaign(request).await?)?;
            follow_with(client, &resumed.id, draw).await
        }
    }
}

/// Brings a campaign to its end, as [`to_rest`] does. Returns the completed campaign.
pub(super) async fn to_end(
    client: &mut Client,
    begun: v1::Campaign,
    draw: impl FnMut(&v1::Campaign) -> Result<(), OutputError>,
) -> Result<v1::Campaign, CliError> {
    let last = to_rest(client, begun, draw).await?;
    match last.state() {
        v1::CampaignState::Completed => Ok(last),
        v1::CampaignState::Failed => {
            let message = format!("campaign {} failed: {}", last.id, last.error);
            Err(CliError::Failed(message))
        }
        _ => Err(CliError::Failed(stopped(&last))),
    }
}

/// Message about a campaign that stopped without a failure.
pub(super) fn stopped(campaign: &v1::Campaign) -> String {
    format!("campaign {} was stopped by another command", campaign.id)
}

/// The first campaign in `known` that still follows its specification: nobody has cancelled it, taught it, or moved it to another
/// checkpoint.
async fn usable(client: &mut Client, known: Vec<String>) -> Result<Option<v1::Campaign>, CliError> {
    for campaign in known {
        // The campaign may have continued since it was listed: get its current state.
        let campaign = get_campaign(client, campaign).await?;
        if campaign.state() == v1::CampaignState::Cancelled {
            continue;
        }
        let digest = get_digest(client, &campaign.id).await?;
        // A campaign without a checkpoint cannot have adopted one.
        let adopted = digest.adopted && !campaign.checkpoint.is_empty();
        if !digest.attended && !adopted {
            return Ok(Some(campaign));
        }
    }
    Ok(None)
}

/// The request id for beginning a campaign of this specification. All callers use the same id while exactly the campaigns `known`
/// have the specification.
fn request_id(spec: &CampaignSpec, known: &[String]) -> String {
    let of = format!("{} {}", cell_digest(spec), known.join(" "));
    blake3::hash(of.as_bytes()).to_hex().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn campaign(id: &str, seed: u64) -> (v1::Campaign, CampaignSpec) {
        let text = format!("model = \"single-sensor\"\nmethod = \"random\"\nseed = {seed}");
        let spec = CampaignSpec::from_toml(&text).unwrap();
        let campaign = v1::Campaign {
            id: id.to_owned(),
            spec: Some((&spec).into()),
            ..v1::Campaign::default()
        };
        (campaign, spec)
    }

    #[test]
    fn campaigns_are_found_by_their_specification_for_as_long_as_they_are_there() {
        let ((one, spec), (other, _), (again, _)) =
            (campaign("b-1", 1), campaign("c-2", 2), campaign("a-3", 1));
        let mut known = KnownCampaigns::default();
        known.take(vec![one.clone(), other.clone()]);
        assert_eq!(known.of(&spec), ["b-1"]);
        known.take(vec![one, other.clone(), again.clone()]);
        assert_eq!(known.of(&spec), ["b-1", "a-3"]);
        // Now the first campaign is deleted.
        known.take(vec![other, again]);
        assert_eq!(known.of(&spec), ["a-3"]);
    }
}
