//! The history of learning, round by round: the checkpoints with their accuracies, and the taxonomy made with each checkpoint.

use super::parts;
use maud::{Markup, html};
use murmuration_model::{CampaignRecord, CampaignState, Round};
use murmuration_store::{CheckpointRecord, Store, StoreError, TaxonomyVersion};
use murmuration_study::wide;
use murmuration_swarm::{CheckpointDigest, Feedback, Lineage, grouped, rounded, training::Configuration};
use std::collections::BTreeSet;

/// Maximum number of rows for future rounds.
const MOST_TO_COME: u32 = 10;

/// A checkpoint of a campaign's archive, and the taxonomy made with the checkpoint.
#[derive(Debug, Clone, PartialEq)]
struct Step {
    /// Number of rounds up to this checkpoint, its own round included; 0 for the first checkpoint.
    round: u32,
    /// The checkpoint; `None` if the round has no checkpoint (yet).
    checkpoint: Option<Learned>,
    /// The taxonomy made with the checkpoint.
    version: Option<TaxonomyVersion>,
}

/// A checkpoint with its accuracies and the labels that it learned from.
#[derive(Debug, Clone, PartialEq)]
struct Learned {
    digest: CheckpointDigest,
    made_ms: u64,
    /// The labels that the checkpoint learned from, in words; `None` if it learned without labels.
    from: Option<String>,
    /// Accuracy of the parent checkpoint on the held-out triplets; `None` if unknown, or if the parent was measured on other
    /// triplets.
    before: Option<f64>,
    /// Accuracy of this checkpoint on the held-out triplets; `None` if unknown.
    after: Option<f64>,
}

/// The table of the history; empty for a campaign without an embedding. Blocks while it reads the store.
pub(super) fn read(store: &Store, record: &CampaignRecord) -> Result<Markup, StoreError> {
    if !record.spec.space().embeds() {
        return Ok(Markup::default());
    }
    let versions = store.taxonomy_versions(&record.id)?;
    let mut known = Vec::new();
    for (round, digest) in checkpoints(store, record, &versions)? {
        known.push((round, learned(store, digest)?));
    }
    Ok(table(
        record,
        &with_rounds_to_come(record, steps(versions, known)),
    ))
}

/// The checkpoints of an archive with their rounds: the lineage of the current checkpoint, the checkpoint that the archive moves
/// to, and the checkpoints of former taxonomies.
fn checkpoints(
    store: &Store,
    record: &CampaignRecord,
    versions: &[TaxonomyVersion],
) -> Result<Vec<(u32, CheckpointDigest)>, StoreError> {
    let (now, next) = (record.embedder.checkpoint(), record.embedder.next());
    let parent = next.map(|next| store.checkpoint(next)).transpose()?;
    let parent = parent.and_then(|next| next.lineage.parent);
    // A round is done once its checkpoint exists. After that, the archive moves to the checkpoint.
    let moves_on = now.is_some() && parent == now;
    let rounds = store.repetition(record)?.rounds;
    let mut all = led_to(now, record.rounds.done.saturating_sub(moves_on.into()), &rounds);
    all.extend(next.map(|next| (record.rounds.done, next)));
    all.extend(
        versions
            .iter()
            .filter_map(|version| Some((version.rounds, version.checkpoint?))),
    );
    let mut seen = BTreeSet::new();
    all.retain(|(_, digest)| seen.insert(digest.to_string()));
    Ok(all)
}

/// The checkpoints that led to the archive's current checkpoint `now`, with their rounds. `done` is the number of the campaign's
/// rounds, `rounds` the lineage of `now`. If the lineage has another number of rounds, `now` was adopted, and its lineage does
/// not belong to this campaign.
fn led_to(now: Option<CheckpointDigest>, done: u32, rounds: &[Round]) -> Vec<(u32, CheckpointDigest)> {
    if rounds.len() != done as usize {
        return now.into_iter().map(|adopted| (done, adopted)).collect();
    }
    let first = rounds.first().map(|round| round.parent).or(now);
    let first = first.into_iter().map(|first| (0, first));
    first
        .chain((1..).zip(rounds.iter().map(|round| round.checkpoint)))
        .collect()
}

fn learned(store: &Store, digest: CheckpointDigest) -> Result<Learned, StoreError> {
    let CheckpointRecord {
        lineage, created_ms, ..
    } = store.checkpoint(digest)?;
    let parent = lineage
        .parent
        .map(|parent| store.checkpoint(parent))
        .transpose()?;
    let before = parent
        .filter(|parent| are_judged_alike(&parent.lineage, &lineage))
        .and_then(|parent| accuracy(&parent.lineage));
    let labels = lineage.metrics.get("labels").map_or(0, |&labels| labels as u64);
    let from = lineage.parent.filter(|_| labels > 0).map(|parent| {
        let round = Round {
            parent,
            checkpoint: digest,
            labels,
            label_digest: String::new(),
        };
        round.learned_from()
    });
    Ok(Learned {
        digest,
        made_ms: created_ms,
        from,
        before,
        after: accuracy(&lineage),
    })
}

/// Whether the accuracies of two checkpoints come from the same triplets.
fn are_judged_alike(one: &Lineage, other: &Lineage) -> bool {
    let [ours, theirs] = [one, other].map(|lineage| Configuration::from_toml(&lineage.configuration));
    one.data_digest == other.data_digest
        && ours.is_ok_and(|ours| theirs.is_ok_and(|theirs| ours.judges_as(&theirs)))
}

fn accuracy(lineage: &Lineage) -> Option<f64> {
    lineage.metrics.get("triplet_accuracy").copied()
}

/// One step for each taxonomy and for each checkpoint without one, ordered by round, then by time.
fn steps(versions: Vec<TaxonomyVersion>, known: Vec<(u32, Learned)>) -> Vec<Step> {
    let of =
        |digest: Option<CheckpointDigest>| known.iter().find(|(_, learned)| Some(learned.digest) == digest);
    let has_version: Vec<_> = versions.iter().filter_map(|version| version.checkpoint).collect();
    let mut steps: Vec<Step> = versions
        .into_iter()
        .map(|version| Step {
            round: version.rounds,
            checkpoint: of(version.checkpoint).map(|(_, learned)| learned.clone()),
            version: Some(version),
        })
        .collect();
    let without = known
        .iter()
        .filter(|(_, learned)| !has_version.contains(&learned.digest));
    steps.extend(without.map(|(round, learned)| Step {
        round: *round,
        checkpoint: Some(learned.clone()),
        version: None,
    }));
    steps.sort_by_key(|step| (step.round, step.made_ms()));
    steps
}

impl Step {
    fn digest(&self) -> Option<CheckpointDigest> {
        self.checkpoint.as_ref().map(|learned| learned.digest)
    }

    /// The time at which the taxonomy was made, or else the checkpoint, in milliseconds since 1970-01-01 UTC.
    fn made_ms(&self) -> Option<u64> {
        match &self.version {
            Some(version) => version.made_ms,
            None => self.checkpoint.as_ref().map(|learned| learned.made_ms),
        }
    }
}

/// Adds a step for the current round and for each round that will begin by itself, so that the table keeps its height.
fn with_rounds_to_come(record: &CampaignRecord, mut steps: Vec<Step>) -> Vec<Step> {
    let ends = match record.state {
        CampaignState::Running | CampaignState::Paused => {
            let of_spec = record.spec.feedback().map_or(0, Feedback::rounds);
            of_spec.max(record.rounds.done + u32::from(record.rounds.current_cutoff.is_some()))
        }
        CampaignState::Completed | CampaignState::Failed | CampaignState::Cancelled => return steps,
    };
    let first = steps.last().map_or(0, |step| step.round + 1);
    steps.extend((first..=ends).take(MOST_TO_COME as usize).map(|round| Step {
        round,
        checkpoint: None,
        version: None,
    }));
    steps
}

fn table(record: &CampaignRecord, steps: &[Step]) -> Markup {
    html! {
        section.history aria-labelledby="history" {
            h2 #history { "History" }
            p.reason {
                "A round learns from the labels at its start, and trains the previous checkpoint further. A triplet has two pictures of one "
                "controller and one picture of another; the accuracy is the share of held-out triplets that a checkpoint tells apart. "
                "“Accuracy before” is empty if the previous checkpoint was measured on other pictures. The accuracy may fall a little while the "
                "agreement with labels rises, which " code { "murmuration lab accuracy" } " measures."
            }
            (wide("Rounds", &html! { table {
                thead { tr { @for title in [
                    "Round", "Made", "Learned from", "Accuracy before", "Accuracy after", "Checkpoint", "Individuals", "Taxonomy",
                ] { th scope="col" { (title) } } } }
                tbody { @for (place, step) in steps.iter().enumerate() { (line(record, &steps[..place], step, place + 1 == steps.len())) } }
            } }))
        }
    }
}

fn line(record: &CampaignRecord, before: &[Step], step: &Step, is_last: bool) -> Markup {
    let learned = step.checkpoint.as_ref();
    // A round trains one checkpoint, so that a second checkpoint of the same round was adopted.
    let of_round = before.iter().find(|earlier| earlier.round == step.round);
    let digests = of_round.and_then(|earlier| earlier.digest()).zip(step.digest());
    let is_adopted = digests.is_some_and(|(learned, this)| learned != this);
    let is_learned_now = record.rounds.current_cutoff.is_some() && step.round == record.rounds.done + 1;
    html! {
        tr {
            th scope="row" { @if is_adopted { "adopted" } @else if step.round == 0 { "first" } @else { (step.round) } }
            td { @if let Some(ms) = step.made_ms() { (parts::moment(ms)) } @else { "–" } }
            td {
                @match learned {
                    Some(learned) => (learned.from.as_deref().unwrap_or("pictures without labels")),
                    None if is_learned_now && record.state == CampaignState::Paused => "paused",
                    None if is_learned_now => "is learned now",
                    None => "to come",
                }
            }
            td { (share(learned.and_then(|learned| learned.before))) }
            td { (share(learned.and_then(|learned| learned.after))) }
            td { @if let Some(learned) = learned { code { (learned.digest.to_string().chars().take(12).collect::<String>()) } } @else { "–" } }
            td { @if let Some(version) = &step.version { (grouped(version.individuals)) } @else { "–" } }
            td {
                @match &step.version {
                    Some(version) => {
                        a href={ "/campaigns/" (record.id) "/taxonomy?version=" (version.version) } { "version " (version.version) }
                    },
                    // The campaign learned again before its archive was clustered.
                    None if !is_last || record.state == CampaignState::Cancelled => "none",
                    None => "when the search has ended",
                }
            }
        }
    }
}

fn share(share: Option<f64>) -> String {
    share.map_or_else(
        || "–".to_owned(),
        |share| format!("{} %", rounded(100.0 * share, 1)),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples;
    use murmuration_model::Rounds;

    fn record(state: CampaignState, rounds: Rounds) -> CampaignRecord {
        CampaignRecord {
            state,
            rounds,
            ..samples::record("model = \"two-sensor\"\nmethod = \"latent\"\n[feedback]\nrounds = 2")
        }
    }

    fn learned(name: &[u8], made_ms: u64, from: Option<&str>) -> Learned {
        Learned {
            digest: CheckpointDigest::of(name),
            made_ms,
            from: from.map(str::to_owned),
            before: from.map(|_| 0.5),
            after: Some(0.75),
        }
    }

    fn version(number: u32, rounds: u32, checkpoint: &[u8]) -> TaxonomyVersion {
        TaxonomyVersion {
            version: number,
            stands: false,
            made_ms: Some(u64::from(number) * 60_000),
            checkpoint: Some(CheckpointDigest::of(checkpoint)),
            rounds,
            generations: 5,
            individuals: 1_200,
        }
    }

    #[test]
    fn every_round_has_a_row_with_what_it_learned_from_and_its_taxonomy_if_it_has_one() {
        let known = vec![
            (0, learned(b"first", 30_000, None)),
            (
                1,
                learned(b"skipped", 90_000, Some("the classes of 2 individuals")),
            ),
            (
                2,
                learned(b"taught", 100_000, Some("the classes of 20 individuals")),
            ),
        ];
        let steps = steps(vec![version(1, 0, b"first"), version(2, 2, b"taught")], known);
        let rounds: Vec<_> = steps
            .iter()
            .map(|step| (step.round, step.version.is_some()))
            .collect();
        assert_eq!(rounds, [(0, true), (1, false), (2, true)]);
        let record = record(CampaignState::Completed, Rounds::default());
        let page = table(&record, &steps).into_string();
        for expected in [
            "pictures without labels",
            "<td>the classes of 20 individuals</td><td>50.0 %</td><td>75.0 %</td>",
            "<a href=\"/campaigns/two-1/taxonomy?version=2\">version 2</a>",
            "<td>1,200</td>",
            "<td>none</td>",
        ] {
            assert!(page.contains(expected), "{expected} is not in {page}");
        }
        assert!(!page.contains("to come"), "{page}");
    }

    #[test]
    fn a_checkpoint_that_was_adopted_is_not_called_the_first() {
        let known = vec![
            (0, learned(b"first", 30_000, None)),
            (0, learned(b"other", 40_000, None)),
        ];
        let steps = steps(vec![version(1, 0, b"first"), version(2, 0, b"other")], known);
        let page = table(&record(CampaignState::Completed, Rounds::default()), &steps).into_string();
        assert_eq!(page.matches(">first<").count(), 1, "{page}");
        assert_eq!(page.matches(">adopted<").count(), 1, "{page}");
    }

    #[test]
    fn what_led_to_an_archive_is_shown_unless_another_checkpoint_was_adopted() {
        let [first, second] = [b"first".as_slice(), b"second"].map(CheckpointDigest::of);
        let round = Round {
            parent: first,
            checkpoint: second,
            labels: 5,
            label_digest: String::new(),
        };
        let rounds = std::slice::from_ref(&round);
        assert_eq!(led_to(Some(second), 1, rounds), [(0, first), (1, second)]);
        assert_eq!(led_to(Some(first), 0, &[]), [(0, first)]);
        assert_eq!(led_to(None, 0, &[]), []);
        // Before its first round, this campaign adopted the checkpoint of another campaign's round.
        assert_eq!(led_to(Some(second), 0, rounds), [(0, second)]);
    }

    #[test]
    fn rounds_to_come_have_their_rows_before_they_begin() {
        let rows = |rounds, known: Vec<(u32, Learned)>| {
            let record = record(CampaignState::Running, rounds);
            with_rounds_to_come(&record, steps(Vec::new(), known))
        };
        let before = rows(Rounds::default(), Vec::new());
        assert_eq!(
            before.iter().map(|step| step.round).collect::<Vec<_>>(),
            [0, 1, 2]
        );
        let learning = Rounds {
            current_cutoff: Some(9),
            ..Rounds::default()
        };
        let first = vec![(0, learned(b"first", 1, None))];
        assert_eq!(rows(learning, first.clone()).len(), before.len());
        let page = table(&record(CampaignState::Running, learning), &rows(learning, first)).into_string();
        assert!(
            page.contains("is learned now") && page.contains("to come"),
            "{page}"
        );
    }
}
