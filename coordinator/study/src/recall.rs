//! Recall: the share of an atlas's niches, or of its classes and patterns, that a search finds in a number of evaluations.

use crate::{
    figure::Figure,
    reference::{Judged, Reference},
    richness::Richness,
};
use murmuration_search::novelty::Misfit;
use murmuration_swarm::{CampaignSpec, Class, Method};
use serde::{Deserialize, Serialize};
use std::{collections::BTreeMap, num::NonZeroU32};

#[derive(Debug, Clone, PartialEq)]
pub struct RecallPlan {
    /// The campaign of the atlas, whose trials are judged. Every cell has the robots and the world of this campaign.
    pub atlas: CampaignSpec,
    /// Numbers of evaluations, ascending, at which recall is measured: 1 to 32 numbers, each at most the number of evaluations of
    /// every cell.
    pub at: Vec<NonZeroU32>,
    /// Largest number of niches of the behaviour space, 2 to 5,000.
    pub niches: NonZeroU32,
}

/// The counts of the first individuals of an archive, at some numbers of evaluations.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecallCounts {
    /// Whether the individuals were drawn independently of each other. The method `random` draws independently, unless the
    /// campaign begins with given controllers.
    pub is_independent: bool,
    /// The counts at each number of evaluations, ascending; at least one stage.
    pub stages: Vec<RecallStage>,
}

/// The counts of the first individuals of an archive.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecallStage {
    /// Number of individuals.
    pub evaluations: u32,
    /// Number of the individuals' trials with each verdict, by the verdict's name.
    pub verdicts: BTreeMap<String, u64>,
    /// Number of individuals in each niche of the reference, in the order of the reference.
    pub niches: Vec<u64>,
}

/// Counts the verdicts and niches of the first individuals of a campaign's archive, which is in the order of its individuals.
///
/// # Errors
/// [`Misfit`] if features are not finite, or too large.
pub fn measure_recall(
    spec: &CampaignSpec,
    archive: &[Judged],
    at: &[NonZeroU32],
    reference: &Reference,
) -> Result<RecallCounts, Misfit> {
    // Later individuals count at no stage.
    let most = at.iter().map(|evaluations| evaluations.get() as usize).max();
    let archive = &archive[..archive.len().min(most.unwrap_or_default())];
    let niches = reference.niches_of(archive)?;
    let stage = |evaluations: &NonZeroU32| {
        let mut stage = RecallStage {
            evaluations: evaluations.get(),
            verdicts: BTreeMap::new(),
            niches: vec![0; reference.niches.len()],
        };
        for (judged, &niche) in archive.iter().zip(&niches).take(evaluations.get() as usize) {
            stage.niches[niche] += 1;
            for verdict in &judged.verdicts {
                *stage.verdicts.entry(verdict.name().to_owned()).or_default() += 1;
            }
        }
        stage
    };
    Ok(RecallCounts {
        is_independent: is_independent(spec),
        stages: at.iter().map(stage).collect(),
    })
}

/// Whether the individuals of a campaign are drawn independently of each other, from one distribution.
pub(crate) fn is_independent(spec: &CampaignSpec) -> bool {
    spec.method() == Method::Random && spec.controllers().initial().is_empty()
}

impl RecallStage {
    /// Recall at this stage, percent: of all niches, of the niches of each class, and of the classes and patterns.
    pub fn recall(&self, reference: &Reference) -> BTreeMap<Figure, f64> {
        let niches = || reference.niches.iter().zip(&self.niches);
        let reached = |of: &dyn Fn(&str) -> bool| {
            let reached: Vec<bool> = niches()
                .filter(|(niche, _)| of(&niche.class))
                .map(|(_, &count)| count > 0)
                .collect();
            percent(
                reached.iter().filter(|is_reached| **is_reached).count(),
                reached.len(),
            )
        };
        let known = reference.verdicts.keys();
        let found = known
            .filter(|verdict| self.verdicts.contains_key(*verdict))
            .count();
        let of_all = [
            (Figure::NichesReached, reached(&|_| true)),
            (Figure::VerdictsFound, percent(found, reference.verdicts.len())),
        ];
        let of_class =
            Class::ALL.map(|class| (Figure::Reached(class), reached(&|name| name == class.name())));
        let figures = of_all.into_iter().chain(of_class);
        figures
            .filter_map(|(figure, share)| Some((figure, share?)))
            .collect()
    }

    /// The estimated number of classes and patterns.
    pub(crate) fn richness_of_verdicts(&self) -> Option<Richness> {
        Richness::of(&self.verdicts.values().copied().collect::<Vec<_>>())
    }

    /// The estimated number of niches that endless draws would reach.
    pub(crate) fn richness_of_niches(&self) -> Option<Richness> {
        Richness::of(&self.niches)
    }

    /// The estimates of verdicts and of niches, as figures.
    pub fn richness(&self) -> BTreeMap<Figure, f64> {
        let mut figures = BTreeMap::new();
        if let Some(of) = self.richness_of_verdicts() {
            figures.insert(Figure::VerdictsSeen, of.seen as f64);
            figures.insert(Figure::VerdictsChao1, of.chao1);
            figures.extend(of.ace.map(|ace| (Figure::VerdictsAce, ace)));
        }
        if let Some(of) = self.richness_of_niches() {
            figures.insert(Figure::NichesSeen, of.seen as f64);
            figures.insert(Figure::NichesChao1, of.chao1);
            figures.extend(of.ace.map(|ace| (Figure::NichesAce, ace)));
        }
        figures
    }
}

/// `count` in percent of `all`; `None` if `all` is 0.
fn percent(count: usize, all: usize) -> Option<f64> {
    (all > 0).then(|| 100.0 * count as f64 / all as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::Niche;
    use murmuration_swarm::{Controller, Features, Pattern, Verdict};

    /// Three niches along the first feature: milling at 0 and at 10, dispersal at 20.
    fn reference() -> Reference {
        let niche = |at: f64, class: Class| Niche {
            centroid: along(at),
            class: class.name().to_owned(),
            members: 5,
        };
        let verdicts = ["milling", "dispersal", "chain", "random"];
        Reference {
            measures: String::new(),
            campaign: "atlas".to_owned(),
            archive_digest: String::new(),
            verdicts: verdicts.map(|name| (name.to_owned(), 9)).into(),
            scale: [1.0; 5],
            niches: vec![
                niche(0.0, Class::Milling),
                niche(10.0, Class::Milling),
                niche(20.0, Class::Dispersal),
            ],
        }
    }

    fn along(at: f64) -> Features {
        [at, 0.0, 0.0, 0.0, 0.0]
    }

    fn spec() -> CampaignSpec {
        spec_with("method = \"random\"")
    }

    fn spec_with(more: &str) -> CampaignSpec {
        CampaignSpec::from_toml(&format!("name = \"a\"\nmodel = \"single-sensor\"\n{more}")).unwrap()
    }

    fn archive(individuals: &[(f64, Verdict)]) -> Vec<Judged> {
        let spec = spec();
        let judged = |&(at, verdict): &(f64, Verdict)| Judged {
            controller: Controller::new(spec.model(), &[0.0; 4]).unwrap(),
            features: along(at),
            behaviour: Vec::new(),
            verdicts: vec![verdict],
        };
        individuals.iter().map(judged).collect()
    }

    #[test]
    fn recall_grows_with_the_evaluations() {
        let milling = Verdict::Class(Class::Milling);
        let archive = archive(&[
            (1.0, milling),
            (-3.0, Verdict::Pattern(Pattern::Chain)),
            (14.9, milling),
            (99.0, Verdict::Class(Class::Aggregation)),
        ]);
        let at = [1, 3, 4].map(|count| NonZeroU32::new(count).unwrap());
        let counts = measure_recall(&spec(), &archive, &at, &reference()).unwrap();
        let recall: Vec<_> = counts
            .stages
            .iter()
            .map(|stage| stage.recall(&reference()))
            .collect();
        let of = |figure| recall.iter().map(|of| of[&figure].round()).collect::<Vec<_>>();
        assert_eq!(of(Figure::NichesReached), [33.0, 67.0, 100.0]);
        assert_eq!(of(Figure::Reached(Class::Milling)), [50.0, 100.0, 100.0]);
        assert_eq!(of(Figure::Reached(Class::Dispersal)), [0.0, 0.0, 100.0]);
        // The atlas has no aggregation.
        assert_eq!(of(Figure::VerdictsFound), [25.0, 50.0, 50.0]);
        assert!(
            !recall[0].contains_key(&Figure::Reached(Class::NestedCycle)),
            "it has no niche"
        );
        assert_eq!(counts.stages[2].niches, [2, 1, 1]);
    }

    #[test]
    fn draws_are_independent_where_nothing_but_chance_chose_them() {
        let is_independent = |more| is_independent(&spec_with(more));
        assert!(is_independent("method = \"random\""));
        assert!(is_independent("method = \"random\"\nfilter = true"));
        assert!(!is_independent("method = \"hand-crafted\""));
        assert!(!is_independent(
            "method = \"random\"\ncontrollers.initial = [[-0.7, 0.3, 1.0, 1.0]]"
        ));
    }

    #[test]
    fn abundances_are_counts_of_draws() {
        let stage = RecallStage {
            evaluations: 7,
            verdicts: [("milling".to_owned(), 5), ("chain".to_owned(), 2)].into(),
            niches: vec![1, 1, 0, 2, 2, 1],
        };
        let figures = stage.richness();
        assert_eq!(
            (figures[&Figure::VerdictsSeen], figures[&Figure::VerdictsChao1]),
            (2.0, 2.0)
        );
        assert_eq!(
            (figures[&Figure::NichesSeen], figures[&Figure::NichesChao1]),
            (5.0, 6.0)
        );
        assert_eq!(figures[&Figure::NichesAce], 8.75);
    }
}
