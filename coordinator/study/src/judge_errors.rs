//! The judge's errors, carried into the figures by resampling.
//!
//! The judge and the annotators of the labelled sets differ about some behaviours ([`JudgeErrors`]). A resampling draws the
//! labelled behaviours and the replicates. For each individual whose class the judge gave, the resampling draws one of the
//! classes that annotators gave to behaviours with the same class by the judge. For shares, a resampling also draws the trials.
//! The spread of the figures over many resamplings shows the uncertainty due to judge, replicates and trials.

use crate::{figure::Figure, measured::JudgedBehaviours, shares::JudgedTrials};
use murmuration_swarm::{CapabilityModel, Class, Preset, Purpose, RandomStream};
use std::collections::BTreeMap;

/// Number of classes. Counts are indexed by the place of the class in [`Class::ALL`], which is its number.
const CLASSES: usize = Class::ALL.len();

/// Number of resamplings.
const RESAMPLINGS: usize = 1000;

/// Largest number of trials that are drawn one by one. With more trials, chance moves a share by less than two points: the trials
/// of a replicate are then not redrawn, and the trials of a class are divided in proportion to the drawn behaviours.
const MOST_DRAWN: u64 = 1000;

/// Number of labelled behaviours of a class (row) to which the judge gives a class (column); both in the order of [`Class::ALL`].
type Counts = [[u16; CLASSES]; CLASSES];

/// Counts of `tests/labelled/single_sensor/validation.csv`.
const SINGLE_SENSOR: Counts = [
    [32, 0, 0, 0, 1, 1, 1, 0],
    [0, 7, 0, 0, 0, 0, 1, 1],
    [0, 0, 8, 0, 0, 0, 0, 2],
    [0, 0, 0, 52, 0, 0, 0, 3],
    [0, 0, 0, 0, 5, 0, 0, 0],
    [0, 0, 0, 0, 0, 0, 0, 0],
    [0, 0, 0, 0, 0, 0, 0, 0],
    [0, 3, 0, 1, 0, 0, 0, 82],
];

/// Counts of `tests/labelled/two_sensor/validation.csv` and `tests/labelled/rare/validation.csv`.
const TWO_SENSORS: Counts = [
    [11, 0, 0, 0, 1, 2, 2, 0],
    [0, 8, 0, 0, 0, 0, 0, 3],
    [0, 0, 9, 0, 0, 0, 0, 0],
    [0, 0, 0, 24, 0, 0, 0, 8],
    [0, 0, 0, 0, 9, 0, 0, 0],
    [0, 0, 1, 0, 0, 14, 0, 1],
    [1, 0, 2, 0, 0, 0, 14, 0],
    [0, 3, 0, 3, 2, 0, 0, 123],
];

/// Differences between the judge's classes and the annotators' classes, as measured on labelled behaviours.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JudgeErrors {
    /// The annotators' class and the judge's class of each labelled behaviour.
    pairs: Vec<(Class, Class)>,
}

impl JudgeErrors {
    /// The errors on the labelled sets that fit a model best: sets of robots with one sensor, or with two.
    pub fn of_model(model: &CapabilityModel) -> Self {
        match model.preset() {
            Some(Preset::SingleSensor) => Self::of_counts(&SINGLE_SENSOR),
            _ => Self::of_counts(&TWO_SENSORS),
        }
    }

    fn of_counts(counts: &Counts) -> Self {
        let rows = Class::ALL.into_iter().zip(counts);
        let pairs = rows.flat_map(|(given, row)| {
            let columns = Class::ALL.into_iter().zip(row);
            columns.flat_map(move |(judged, &count)| std::iter::repeat_n((given, judged), count.into()))
        });
        Self {
            pairs: pairs.collect(),
        }
    }

    /// The annotators' class and the judge's class of each labelled behaviour.
    pub fn pairs(&self) -> &[(Class, Class)] {
        &self.pairs
    }

    /// The figures of the replicates, resampled. `known` returns the class that a person gave to an individual of a replicate, if
    /// any. The same replicates and `row` give the same figures.
    pub(crate) fn resampled(
        &self,
        replicates: &[&JudgedBehaviours],
        known: impl Fn(usize, u64) -> Option<Class>,
        row: u64,
    ) -> Vec<BTreeMap<Figure, f64>> {
        if replicates.is_empty() {
            return Vec::new();
        }
        let mut stream = RandomStream::derive(0, Purpose::Resample, row);
        let replicates: Vec<Named> = replicates
            .iter()
            .enumerate()
            .map(|(place, behaviours)| Named::of(behaviours, |index| known(place, index)))
            .collect();
        let one = |_| self.one_resampling(&replicates, &mut stream);
        (0..RESAMPLINGS).map(one).collect()
    }

    fn one_resampling(&self, replicates: &[Named], stream: &mut RandomStream) -> BTreeMap<Figure, f64> {
        let given = self.drawn_labels(stream);
        let mut sums = [0.0; CLASSES + 1];
        for _ in replicates {
            let named = &replicates[stream.below(replicates.len() as u64) as usize];
            let draw = |&(class, by_judge): &(usize, bool)| match &given[class] {
                classes if by_judge && !classes.is_empty() => {
                    classes[stream.below(classes.len() as u64) as usize]
                }
                // The class is from a person, or from the judge without a known error rate for this class.
                _ => class,
            };
            let drawn: Vec<usize> = named.individuals.iter().map(draw).collect();
            named.count(&drawn, &mut sums);
        }
        let figures = [Figure::Distinct]
            .into_iter()
            .chain(Class::ALL.map(Figure::Class));
        let means = sums.map(|sum| sum / replicates.len() as f64);
        figures.zip(means).collect()
    }

    /// The shares of classes among the trials of the replicates, resampled, percent. The same replicates and `row` give the same
    /// shares.
    pub(crate) fn resampled_shares(
        &self,
        replicates: &[&JudgedTrials],
        row: u64,
    ) -> Vec<BTreeMap<Figure, f64>> {
        let mut stream = RandomStream::derive(0, Purpose::Resample, row);
        let judged = replicates
            .iter()
            .map(|trials| Class::ALL.map(|class| trials.of_class(class)));
        let replicates: Vec<[u64; CLASSES]> = judged
            .filter(|counts| counts.iter().any(|&count| count > 0))
            .collect();
        if replicates.is_empty() {
            return Vec::new();
        }
        let mut one = || {
            let given = self.drawn_labels(&mut stream);
            let mut sums = [0.0; CLASSES];
            for _ in &replicates {
                let judged = &replicates[stream.below(replicates.len() as u64) as usize];
                let trials = judged.iter().sum::<u64>() as f64;
                let named = renamed(&redrawn(judged, &mut stream), &given, &mut stream);
                for (sum, count) in sums.iter_mut().zip(named) {
                    *sum += 100.0 * count / trials / replicates.len() as f64;
                }
            }
            Class::ALL.map(Figure::Share).into_iter().zip(sums).collect()
        };
        (0..RESAMPLINGS).map(|_| one()).collect()
    }

    /// Draws labelled behaviours with replacement, as many as the sets have. Returns the annotators' classes, by the judge's
    /// class.
    fn drawn_labels(&self, stream: &mut RandomStream) -> [Vec<usize>; CLASSES] {
        let mut given: [Vec<usize>; CLASSES] = Default::default();
        for _ in &self.pairs {
            let (class, judged) = self.pairs[stream.below(self.pairs.len() as u64) as usize];
            given[judged as usize].push(class as usize);
        }
        given
    }
}

/// Draws trials with replacement, as many as were judged. Returns the number of trials of each class by the judge.
fn redrawn(judged: &[u64; CLASSES], stream: &mut RandomStream) -> [u64; CLASSES] {
    let trials = judged.iter().sum();
    if trials > MOST_DRAWN {
        return *judged;
    }
    let mut drawn = [0; CLASSES];
    for _ in 0..trials {
        let mut at = stream.below(trials);
        for (count, drawn) in judged.iter().zip(&mut drawn) {
            if at < *count {
                *drawn += 1;
                break;
            }
            at -= count;
        }
    }
    drawn
}

/// Number of trials to which annotators would give each class, from the number of trials of each class by the judge. Each trial
/// gets an annotators' class from `given`, of a behaviour with the same class by the judge.
fn renamed(
    judged: &[u64; CLASSES],
    given: &[Vec<usize>; CLASSES],
    stream: &mut RandomStream,
) -> [f64; CLASSES] {
    let mut named = [0.0; CLASSES];
    for (class, (&count, classes)) in judged.iter().zip(given).enumerate() {
        if classes.is_empty() {
            // The error rate of this class is unknown.
            named[class] += count as f64;
        } else if count > MOST_DRAWN {
            let part = count as f64 / classes.len() as f64;
            classes.iter().for_each(|&class| named[class] += part);
        } else {
            let drawn = (0..count).map(|_| classes[stream.below(classes.len() as u64) as usize]);
            drawn.for_each(|class| named[class] += 1.0);
        }
    }
    named
}

/// The individuals of a replicate, indexed for repeated counting.
struct Named {
    /// For each individual, the place of its class in [`Class::ALL`], and whether the judge gave this class.
    individuals: Vec<(usize, bool)>,
    /// The individuals of each taxonomy, as places in `individuals`.
    taxonomies: Vec<Vec<usize>>,
}

impl Named {
    fn of(behaviours: &JudgedBehaviours, known: impl Fn(u64) -> Option<Class>) -> Self {
        let indices: Vec<u64> = behaviours.individuals.keys().copied().collect();
        let class = |&index: &u64| match known(index) {
            Some(class) => (class as usize, false),
            None => (behaviours.judged(index) as usize, true),
        };
        let place = |index: &u64| indices.binary_search(index).ok();
        let places = |medoids: &[u64]| medoids.iter().filter_map(place).collect();
        let taxonomies = behaviours.taxonomies.iter();
        Self {
            individuals: indices.iter().map(class).collect(),
            taxonomies: taxonomies.map(|taxonomy| places(&taxonomy.medoids)).collect(),
        }
    }

    /// Adds the number of distinct classes, then the number of medoids of each class, as means over the taxonomies.
    fn count(&self, classes: &[usize], sums: &mut [f64; CLASSES + 1]) {
        let share = 1.0 / self.taxonomies.len().max(1) as f64;
        for taxonomy in &self.taxonomies {
            let mut counts = [0_u32; CLASSES];
            taxonomy.iter().for_each(|&place| counts[classes[place]] += 1);
            sums[0] += share * counts.iter().filter(|count| **count > 0).count() as f64;
            for (sum, count) in sums[1..].iter_mut().zip(counts) {
                *sum += share * f64::from(count);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tables::Resampled;
    use murmuration_swarm::Verdict;

    /// `count` trials of milling and `count` trials of dispersal.
    fn halves(count: usize) -> JudgedTrials {
        let both = [Class::Milling, Class::Dispersal].into_iter();
        both.flat_map(|class| std::iter::repeat_n(Verdict::Class(class), count))
            .collect()
    }

    /// The share of milling, resampled with a judge that never errs.
    fn milling(replicates: &[&JudgedTrials]) -> Resampled {
        let mut counts = [[0; CLASSES]; CLASSES];
        (0..CLASSES).for_each(|class| counts[class][class] = 10);
        let resampled = JudgeErrors::of_counts(&counts).resampled_shares(replicates, 0);
        let shares = resampled.iter().map(|of| of[&Figure::Share(Class::Milling)]);
        Resampled::of(shares.collect()).unwrap()
    }

    #[test]
    fn few_trials_of_one_replicate_spread_as_a_binomial_does() {
        let of = milling(&[&halves(8)]);
        assert!((of.mean - 50.0).abs() < 2.0, "{of:?}");
        // 16 trials have a standard error of 12.5 points; 1.645 standard errors are 20.6 points.
        let spread = (of.high - of.low) / 2.0;
        assert!((15.0..26.0).contains(&spread), "{of:?}");
    }

    #[test]
    fn many_trials_stay_as_they_are() {
        let of = milling(&[&halves(501)]);
        assert!((of.high - of.low).abs() < 1e-9, "{of:?}");
    }
}
