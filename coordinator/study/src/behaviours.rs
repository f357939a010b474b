//! The paper's count of behaviours (section "Evolving New Behaviors"): the classes among the medoids of the last generations.

use crate::{
    maps::BehavioursError,
    measured::{JudgedBehaviours, JudgedIndividual, MedoidsOf},
    second_judge::second_judge,
    study::{Measures, RandomBatches},
};
use murmuration_judge::{frames, judge};
use murmuration_search::{interrupt::Interrupt, medoids, novelty::Behaviours};
use murmuration_sim::{replay::replay_frames, simulate::Start};
use murmuration_swarm::{CampaignSpec, Controller, Method};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

#[derive(Debug, Clone, PartialEq)]
pub struct Individual {
    /// Generation of the individual, from 0.
    pub generation: u32,
    pub controller: Controller,
    /// Seed of the first start.
    pub seed: u64,
    /// Coordinates in the behaviour space.
    pub behaviour: Vec<f64>,
    /// Number of the individual's class in the training of the campaign's embedder; `None` if the embedder did not learn from the
    /// individual.
    pub class: Option<u32>,
}

/// Judges the last taxonomies of an archive, which is in the order of its individuals. A generation's taxonomy is clustered from
/// the archive after that generation, in the behaviour space of the whole archive. The last generation's taxonomy is the
/// campaign's. `interrupt` ends a clustering.
pub fn measure_behaviours(
    spec: &CampaignSpec,
    archive: &[Individual],
    measures: &Measures,
    interrupt: &Interrupt,
) -> Result<JudgedBehaviours, BehavioursError> {
    let samples = spec.method() == Method::Random && measures.random == RandomBatches::Samples;
    let taxonomies = match samples {
        true => batches(spec, archive, measures),
        false => last_taxonomies(spec, archive, measures, interrupt)?,
    };
    if taxonomies.is_empty() {
        return Err(BehavioursError::Empty);
    }
    let members = taxonomies.iter().flat_map(|taxonomy| &taxonomy.medoids);
    let members: BTreeSet<u64> = members.copied().collect();
    let judged = |&index: &u64| -> Result<(u64, JudgedIndividual), BehavioursError> {
        interrupt.check()?;
        let individual = archive.get(index as usize).ok_or(BehavioursError::Empty)?;
        Ok((index, judged(spec, individual, index)?))
    };
    let members: Vec<u64> = members.into_iter().collect();
    Ok(JudgedBehaviours {
        taxonomies,
        individuals: members.par_iter().map(judged).collect::<Result<_, _>>()?,
    })
}

/// The last batches of samples, in the order in which they were drawn. A batch is as large as a taxonomy.
fn batches(spec: &CampaignSpec, archive: &[Individual], measures: &Measures) -> Vec<MedoidsOf> {
    let size = spec.medoids() as usize;
    let whole = archive.len() / size;
    let first = whole.saturating_sub(measures.generations.get() as usize);
    let batch = |number: usize| MedoidsOf {
        generation: number as u32,
        medoids: (number * size..(number + 1) * size)
            .map(|index| index as u64)
            .collect(),
    };
    (first..whole).map(batch).collect()
}

fn last_taxonomies(
    spec: &CampaignSpec,
    archive: &[Individual],
    measures: &Measures,
    interrupt: &Interrupt,
) -> Result<Vec<MedoidsOf>, BehavioursError> {
    let generations: BTreeSet<u32> = archive.iter().map(|individual| individual.generation).collect();
    let skipped = generations
        .len()
        .saturating_sub(measures.generations.get() as usize);
    let taxonomy = |generation: u32| -> Result<MedoidsOf, BehavioursError> {
        let until = archive.partition_point(|individual| individual.generation <= generation);
        let mut behaviours = Behaviours::new(archive.first().map_or(0, |first| first.behaviour.len()));
        let mut labelled = BTreeMap::new();
        for (index, individual) in archive[..until].iter().enumerate() {
            behaviours.push(&individual.behaviour)?;
            labelled.extend(individual.class.map(|class| (index, class)));
        }
        let clustering = medoids::choose(spec, &behaviours, &labelled, interrupt, &|_| {})?;
        Ok(MedoidsOf {
            generation,
            medoids: clustering.medoids.iter().map(|&medoid| medoid as u64).collect(),
        })
    };
    generations.into_iter().skip(skipped).map(taxonomy).collect()
}

fn judged(
    spec: &CampaignSpec,
    individual: &Individual,
    index: u64,
) -> Result<JudgedIndividual, BehavioursError> {
    let world = spec.world();
    let start = Start::seeded(individual.seed);
    let motion = replay_frames(&individual.controller, world, &start, &frames(world))
        .map_err(|error| BehavioursError::Simulation { index, error })?;
    let verdict = judge(&motion, world);
    Ok(JudgedIndividual {
        seed: individual.seed,
        controller: individual.controller.genes().to_vec(),
        class: verdict.class().name().to_owned(),
        pattern: verdict.pattern().map_or("", |pattern| pattern.name()).to_owned(),
        second_class: second_judge(&motion, world).name().to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Study;
    use std::path::Path;

    /// An archive whose individuals do not move, in generations of four.
    fn archive(spec: &CampaignSpec, count: usize) -> Vec<Individual> {
        let individual = |index: usize| Individual {
            generation: index as u32 / 4,
            controller: Controller::new(spec.model(), &[0.0; 4]).unwrap(),
            seed: index as u64,
            behaviour: vec![index as f64 * index as f64],
            class: None,
        };
        (0..count).map(individual).collect()
    }

    fn study(more: &str) -> (CampaignSpec, Measures) {
        let text = format!(
            "name = \"s\"\nbehaviours.generations = 2\n{more}\n[campaign]\nmodel = \"single-sensor\"\nmethod = \"random\"\n\
             search.population = 4\nsearch.generations = 4\ntaxonomy.medoids = 3\nworld.horizon = 4"
        );
        let study = Study::from_toml(&text, Path::new(""), false).unwrap();
        (study.cells[0].spec.clone(), study.measures.clone())
    }

    fn indices(more: &str) -> Vec<(u32, Vec<u64>)> {
        let (spec, measures) = study(more);
        let archive = archive(&spec, 16);
        let judged = measure_behaviours(&spec, &archive, &measures, &Interrupt::default()).unwrap();
        let known: BTreeSet<u64> = judged.individuals.keys().copied().collect();
        let taxonomies = judged.taxonomies.into_iter();
        let taxonomies: Vec<_> = taxonomies
            .map(|taxonomy| (taxonomy.generation, taxonomy.medoids))
            .collect();
        let all: BTreeSet<u64> = taxonomies
            .iter()
            .flat_map(|(_, medoids)| medoids)
            .copied()
            .collect();
        assert_eq!(known, all, "each is judged once");
        taxonomies
    }

    #[test]
    fn random_samples_are_counted_in_batches_as_large_as_a_taxonomy() {
        // 16 samples are five batches of three.
        assert_eq!(indices(""), [(3, vec![9, 10, 11]), (4, vec![12, 13, 14])]);
    }

    #[test]
    fn a_taxonomy_is_that_of_the_archive_as_it_stood() {
        let taxonomies = indices("behaviours.random = \"medoids\"");
        let generations: Vec<u32> = taxonomies.iter().map(|(generation, _)| *generation).collect();
        assert_eq!(generations, [2, 3]);
        assert!(taxonomies[0].1.iter().all(|&index| index < 12) && taxonomies[0].1.len() == 3);
        // The last generation has the behaviours 144 to 225, far above all earlier ones: one of its individuals is a medoid.
        assert!(taxonomies[1].1.iter().any(|&index| index >= 12));
    }

    #[test]
    fn an_archive_with_too_few_individuals_is_refused() {
        let (spec, measures) = study("");
        for count in [0, 2] {
            let measured =
                measure_behaviours(&spec, &archive(&spec, count), &measures, &Interrupt::default());
            assert!(matches!(measured, Err(BehavioursError::Empty)), "{measured:?}");
        }
    }
}
