//! `DATASHEET.md`: the questions of Gebru et al., "Datasheets for Datasets" (Communications of the ACM 64(12), 2021), answered
//! for this campaign.

use murmuration_model::{
    ExportedCampaign, Timestamp,
    labels::{Annotator, Labels},
};
use murmuration_store::CheckpointRecord;
use murmuration_swarm::{CampaignSpec, CheckpointDigest, EmbedderSource, Method, counted};
use std::{fmt::Write as _, iter};

/// The datasheet of an export.
pub(crate) fn page(campaign: &ExportedCampaign, labels: &Labels, checkpoints: &[CheckpointRecord]) -> String {
    let record = &campaign.record;
    let spec = &record.spec;
    let mut page = format!("# Datasheet of campaign {}\n", record.id);
    let mut section = |title: &str, text: &str| {
        let _ = write!(page, "\n## {title}\n\n{text}\n");
    };
    section(
        "Motivation",
        "The data show which collective behaviours a swarm of the robots described below can show. Nobody named the \
         behaviours beforehand. Whoever ran the campaign may add why, and who paid for it.",
    );
    section("Composition", &composition(campaign, labels, checkpoints));
    section(
        "Collection process",
        &format!(
            "Every individual was simulated; no robot moved. The simulator has version {}, and is deterministic: a controller and \
             a seed have the same features and the same picture on every machine. Controllers were {}. The campaign was created \
             on {}.",
            record.simulator_version,
            proposed(campaign, checkpoints),
            Timestamp::from_ms(record.created_ms).day()
        ),
    );
    section(
        "Preprocessing, cleaning and labelling",
        &format!("{} {}", filtered(spec), labelled(labels)),
    );
    let space = match checkpoints {
        [] => "the five features, whose scale depends on the robots and their world",
        _ => "one embedder",
    };
    section(
        "Uses",
        &format!(
            "Comparing methods of search, training embedders of behaviours, choosing controllers for robots. The pictures and \
             features are a simulator's: robots with noise, other bodies or other worlds may behave otherwise. Novelty and distances \
             are in the space of {space}, and cannot be compared with those of another."
        ),
    );
    section(
        "Distribution",
        "Whoever distributes the data says here under which licence. Murmuration claims no right in what it computes.",
    );
    section(
        "Maintenance",
        &format!(
            "The folder does not change: `BLAKE3SUMS` has the digest of every file, and the archive has the digest `{}`. A later \
             export of the campaign may have more individuals, labels and checkpoints.",
            campaign.digest
        ),
    );
    page
}

fn composition(campaign: &ExportedCampaign, labels: &Labels, checkpoints: &[CheckpointRecord]) -> String {
    let (record, spec) = (&campaign.record, &campaign.record.spec);
    let model = spec.model();
    let standing = labels.standing().count() as u64;
    format!(
        "{individuals} in {generations}. Each is a controller of {genes}, simulated from {starts}, with {pictures} of {shape} \
         pixels{features}. The robots: {robots}, in a world of {width} x {height} world units. The label log has \
         {entries}, of which {standing} stand. {checkpoints}. Nothing is sampled or left out: these are all individuals of the \
         complete generations. There are no data about people, apart from the names that annotators gave themselves.",
        individuals = counted(record.individuals(), "individual"),
        generations = counted(record.generations_done.into(), "generation"),
        genes = counted(model.genes() as u64, "gene"),
        starts = counted(spec.starts().get() as u64, "start"),
        pictures = counted(spec.starts().get() as u64, "picture"),
        shape = spec.image().shape(),
        features = match record.embedder.checkpoint() {
            Some(_) => ", five features and an embedding",
            None => " and five features",
        },
        robots = model.to_line(),
        width = spec.world().width(),
        height = spec.world().height(),
        entries = counted(labels.entries(), "entry"),
        standing = counted(standing, "answer"),
        checkpoints = match checkpoints.len() {
            0 => "There is no checkpoint".to_owned(),
            count => format!("There are {}", counted(count as u64, "checkpoint")),
        },
    )
}

/// Where controllers come from.
fn proposed(campaign: &ExportedCampaign, checkpoints: &[CheckpointRecord]) -> String {
    let (record, method) = (&campaign.record, campaign.record.spec.method());
    let network = network(method, record.embedder.checkpoint(), checkpoints);
    match method {
        Method::Random => "sampled uniformly".to_owned(),
        Method::Exhaustive => "enumerated: all those of a grid".to_owned(),
        Method::HandCrafted => "bred by novelty search on the hand-crafted features".to_owned(),
        Method::Latent | Method::Untrained => {
            let features = match record.spec.space().has_features() {
                true => " and the hand-crafted features together",
                false => "",
            };
            format!("bred by novelty search on the embedding of {network}{features}")
        }
    }
}

/// Describes the network that embeds an archive. The description follows the network's lineage, because a campaign can have moved
/// to a network that its method does not name.
fn network(
    method: Method,
    checkpoint: Option<CheckpointDigest>,
    checkpoints: &[CheckpointRecord],
) -> &'static str {
    let of = |digest| checkpoints.iter().find(|record| record.digest == digest);
    let newest = checkpoint.and_then(of);
    let mut lineage = iter::successors(newest, |record| record.lineage.parent.and_then(of))
        // Stops after as many checkpoints as the export has, because a lineage in a circle has no end.
        .take(checkpoints.len())
        .map(|record| &record.lineage);
    if lineage.any(|lineage| !lineage.label_digest.is_empty()) {
        return "a network that was fine-tuned on labels (earlier generations: of those that it was fine-tuned from)";
    }
    match (method, newest) {
        (Method::Untrained, _) => "an untrained network",
        (_, Some(record)) if record.lineage.data_digest.is_empty() => {
            "a network that was made elsewhere, of whose training nothing is recorded"
        }
        _ => "a network that was trained without labels",
    }
}

fn filtered(spec: &CampaignSpec) -> String {
    let filter = match spec.filter() {
        true => {
            "The paper's heuristic filter rejected some controllers before they were simulated; `generations.parquet` counts them."
        }
        false => "No controller was filtered out.",
    };
    let trained = match spec.embedder() {
        Some(EmbedderSource::Trained { dataset, .. }) => {
            format!(
                " The embedder was trained on {}, which are not part of the export.",
                counted(dataset.pictures(), "picture")
            )
        }
        Some(EmbedderSource::Published(_)) => " The embedder had been trained before.".to_owned(),
        None => String::new(),
    };
    format!("{filter}{trained}")
}

fn labelled(labels: &Labels) -> String {
    let people = labels
        .annotators()
        .filter(|who| **who != Annotator::synthetic())
        .count() as u64;
    let synthetic = labels.answered_by_machine() as u64;
    format!(
        "Labels were given by {}; {} {} a label of the rule-based judge alone (annotator `synthetic`).",
        match people {
            0 => "nobody".to_owned(),
            1 => "1 annotator".to_owned(),
            people => format!("{people} annotators"),
        },
        counted(synthetic, "individual"),
        match synthetic {
            1 => "has",
            _ => "have",
        }
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_swarm::Lineage;

    #[test]
    fn the_network_is_named_as_it_was_trained() {
        let record = |name: &str, parent: Option<&str>, data: &str, labels: &str| CheckpointRecord {
            digest: CheckpointDigest::of(name.as_bytes()),
            size: 1,
            lineage: Lineage {
                parent: parent.map(|parent| CheckpointDigest::of(parent.as_bytes())),
                data_digest: data.to_owned(),
                label_digest: labels.to_owned(),
                ..Lineage::default()
            },
            created_ms: 0,
        };
        let checkpoints = [
            record("own", None, "aa", ""),
            record("round", Some("own"), "aa", "bb"),
            record("since", Some("round"), "aa", ""),
            record("foreign", None, "", ""),
        ];
        let message = |method, name: &str| {
            let digest = CheckpointDigest::of(name.as_bytes());
            network(method, Some(digest), &checkpoints)
        };
        assert!(message(Method::Latent, "own").contains("without labels"));
        assert!(message(Method::Untrained, "own").contains("untrained"));
        for method in [Method::Latent, Method::Untrained] {
            for name in ["round", "since"] {
                assert!(message(method, name).contains("fine-tuned on labels"), "{name}");
            }
        }
        assert!(message(Method::Latent, "foreign").contains("nothing is recorded"));
    }
}
