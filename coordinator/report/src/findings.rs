//! The findings of a campaign: which of its behaviours are distinct, which of them pages show first, and sentences about them.

use crate::{Judged, Purity, Report, card::Namer, judged::RANDOM};
use maud::{Markup, html};
use murmuration_model::labels::{ClassKey, ClassName};
use murmuration_swarm::{CampaignSpec, Class, Verdict, counted, noun};
use std::collections::BTreeSet;

/// The kind of behaviour that a card shows. Cards of one kind count as one distinct behaviour.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Shown {
    /// A behaviour with a name by an annotator: its own, or one from an earlier version that the judge does not contradict.
    Named(String),
    /// A behaviour that only the rule-based judge names.
    Judged(String),
    /// A behaviour that only the judge names, in a cluster of whose members few are of this kind.
    Mixed,
    /// A behaviour without a name, or a random behaviour.
    Random,
}

impl Shown {
    /// The kind of a card from the name of the behaviour and who gave it, if any, the judge's verdict, if any, and the purity of
    /// the cluster, if it is known. A name from an earlier version counts only if the judge does not contradict it.
    pub fn of(name: Option<(&ClassName, Namer)>, verdict: Option<Verdict>, purity: Option<Purity>) -> Self {
        let name = name.filter(|(name, by)| match by {
            Namer::Annotator => true,
            Namer::Judge => false,
            Namer::Earlier => verdict.is_none_or(|verdict| verdict.name() == name.key().as_str()),
        });
        let name = name.map(|(name, _)| name);
        let is_random = |name: &str| name.eq_ignore_ascii_case(Class::Random.name());
        match (name, verdict) {
            (Some(name), _) if is_random(&name.shown()) => Self::Random,
            (Some(name), _) => Self::Named(name.shown()),
            (None, Some(verdict)) if verdict != RANDOM => match purity.is_some_and(Purity::is_low) {
                true => Self::Mixed,
                false => Self::Judged(verdict.words()),
            },
            (None, _) => Self::Random,
        }
    }

    /// The class of the card's name, if the card has a name.
    fn key(&self) -> Option<ClassKey> {
        match self {
            Self::Named(name) | Self::Judged(name) => Some(ClassKey::from(name.as_str())),
            Self::Mixed | Self::Random => None,
        }
    }

    const fn is_named(&self) -> bool {
        matches!(self, Self::Named(_))
    }
}

/// Positions of the cards that a page of a campaign shows first, and positions of those that it folds beneath them: the
/// distinct ones and the others. No card is folded if none is distinct, or if there are several species: the judge knows only
/// a few patterns of two species, so its names do not show which behaviours are of one kind.
pub fn folding(shown: &[Shown], spec: &CampaignSpec) -> (Vec<usize>, Vec<usize>) {
    let (distinct, others) = distinct(shown);
    match distinct.is_empty() || spec.model().species().len() > 1 {
        true => ((0..shown.len()).collect(), Vec::new()),
        false => (distinct, others),
    }
}

/// Positions of the cards that show a new behaviour, and positions of the other cards. If an annotator and the judge give the
/// same name to different cards, the annotator's card is the new behaviour.
fn distinct(shown: &[Shown]) -> (Vec<usize>, Vec<usize>) {
    let named = shown.iter().filter(|shown| shown.is_named());
    let named: BTreeSet<ClassKey> = named.filter_map(Shown::key).collect();
    let mut seen = BTreeSet::new();
    (0..shown.len()).partition(|&place| {
        let shown = &shown[place];
        let key = shown.key().filter(|key| shown.is_named() || !named.contains(key));
        key.is_some_and(|key| seen.insert(key))
    })
}

/// Summary of the cards that are folded beneath the distinct behaviours.
pub fn folded(shown: &[Shown], places: &[usize]) -> String {
    let count = |kind: &Shown| places.iter().filter(|&&place| shown[place] == *kind).count();
    let (random, mixed) = (count(&Shown::Random), count(&Shown::Mixed));
    let parts = [
        (random, "random"),
        (mixed, "mixed"),
        (places.len() - random - mixed, "of a kind that is shown above"),
    ];
    let parts = parts.into_iter().filter(|(count, _)| *count > 0);
    let parts: Vec<String> = parts.map(|(count, kind)| format!("{count} {kind}")).collect();
    format!("{} more: {}", places.len(), parts.join(", "))
}

/// Summary of the findings in one paragraph; empty if no behaviour has a name.
pub fn answer(shown: &[Shown], judged: &Judged) -> Markup {
    let found = found(shown, judged);
    html! {
        @if !found.is_empty() {
            p.findings {
                @for (count, names) in found { strong { (count) } ": " (names) ". " }
                @if let Some(share) = judged.random_share() {
                    "The judge knows no kind for about " (format!("{:.0} %", 100.0 * share)) " of the archive (a sample of "
                    (judged.sample.len()) ")."
                }
            }
        }
    }
}

/// Summary in sentences: a lower bound on the number of distinct behaviours that annotators named, the number of further kinds of
/// behaviour that the judge names on cards, and the number of those that only its sample of the archive has. Nearly equal names of annotators count as one name. The judge makes mistakes, so the
/// number of its names is no lower bound.
fn found(shown: &[Shown], judged: &Judged) -> Vec<(String, String)> {
    let (places, _) = distinct(shown);
    // Groups of annotators' names that are nearly equal.
    let mut named: Vec<Vec<&str>> = Vec::new();
    let near = |named: &[Vec<&str>], name: &str| {
        let key = ClassKey::from(name);
        let is_near = |other: &&str| {
            let other = ClassKey::from(*other);
            other == key || other.is_near(&key)
        };
        named.iter().position(|group| group.iter().any(is_near))
    };
    for &place in &places {
        if let Shown::Named(name) = &shown[place] {
            match near(&named, name) {
                Some(group) => named[group].push(name),
                None => named.push(vec![name]),
            }
        }
    }
    let on_cards: Vec<&String> = places
        .iter()
        .filter_map(|&place| match &shown[place] {
            Shown::Judged(name) => Some(name),
            _ => None,
        })
        .collect();
    let judged = judged
        .kinds(on_cards.iter().map(|name| (*name).clone()))
        .into_iter();
    let judged = judged.filter(|(name, _)| near(&named, name).is_none());
    let (on_cards, elsewhere): (Vec<_>, Vec<_>) = judged.partition(|(name, _)| on_cards.contains(&name));
    let listed = |kinds: &[(String, Option<f64>)]| {
        let listed = kinds.iter().map(|(name, share)| match share {
            Some(share) => format!("{name} ({share:.0}\u{a0}%)"),
            None => name.clone(),
        });
        listed.collect::<Vec<_>>().join(", ")
    };
    let more = if named.is_empty() { "" } else { " more" };
    let named = (!named.is_empty()).then(|| {
        let count = counted(named.len() as u64, "distinct behaviour");
        let names: Vec<String> = named.iter().map(|near| near.join(" or ")).collect();
        (format!("At least {count}"), names.join(", "))
    });
    let judged = (!on_cards.is_empty()).then(|| {
        let count = on_cards.len();
        let kinds = noun(count as u64, "kind");
        (
            format!("The rule-based judge names {count}{more} {kinds} of behaviour"),
            listed(&on_cards),
        )
    });
    let elsewhere = (!elsewhere.is_empty()).then(|| {
        let kinds = counted(elsewhere.len() as u64, "kind");
        (
            format!("The judge finds {kinds} that no card shows"),
            listed(&elsewhere),
        )
    });
    named.into_iter().chain(judged).chain(elsewhere).collect()
}

impl Report {
    /// The name of each card, in the order of the taxonomy.
    pub(crate) fn shown(&self) -> Vec<Shown> {
        let shown = |place: usize| {
            let name = self.name_of(place);
            Shown::of(
                name.map(|name| (name.class, name.namer())),
                self.judged.medoids.get(place).copied(),
                self.purity(place),
            )
        };
        (0..self.medoids.len()).map(shown).collect()
    }

    /// Places of the behaviours that the report shows first, and of those that it folds beneath them.
    pub(crate) fn folding(&self) -> (Vec<usize>, Vec<usize>) {
        folding(&self.shown(), &self.spec)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample::{self, SMALL};
    use murmuration_swarm::Pattern;

    #[test]
    fn what_annotators_named_is_said_before_what_the_judge_names() {
        let named = |name: &str| Shown::Named(name.to_owned());
        let judged = |name: &str| Shown::Judged(name.to_owned());
        let message = |shown: &[Shown]| {
            let message = found(shown, &Judged::default()).into_iter();
            message
                .map(|(count, names)| format!("{count}: {names}"))
                .collect::<Vec<_>>()
        };
        let both = [
            judged("milling"),
            named("ring"),
            Shown::Random,
            judged("milling"),
            judged("chain"),
        ];
        assert_eq!(
            message(&both),
            [
                "At least 1 distinct behaviour: ring",
                "The rule-based judge names 2 more kinds of behaviour: milling, chain"
            ]
        );
        assert_eq!(
            message(&both[3..4]),
            ["The rule-based judge names 1 kind of behaviour: milling"]
        );
        assert!(message(&both[2..3]).is_empty());
        // The judge and an annotator give the name `milling`, and an annotator mistypes it as `miling`.
        let twice = [
            judged("milling"),
            named("milling"),
            named("miling"),
            judged("chain"),
        ];
        assert_eq!(
            message(&twice),
            [
                "At least 1 distinct behaviour: milling or miling",
                "The rule-based judge names 1 more kind of behaviour: chain"
            ]
        );
        assert_eq!(distinct(&twice), (vec![1, 2, 3], vec![0]));
        assert_eq!(
            message(&[judged("milling"), named("miling")]),
            ["At least 1 distinct behaviour: miling"]
        );
    }

    #[test]
    fn kinds_have_their_share_of_the_sample_and_mixed_clusters_are_not_named() {
        let [milling, chain] = [Verdict::Class(Class::Milling), Verdict::Pattern(Pattern::Chain)];
        let dispersal = Verdict::Class(Class::Dispersal);
        let sample = [
            vec![dispersal; 5],
            vec![milling; 2],
            vec![RANDOM; 12],
            vec![chain],
        ]
        .concat();
        let judged = Judged {
            medoids: Vec::new(),
            sample: (0..).zip(sample).collect(),
        };
        let purity = |alike| {
            Some(Purity {
                alike,
                known: 12,
                by_labels: false,
            })
        };
        let shown = [
            Shown::of(None, Some(milling), purity(4)),
            Shown::of(None, Some(milling), purity(3)),
            Shown::of(None, Some(RANDOM), purity(12)),
        ];
        assert_eq!(shown[1], Shown::Mixed);
        let found = found(&shown, &judged);
        assert_eq!(
            found,
            [
                (
                    "The rule-based judge names 1 kind of behaviour",
                    "milling (10\u{a0}%)"
                ),
                (
                    "The judge finds 1 kind that no card shows",
                    "dispersal (25\u{a0}%)"
                ),
            ]
            .map(|(count, names)| (count.to_owned(), names.to_owned()))
        );
        assert_eq!(folded(&shown, &[1, 2]), "2 more: 1 random, 1 mixed");
        // A kind that an annotator has named does not count again as a find of the judge.
        let named = [Shown::Named("dispersal".to_owned())];
        assert_eq!(super::found(&named, &judged).len(), 2);
    }

    #[test]
    fn a_card_is_distinct_if_it_has_a_name_that_none_before_it_has() {
        let mut report = sample::report(&SMALL);
        // The first medoid has a label.
        report.judged.medoids = vec![Verdict::Class(Class::Random); 3];
        assert_eq!(distinct(&report.shown()), (vec![0], vec![1, 2]));
        report.judged.medoids = vec![Verdict::Class(Class::Milling); 3];
        assert_eq!(distinct(&report.shown()), (vec![0, 1], vec![2]));
        report.names = crate::Names::default();
        assert_eq!(distinct(&report.shown()), (vec![0], vec![1, 2]));
    }
}
