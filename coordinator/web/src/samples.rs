//! Values for the tests of this crate.

use murmuration_model::{ArchiveEmbedder, CampaignRecord, CampaignState, Rounds, Weight};
use murmuration_swarm::CampaignSpec;

/// The record of a new campaign `two-1` with this specification.
pub(super) fn record(spec: &str) -> CampaignRecord {
    CampaignRecord {
        id: "two-1".parse().unwrap(),
        spec: CampaignSpec::from_toml(spec).unwrap(),
        weight: Weight::default(),
        study: None,
        state: CampaignState::Running,
        error: String::new(),
        created_ms: 7,
        ended_ms: None,
        rollbacks: 0,
        decisions: 0,
        simulator_version: String::new(),
        generations_done: 0,
        last_novelty: None,
        embedder: ArchiveEmbedder::None,
        pictures_done: 0,
        rounds: Rounds::default(),
    }
}
