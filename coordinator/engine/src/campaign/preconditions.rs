//! Conditions for a campaign to continue.

use super::CampaignError;
use murmuration_model::{CampaignId, CampaignRecord, labels::Labels};
use murmuration_proto::SIMULATOR_VERSION;
use std::collections::BTreeSet;

/// Checks that this version of the simulator began the campaign: all evaluations of an archive must come from one version.
pub(super) fn check_simulator(record: &CampaignRecord) -> Result<(), CampaignError> {
    match record.simulator_version == SIMULATOR_VERSION {
        true => Ok(()),
        false => Err(CampaignError::OtherSimulator {
            id: record.id.clone(),
            theirs: record.simulator_version.clone(),
        }),
    }
}

/// Checks that the labels name enough classes to learn from.
pub(super) fn check_classes(id: &CampaignId, labels: &Labels) -> Result<(), CampaignError> {
    let classes: BTreeSet<u32> = labels
        .numbered_classes()
        .into_iter()
        .map(|(_, class)| class)
        .collect();
    match classes.len() {
        2.. => Ok(()),
        classes => Err(CampaignError::TooFewClasses {
            id: id.clone(),
            classes,
        }),
    }
}
