//! Messages about the change that a command made, and the next command to type.

use super::{CliError, Global, json};
use murmuration_link::{OutputError, errln, outln};
use murmuration_proto::v1;
use murmuration_swarm::CampaignSpec;

/// Prints the change that a command made and the next command to type. If the campaign's state is not the `expected` one, prints
/// the state in place of the change.
pub fn changed(
    global: &Global,
    campaign: &v1::Campaign,
    expected: v1::CampaignState,
    what: &str,
    next: &str,
) -> Result<(), OutputError> {
    if global.json {
        return json::print(json::Document(campaign));
    }
    outln!("{}", campaign.id)?;
    if campaign.state() == expected {
        errln!("campaign {} {what}; next: {}", campaign.id, global.next(next));
    } else {
        let next = what_next(global, campaign);
        errln!("campaign {} is now {}; {next}", campaign.id, state(campaign));
    }
    Ok(())
}

/// The command to type next about a campaign that has stopped.
pub fn what_next(global: &Global, campaign: &v1::Campaign) -> String {
    let id = &campaign.id;
    let spec = campaign.spec.clone().map(CampaignSpec::try_from);
    let is_taught = matches!(&spec, Some(Ok(spec)) if spec.feedback().is_some());
    let next = match campaign.state() {
        v1::CampaignState::Completed => format!("report {id}"),
        v1::CampaignState::Running if campaign.active => format!("watch {id}"),
        v1::CampaignState::Running | v1::CampaignState::Paused | v1::CampaignState::Failed => {
            format!("resume {id}")
        }
        v1::CampaignState::Cancelled | v1::CampaignState::Unspecified => "list".to_owned(),
    };
    let next = format!("next: {}", global.next(&next));
    if campaign.state() == v1::CampaignState::Completed && is_taught {
        let label = global.next(&format!("label {id} --csv FILE"));
        return format!("{next}; to add labels: {label} (or --synthetic N)");
    }
    next
}

/// Error with the reason why a campaign failed, and the next command to type.
pub fn failed(global: &Global, campaign: &v1::Campaign) -> CliError {
    let (id, error) = (&campaign.id, &campaign.error);
    CliError::Failed(format!(
        "campaign {id} failed: {error}; {}",
        what_next(global, campaign)
    ))
}

/// The state in a word. A running campaign that no process works on is `interrupted`; a campaign that waits, for example for disk
/// space, is `waiting`.
pub fn state(campaign: &v1::Campaign) -> String {
    match campaign.state() {
        v1::CampaignState::Running if !campaign.waiting.is_empty() => "waiting".to_owned(),
        v1::CampaignState::Running if !campaign.active => "interrupted".to_owned(),
        state => state
            .as_str_name()
            .trim_start_matches("CAMPAIGN_STATE_")
            .to_lowercase(),
    }
}
