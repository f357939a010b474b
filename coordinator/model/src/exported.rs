//! A campaign during its transfer from one store to another, without the contents of its archive and label log.

use super::{CampaignId, CampaignRecord, CampaignState, Rounds};
use murmuration_proto::SIMULATOR_VERSION;
use murmuration_swarm::{CheckpointDigest, Invalid, Text, text};

#[derive(Debug, Clone, PartialEq)]
pub struct ExportedCampaign {
    /// The campaign, without the pictures of its dataset.
    pub record: CampaignRecord,
    pub label_entries: u64,
    /// BLAKE3 of the campaign's archive, 64 hexadecimal digits.
    pub digest: String,
}

impl ExportedCampaign {
    /// Maximum length of a label log in a transfer: the state computed from a log takes up to 0.8 kB of memory an entry.
    pub(crate) const MAX_LABEL_ENTRIES: u64 = 1_000_000;
    /// Maximum number at the end of a campaign's id in a transfer.
    pub(crate) const MAX_NUMBER: u64 = 1_000_000_000_000;
    /// Maximum number of rounds of feedback in a transfer.
    pub(crate) const MAX_ROUNDS: u32 = 10_000;

    /// Checks a campaign before a store imports it.
    ///
    /// # Errors
    /// [`Invalid`] names a value that no campaign of this version has.
    pub fn new(record: CampaignRecord, label_entries: u64, digest: String) -> Result<Self, Invalid> {
        check_id(&record.id)?;
        check_version(&record.simulator_version)?;
        check_numbers(&record, label_entries)?;
        check_digest(&digest)?;
        check_rounds(&record.rounds, label_entries)?;
        check_generations(&record)?;
        check_embedder(&record)?;
        Ok(Self {
            record,
            label_entries,
            digest,
        })
    }

    /// The campaign's state in the store that imports it: a running campaign is paused, until a person resumes it.
    pub const fn state_when_imported(&self) -> CampaignState {
        match self.record.state {
            CampaignState::Running => CampaignState::Paused,
            state => state,
        }
    }
}

/// Checks that the number of the id leaves room for the ids of new campaigns.
fn check_id(id: &CampaignId) -> Result<(), Invalid> {
    let most = ExportedCampaign::MAX_NUMBER;
    match id.number() {
        Some(number) if number <= most => Ok(()),
        _ => {
            let allowed = format!("an id, NAME-N, whose N is at most {most}");
            Err(Invalid::new("campaign", id.as_str(), allowed))
        }
    }
}

fn check_version(version: &str) -> Result<(), Invalid> {
    if version == SIMULATOR_VERSION {
        return Ok(());
    }
    let allowed = format!("{SIMULATOR_VERSION}: this version cannot check results of another version");
    Err(Invalid::new(
        "simulator_version",
        Text::line(version).as_str(),
        allowed,
    ))
}

/// Checks the numbers that the database or the coordinator's memory limits.
fn check_numbers(record: &CampaignRecord, label_entries: u64) -> Result<(), Invalid> {
    for (field, number) in [("created_ms", record.created_ms), ("rollbacks", record.rollbacks)] {
        if number > i64::MAX.unsigned_abs() {
            return Err(Invalid::new(field, number, "at most 2^63 - 1"));
        }
    }
    if label_entries > ExportedCampaign::MAX_LABEL_ENTRIES {
        let allowed = format!("at most {}", ExportedCampaign::MAX_LABEL_ENTRIES);
        return Err(Invalid::new("label_entries", label_entries, allowed));
    }
    Ok(())
}

fn check_digest(digest: &str) -> Result<(), Invalid> {
    // The digest must be in lower case, because it is compared character by character.
    let is_digit = |byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f');
    match digest.len() == 64 && digest.bytes().all(is_digit) {
        true => Ok(()),
        false => Err(Invalid::new(
            "digest",
            text::quoted(digest),
            "64 hexadecimal digits, in lower case",
        )),
    }
}

fn check_rounds(rounds: &Rounds, label_entries: u64) -> Result<(), Invalid> {
    let (done, last_cutoff) = (rounds.done, rounds.last_cutoff);
    for (field, cutoff) in [
        ("label_cutoff", rounds.current_cutoff),
        ("last_label_cutoff", Some(last_cutoff)),
    ] {
        if let Some(cutoff) = cutoff.filter(|cutoff| *cutoff > label_entries) {
            return Err(Invalid::new(
                field,
                cutoff,
                "at most the entries of the label log",
            ));
        }
    }
    if let Some(current) = rounds.current_cutoff.filter(|current| *current < last_cutoff) {
        let allowed = format!("at least {last_cutoff}, the last_label_cutoff");
        return Err(Invalid::new("label_cutoff", current, allowed));
    }
    if done > ExportedCampaign::MAX_ROUNDS {
        let allowed = format!("at most {}", ExportedCampaign::MAX_ROUNDS);
        return Err(Invalid::new("rounds", done, allowed));
    }
    if (done > 0) != (last_cutoff > 0) {
        let allowed = "0 without a last_label_cutoff, and only then: a round learns from labels";
        return Err(Invalid::new("rounds", done, allowed));
    }
    Ok(())
}

fn check_generations(record: &CampaignRecord) -> Result<(), Invalid> {
    let is_completed = record.state == CampaignState::Completed;
    let wanted = record.generations();
    let allowed = match is_completed {
        _ if record.generations_done > wanted => {
            format!("at most {wanted}, those of the specification and its rounds")
        }
        true if record.generations_done < wanted => format!("{wanted}, as the campaign is completed"),
        _ => return Ok(()),
    };
    Err(Invalid::new("generations", record.generations_done, allowed))
}

/// Checks that the archive is embedded if, and only if, the campaign's behaviour space has an embedding.
fn check_embedder(record: &CampaignRecord) -> Result<(), Invalid> {
    let (space, is_completed) = (record.spec.space(), record.state == CampaignState::Completed);
    let (checkpoint, next) = (record.embedder.checkpoint(), record.embedder.next());
    let shown = |digest: Option<CheckpointDigest>| digest.map_or("none".to_owned(), |one| one.to_string());
    if !space.embeds() {
        return match (checkpoint, next) {
            (None, None) => Ok(()),
            (Some(_), _) => Err(Invalid::new(
                "checkpoint",
                shown(checkpoint),
                format!("none in the space {space}"),
            )),
            (None, Some(_)) => Err(Invalid::new(
                "next_checkpoint",
                shown(next),
                format!("none in the space {space}"),
            )),
        };
    }
    if is_completed && (checkpoint.is_none() || next.is_some()) {
        let (field, value) = match next {
            Some(_) => ("next_checkpoint", next),
            None => ("checkpoint", checkpoint),
        };
        let allowed = "one checkpoint and no next one, as the campaign is completed";
        return Err(Invalid::new(field, shown(value), allowed));
    }
    if record.generations_done > 0 && checkpoint.is_none() && next.is_none() {
        let allowed = format!("one, as an archive in the space {space} is embedded");
        return Err(Invalid::new("checkpoint", "none", allowed));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ArchiveEmbedder, CampaignNotes, Weight};
    use murmuration_swarm::CampaignSpec;

    fn spec(method: &str) -> CampaignSpec {
        CampaignSpec::from_toml(&format!("model = \"single-sensor\"\nmethod = \"{method}\"")).unwrap()
    }

    fn campaign() -> ExportedCampaign {
        let [from, to] = [b"one", b"two"].map(|bytes| CheckpointDigest::of(bytes));
        let record = CampaignRecord {
            id: "single-7".parse().unwrap(),
            spec: spec("latent"),
            weight: Weight::default(),
            study: None,
            notes: CampaignNotes::default(),
            state: CampaignState::Running,
            error: String::new(),
            created_ms: 5,
            ended_ms: None,
            rollbacks: 2,
            decisions: 0,
            simulator_version: SIMULATOR_VERSION.to_owned(),
            generations_done: 9,
            last_novelty: None,
            embedder: ArchiveEmbedder::Switching {
                from: Some(from),
                to,
                embedded: 0,
            },
            pictures_done: 0,
            rounds: Rounds {
                done: 1,
                last_cutoff: 3,
                current_cutoff: Some(4),
            },
        };
        ExportedCampaign {
            record,
            label_entries: 4,
            digest: "0".repeat(64),
        }
    }

    fn checked(change: impl Fn(&mut ExportedCampaign)) -> Result<ExportedCampaign, Invalid> {
        let mut one = campaign();
        change(&mut one);
        ExportedCampaign::new(one.record, one.label_entries, one.digest)
    }

    /// The field that the refusal of the change names.
    fn refused(change: impl Fn(&mut ExportedCampaign)) -> String {
        checked(change).unwrap_err().field
    }

    #[test]
    fn what_is_exported_does_not_run_elsewhere() {
        let exported = checked(|_| {}).unwrap();
        assert_eq!(exported, campaign());
        assert_eq!(exported.state_when_imported(), CampaignState::Paused);
    }

    #[test]
    fn what_no_store_holds_is_refused_by_name() {
        for id in ["small-1000000000001", "small-99999999999999999999"] {
            assert_eq!(refused(|one| one.record.id = id.parse().unwrap()), "campaign");
        }
        assert_eq!(refused(|one| one.record.created_ms = u64::MAX), "created_ms");
        assert_eq!(
            refused(|one| one.record.simulator_version.clear()),
            "simulator_version"
        );
        assert_eq!(
            refused(|one| one.record.generations_done = 1_000_000),
            "generations"
        );
        assert_eq!(
            refused(|one| one.record.state = CampaignState::Completed),
            "generations"
        );
        assert_eq!(refused(|one| one.label_entries = u64::MAX), "label_entries");
        for digest in ["", "\u{1b}[2J", &"A".repeat(64)] {
            assert_eq!(refused(|one| digest.clone_into(&mut one.digest)), "digest");
        }
    }

    #[test]
    fn rounds_that_no_campaign_has_are_refused_by_name() {
        let refused = |change: fn(&mut Rounds)| refused(|one| change(&mut one.record.rounds));
        assert_eq!(refused(|rounds| rounds.done = u32::MAX), "rounds");
        assert_eq!(refused(|rounds| rounds.done = 0), "rounds");
        assert_eq!(refused(|rounds| rounds.last_cutoff = 0), "rounds");
        assert_eq!(refused(|rounds| rounds.current_cutoff = Some(2)), "label_cutoff");
        assert_eq!(refused(|rounds| rounds.current_cutoff = Some(5)), "label_cutoff");
        assert_eq!(refused(|rounds| rounds.last_cutoff = 5), "last_label_cutoff");
    }

    #[test]
    fn an_archive_is_embedded_if_and_only_if_its_method_asks_for_it() {
        let unembedded = |one: &mut ExportedCampaign| one.record.embedder = ArchiveEmbedder::None;
        let completed = |one: &mut ExportedCampaign| {
            one.record.state = CampaignState::Completed;
            one.record.generations_done = one.record.generations();
        };
        assert_eq!(refused(unembedded), "checkpoint");
        assert_eq!(refused(completed), "next_checkpoint");
        let without_both = |one: &mut ExportedCampaign| {
            completed(one);
            unembedded(one);
        };
        assert_eq!(refused(without_both), "checkpoint");
        // Before its first generation, a campaign can be without a checkpoint.
        let new = |one: &mut ExportedCampaign| {
            unembedded(one);
            one.record.generations_done = 0;
        };
        assert!(checked(new).is_ok());
        let hand_crafted = |one: &mut ExportedCampaign| one.record.spec = spec("hand-crafted");
        assert_eq!(refused(hand_crafted), "checkpoint");
        let only_next = |one: &mut ExportedCampaign| {
            hand_crafted(one);
            let to = CheckpointDigest::of(b"two");
            one.record.embedder = ArchiveEmbedder::Switching {
                from: None,
                to,
                embedded: 0,
            };
        };
        assert_eq!(refused(only_next), "next_checkpoint");
    }
}
