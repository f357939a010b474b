//! The cards of behaviours on the page Taxonomy.

use super::{Shown, alike, starts, versions};
use crate::{archived, parts};
use maud::{Markup, html};
use murmuration_engine::taxonomy::{ClusterName, Origin};
use murmuration_model::{
    CampaignRecord,
    labels::{ClassName, GivenClass},
};
use murmuration_swarm::{Verdict, counted, figure, grouped};

pub(super) struct Card<'a> {
    pub(super) record: &'a CampaignRecord,
    pub(super) shown: &'a Shown,
    pub(super) place: usize,
}

impl Card<'_> {
    fn name(&self) -> Option<&ClusterName> {
        self.shown.names.names.get(self.place)?.as_ref()
    }
}

/// The card of several clusters with the same name, as one behaviour.
pub(super) fn merged(record: &CampaignRecord, shown: &Shown, group: &[usize]) -> Markup {
    let medoids = || group.iter().map(|&place| &shown.taxonomy.medoids[place]);
    let members: u64 = medoids().map(|medoid| medoid.cluster_size).sum();
    let individuals = shown.taxonomy.clusters.len().max(1);
    let name = group
        .first()
        .and_then(|&place| shown.names.names.get(place)?.as_ref());
    let first = group.first().map_or(0, |place| place + 1);
    html! {
        section aria-labelledby={ "merged-" (first) } {
            h2 id={ "merged-" (first) } { @if let Some(name) = name { (name.class.shown()) } }
            p.reason {
                "One behaviour in " (counted(group.len() as u64, "cluster")) ", merged by their name: " (grouped(members)) " individuals, "
                (format!("{:.1} %", 100.0 * members as f64 / individuals as f64)) "."
                @if shown.version.stands { span.scripted { " Give one of them another name to take it out." } }
            }
            div.medoids { @for &place in group { (card(&Card { record, shown, place })) } }
        }
    }
}

/// The card of a cluster: its picture, its name and its numbers.
pub(super) fn card(card: &Card<'_>) -> Markup {
    let (record, taxonomy) = (card.record, &card.shown.taxonomy);
    let medoid = &taxonomy.medoids[card.place];
    let individuals = taxonomy.clusters.len();
    let index = medoid.individual.index;
    let robust = taxonomy.robust_trials.get(index as usize);
    let share = 100.0 * medoid.cluster_size as f64 / individuals.max(1) as f64;
    let number = card.place + 1;
    html! {
        article.medoid data-index=(index) aria-labelledby={ "behaviour-" (number) } {
            (stage(record, index, &format!("behaviour {number}")))
            h2 id={ "behaviour-" (number) } { "Behaviour " (number) }
            p.reason title={
                (grouped(medoid.cluster_size)) " of " (counted(individuals as u64, "individual"))
                " are nearer to this behaviour than to any other on this page"
            } { (format!("{share:.1} %")) " · cluster of " (grouped(medoid.cluster_size)) }
            progress value=(medoid.cluster_size) max=(individuals) aria-label="Share of all individuals" {}
            (naming(card, index))
            (judged(card, index))
            (alike::mark(card.shown, card.place))
            dl.figures {
                div { dt { "Individual" } dd { (grouped(index)) } }
                div { dt { "Generation" } dd { (grouped(medoid.individual.generation.into())) } }
                div { dt { "Novelty" } dd { (figure(medoid.novelty)) } }
                @if let Some(robust) = robust {
                    div title="Trials of this individual to which no other behaviour on this page is nearer than this one" {
                        dt { "Robustness" }
                        dd { (robust) " of " (record.spec.starts().get()) " trials" }
                    }
                }
            }
            code { (medoid.individual.controller) }
            (files(card, index))
        }
    }
}

/// The card of an individual that is not a medoid: its picture and its name.
pub(super) fn further(record: &CampaignRecord, name: Option<&GivenClass>, index: u64) -> Markup {
    let of = format!("individual {index}");
    html! {
        article.medoid data-index=(index) aria-labelledby={ "individual-" (index) } {
            (stage(record, index, &of))
            h3 id={ "individual-" (index) } { "Individual " (grouped(index)) }
            (name_field(index, &of, name.map(|name| &name.class)))
        }
    }
}

/// The picture of an individual, on which its motion plays; `of` says in words what the picture shows.
fn stage(record: &CampaignRecord, index: u64, of: &str) -> Markup {
    html! {
        div.stage tabindex="0" role="button" aria-label={ "Play " (of) } {
            (parts::shape(record.spec.world()))
            img src=(archived::picture(record, index)) width="150" height="150" loading="lazy" alt={ "Picture of " (of) };
            canvas aria-hidden="true" {}
        }
    }
}

/// The field for an individual's name.
fn name_field(index: u64, of: &str, name: Option<&ClassName>) -> Markup {
    html! {
        form.naming.scripted data-index=(index) {
            label { span.unseen { "Name of " (of) }
                input name="name" list="names" maxlength="64" autocomplete="off" placeholder="Name it"
                    value=[name.map(ClassName::shown)];
            }
            button.plain { "Save" }
        }
    }
}

/// The judge's verdict on a medoid, with a button that makes the verdict the name of the behaviour.
fn judged(card: &Card<'_>, index: u64) -> Markup {
    let word = card.shown.words.get(&index).copied();
    let is_named_so = |verdict: Verdict| {
        card.name()
            .is_some_and(|name| name.class.key().as_str() == verdict.name())
    };
    html! {
        @if let Some(verdict) = word.filter(|verdict| !is_named_so(*verdict)) {
            p.judged {
                "The judge says: " (starts::in_words(verdict)) ". "
                @if card.shown.version.stands {
                    button.plain.scripted.once-named type="button" data-suggested=(verdict.name().replace('_', " ")) {
                        "Use as name" span.unseen { " of behaviour " (card.place + 1) }
                    }
                }
            }
        }
    }
}

/// Links for which workers must simulate: further starts, and files to download.
fn files(card: &Card<'_>, index: u64) -> Markup {
    let number = card.place + 1;
    let of = format!("/campaigns/{}/individuals/{index}", card.record.id);
    let created = card.record.archive_version().origin();
    let file = |name: &str, title: &str, of_what: &str| {
        html! {
            a href={ (of) "/" (name) "?created=" (created) } { (title) span.unseen { " of the " (of_what) " of behaviour " (number) } }
        }
    };
    html! {
        a.button.further href={ (of) "/starts" } { "Try 20 further starts" span.unseen { " of behaviour " (number) } }
        p.reason { "Download: " (file("motion.gif", "GIF", "motion")) ", " (file("paths.svg", "SVG", "paths")) }
    }
}

/// The name of a behaviour and the origin of the name. The name can be edited if the version is current.
fn naming(card: &Card<'_>, index: u64) -> Markup {
    let (name, number) = (card.name(), card.place + 1);
    html! {
        @if card.shown.version.stands {
            (name_field(index, &format!("behaviour {number}"), name.map(|name| &name.class)))
        } @else if let Some(name) = name {
            p { strong { (name.class.shown()) } }
        }
        @if let Some(name) = name {
            @match name.origin {
                Origin::Person => {},
                Origin::Judge => {
                    p.reason { "Named “" (name.class.shown()) "” by the rule-based judge, not by a person." }
                },
                Origin::Carried { version, place, shared, of } => {
                    p.reason {
                        "Carried over from behaviour " (place + 1) " of " (versions::link(card.record, version)) ": "
                        (grouped(shared)) " of its " (counted(of, "individual")) " are in this cluster."
                        @if card.shown.version.stands { " Save the name to make it a label of this behaviour." }
                    }
                },
            }
        }
    }
}
