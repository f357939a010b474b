//! Archives whose trials were judged.

use super::{super::CliError, clients::Clients};
use murmuration_proto::{CampaignSpec, Controller, Invalid, v1};
use murmuration_service::report_data;
use murmuration_study::Judged;

/// The individuals of a campaign that judges, in order.
pub(super) async fn judged_archive(
    clients: &mut Clients,
    spec: &CampaignSpec,
    campaign: &str,
) -> Result<Vec<Judged>, CliError> {
    let request = v1::GetArchiveRequest {
        campaign: campaign.to_owned(),
        images: false,
    };
    let mut chunks = clients.campaigns.get_archive(request).await?.into_inner();
    let mut archive = Vec::new();
    while let Some(chunk) = chunks.message().await? {
        for individual in chunk.individuals {
            archive.push(judged(spec, &individual)?);
        }
    }
    Ok(archive)
}

fn judged(spec: &CampaignSpec, individual: &v1::Individual) -> Result<Judged, Invalid> {
    let features = report_data::features(&individual.features)?;
    Ok(Judged {
        behaviour: spec.method().behaviour(&features, &individual.embedding),
        controller: Controller::new(spec.model(), &individual.controller)?,
        features,
        verdicts: report_data::verdicts_of(spec, individual)?,
    })
}
