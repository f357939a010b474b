//! The rule-based judge's verdicts on the medoids of an archive and on a sample of it.

use murmuration_judge::{FEWEST_ROBOTS, frames, judge_species};
use murmuration_sim::{replay::replay_frames, simulate::Start};
use murmuration_swarm::{CampaignSpec, Class, Controller, Invalid, Verdict, World};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// A behaviour of the class `random` without a pattern.
pub(crate) const RANDOM: Verdict = Verdict::Class(Class::Random);

/// Size of the sample. A sample of this size gives the share of random behaviours to within 7 percentage points.
const SAMPLE: usize = 200;

/// Maximum number of robot steps to simulate for the sample, and the same for the medoids: those of 200 swarms of the paper,
/// which take half a second of one core. The number is low because coordinators, which have other work, also make reports.
const MOST_STEPS: u64 = 200 * 24 * 1200;

/// Minimum size of a sample that represents the archive.
const LEAST: usize = 50;

/// The rule-based judge's verdicts on the medoids of an archive and on a sample of it.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Judged {
    /// The verdict on each medoid, in the order of the taxonomy; empty if judging is impossible or would take too long.
    pub medoids: Vec<Verdict>,
    /// Indices of individuals evenly spread over the archive, each with its verdict; empty if judging is impossible or would take
    /// too long.
    pub sample: Vec<(u64, Verdict)>,
}

/// An individual to judge.
#[derive(Debug, Clone, Copy)]
pub struct Candidate<'a> {
    /// Index in the archive.
    pub index: u64,
    pub controller: &'a Controller,
    /// Seed of the individual's start, or of the first start if there are several.
    pub seed: u64,
}

/// Number of swarms of a world whose simulation is within `MOST_STEPS`; 0 if the judge cannot judge them.
fn affordable(spec: &CampaignSpec) -> usize {
    let world = spec.world();
    // The judge needs several robots and a full window of motion.
    if world.agents() < FEWEST_ROBOTS || world.horizon() < spec.image().window() {
        return 0;
    }
    // The time of a step grows with the square of the number of robots, once there are many.
    let weight = u64::from(world.agents() / 64).max(1);
    let steps = u64::from(world.agents()) * u64::from(world.horizon()) * weight;
    usize::try_from(MOST_STEPS / steps.max(1)).unwrap_or(SAMPLE)
}

impl Candidate<'_> {
    fn verdict(&self, world: &World) -> Result<Verdict, Invalid> {
        let start = Start::seeded(self.seed);
        let motion = replay_frames(self.controller, world, &start, &frames(world))?;
        let species = self.controller.species_of_robots(world.agents());
        Ok(judge_species(&motion, &species, world))
    }
}

impl Judged {
    /// The indices of the sample of an archive with `individuals` individuals, evenly spread over the archive; empty if judging is
    /// impossible or would take too long.
    #[must_use]
    pub fn sample(spec: &CampaignSpec, individuals: usize) -> Vec<u64> {
        let count = SAMPLE.min(affordable(spec)).min(individuals);
        let count = if count < LEAST { 0 } else { count };
        (0..count)
            .map(|place| (place * individuals / count) as u64)
            .collect()
    }

    /// Simulates and judges the medoids of an archive and its [`sample`](Self::sample).
    ///
    /// # Errors
    /// If an individual cannot be simulated.
    pub fn of(
        spec: &CampaignSpec,
        medoids: &[Candidate<'_>],
        sample: &[Candidate<'_>],
    ) -> Result<Self, Invalid> {
        let world = spec.world();
        let medoids = if medoids.len() > affordable(spec) {
            &[]
        } else {
            medoids
        };
        let sampled = sample.par_iter();
        let sampled = sampled.map(|candidate| Ok((candidate.index, candidate.verdict(world)?)));
        Ok(Self {
            medoids: medoids
                .par_iter()
                .map(|medoid| medoid.verdict(world))
                .collect::<Result<_, _>>()?,
            sample: sampled.collect::<Result<_, Invalid>>()?,
        })
    }

    /// The kinds that the judge names on cards or at least twice in the sample, each with its share of the sample in percent, if the
    /// sample has it; the most frequent first.
    pub(crate) fn kinds(&self, on_cards: impl Iterator<Item = String>) -> Vec<(String, Option<f64>)> {
        let mut counts: BTreeMap<String, usize> = BTreeMap::new();
        for (_, verdict) in self.sample.iter().filter(|(_, verdict)| *verdict != RANDOM) {
            *counts.entry(verdict.words()).or_default() += 1;
        }
        let mut kinds: Vec<String> = on_cards.collect();
        let further = counts.iter().filter(|(_, count)| **count > 1);
        for (name, _) in further {
            if !kinds.contains(name) {
                kinds.push(name.clone());
            }
        }
        let count = |name: &String| counts.get(name).copied().unwrap_or_default();
        kinds.sort_by_key(|name| std::cmp::Reverse(count(name)));
        let share = |count: usize| (count > 0).then(|| 100.0 * count as f64 / self.sample.len() as f64);
        kinds
            .into_iter()
            .map(|name| {
                let share = share(count(&name));
                (name, share)
            })
            .collect()
    }

    /// The share of the sample that is of the class `random` without a pattern, 0 to 1; `None` if there is no sample.
    pub(crate) fn random_share(&self) -> Option<f64> {
        let random = self.sample.iter().filter(|(_, verdict)| *verdict == RANDOM);
        let random = random.count();
        (!self.sample.is_empty()).then(|| random as f64 / self.sample.len() as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        Entry,
        sample::{self, SMALL},
    };

    #[test]
    fn a_sample_is_judged_where_there_are_enough() {
        let report = sample::report(&SMALL);
        let judged = |archive: &[Entry]| {
            let candidate = |index: u64| archive[index as usize].candidate(index);
            let sample = Judged::sample(&report.spec, archive.len());
            let sample: Vec<_> = sample.into_iter().map(candidate).collect();
            Judged::of(&report.spec, &[candidate(1), candidate(0)], &sample).unwrap()
        };
        let few = judged(&report.individuals);
        assert_eq!((few.medoids.len(), few.sample.len()), (2, 0));
        let more = judged(&vec![report.individuals.clone(); 2].concat());
        assert_eq!(more.sample.len(), 2 * report.individuals.len());
        assert_eq!(more.sample[..2], [(0, more.medoids[1]), (1, more.medoids[0])]);
        let many = vec![report.individuals.clone(); 20].concat();
        let many = judged(&many);
        assert_eq!(many.sample.len(), SAMPLE);
    }

    #[test]
    fn swarms_that_take_long_are_not_judged() {
        let report = sample::report(&SMALL);
        let spec = CampaignSpec::from_toml(
            "model = \"single-sensor\"\nmethod = \"hand-crafted\"\n[world]\nagents = 1000\nhorizon = 10000",
        );
        let spec = spec.unwrap();
        let medoids = [0, 1, 2].map(|index| report.individuals[index as usize].candidate(index));
        assert_eq!(Judged::of(&spec, &medoids, &[]).unwrap(), Judged::default());
        assert!(Judged::sample(&spec, 1000).is_empty());
    }
}
