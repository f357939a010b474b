//! Which behaviours to ask people to compare.

use crate::space::Space;
use murmuration_model::{
    CampaignRecord,
    labels::{Annotator, Labels, Triple},
};
use murmuration_proto::{Purpose, RandomStream};
use murmuration_search::novelty::Behaviours;
use std::collections::BTreeSet;

/// Questions that are drawn, of which the best is asked.
const DRAWN: usize = 256;
/// Behaviours nearer to each other than this share of the usual distance are near-duplicates: nobody can tell them apart.
const NEAR_DUPLICATES: f64 = 0.05;

/// What somebody is asked to compare.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AskedComparison {
    /// The question; `None` if there is nothing to compare.
    pub triple: Option<Triple>,
    /// Comparisons of this annotator that stand.
    pub own: u64,
    /// Comparisons of everybody that stand.
    pub comparisons: u64,
    /// Individuals in the archive.
    pub individuals: u64,
}

/// A question, and the distances between its behaviours.
struct Candidate {
    triple: Triple,
    /// From the reference to the nearer of the other two, and to the farther.
    near: f64,
    far: f64,
    /// Between the other two.
    between: f64,
}

impl Candidate {
    fn of(behaviours: &Behaviours, triple: Triple) -> Self {
        let [reference, left, right] = triple.individuals().map(|index| index as usize);
        let distance = |one, other| behaviours.squared_distance(one, other).sqrt();
        let sides = [distance(reference, left), distance(reference, right)];
        Self {
            triple,
            near: sides[0].min(sides[1]),
            far: sides[0].max(sides[1]),
            between: distance(left, right),
        }
    }

    fn has_near_duplicates(&self, usual: f64) -> bool {
        self.near.min(self.between) <= NEAR_DUPLICATES * usual
    }

    /// How much an answer would say, 0 to 1: 1 if the reference lies half-way between the other two, so that the embedder cannot say
    /// which is more alike, and they are as different as can be.
    fn promise(&self) -> f64 {
        self.near / self.far * self.between / (self.near + self.far)
    }
}

/// The question of comparison to ask next about an archive of these behaviours; none of `asked`, which are
/// [in order](Triple::in_order), whichever side the behaviours are on. `None` if there is nothing left to ask.
///
/// Of random questions it is the one whose reference lies between two behaviours, nearly as far from one as from the other. The
/// nearer one must be nearer than half of all are, or else a person would mostly say that neither is alike. No two of the three
/// are near-duplicates.
#[must_use]
pub fn next_comparison(
    behaviours: &Behaviours,
    asked: &BTreeSet<Triple>,
    stream: &mut RandomStream,
) -> Option<Triple> {
    let count = behaviours.len() as u64;
    if count < 3 {
        return None;
    }
    let drawn = (0..DRAWN).filter_map(|_| draw(count, stream));
    let mut candidates: Vec<Candidate> = drawn
        .filter(|triple| !asked.contains(&triple.in_order()))
        .map(|triple| Candidate::of(behaviours, triple))
        .collect();
    let usual = median(candidates.iter().map(|candidate| candidate.far))?;
    candidates.retain(|candidate| !candidate.has_near_duplicates(usual));
    let likely = median(candidates.iter().map(|candidate| candidate.near))?;
    let likely = candidates.iter().filter(|candidate| candidate.near <= likely);
    let best = likely.max_by(|one, other| one.promise().total_cmp(&other.promise()))?;
    Some(best.triple)
}

/// What an annotator is asked about the archive in `space`: another question than others are asked meanwhile, most likely, and the
/// same one again after it was withdrawn.
pub(super) fn asked(
    record: &CampaignRecord,
    space: &Space,
    labels: &Labels,
    annotator: &Annotator,
) -> AskedComparison {
    let triple = several(record, space, labels, annotator, 1);
    AskedComparison {
        triple: triple.first().copied(),
        own: labels.compared_by(annotator) as u64,
        comparisons: labels.comparisons().count() as u64,
        individuals: record.individuals(),
    }
}

/// Up to `count` questions, one after the other.
pub(super) fn several(
    record: &CampaignRecord,
    space: &Space,
    labels: &Labels,
    annotator: &Annotator,
    count: usize,
) -> Vec<Triple> {
    let mut asked = labels.compared();
    let first = labels.compared_by(annotator) as u64;
    let mut questions = Vec::new();
    for place in (first..).take(count) {
        let index = index_of(annotator, place);
        let mut stream = RandomStream::derive(record.spec.seed(), Purpose::Comparison, index);
        let Some(triple) = next_comparison(&space.behaviours, &asked, &mut stream) else {
            break;
        };
        asked.insert(triple.in_order());
        questions.push(triple);
    }
    questions
}

/// The index of the stream of an annotator's question, the `place`-th from 0: another for everybody (FNV-1a of the name).
fn index_of(annotator: &Annotator, place: u64) -> u64 {
    let hash = annotator
        .as_str()
        .bytes()
        .fold(0xcbf2_9ce4_8422_2325, |hash: u64, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3)
        });
    hash.wrapping_add(place)
}

/// Three different behaviours of so many, 3 or more.
fn draw(count: u64, stream: &mut RandomStream) -> Option<Triple> {
    let reference = stream.below(count);
    let left = (reference + 1 + stream.below(count - 1)) % count;
    // Counted on from the reference, past the left one.
    let distance = (left + count - reference) % count;
    let step = 1 + stream.below(count - 2);
    let step = if step < distance { step } else { step + 1 };
    Triple::new(reference, left, (reference + step) % count).ok()
}

fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn behaviours(places: &[f64]) -> Behaviours {
        let mut behaviours = Behaviours::new(1);
        for place in places {
            behaviours.push(&[*place]).unwrap();
        }
        behaviours
    }

    fn stream(index: u64) -> RandomStream {
        RandomStream::derive(1, Purpose::Comparison, index)
    }

    #[test]
    fn every_question_is_asked_once_and_then_there_is_none() {
        let behaviours = behaviours(&[0.0, 1.0, 3.0, 7.0, 15.0]);
        let mut asked = BTreeSet::new();
        let mut index = 0;
        while let Some(triple) = next_comparison(&behaviours, &asked, &mut stream(index)) {
            assert!(asked.insert(triple.in_order()), "{triple:?} was asked before");
            index += 1;
        }
        // Five references, each with six pairs of others.
        assert_eq!(asked.len(), 30);
    }

    #[test]
    fn the_reference_lies_between_two_different_behaviours() {
        // Two clumps and one behaviour in their middle.
        let places = [0.0, 0.2, 0.4, 5.0, 9.6, 9.8, 10.0];
        let triple = next_comparison(&behaviours(&places), &BTreeSet::new(), &mut stream(0)).unwrap();
        assert_eq!(triple.reference(), 3);
        let sides = [triple.left(), triple.right()].map(|index| places[index as usize]);
        assert!((sides[0] < 5.0) != (sides[1] < 5.0), "{sides:?}");
    }

    #[test]
    fn near_duplicates_are_not_compared() {
        let places = [0.0, 0.001, 5.0, 9.0];
        let behaviours = behaviours(&places);
        let mut asked = BTreeSet::new();
        while let Some(triple) = next_comparison(&behaviours, &asked, &mut stream(asked.len() as u64)) {
            let both = [0, 1].iter().all(|twin| triple.individuals().contains(twin));
            assert!(!both, "{triple:?}");
            asked.insert(triple.in_order());
        }
        assert!(!asked.is_empty());
        let alike = self::behaviours(&[2.0; 9]);
        assert_eq!(next_comparison(&alike, &BTreeSet::new(), &mut stream(0)), None);
        let few = self::behaviours(&[1.0, 2.0]);
        assert_eq!(next_comparison(&few, &BTreeSet::new(), &mut stream(0)), None);
    }

    proptest! {
        #[test]
        fn a_question_is_a_function_of_archive_log_and_stream(
            places in prop::collection::vec(0.0..100.0_f64, 3..40),
            index: u64,
        ) {
            let behaviours = behaviours(&places);
            let one = next_comparison(&behaviours, &BTreeSet::new(), &mut stream(index));
            let again = next_comparison(&behaviours, &BTreeSet::new(), &mut stream(index));
            prop_assert_eq!(one, again);
            if let Some(triple) = one {
                prop_assert!(triple.individuals().iter().all(|&place| (place as usize) < places.len()));
                let asked = BTreeSet::from([triple.in_order()]);
                let other = next_comparison(&behaviours, &asked, &mut stream(index));
                prop_assert!(other.is_none_or(|other| other.in_order() != triple.in_order()));
            }
        }
    }

    #[test]
    fn three_different_behaviours_are_drawn_uniformly() {
        let mut stream = stream(0);
        let mut times = std::collections::BTreeMap::new();
        for _ in 0..24_000 {
            let triple = draw(4, &mut stream).unwrap();
            *times.entry(triple).or_insert(0) += 1;
        }
        assert_eq!(times.len(), 24);
        assert!(
            times.values().all(|times| (850..1150).contains(times)),
            "{times:?}"
        );
    }
}
