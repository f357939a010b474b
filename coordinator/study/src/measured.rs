//! What was measured of a cell, as it is kept.

use crate::{figure::Figure, maps::Maps, recall::RecallCounts, shares::JudgedTrials};
use murmuration_proto::Class;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// What was measured of a completed cell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Measured {
    /// Digest of the cell's specification ([`cell_digest`](crate::cell_digest)).
    pub cell: String,
    /// How it was measured ([`measures_digest`](crate::measures_digest)).
    pub measures: String,
    /// Id of its campaign.
    pub campaign: String,
    /// Digest of the archive.
    pub archive_digest: String,
    /// Digest of the checkpoint of the archive's embeddings; empty if none.
    pub checkpoint: String,
    /// Individuals of the archive.
    pub evaluations: u64,
    /// The behaviours that were judged, if they were.
    pub behaviours: Option<JudgedBehaviours>,
    /// The verdicts of its trials, if they were counted.
    pub shares: Option<JudgedTrials>,
    /// The accuracy of the embedding; `None` if it was not measured or the cell has none.
    pub accuracy: Option<AccuracyFigures>,
    /// How the search ended, if that was measured.
    pub search: Option<SearchFigures>,
    /// What its first individuals were, if recall or richness was measured.
    #[serde(default)]
    pub recall: Option<RecallCounts>,
    /// The maps of its first generation, if they were made.
    #[serde(default)]
    pub maps: Option<Maps>,
}

/// The last taxonomies of a cell, judged.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JudgedBehaviours {
    /// The taxonomies, the last of the search last; at least one.
    pub taxonomies: Vec<MedoidsOf>,
    /// The individuals in them, by index.
    pub individuals: BTreeMap<u64, JudgedIndividual>,
}

/// A taxonomy, or a batch of samples of a random search.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MedoidsOf {
    /// The last generation in it, from 0; of batches their number, from 0.
    pub generation: u32,
    /// The indices of the individuals, of medoids that of the largest cluster first; at least one.
    pub medoids: Vec<u64>,
}

/// An individual with the judge's word.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JudgedIndividual {
    /// Seed of its start.
    pub seed: u64,
    /// The genes of its controller.
    pub controller: Vec<f64>,
    /// Name of its class.
    pub class: String,
    /// Name of its pattern; empty if none.
    pub pattern: String,
}

/// The accuracy of an embedding on labelled sets.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AccuracyFigures {
    /// `features`, or the digest of the checkpoint: equal ones are counted once.
    pub embedding: String,
    /// Correct triplets whose anchor is not `random`, percent.
    pub anchor_not_random: f64,
    /// Correct triplets, percent.
    pub every_anchor: f64,
}

/// How a search ended.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SearchFigures {
    /// Sum over the archive of the distance to the nearest medoid, units of the behaviour space.
    pub loss: f64,
    /// Mean novelty of the last generation when it was evaluated, units of the behaviour space.
    pub novelty: f64,
}

impl JudgedBehaviours {
    /// The figures, with the class that `class_of` says of an individual by its index.
    #[must_use]
    pub fn figures(&self, class_of: impl Fn(u64) -> Class) -> BTreeMap<Figure, f64> {
        let mut sums: BTreeMap<Figure, f64> = Class::ALL
            .map(|class| (Figure::Class(class), 0.0))
            .into_iter()
            .collect();
        let mut distinct = 0;
        for taxonomy in &self.taxonomies {
            let mut classes = BTreeSet::new();
            for &index in &taxonomy.medoids {
                let class = class_of(index);
                *sums.entry(Figure::Class(class)).or_default() += 1.0;
                classes.insert(class);
            }
            distinct += classes.len();
        }
        sums.insert(Figure::Distinct, distinct as f64);
        let count = self.taxonomies.len().max(1) as f64;
        sums.values_mut().for_each(|sum| *sum /= count);
        sums
    }

    /// The judge's word of an individual; [`Class::Random`] of one that it was not asked about.
    #[must_use]
    pub fn judged(&self, index: u64) -> Class {
        let name = self
            .individuals
            .get(&index)
            .map(|individual| individual.class.as_str());
        let class = name.and_then(|name| Class::ALL.into_iter().find(|class| class.name() == name));
        class.unwrap_or(Class::Random)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_are_counted_per_taxonomy_and_averaged() {
        let taxonomy = |generation, medoids: &[u64]| MedoidsOf {
            generation,
            medoids: medoids.to_vec(),
        };
        let behaviours = JudgedBehaviours {
            taxonomies: vec![taxonomy(0, &[1, 2, 3]), taxonomy(1, &[1, 2, 4])],
            individuals: BTreeMap::new(),
        };
        let class = |index| match index {
            1 | 2 => Class::Milling,
            3 => Class::Random,
            _ => Class::Milling,
        };
        let figures = behaviours.figures(class);
        assert_eq!(figures[&Figure::Distinct], 1.5);
        assert_eq!(figures[&Figure::Class(Class::Milling)], 2.5);
        assert_eq!(figures[&Figure::Class(Class::Random)], 0.5);
        assert_eq!(figures[&Figure::Class(Class::Dispersal)], 0.0);
    }
}
