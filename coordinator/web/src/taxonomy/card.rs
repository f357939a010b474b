//! The cards of behaviours on the page Taxonomy.

use super::{
    alike,
    shown_version::{ShownVersion, on_card},
    starts, versions,
};
use crate::{archived, by_example, parts, play};
use maud::{Markup, html};
use murmuration_accuracy::RANDOM;
use murmuration_engine::taxonomy::{ClusterName, Origin};
use murmuration_model::{CampaignRecord, labels::GivenClass};
use murmuration_report::{
    Purity,
    card::{CardName, Sight, genes, heading, measures, sight},
};
use murmuration_swarm::{Verdict, counted, figure, grouped};

pub(crate) struct Card<'a> {
    pub(crate) record: &'a CampaignRecord,
    pub(crate) shown: &'a ShownVersion,
    pub(crate) place: usize,
}

impl Card<'_> {
    fn name(&self) -> Option<&ClusterName> {
        self.shown.name(self.place)
    }

    /// The judge's verdict on the medoid.
    fn verdict(&self) -> Option<Verdict> {
        self.shown.verdicts.get(&self.index()).copied()
    }

    /// The name of the behaviour, or else the judge's verdict on it.
    pub(super) fn card_name(&self) -> Option<CardName> {
        let given = self.name().map(on_card);
        given.or_else(|| {
            self.verdict()
                .map(|verdict| CardName::of_verdict(verdict, self.purity()))
        })
    }

    fn index(&self) -> u64 {
        self.shown.taxonomy.medoids[self.place].individual.index
    }

    /// The number of the cluster's individuals, and of all individuals.
    fn members(&self) -> [u64; 2] {
        let taxonomy = &self.shown.taxonomy;
        [
            taxonomy.medoids[self.place].cluster_size,
            taxonomy.clusters.len() as u64,
        ]
    }

    fn purity(&self) -> Option<Purity> {
        *self.shown.purities.get(self.place)?
    }

    /// The number of the medoid's robust trials, and of all its trials; `None` if individuals have one trial.
    fn robust(&self) -> Option<(usize, usize)> {
        let robust = self.shown.taxonomy.robust_trials.get(self.index() as usize)?;
        Some((usize::from(*robust), self.record.spec.starts().get()))
    }
}

/// The card of several clusters with the same name, as one behaviour.
pub(super) fn merged(record: &CampaignRecord, shown: &ShownVersion, group: &[usize]) -> Markup {
    let medoids = || group.iter().map(|&place| &shown.taxonomy.medoids[place]);
    let members: u64 = medoids().map(|medoid| medoid.cluster_size).sum();
    let individuals = shown.taxonomy.clusters.len().max(1);
    let name = group.first().and_then(|&place| shown.name(place));
    let first = group.first().map_or(0, |place| place + 1);
    html! {
        section aria-labelledby={ "merged-" (first) } {
            h2 id={ "merged-" (first) } { @if let Some(name) = name { (name.class.shown()) } }
            p.reason {
                "One behaviour in " (counted(group.len() as u64, "cluster")) ", merged by their name: " (grouped(members)) " individuals, "
                (share(members, individuals)) "."
                @if shown.version.stands { span.scripted { " Give one of them another name to take it out." } }
            }
            div.medoids { @for &place in group { (card(&Card { record, shown, place })) } }
        }
    }
}

/// The card of a cluster: its picture, its name and its numbers.
pub(super) fn card(card: &Card<'_>) -> Markup {
    let (record, number) = (card.record, card.place + 1);
    let (index, [members, individuals]) = (card.index(), card.members());
    html! {
        article.medoid.behaviour data-index=(index) aria-labelledby={ "behaviour-" (number) } {
            (film(record, index, &format!("behaviour {number}")))
            progress value=(members) max=(individuals) aria-label="Share of all individuals" {}
            div.text {
                div.name {
                    h2 id={ "behaviour-" (number) } { (heading(number, card.card_name().as_ref(), None)) }
                    (line(card))
                }
                (naming(card, index))
                (origin(card))
                (alike::mark(card.shown, card.place))
                (sights(card))
                (more(card))
            }
        }
    }
}

/// The card of a cluster on pages where its motion does not play and it is not named.
pub(crate) fn brief(card: &Card<'_>) -> Markup {
    let (number, index, [members, individuals]) = (card.place + 1, card.index(), card.members());
    html! {
        article.behaviour {
            a.film href={ "/campaigns/" (card.record.id) "/taxonomy#behaviour-" (number) } {
                img src=(archived::paths(card.record, index)) width="300" height="300" loading="lazy"
                    alt={ "Paths of behaviour " (number) ", individual " (index) };
            }
            progress value=(members) max=(individuals) aria-label="Share of all individuals" {}
            div.text {
                div.name { h3 { (heading(number, card.card_name().as_ref(), None)) } (line(card)) }
                (sights(card))
                (more(card))
            }
        }
    }
}

/// The line with the share, the purity and the robustness of a cluster.
fn line(card: &Card<'_>) -> Markup {
    let [members, individuals] = card.members();
    let title = format!(
        "{} of {} are nearer to this behaviour than to any other of the taxonomy",
        grouped(members),
        counted(individuals, "individual")
    );
    html! { p title=(title) { (measures(&share(members, individuals as usize), card.purity(), card.robust())) } }
}

/// The part of a cluster's individuals in all individuals, in percent.
fn share(members: u64, individuals: usize) -> String {
    format!("{:.1} %", 100.0 * members as f64 / individuals.max(1) as f64)
}

/// The pictures of the medoid and of the members that show the spread of its cluster, as the embedder sees them.
fn sights(card: &Card<'_>) -> Markup {
    let (record, number) = (card.record, card.place + 1);
    let medoid = &card.shown.taxonomy.medoids[card.place];
    let spread = card.shown.measurements.spreads.get(card.place).copied().flatten();
    let members = spread
        .into_iter()
        .flat_map(|members| ["nearest", "median", "farthest"].into_iter().zip(members));
    html! {
        div.sights {
            (sight(&Sight {
                source: archived::picture(record, medoid.individual.index),
                alt: format!("Image of behaviour {number}"),
                caption: "image",
                title: "The image of this behaviour, as the embedder sees it".to_owned(),
            }))
            @for (which, (member, distance)) in members {
                (sight(&Sight {
                    source: archived::picture(record, member as u64),
                    alt: format!("Image of the member of cluster {number} that is {which}: individual {member}"),
                    caption: which,
                    title: format!(
                        "The member of this cluster that is {which}: individual {}, at a distance of {}",
                        grouped(member as u64),
                        figure(distance)
                    ),
                }))
            }
        }
    }
}

/// The folded part of a card: numbers, genes and actions.
fn more(card: &Card<'_>) -> Markup {
    let medoid = &card.shown.taxonomy.medoids[card.place];
    let index = medoid.individual.index;
    html! {
        details.more {
            summary { "More" span.unseen { " about behaviour " (card.place + 1) } }
            dl.figures {
                @if let Some(purity) = card.purity() {
                    div title=(purity.in_words()) { dt { "Purity" } dd { (purity.alike) " of " (purity.known) } }
                }
                @if let Some((robust, starts)) = card.robust() {
                    div title="Trials of this individual to which no other behaviour of the taxonomy is nearer than this one" {
                        dt { "Robustness" }
                        dd { (robust) " of " (starts) " trials" }
                    }
                }
                div { dt { "Novelty" } dd { (figure(medoid.novelty)) } }
                div { dt { "Mean distance" } dd { (figure(medoid.mean_distance)) } }
                div { dt { "Cluster" } dd { (grouped(medoid.cluster_size)) } }
                div { dt { "Generation" } dd { (grouped(medoid.individual.generation.into())) } }
                div { dt { "Individual" } dd { (grouped(index)) } }
            }
            h3 { "Controller" }
            (genes(&medoid.individual.controller))
            code { (medoid.individual.controller) }
            (uses(card))
            (files(card, index))
        }
    }
}

/// The actions on a behaviour: play with its swarm, start a campaign from it, try it from further starts.
fn uses(card: &Card<'_>) -> Markup {
    let (record, number) = (card.record, card.place + 1);
    let individual = &card.shown.taxonomy.medoids[card.place].individual;
    let play = play::address_of(&record.spec, &individual.controller, individual.seed);
    let of = || html! { span.unseen { " behaviour " (number) } };
    html! {
        div.choices {
            @if let Some(play) = &play {
                a.button href={ "/play?" (play) } { "Play with it" (of()) }
            }
            (by_example::buttons(&record.id, Some((individual.index, &format!("behaviour {number}")))))
            a.button.further href={ "/campaigns/" (record.id) "/individuals/" (individual.index) "/starts" } {
                "Try 20 further starts" span.unseen { " of behaviour " (number) }
            }
        }
    }
}

/// The card of an individual that is not a medoid: its picture and its name.
pub(super) fn further(record: &CampaignRecord, name: Option<&GivenClass>, index: u64) -> Markup {
    let of = format!("individual {index}");
    html! {
        article.medoid.behaviour data-index=(index) aria-labelledby={ "individual-" (index) } {
            (film(record, index, &of))
            div.text {
                div.name { h3 id={ "individual-" (index) } { "Individual " (grouped(index)) } }
                (name_field(index, &of, &name.map_or(Field::Empty, |name| Field::Given(name.class.shown()))))
            }
        }
    }
}

/// The paths of an individual, on which its motion plays, with the controls of the motion; `of` says in words what they show.
fn film(record: &CampaignRecord, index: u64, of: &str) -> Markup {
    html! {
        div.film {
            div.stage tabindex="0" role="button" aria-label={ "Play " (of) } {
                (parts::shape(record.spec.world()))
                img src=(archived::paths(record, index)) width="300" height="300" loading="lazy" alt={ "Paths of " (of) };
                canvas aria-hidden="true" {}
            }
            div.transport.scripted {
                button.toggle type="button" aria-label={ "Play " (of) } {}
                input.scrub type="range" min="0" max="1" value="0" aria-label={ "Step of " (of) } disabled;
                output.step {}
            }
        }
    }
}

/// The name in an individual's field.
enum Field {
    Empty,
    /// A person gave the name.
    Given(String),
    /// Nobody has given the name yet. It becomes the name with a click.
    Suggested(String),
}

/// The field for an individual's name.
fn name_field(index: u64, of: &str, field: &Field) -> Markup {
    let (value, suggested) = match field {
        Field::Empty => (None, None),
        Field::Given(name) => (Some(name), None),
        Field::Suggested(name) => (None, Some(name)),
    };
    let placeholder = suggested.map_or_else(|| "Name it".to_owned(), |name| format!("{name}?"));
    html! {
        form.naming.scripted data-index=(index) data-suggested=[suggested] {
            label { span.unseen { "Name of " (of) }
                input name="name" list="names" maxlength="64" autocomplete="off" placeholder=(placeholder) value=[value];
            }
            button.plain {
                @if suggested.is_some() { span.while-empty { "Confirm" } span.once-typed { "Save" } } @else { "Save" }
            }
        }
    }
}

/// Links to files to download, for which workers must simulate.
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
        p.reason { "Download: " (file("motion.gif", "GIF", "motion")) ", " (file("paths.svg", "SVG", "paths")) }
    }
}

/// The field for the name of a behaviour, if the version is current. It suggests the name that was carried over, or else the
/// judge's verdict.
fn naming(card: &Card<'_>, index: u64) -> Markup {
    let random = |verdict: Verdict| verdict.name() == RANDOM;
    let field = match (card.name(), card.verdict()) {
        (Some(name), _) if name.origin == Origin::Person => Field::Given(name.class.shown()),
        (Some(name), _) => Field::Suggested(name.class.shown()),
        (None, Some(verdict)) if !random(verdict) => Field::Suggested(verdict.name().replace('_', " ")),
        (None, _) => Field::Empty,
    };
    html! {
        @if card.shown.version.stands { (name_field(index, &format!("behaviour {}", card.place + 1), &field)) }
    }
}

/// The origin of a name that was carried over, and the judge's verdict if it differs from the name.
fn origin(card: &Card<'_>) -> Markup {
    let name = card.name();
    let differs = |verdict: &Verdict| name.is_some_and(|name| name.class.key().as_str() != verdict.name());
    let verdict = card.verdict().filter(differs);
    let carried = name.and_then(|name| match name.origin {
        Origin::Carried {
            version,
            place,
            shared,
            of,
        } => Some((version, place, shared, of)),
        Origin::Person | Origin::Judge => None,
    });
    html! {
        @if carried.is_some() || verdict.is_some() {
            p.judged {
                @if let Some((version, place, shared, of)) = carried {
                    "Carried over from behaviour " (place + 1) " of " (versions::link(card.record, version)) ": "
                    (grouped(shared)) " of its " (counted(of, "individual")) " are in this cluster. "
                    @if card.shown.version.stands { "Confirm the name to make it a label of this behaviour. " }
                }
                @if let Some(verdict) = verdict { "The judge says: " (starts::in_words(verdict)) "." }
            }
        }
    }
}
