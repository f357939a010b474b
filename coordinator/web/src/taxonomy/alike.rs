//! Pairs of clusters that are possibly one behaviour, and merged clusters: clusters with the same name are one behaviour.

use super::{shown_version::ShownVersion, starts};
use crate::archived;
use maud::{Markup, html};
use murmuration_accuracy::RANDOM;
use murmuration_engine::taxonomy::{Alike, Origin};
use murmuration_model::{CampaignRecord, labels::ClassName};
use murmuration_swarm::{counted, grouped, rounded};

/// Number of pairs listed at first, nearest first, and maximum number of pairs listed on request.
const AT_ONCE: usize = 3;
const MOST: usize = 50;

/// The name of a cluster that people gave, or that comes from an earlier version; `None` for `random`, because random behaviours
/// need not be alike.
fn name_of(shown: &ShownVersion, place: usize) -> Option<&ClassName> {
    let name = shown.names.names.get(place)?.as_ref()?;
    (name.origin != Origin::Judge && name.class.key().as_str() != RANDOM).then_some(&name.class)
}

/// The clusters, largest first. Clusters with the same name are grouped, because they are one behaviour.
pub(super) fn groups(shown: &ShownVersion) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for place in 0..shown.taxonomy.medoids.len() {
        let name = name_of(shown, place);
        let same = |group: &&mut Vec<usize>| {
            name.is_some() && group.first().is_some_and(|&first| name_of(shown, first) == name)
        };
        match groups.iter_mut().find(same) {
            Some(group) => group.push(place),
            None => groups.push(vec![place]),
        }
    }
    groups
}

/// The pairs of similar clusters that people have not merged yet.
fn open(shown: &ShownVersion) -> impl Iterator<Item = &Alike> {
    let is_one = |pair: &&Alike| {
        let name = name_of(shown, pair.one);
        name.is_some() && name == name_of(shown, pair.other)
    };
    shown.alike.iter().filter(move |pair| !is_one(pair))
}

/// The mark on the card of a cluster that is possibly the same behaviour as other clusters.
pub(super) fn mark(shown: &ShownVersion, place: usize) -> Markup {
    let others = open(shown).filter_map(|pair| match place {
        place if place == pair.one => Some(pair.other),
        place if place == pair.other => Some(pair.one),
        _ => None,
    });
    let others: Vec<usize> = others.collect();
    html! {
        @if !others.is_empty() {
            p.alike {
                "≈ maybe the same: "
                @for (nth, other) in others.iter().enumerate() {
                    @if nth > 0 { ", " }
                    a href={ "#behaviour-" (other + 1) } { (other + 1) }
                }
            }
        }
    }
}

/// A link to the list of similar pairs, with their number.
pub(super) fn link(shown: &ShownVersion) -> Markup {
    let pairs = open(shown).count();
    html! {
        @if pairs > 0 {
            a href="#pairs" { (counted(pairs as u64, "pair")) " of clusters" } " may be the same behaviour."
        }
    }
}

/// The list of similar pairs, each with a button that merges the pair.
pub(super) fn section(record: &CampaignRecord, shown: &ShownVersion) -> Markup {
    html! {
        @if open(shown).next().is_some() {
            section.pairs aria-labelledby="pairs" {
                h2 #pairs { "Possibly the same behaviour" }
                p.reason {
                    "These clusters touch: the distance between their medoids is less than the mean distances of their members from the medoids, added up. "
                    span.scripted { "Merge gives both medoids one name, and the page shows them as one behaviour; Undo reverts that. The clusters themselves do not change." }
                }
                ul { @for pair in open(shown).take(AT_ONCE) { li { (pair_of(record, shown, pair)) } } }
                @let further = open(shown).count().saturating_sub(AT_ONCE);
                @if further > 0 {
                    details {
                        summary { (counted(further as u64, "further pair")) " of clusters " (if further == 1 { "touches" } else { "touch" }) }
                        ul { @for pair in open(shown).take(MOST).skip(AT_ONCE) { li { (pair_of(record, shown, pair)) } } }
                        @if further > MOST - AT_ONCE { p.reason { "These are the nearest pairs. Merge some to see others." } }
                    }
                }
            }
        }
    }
}

fn pair_of(record: &CampaignRecord, shown: &ShownVersion, pair: &Alike) -> Markup {
    let medoids = [pair.one, pair.other].map(|place| &shown.taxonomy.medoids[place]);
    let indices = medoids.map(|medoid| medoid.individual.index);
    let [one, other] = [pair.one + 1, pair.other + 1];
    let words = indices.map(|index| shown.verdicts.get(&index).copied());
    let name = name_of(shown, pair.one).or_else(|| name_of(shown, pair.other));
    // If the judge's verdicts on the two medoids differ, no verdict is suggested as a name.
    let word = words[0].filter(|verdict| words[1] == Some(*verdict) && verdict.name() != RANDOM);
    let suggested = name
        .map(ClassName::shown)
        .or_else(|| word.map(|verdict| verdict.name().replace('_', " ")));
    let message: Vec<String> = indices.iter().map(u64::to_string).collect();
    html! {
        div.pictures aria-hidden="true" {
            @for index in indices { img src=(archived::paths(record, index)) width="75" height="75" loading="lazy" alt=""; }
        }
        div {
            p {
                "Behaviours " a href={ "#behaviour-" (one) } { (one) } " and " a href={ "#behaviour-" (other) } { (other) }
                ": their medoids are " (figure(pair.distance)) " apart; members are "
                (figure(medoids[0].mean_distance)) " and " (figure(medoids[1].mean_distance)) " from them on average, "
                (grouped(medoids[0].cluster_size)) " and " (grouped(medoids[1].cluster_size)) " in number."
                @if let [Some(first), Some(second)] = words {
                    @if first == second { " The judge calls both " (starts::in_words(first)) "." }
                    @else { " The judge tells them apart: " (starts::in_words(first)) " and " (starts::in_words(second)) "." }
                }
            }
            form.merge.scripted.once-named data-indices=(message.join(" ")) {
                label { span.unseen { "One name for behaviours " (one) " and " (other) }
                    input name="name" list="names" maxlength="64" autocomplete="off" required placeholder="One name for both" value=[suggested];
                }
                button.plain { "Merge" span.unseen { " behaviours " (one) " and " (other) } }
            }
        }
    }
}

fn figure(distance: f64) -> String {
    rounded(distance, 3)
}
