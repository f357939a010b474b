//! Measurements of a cell, as they are stored.

use crate::{figure::Figure, maps::Maps, recall::RecallCounts, shares::JudgedTrials};
use murmuration_swarm::Class;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// The measurements of a completed cell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Measured {
    /// Digest of the cell's specification ([`cell_digest`](crate::cell_digest)).
    pub cell: String,
    /// Digest of the measures of the cell ([`measures_digest`](crate::measures_digest)).
    pub measures: String,
    /// Id of the cell's campaign.
    pub campaign: String,
    /// Digest of the archive.
    pub archive_digest: String,
    /// Digest of the checkpoint of the archive's embeddings; empty without a checkpoint.
    pub checkpoint: String,
    /// Individuals of the archive.
    pub evaluations: u64,
    /// The judged behaviours of the cell, if behaviours were judged.
    pub behaviours: Option<JudgedBehaviours>,
    /// The verdicts of the cell's trials, if they were counted.
    pub shares: Option<JudgedTrials>,
    /// The accuracy of the embedding; `None` if the accuracy was not measured or the cell has no embedding.
    pub accuracy: Option<AccuracyFigures>,
    /// Figures of the end of the search, if they were measured.
    pub search: Option<SearchFigures>,
    /// The counts of the cell's first individuals, if recall or richness was measured.
    #[serde(default)]
    pub recall: Option<RecallCounts>,
    /// The maps of the cell's first generation, if they were made.
    #[serde(default)]
    pub maps: Option<Maps>,
}

/// The judged last taxonomies of a cell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JudgedBehaviours {
    /// The taxonomies in the order of the search; at least one.
    pub taxonomies: Vec<MedoidsOf>,
    /// The individuals of the taxonomies, by index.
    pub individuals: BTreeMap<u64, JudgedIndividual>,
}

/// A taxonomy, or a batch of samples of a random search.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MedoidsOf {
    /// The last generation in the taxonomy, from 0; for a batch, the number of the batch, from 0.
    pub generation: u32,
    /// The indices of the individuals, at least one; of medoids, the medoid of the largest cluster first.
    pub medoids: Vec<u64>,
}

/// An individual with the judges' classes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JudgedIndividual {
    /// Seed of the individual's start.
    pub seed: u64,
    /// The genes of the individual's controller.
    pub controller: Vec<f64>,
    /// Name of the individual's class.
    pub class: String,
    /// Name of the individual's pattern; empty without a pattern.
    pub pattern: String,
    /// Name of the individual's class by the second judge; empty if the second judge was not asked.
    #[serde(default)]
    pub second_class: String,
}

/// The accuracy of an embedding on labelled sets.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AccuracyFigures {
    /// `features`, or the digest of the checkpoint. Cells with the same embedding count as one replicate.
    pub embedding: String,
    /// Correct triplets, in percent of the triplets whose anchor is not `random`.
    pub anchor_not_random: f64,
    /// Correct triplets, in percent of all triplets.
    pub every_anchor: f64,
}

/// Figures of the end of a search.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SearchFigures {
    /// Sum over the archive of the distance to the nearest medoid, units of the behaviour space.
    pub loss: f64,
    /// Mean novelty of the last generation when it was evaluated, units of the behaviour space.
    pub novelty: f64,
}

impl JudgedBehaviours {
    /// The figures, with the classes that `class_of` returns for the indices of individuals. The second judge's classes count
    /// only if every individual has a class by the second judge.
    pub fn figures(&self, class_of: impl Fn(u64) -> Class) -> BTreeMap<Figure, f64> {
        let mut sums: BTreeMap<Figure, f64> = Class::ALL
            .map(|class| (Figure::Class(class), 0.0))
            .into_iter()
            .collect();
        let mut add = |figure: Figure, count: usize| *sums.entry(figure).or_default() += count as f64;
        let is_second_asked = self.individuals.keys().all(|&index| self.second(index).is_some());
        for taxonomy in &self.taxonomies {
            let medoids = taxonomy.medoids.iter();
            let words: Vec<_> = medoids
                .map(|&index| (class_of(index), self.second(index)))
                .collect();
            words.iter().for_each(|&(class, _)| add(Figure::Class(class), 1));
            let first: BTreeSet<Class> = words.iter().map(|&(class, _)| class).collect();
            add(Figure::Distinct, first.len());
            if is_second_asked {
                let second: BTreeSet<Class> = words.iter().filter_map(|&(_, second)| second).collect();
                let both = words.iter().filter(|&&(class, second)| second == Some(class));
                let both: BTreeSet<Class> = both.map(|&(class, _)| class).collect();
                add(Figure::DistinctBySecond, second.len());
                add(Figure::DistinctByBoth, both.len());
            }
        }
        let count = self.taxonomies.len().max(1) as f64;
        sums.values_mut().for_each(|sum| *sum /= count);
        sums
    }

    /// The judge's class of an individual; [`Class::Random`] if it was not judged.
    pub fn judged(&self, index: u64) -> Class {
        let individual = self.individuals.get(&index);
        let class = individual.and_then(|individual| named(&individual.class));
        class.unwrap_or(Class::Random)
    }

    /// The second judge's class of an individual; `None` if the second judge was not asked about it.
    pub fn second(&self, index: u64) -> Option<Class> {
        named(&self.individuals.get(&index)?.second_class)
    }
}

fn named(name: &str) -> Option<Class> {
    Class::ALL.into_iter().find(|class| class.name() == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn taxonomy(generation: u32, medoids: &[u64]) -> MedoidsOf {
        MedoidsOf {
            generation,
            medoids: medoids.to_vec(),
        }
    }

    /// Two taxonomies of the individuals 1 to 4, with these classes by the second judge.
    fn behaviours(second: [&str; 4]) -> JudgedBehaviours {
        let individual = |second: &str| JudgedIndividual {
            seed: 1,
            controller: vec![0.0; 4],
            class: String::new(),
            pattern: String::new(),
            second_class: second.to_owned(),
        };
        JudgedBehaviours {
            taxonomies: vec![taxonomy(0, &[1, 2, 3]), taxonomy(1, &[1, 2, 4])],
            individuals: (1..).zip(second.map(individual)).collect(),
        }
    }

    fn class(index: u64) -> Class {
        match index {
            3 => Class::Random,
            _ => Class::Milling,
        }
    }

    #[test]
    fn classes_are_counted_per_taxonomy_and_averaged() {
        let figures = behaviours([""; 4]).figures(class);
        assert_eq!(figures[&Figure::Distinct], 1.5);
        assert_eq!(figures[&Figure::Class(Class::Milling)], 2.5);
        assert_eq!(figures[&Figure::Class(Class::Random)], 0.5);
        assert_eq!(figures[&Figure::Class(Class::Dispersal)], 0.0);
    }

    #[test]
    fn the_second_judge_counts_alone_and_with_the_first() {
        let figures = behaviours(["milling", "dispersal", "aggregation", "random"]).figures(class);
        assert_eq!(figures[&Figure::Distinct], 1.5);
        assert_eq!(figures[&Figure::DistinctBySecond], 3.0);
        // Both judges name milling in both taxonomies. Classes that only one judge names do not count.
        assert_eq!(figures[&Figure::DistinctByBoth], 1.0);
    }

    #[test]
    fn files_from_before_the_second_judge_have_no_figures_of_it() {
        let before = r#"{"seed":1,"controller":[0.5],"class":"milling","pattern":""}"#;
        let individual: JudgedIndividual = serde_json::from_str(before).unwrap();
        assert_eq!(individual.second_class, "");
        let figures = behaviours(["milling", "", "milling", "milling"]).figures(class);
        assert!(!figures.contains_key(&Figure::DistinctBySecond));
        assert!(!figures.contains_key(&Figure::DistinctByBoth));
    }
}
