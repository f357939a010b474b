//! A campaign on its way from one store to another, without what its archive and label log hold.

use super::{ArchiveEmbedder, CampaignId, CampaignRecord, CampaignState, Rounds};
use murmuration_proto::{CheckpointDigest, Invalid, SIMULATOR_VERSION, Text, text, v1};

/// A campaign that was exported, and how much of it follows.
#[derive(Debug, Clone, PartialEq)]
pub struct ExportedCampaign {
    /// The campaign. Of its dataset it has no picture.
    pub record: CampaignRecord,
    /// Entries of its label log.
    pub label_entries: u64,
    /// BLAKE3 of its archive, 64 hexadecimal digits; empty if it is not known yet.
    pub digest: String,
}

impl ExportedCampaign {
    /// Maximum number of entries of a label log that is transferred: what follows from a log is held in memory.
    pub const MAX_LABEL_ENTRIES: u64 = 10_000_000;
    /// Maximum number at the end of the id of a campaign that is transferred.
    pub const MAX_NUMBER: u64 = 1_000_000_000_000;
    /// Maximum number of rounds of feedback of a campaign that is transferred.
    pub const MAX_ROUNDS: u32 = 10_000;

    /// The state that it has in the store that it comes to: nobody runs it there until a person resumes it.
    #[must_use]
    pub const fn state_when_imported(&self) -> CampaignState {
        match self.record.state {
            CampaignState::Running => CampaignState::Paused,
            state => state,
        }
    }
}

impl From<ExportedCampaign> for v1::ExportedCampaign {
    fn from(exported: ExportedCampaign) -> Self {
        let record = exported.record;
        let digest = |digest: Option<CheckpointDigest>| digest.map(|digest| digest.to_string());
        Self {
            id: record.id.to_string(),
            spec: Some((&record.spec).into()),
            state: v1::CampaignState::from(record.state).into(),
            error: record.error,
            created_ms: record.created_ms,
            weight: record.weight.get(),
            simulator_version: record.simulator_version,
            rollbacks: record.rollbacks,
            rounds_done: record.rounds.done,
            last_label_cutoff: record.rounds.last_cutoff,
            label_cutoff: record.rounds.current_cutoff,
            checkpoint: digest(record.embedder.checkpoint()).unwrap_or_default(),
            next_checkpoint: digest(record.embedder.next()).unwrap_or_default(),
            generations: record.generations_done,
            label_entries: exported.label_entries,
            digest: exported.digest,
        }
    }
}

impl TryFrom<v1::ExportedCampaign> for ExportedCampaign {
    type Error = Invalid;

    fn try_from(message: v1::ExportedCampaign) -> Result<Self, Invalid> {
        let state = message.state();
        let spec = message
            .spec
            .clone()
            .ok_or_else(|| Invalid::new("spec", "nothing", "a campaign specification"))?;
        check_version(&message.simulator_version)?;
        check_plain_fields(&message)?;
        let record = CampaignRecord {
            id: id(&message.id)?,
            spec: spec.try_into()?,
            weight: message.weight.try_into()?,
            study: None,
            state: state.try_into()?,
            error: Text::line(&message.error).into(),
            created_ms: message.created_ms,
            ended_ms: None,
            rollbacks: message.rollbacks,
            decisions: 0,
            generations_done: message.generations,
            last_novelty: None,
            embedder: embedder(&message)?,
            pictures_done: 0,
            rounds: rounds(&message)?,
            simulator_version: message.simulator_version,
        };
        check_generations(&record)?;
        check_embedder(&record)?;
        Ok(Self {
            record,
            label_entries: message.label_entries,
            digest: message.digest,
        })
    }
}

/// An id whose number leaves room for those of new campaigns.
fn id(text: &str) -> Result<CampaignId, Invalid> {
    let id: CampaignId = text.parse()?;
    let most = ExportedCampaign::MAX_NUMBER;
    match id.number() {
        Some(number) if number <= most => Ok(id),
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
    let allowed = format!("{SIMULATOR_VERSION}: another version's bits cannot be checked by this one");
    Err(Invalid::new(
        "simulator_version",
        Text::line(version).as_str(),
        allowed,
    ))
}

/// Checks the digest, and the numbers that a database, or the memory of a coordinator, has limits for.
fn check_plain_fields(message: &v1::ExportedCampaign) -> Result<(), Invalid> {
    for (field, number) in [
        ("created_ms", message.created_ms),
        ("rollbacks", message.rollbacks),
    ] {
        if number > i64::MAX.unsigned_abs() {
            return Err(Invalid::new(field, number, "at most 2^63 - 1"));
        }
    }
    if message.label_entries > ExportedCampaign::MAX_LABEL_ENTRIES {
        let allowed = format!("at most {}", ExportedCampaign::MAX_LABEL_ENTRIES);
        return Err(Invalid::new("label_entries", message.label_entries, allowed));
    }
    let digest = &message.digest;
    // As it is written: it is compared character by character.
    let is_digit = |byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f');
    if !(digest.is_empty() || digest.len() == 64 && digest.bytes().all(is_digit)) {
        return Err(Invalid::new(
            "digest",
            text::quoted(digest),
            "64 hexadecimal digits, in lower case",
        ));
    }
    Ok(())
}

fn embedder(message: &v1::ExportedCampaign) -> Result<ArchiveEmbedder, Invalid> {
    let checkpoint = |field: &str, digest: &str| match digest {
        "" => Ok(None),
        digest => digest
            .parse::<CheckpointDigest>()
            .map(Some)
            .map_err(|error| Invalid {
                field: field.to_owned(),
                ..error
            }),
    };
    let from = checkpoint("checkpoint", &message.checkpoint)?;
    Ok(
        match (from, checkpoint("next_checkpoint", &message.next_checkpoint)?) {
            (None, None) => ArchiveEmbedder::None,
            (Some(checkpoint), None) => ArchiveEmbedder::Checkpoint(checkpoint),
            (from, Some(to)) => ArchiveEmbedder::Switching {
                from,
                to,
                embedded: 0,
            },
        },
    )
}

fn rounds(message: &v1::ExportedCampaign) -> Result<Rounds, Invalid> {
    let cutoff = |field: &str, cutoff: u64| match cutoff <= message.label_entries {
        true => Ok(cutoff),
        false => Err(Invalid::new(
            field,
            cutoff,
            "at most the entries of the label log",
        )),
    };
    let current_cutoff = message
        .label_cutoff
        .map(|entries| cutoff("label_cutoff", entries))
        .transpose()?;
    let last_cutoff = cutoff("last_label_cutoff", message.last_label_cutoff)?;
    if let Some(current) = current_cutoff.filter(|current| *current < last_cutoff) {
        let allowed = format!("at least {last_cutoff}, the last_label_cutoff");
        return Err(Invalid::new("label_cutoff", current, allowed));
    }
    let done = message.rounds_done;
    if done > ExportedCampaign::MAX_ROUNDS {
        let allowed = format!("at most {}", ExportedCampaign::MAX_ROUNDS);
        return Err(Invalid::new("rounds_done", done, allowed));
    }
    if (done > 0) != (last_cutoff > 0) {
        let allowed = "0 without a last_label_cutoff, and only then: a round learns from labels";
        return Err(Invalid::new("rounds_done", done, allowed));
    }
    Ok(Rounds {
        done,
        last_cutoff,
        current_cutoff,
    })
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

/// Checks that the archive is embedded if, and only if, the campaign's method asks for that.
fn check_embedder(record: &CampaignRecord) -> Result<(), Invalid> {
    let (method, is_completed) = (record.spec.method(), record.state == CampaignState::Completed);
    let (checkpoint, next) = (record.embedder.checkpoint(), record.embedder.next());
    let shown = |digest: Option<CheckpointDigest>| digest.map_or("none".to_owned(), |one| one.to_string());
    if !method.embeds() {
        return match (checkpoint, next) {
            (None, None) => Ok(()),
            (Some(_), _) => Err(Invalid::new(
                "checkpoint",
                shown(checkpoint),
                format!("none with the method {method}"),
            )),
            (None, Some(_)) => Err(Invalid::new(
                "next_checkpoint",
                shown(next),
                format!("none with the method {method}"),
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
        let allowed = format!("one, as an archive of the method {method} is embedded");
        return Err(Invalid::new("checkpoint", "none", allowed));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_proto::CampaignSpec;

    fn message() -> v1::ExportedCampaign {
        let spec = CampaignSpec::from_toml("model = \"single-sensor\"\nmethod = \"latent\"").unwrap();
        v1::ExportedCampaign {
            id: "single-7".to_owned(),
            spec: Some((&spec).into()),
            state: v1::CampaignState::Running.into(),
            created_ms: 5,
            weight: 100,
            simulator_version: SIMULATOR_VERSION.to_owned(),
            rollbacks: 2,
            rounds_done: 1,
            last_label_cutoff: 3,
            label_cutoff: Some(4),
            checkpoint: CheckpointDigest::of(b"one").to_string(),
            next_checkpoint: CheckpointDigest::of(b"two").to_string(),
            generations: 9,
            label_entries: 4,
            ..v1::ExportedCampaign::default()
        }
    }

    /// The field that is named where the change is refused.
    fn refused(change: impl Fn(&mut v1::ExportedCampaign)) -> String {
        let mut message = message();
        change(&mut message);
        ExportedCampaign::try_from(message).unwrap_err().field
    }

    #[test]
    fn what_is_exported_reads_back_and_does_not_run_elsewhere() {
        let exported = ExportedCampaign::try_from(message()).unwrap();
        assert_eq!(v1::ExportedCampaign::from(exported.clone()), message());
        assert_eq!(exported.state_when_imported(), CampaignState::Paused);
    }

    #[test]
    fn what_no_store_holds_is_refused_by_name() {
        assert_eq!(refused(|one| one.id = "../../etc-1".to_owned()), "campaign");
        assert_eq!(
            refused(|one| one.id = "small-1000000000001".to_owned()),
            "campaign"
        );
        assert_eq!(
            refused(|one| one.id = "small-99999999999999999999".to_owned()),
            "campaign"
        );
        assert_eq!(refused(|one| one.spec = None), "spec");
        assert_eq!(refused(|one| one.state = 0), "state");
        assert_eq!(refused(|one| one.weight = 0), "weight");
        assert_eq!(refused(|one| one.created_ms = u64::MAX), "created_ms");
        assert_eq!(refused(|one| one.simulator_version.clear()), "simulator_version");
        assert_eq!(refused(|one| one.label_cutoff = Some(5)), "label_cutoff");
        assert_eq!(refused(|one| one.last_label_cutoff = 5), "last_label_cutoff");
        assert_eq!(
            refused(|one| one.next_checkpoint = "x".to_owned()),
            "next_checkpoint"
        );
        assert_eq!(refused(|one| one.generations = 1_000_000), "generations");
        let completed = v1::CampaignState::Completed as i32;
        assert_eq!(completed, 3);
        assert_eq!(refused(|one| one.state = 3), "generations");
        assert_eq!(refused(|one| one.label_entries = u64::MAX), "label_entries");
        assert_eq!(refused(|one| one.digest = "\u{1b}[2J".to_owned()), "digest");
        assert_eq!(refused(|one| one.digest = "A".repeat(64)), "digest");
    }

    #[test]
    fn rounds_that_no_campaign_has_are_refused_by_name() {
        assert_eq!(refused(|one| one.rounds_done = u32::MAX), "rounds_done");
        assert_eq!(refused(|one| one.rounds_done = 0), "rounds_done");
        assert_eq!(refused(|one| one.last_label_cutoff = 0), "rounds_done");
        assert_eq!(refused(|one| one.label_cutoff = Some(2)), "label_cutoff");
    }

    #[test]
    fn an_archive_is_embedded_if_and_only_if_its_method_asks_for_it() {
        let unembedded = |one: &mut v1::ExportedCampaign| {
            (one.checkpoint, one.next_checkpoint) = (String::new(), String::new());
        };
        let completed = |one: &mut v1::ExportedCampaign| {
            one.state = v1::CampaignState::Completed.into();
            let record = ExportedCampaign::try_from(message()).unwrap().record;
            one.generations = record.generations();
        };
        assert_eq!(refused(unembedded), "checkpoint");
        assert_eq!(refused(completed), "next_checkpoint");
        let without_both = |one: &mut v1::ExportedCampaign| {
            completed(one);
            unembedded(one);
        };
        assert_eq!(refused(without_both), "checkpoint");
        // Before its first generation a campaign has none yet.
        let mut new = message();
        unembedded(&mut new);
        new.generations = 0;
        assert!(ExportedCampaign::try_from(new).is_ok());
        let hand_crafted = |one: &mut v1::ExportedCampaign| {
            let spec = CampaignSpec::from_toml("model = \"single-sensor\"\nmethod = \"hand-crafted\"");
            one.spec = Some((&spec.unwrap()).into());
        };
        assert_eq!(refused(hand_crafted), "checkpoint");
        let only_next = |one: &mut v1::ExportedCampaign| {
            hand_crafted(one);
            one.checkpoint.clear();
        };
        assert_eq!(refused(only_next), "next_checkpoint");
    }
}
