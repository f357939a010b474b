//! The shares of classes and patterns among all trials of a cell, as judged by the workers.

use crate::figure::Figure;
use murmuration_swarm::{Class, Pattern, Verdict};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Number of trials of a cell with each verdict.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JudgedTrials {
    /// Trials by the name of their verdict ([`Verdict::name`]). A trial with a pattern counts only for its pattern.
    pub verdicts: BTreeMap<String, u64>,
}

impl JudgedTrials {
    pub fn add(&mut self, verdict: Verdict) {
        *self.verdicts.entry(verdict.name().to_owned()).or_default() += 1;
    }

    /// Number of trials of all classes.
    pub fn trials(&self) -> u64 {
        Verdict::all().map(|verdict| self.of(verdict)).sum()
    }

    /// Number of trials of a class, including the trials of its patterns.
    pub fn of_class(&self, class: Class) -> u64 {
        let verdicts = Verdict::all().filter(|verdict| verdict.class() == class);
        verdicts.map(|verdict| self.of(verdict)).sum()
    }

    /// The share of each class and pattern among all trials, percent; empty without trials.
    pub fn figures(&self) -> BTreeMap<Figure, f64> {
        let trials = self.trials();
        if trials == 0 {
            return BTreeMap::new();
        }
        let percent = |count: u64| 100.0 * count as f64 / trials as f64;
        let classes = Class::ALL.map(|class| (Figure::Share(class), percent(self.of_class(class))));
        let pattern = |pattern| percent(self.of(Verdict::Pattern(pattern)));
        let patterns = Pattern::OF_ONE_SPECIES.map(|named| (Figure::PatternShare(named), pattern(named)));
        classes.into_iter().chain(patterns).collect()
    }

    fn of(&self, verdict: Verdict) -> u64 {
        self.verdicts.get(verdict.name()).copied().unwrap_or_default()
    }
}

impl FromIterator<Verdict> for JudgedTrials {
    fn from_iter<I: IntoIterator<Item = Verdict>>(verdicts: I) -> Self {
        let mut trials = Self::default();
        verdicts.into_iter().for_each(|verdict| trials.add(verdict));
        trials
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_of_classes_are_of_all_trials_and_patterns_are_random_too() {
        let verdicts = [
            Verdict::Class(Class::Milling),
            Verdict::Class(Class::Random),
            Verdict::Pattern(Pattern::Chain),
            Verdict::Pattern(Pattern::SmallClusters),
        ];
        let figures = JudgedTrials::from_iter(verdicts).figures();
        assert_eq!(figures[&Figure::Share(Class::Milling)], 25.0);
        assert_eq!(figures[&Figure::Share(Class::Random)], 75.0);
        assert_eq!(figures[&Figure::PatternShare(Pattern::Chain)], 25.0);
        assert_eq!(figures[&Figure::PatternShare(Pattern::MovingClumps)], 0.0);
        let classes = Class::ALL.map(|class| figures[&Figure::Share(class)]);
        assert_eq!(classes.iter().sum::<f64>(), 100.0);
    }

    #[test]
    fn a_cell_without_trials_has_no_shares() {
        assert_eq!(JudgedTrials::default().figures(), BTreeMap::new());
    }
}
