//! The comparisons of a log, which stand beside the answers.

use super::Labels;
use crate::labels::{Annotator, Change, ComparedTriplet, Comparison, Preference, Refusal, Triple};
use std::collections::BTreeSet;

impl Labels {
    /// The comparisons that stand, the oldest first.
    pub fn comparisons(&self) -> impl Iterator<Item = &Comparison> {
        self.comparisons.standing()
    }

    /// What the comparisons say that an embedder can learn from, each once, the oldest first.
    #[must_use]
    pub fn compared_triplets(&self) -> Vec<ComparedTriplet> {
        let mut told = BTreeSet::new();
        let triplets = self.comparisons().filter_map(Comparison::triplet);
        triplets.filter(|triplet| told.insert(*triplet)).collect()
    }

    /// The questions of comparison that somebody has answered, each [in order](Triple::in_order).
    #[must_use]
    pub fn compared(&self) -> BTreeSet<Triple> {
        self.comparisons.questions()
    }

    /// Number of an annotator's comparisons that stand.
    #[must_use]
    pub fn compared_by(&self, annotator: &Annotator) -> usize {
        self.comparisons.count_of(annotator)
    }

    /// The entry of an annotator's newest comparison that stands.
    #[must_use]
    pub fn newest_comparison(&self, annotator: &Annotator) -> Option<u64> {
        self.comparisons.newest(annotator)
    }

    pub(super) fn compare(&mut self, triple: Triple, preference: Preference, change: &Change) -> Option<u64> {
        self.comparisons.add(Comparison {
            entry: self.entries,
            triple,
            preference,
            annotator: change.annotator.clone(),
            time_ms: change.time_ms,
        })
    }

    pub(super) fn withdraw_comparison(&mut self, entry: u64, annotator: &Annotator) -> Result<u64, Refusal> {
        if self.comparisons.withdraw(entry, annotator) {
            return Ok(entry);
        }
        Err(Refusal::NoComparison {
            annotator: annotator.clone(),
            entry,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::labels::{Action, Entry};

    fn said(annotator: &str, action: Action) -> Change {
        Change {
            annotator: annotator.parse().unwrap(),
            time_ms: 5,
            action,
        }
    }

    fn compare([reference, left, right]: [u64; 3], preference: Preference) -> Action {
        let triple = Triple::new(reference, left, right).unwrap();
        Action::Compare { triple, preference }
    }

    #[test]
    fn comparisons_follow_the_log_and_what_is_withdrawn_teaches_nothing() {
        let mut labels = Labels::default();
        let entries: Vec<Entry> = [
            said("ana", compare([1, 2, 3], Preference::Left)),
            said("ben", compare([1, 2, 3], Preference::Left)),
            said("ana", compare([4, 2, 3], Preference::Neither)),
            said("ana", compare([5, 2, 3], Preference::Right)),
            said("ana", Action::WithdrawComparison { entry: 3 }),
        ]
        .into_iter()
        .map(|change| labels.record(change).unwrap())
        .collect();
        assert_eq!(entries[4].supersedes, Some(3));
        let triplets = labels.compared_triplets();
        assert_eq!(triplets.len(), 1, "two people said the same: {triplets:?}");
        let ana: Annotator = "ana".parse().unwrap();
        assert_eq!(
            (labels.compared_by(&ana), labels.newest_comparison(&ana)),
            (2, Some(2))
        );
        assert_eq!(labels.compared().len(), 2);
        let again = labels.record(said("ben", Action::WithdrawComparison { entry: 2 }));
        assert!(
            matches!(again, Err(Refusal::NoComparison { entry: 2, .. })),
            "{again:?}"
        );
        // No answer about a class was given or undone.
        assert_eq!((labels.individuals(), labels.classes().len()), (0, 0));
        assert!(labels.record(said("ana", Action::Undo)).is_err());
        let mut replayed = Labels::default();
        replayed.follow(entries).unwrap();
        assert_eq!(replayed, labels);
    }
}
