//! Identifies cells by specification: campaigns with equal specifications are the same cell, whatever the names of the campaigns
//! and their studies.

use crate::study::{Cell, Measures, RandomBatches, Study};
use murmuration_proto::{SIMULATOR_VERSION, v1};
use murmuration_swarm::{CampaignSpec, CheckpointDigest, EmbedderSource, Invalid, Method};
use std::{collections::BTreeMap, fmt::Write as _};

/// Version of the measures. The version rises when a new program would give the same campaign other figures.
const MEASURES_VERSION: u32 = 3;

/// The digest of a specification without its name: 64 hexadecimal digits.
pub fn cell_digest(spec: &CampaignSpec) -> String {
    let mut message = v1::CampaignSpec::from(spec);
    message.name = None;
    let text = toml::to_string(&message).unwrap_or_default();
    blake3::hash(text.as_bytes()).to_hex().to_string()
}

/// The digest of the measures of a cell, including the `contents` of the label files: 64 hexadecimal digits.
pub fn measures_digest(measures: &Measures, contents: &[&[u8]]) -> String {
    let mut words = format!("{MEASURES_VERSION} {SIMULATOR_VERSION}");
    for measure in &measures.which {
        // Writing to a text cannot fail.
        let _ = write!(words, " {}", measure.name());
    }
    let random = match measures.random {
        RandomBatches::Samples => "samples",
        RandomBatches::Medoids => "medoids",
    };
    let _ = write!(words, " {} {random}", measures.generations);
    if let Some(recall) = &measures.recall {
        let _ = write!(
            words,
            " {} {} {:?}",
            cell_digest(&recall.atlas),
            recall.niches,
            recall.at
        );
    }
    for content in contents {
        let _ = write!(words, " {}", blake3::hash(content).to_hex());
    }
    blake3::hash(words.as_bytes()).to_hex().to_string()
}

/// The campaign that trains the embedder of a cell with the embedder's seed: the cell's dataset and training, with the shortest
/// possible search. `None` for a cell that shares no embedder: the cell's method has no embedder or an untrained one, or the
/// cell's specification names a checkpoint.
///
/// # Errors
/// Fails if the seed is out of range.
pub fn embedder_spec(spec: &CampaignSpec, seed: u64) -> Result<Option<CampaignSpec>, Invalid> {
    let trains = matches!(spec.embedder(), Some(EmbedderSource::Trained { .. }));
    if !trains || spec.method() == Method::Untrained {
        return Ok(None);
    }
    let mut message = v1::CampaignSpec::from(&spec.clone().with_seed(seed)?);
    message.name = Some(short_name(spec));
    message.search = Some(v1::Search {
        population: Some(1),
        generations: Some(1),
        ..v1::Search::default()
    });
    message.taxonomy = Some(v1::TaxonomyFormat {
        medoids: Some(1),
        ..v1::TaxonomyFormat::default()
    });
    message.evaluation = None;
    message.feedback = None;
    if let Some(controllers) = &mut message.controllers {
        controllers.initial.clear();
    }
    message.try_into().map(Some)
}

impl Study {
    /// The campaign that trains the embedder of a cell, if the cell shares one: see [`embedder_spec`].
    pub fn embedder_of(&self, cell: &Cell) -> Result<Option<CampaignSpec>, Invalid> {
        match self.embedder_seed(cell.replicate) {
            Some(seed) => embedder_spec(&cell.spec, seed),
            None => Ok(None),
        }
    }

    /// The campaign of a cell, with the checkpoint of the embedder that the cell shares. `embedders` has each checkpoint by the
    /// [`cell_digest`] of the campaign that trains the checkpoint. `None` if `embedders` does not have the cell's embedder yet.
    pub fn campaign_of(
        &self,
        cell: &Cell,
        embedders: &BTreeMap<String, CheckpointDigest>,
    ) -> Result<Option<CampaignSpec>, Invalid> {
        let Some(trains) = self.embedder_of(cell)? else {
            return Ok(Some(cell.spec.clone()));
        };
        let known = embedders.get(&cell_digest(&trains));
        known
            .map(|&checkpoint| with_checkpoint(&cell.spec, checkpoint))
            .transpose()
    }
}

/// The cell's specification with a published checkpoint instead of a training.
///
/// # Errors
/// Fails if the cell's method takes no checkpoint.
pub(crate) fn with_checkpoint(
    spec: &CampaignSpec,
    checkpoint: CheckpointDigest,
) -> Result<CampaignSpec, Invalid> {
    let mut message = v1::CampaignSpec::from(spec);
    message.checkpoint = Some(checkpoint.to_string());
    message.dataset = None;
    message.training = None;
    message.try_into()
}

/// The name `NAME-embedder`, cut to the length that is allowed.
fn short_name(spec: &CampaignSpec) -> String {
    let name: String = spec.name().as_str().chars().take(55).collect();
    format!("{name}-embedder")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spec(text: &str) -> CampaignSpec {
        CampaignSpec::from_toml(&format!("model = \"single-sensor\"\n{text}")).unwrap()
    }

    #[test]
    fn a_cell_is_known_by_its_fields_and_not_by_its_name() {
        let [one, renamed, other] = [
            "method = \"latent\"\nname = \"a\"",
            "method = \"latent\"\nname = \"b\"\nseed = 1",
            "method = \"latent\"\nname = \"a\"\nseed = 2",
        ]
        .map(|text| cell_digest(&spec(text)));
        assert_eq!(one, renamed);
        assert_ne!(one, other);
    }

    #[test]
    fn cells_of_one_dataset_and_training_have_one_embedder() {
        let common = "method = \"latent\"\n[dataset]\ncontrollers = 40";
        let of = |text: &str, seed| embedder_spec(&spec(text), seed).unwrap();
        let plain = of(common, 7).unwrap();
        let taught = of(
            &format!("seed = 3\n{common}\n[feedback]\nrounds = 2\n[search]\npopulation = 7"),
            7,
        );
        assert_eq!(Some(cell_digest(&plain)), taught.as_ref().map(cell_digest));
        assert_eq!((plain.seed(), plain.evaluations()), (7, 1));
        assert_ne!(Some(cell_digest(&plain)), of(common, 8).as_ref().map(cell_digest));
        let filtered = of(&format!("filter = true\n{common}"), 7);
        assert_ne!(
            Some(cell_digest(&plain)),
            filtered.as_ref().map(cell_digest),
            "its dataset is another"
        );
        for method in ["random", "hand-crafted", "untrained"] {
            assert_eq!(of(&format!("method = \"{method}\""), 7), None);
        }
    }

    #[test]
    fn a_cell_with_a_checkpoint_keeps_its_search_and_feedback() {
        let digest = CheckpointDigest::of(b"model");
        let given = spec("method = \"latent\"\nseed = 5\n[feedback]\nrounds = 2");
        let with = with_checkpoint(&given, digest).unwrap();
        assert_eq!(with.embedder(), Some(&EmbedderSource::Published(digest)));
        assert_eq!(
            (with.seed(), with.feedback(), with.search()),
            (5, given.feedback(), given.search())
        );
    }

    #[test]
    fn other_measures_have_another_digest() {
        let study = |text: &str| {
            let text =
                format!("name = \"s\"\n{text}\n[campaign]\nmodel = \"single-sensor\"\nmethod = \"random\"");
            crate::Study::from_toml(&text, std::path::Path::new(""), false).unwrap()
        };
        let plain = study("");
        let more = study("[behaviours]\ngenerations = 3");
        let digests = [
            measures_digest(&plain.measures, &[]),
            measures_digest(&more.measures, &[]),
            measures_digest(&plain.measures, &[b"labels"]),
        ];
        assert!(
            digests[0] != digests[1] && digests[0] != digests[2],
            "{digests:?}"
        );
    }

    #[test]
    fn recall_by_another_atlas_or_at_other_numbers_has_another_digest() {
        let digest = |recall: &str| {
            let text = format!(
                "name = \"s\"\nmeasures = [\"recall\"]\n[recall]\n{recall}\n[campaign]\nmodel = \"single-sensor\"\n\
                 method = \"random\"\nevaluation.judge = true"
            );
            let study = crate::Study::from_toml(&text, std::path::Path::new(""), false).unwrap();
            measures_digest(&study.measures, &[])
        };
        let atlas =
            |more: &str| format!("atlas = {{ model = \"single-sensor\", method = \"exhaustive\"{more} }}");
        let digests = [
            atlas(""),
            atlas(", controllers.step = 0.5"),
            format!("{}\nat = [10]", atlas("")),
            format!("{}\nniches = 30", atlas("")),
        ];
        let different: std::collections::BTreeSet<String> =
            digests.iter().map(|recall| digest(recall)).collect();
        assert_eq!(different.len(), 4);
        assert_eq!(
            digest(&atlas("")),
            digest(&format!("{}\nniches = 500", atlas("")))
        );
    }
}
