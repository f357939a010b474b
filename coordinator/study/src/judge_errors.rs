//! The judge's errors, carried into the figures by resampling.
//!
//! What the judge says of a behaviour and what people say of it differ ([`JudgeErrors`]). A resampling draws the labelled
//! behaviours, the replicates and, for each individual that the judge named, the class that people give to what the judge so
//! names. The figures of many resamplings spread as far as judge and replicates leave them open.

use crate::{figure::Figure, measured::JudgedBehaviours};
use murmuration_judge::Class;
use murmuration_proto::{CapabilityModel, Preset, Purpose, RandomStream};
use std::collections::BTreeMap;

/// How often figures are resampled.
const RESAMPLINGS: usize = 1000;

/// How many labelled behaviours of a class (row) the judge says to be of a class (column); both in the order of [`Class::ALL`].
type Counts = [[u16; 8]; 8];

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

/// How the judge's word differs from that of people, as measured on labelled behaviours.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JudgeErrors {
    /// The labelled behaviours: the class that people gave, and the judge's.
    pairs: Vec<(Class, Class)>,
}

impl JudgeErrors {
    /// Those of the labelled sets that fit a model best: behaviours of robots with one sensor, or with two.
    #[must_use]
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

    /// The labelled behaviours: the class that people gave, and the judge's.
    #[must_use]
    pub fn pairs(&self) -> &[(Class, Class)] {
        &self.pairs
    }

    /// The figures of `replicates`, resampled; `known` says whether a person named an individual of a replicate, and how. Of the same
    /// replicates and `row` they are the same.
    pub(crate) fn resampled(
        &self,
        replicates: &[&JudgedBehaviours],
        known: impl Fn(usize, u64) -> Option<Class>,
        row: u64,
    ) -> Vec<BTreeMap<Figure, f64>> {
        let mut stream = RandomStream::derive(0, Purpose::Resample, row);
        let resample = |_| self.one_resampling(replicates, &known, &mut stream);
        match replicates.is_empty() {
            true => Vec::new(),
            false => (0..RESAMPLINGS).map(resample).collect(),
        }
    }

    fn one_resampling(
        &self,
        replicates: &[&JudgedBehaviours],
        known: &impl Fn(usize, u64) -> Option<Class>,
        stream: &mut RandomStream,
    ) -> BTreeMap<Figure, f64> {
        let given = self.drawn_labels(stream);
        let mut sums: BTreeMap<Figure, f64> = BTreeMap::new();
        for _ in replicates {
            let replicate = stream.below(replicates.len() as u64) as usize;
            let behaviours = replicates[replicate];
            let mut drawn = BTreeMap::new();
            for &index in behaviours.individuals.keys() {
                let class = known(replicate, index).unwrap_or_else(|| {
                    let judged = behaviours.judged(index);
                    match given.get(&judged) {
                        Some(classes) => classes[stream.below(classes.len() as u64) as usize],
                        // Nobody knows how often that word is wrong.
                        None => judged,
                    }
                });
                drawn.insert(index, class);
            }
            let class_of = |index| drawn.get(&index).copied().unwrap_or(Class::Random);
            for (figure, value) in behaviours.figures(class_of) {
                *sums.entry(figure).or_default() += value;
            }
        }
        sums.values_mut().for_each(|sum| *sum /= replicates.len() as f64);
        sums
    }

    /// As many labelled behaviours as there are, drawn with replacement: by the judge's class, the classes that people gave.
    fn drawn_labels(&self, stream: &mut RandomStream) -> BTreeMap<Class, Vec<Class>> {
        let mut given: BTreeMap<Class, Vec<Class>> = BTreeMap::new();
        for _ in &self.pairs {
            let (class, judged) = self.pairs[stream.below(self.pairs.len() as u64) as usize];
            given.entry(judged).or_default().push(class);
        }
        given
    }
}
