//! The judge's errors, carried into the figures by resampling.
//!
//! The judge and the annotators of the labelled sets differ about some behaviours ([`JudgeErrors`]). A resampling
//! draws the labelled behaviours, the replicates and, for each individual that the judge named, the class that the annotators give to
//! what the judge so names; of shares also the trials. The figures of many resamplings spread as far as judge, replicates and
//! trials leave them open.

use crate::{figure::Figure, measured::JudgedBehaviours, shares::JudgedTrials};
use murmuration_proto::{CapabilityModel, Class, Preset, Purpose, RandomStream};
use std::collections::BTreeMap;

/// Number of classes. A class is counted at its place in [`Class::ALL`], which is its number.
const CLASSES: usize = Class::ALL.len();

/// How often figures are resampled.
const RESAMPLINGS: usize = 1000;

/// Most trials that are drawn one by one: of more, chance moves a share by less than two points. Trials of a replicate then stay
/// as they are, and those of a class are shared out as the drawn behaviours are.
const MOST_DRAWN: u64 = 1000;

/// How many labelled behaviours of a class (row) the judge says to be of a class (column); both in the order of [`Class::ALL`].
type Counts = [[u16; CLASSES]; CLASSES];

/// `tests/labelled/single_sensor/validation.csv`.
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

/// `tests/labelled/two_sensor/validation.csv` and `tests/labelled/rare/validation.csv`.
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

/// How the judge's word differs from that of the annotators, as measured on labelled behaviours.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JudgeErrors {
    /// The labelled behaviours: the class that the annotators gave, and the judge's.
    pairs: Vec<(Class, Class)>,
}

impl JudgeErrors {
    /// The errors on the labelled sets that fit a model best: behaviours of robots with one sensor, or with two.
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

    /// The labelled behaviours: the class that the annotators gave, and the judge's.
    pub fn pairs(&self) -> &[(Class, Class)] {
        &self.pairs
    }

    /// The figures of replicates, resampled; `known` says whether a person named an individual of a replicate, and how. Of the
    /// same replicates and `row` they are the same.
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
                // A person's word, or one of which nobody knows how often it is wrong.
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

    /// The shares of classes among the trials of replicates, resampled, percent. Of the same replicates and `row` they are
    /// the same.
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

    /// As many labelled behaviours as there are, drawn with replacement: by the judge's class, those that the annotators gave.
    fn drawn_labels(&self, stream: &mut RandomStream) -> [Vec<usize>; CLASSES] {
        let mut given: [Vec<usize>; CLASSES] = Default::default();
        for _ in &self.pairs {
            let (class, judged) = self.pairs[stream.below(self.pairs.len() as u64) as usize];
            given[judged as usize].push(class as usize);
        }
        given
    }
}

/// As many trials as were judged, drawn from them with replacement: how many the judge calls by each class.
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

/// How many trials annotators would call by each class, of so many that the judge calls by each: each gets the class of one of the
/// behaviours that `given` has for the judge's.
fn renamed(
    judged: &[u64; CLASSES],
    given: &[Vec<usize>; CLASSES],
    stream: &mut RandomStream,
) -> [f64; CLASSES] {
    let mut named = [0.0; CLASSES];
    for (class, (&count, classes)) in judged.iter().zip(given).enumerate() {
        if classes.is_empty() {
            // Nobody knows how often this word is wrong.
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

/// The individuals of a replicate by their place among them, for counting them many times.
struct Named {
    /// The class, by its place in [`Class::ALL`], and whether it is the judge's word.
    individuals: Vec<(usize, bool)>,
    /// The individuals of each taxonomy.
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

    /// Adds the distinct classes, then the medoids of each class, as means over the taxonomies.
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
    use murmuration_proto::Verdict;

    /// So many trials each of milling and of dispersal.
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
        // 16 trials: a standard error of 12.5 points, 1.64 of which are 20.6.
        let spread = (of.high - of.low) / 2.0;
        assert!((15.0..26.0).contains(&spread), "{of:?}");
    }

    #[test]
    fn many_trials_stay_as_they_are() {
        let of = milling(&[&halves(501)]);
        assert!((of.high - of.low).abs() < 1e-9, "{of:?}");
    }
}
