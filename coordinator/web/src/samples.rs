//! Values for the tests of this crate.

use murmuration_model::CampaignRecord;
use murmuration_swarm::CampaignSpec;

/// The record of a new campaign `two-1` with this specification.
pub(super) fn record(spec: &str) -> CampaignRecord {
    CampaignRecord::begun("two-1".parse().unwrap(), CampaignSpec::from_toml(spec).unwrap())
}
