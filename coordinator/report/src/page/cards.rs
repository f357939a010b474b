//! The taxonomy: one card per medoid.

use super::{copyable, image_names, inline_png, robots::robots};
use crate::{
    Files, MedoidEntry, MedoidPictures, Report, Spread, again,
    card::{Sight, genes, heading, measures, sight},
    contact_sheet,
    findings::folded,
    numbers::{counted, grouped, percent, short},
};
use maud::{Markup, html};
use murmuration_model::colours;
use murmuration_swarm::Verdict;

pub(super) fn behaviours(
    report: &Report,
    pictures: &[MedoidPictures],
    further: &[Vec<u8>],
    files: Files,
) -> Markup {
    let few = report.spec.world().agents() as usize <= colours::AGENTS.len();
    let one_colour = match (report.spec.model().species().len(), few) {
        (2.., _) => ", one colour per species",
        (_, true) => ", one colour per robot",
        (_, false) => ", a colour for every few robots",
    };
    html! {
        section #behaviours aria-labelledby="behaviours-title" {
            div.heading {
                h2 #behaviours-title { "The behaviours" }
                div.tools.scripted {
                    label { "Speed "
                        select #speed {
                            option value="0.25" { "¼×" }
                            option value="0.5" { "½×" }
                            option value="1" selected { "1×" }
                            option value="2" { "2×" }
                            option value="4" { "4×" }
                        }
                    }
                    button #play-all.main type="button" aria-pressed="false" { "Play all" }
                }
            }
            p.lead {
                "Each picture shows the paths of the last " (counted(report.spec.image().window().min(report.spec.world().horizon()).into(), "step"))
                (one_colour) ", with older parts fainter. "
                @if report.spec.model().species().len() > 1 { (species(report)) " " }
                span.scripted { "Point at a picture, or focus it and press Space, to play the whole run from its start." }
                @match contact_sheet::address(report) {
                    Some(address) => {
                        " The " a href=(address) download="contact-sheet.svg" { "contact sheet" }
                        " has all of them in one figure, to download as SVG."
                    },
                    None if files == Files::Absent => { " " code { "murmuration report " (report.campaign) } " writes all of them in one figure." },
                    None => { " " a href="contact-sheet.svg" { "contact-sheet.svg" } " has all of them in one figure." },
                }
                @if files == Files::Beside { " The folder medoids has each as PNG and SVG." }
            }
            @let (first, others) = report.folding();
            (cards(report, pictures, &first))
            @if !others.is_empty() {
                details.others-shown {
                    summary { (folded(&report.shown(), &others)) }
                    (cards(report, pictures, &others))
                }
            }
            @if !further.is_empty() { (further_behaviours(report, further)) }
        }
    }
}

/// The section of individuals besides the medoids, folded at first.
fn further_behaviours(report: &Report, pictures: &[Vec<u8>]) -> Markup {
    html! {
        details #further {
            summary { (counted(pictures.len() as u64, "further behaviour")) }
            p.lead { "Each behaviour is the farthest from those above and from those listed before it." }
            div.further {
                @for (entry, picture) in report.further.iter().zip(pictures) {
                    @let cluster = report.clusters[entry.index as usize] + 1;
                    figure {
                        img src=(inline_png(picture)) loading="lazy" decoding="async"
                            alt={ "Paths of individual " (entry.index) ", of the cluster of behaviour " (cluster) };
                        figcaption { "Individual " (grouped(entry.index)) br; "in cluster " (cluster) }
                    }
                }
            }
        }
    }
}

fn cards(report: &Report, pictures: &[MedoidPictures], places: &[usize]) -> Markup {
    html! {
        div.cards {
            @for &place in places {
                @if let Some(pictures) = pictures.get(place) { (card(report, place, &report.medoids[place], pictures)) }
            }
        }
    }
}

/// The colour of each species.
fn species(report: &Report) -> Markup {
    let species = report.spec.model().species().iter().zip(colours::AGENTS);
    html! {
        @for (species, colour) in species {
            span.species style={ "--species:" (colours::hex(colour)) } { (species.name()) } " "
        }
    }
}

fn card(report: &Report, place: usize, medoid: &MedoidEntry, pictures: &MedoidPictures) -> Markup {
    let number = place + 1;
    let entry = &report.individuals[medoid.index as usize];
    let world = report.spec.world();
    let colour = colours::hex(colours::cluster(place));
    let command = again::simulate(&report.spec, entry, &format!("behaviour-{number:02}.gif"));
    let controller = entry.controller.to_string();
    html! {
        article.card.behaviour #{ "behaviour-" (number) } tabindex="0" data-place=(place) data-mode="still"
            style={ "--cluster:" (colour) } aria-labelledby={ "name-" (number) } {
            div.stage style={ "aspect-ratio:" (world.width()) "/" (world.height()) } {
                img src=(inline_png(&pictures.trajectory)) loading="lazy" decoding="async"
                    alt={ "Paths of behaviour " (number) ", controller " (controller) };
                canvas aria-hidden="true" {}
            }
            div.transport.scripted {
                button.toggle type="button" aria-label={ "Play behaviour " (number) } {}
                input.scrub type="range" min="0" value="0" aria-label={ "Step of behaviour " (number) };
                output.step {}
            }
            div.bar aria-hidden="true" { span style={ "width:" (share_of(report, medoid)) "%" } {} }
            div.text {
                (share(report, number, medoid))
                (sights(report, number, medoid, pictures))
                (copyable("controller", &controller))
                details.more {
                    summary { "Numbers, robot, replay" }
                    (figures(report, place, medoid))
                    h4 { "Controller" }
                    (genes(&entry.controller))
                    (robots(report, &entry.controller))
                    h4 { "Replay" }
                    (copyable("command", &command))
                }
            }
        }
    }
}

/// The picture of a behaviour as the embedder sees it, those of other members of its cluster, and the place of the cluster.
fn sights(report: &Report, number: usize, medoid: &MedoidEntry, pictures: &MedoidPictures) -> Markup {
    let [image_title, image] = image_names(report);
    html! {
        div.sights {
            (sight(&Sight {
                source: inline_png(&pictures.image),
                alt: format!("{image_title} of behaviour {number}"),
                caption: "image",
                title: image.to_owned(),
            }))
            @if let Some(spread) = &medoid.spread { (others(number, spread, &pictures.members)) }
            figure.scripted {
                canvas.where role="img" aria-label={ "Where cluster " (number) " lies in the behaviour space" } {}
                figcaption { "position" }
            }
        }
    }
}

fn figures(report: &Report, place: usize, medoid: &MedoidEntry) -> Markup {
    let entry = &report.individuals[medoid.index as usize];
    html! {
        dl {
            @if let Some(purity) = report.purity(place) {
                div title=(purity.in_words()) { dt { "Purity" } dd { (purity.alike) " of " (purity.known) } }
            }
            @if let Some(robustness) = entry.robustness {
                div title=(robust(report, place)) { dt { "Robustness" } dd { (of_starts(report, robustness)) } }
                div title=(robust(report, place)) { dt { "of its cluster" } dd { (of_cluster(report, place)) } }
            }
            div { dt { "Novelty" } dd { (short(medoid.novelty)) } }
            div { dt { "Mean distance" } dd { (short(medoid.mean_distance)) } }
            div { dt { "Generation" } dd { (grouped(entry.generation.into())) } }
            div { dt { "Individual" } dd { (grouped(medoid.index)) } }
        }
    }
}

/// The pictures of the nearest, the median and the farthest member of a cluster.
fn others(number: usize, spread: &Spread, pictures: &[Vec<u8>]) -> Markup {
    html! {
        @for ((which, member), picture) in spread.members().into_iter().zip(pictures) {
            (sight(&Sight {
                source: inline_png(picture),
                alt: format!("Image of the member of cluster {number} that is {which}: individual {}", member.index),
                caption: which,
                title: format!(
                    "The member of this cluster that is {which}: individual {}, at a distance of {}",
                    grouped(member.index),
                    short(member.distance)
                ),
            }))
        }
    }
}

/// The number of an individual's trials that show its own behaviour, for example `3 of 4`.
fn of_starts(report: &Report, robustness: f64) -> String {
    let starts = report.spec.starts().get();
    format!("{:.0} of {starts}", robustness * starts as f64)
}

fn of_cluster(report: &Report, place: usize) -> String {
    let mean = report.robustness_of_cluster(place).unwrap_or_default();
    format!("{:.0} %", 100.0 * mean)
}

fn robust(report: &Report, place: usize) -> String {
    format!(
        "Trials of this individual to which no other behaviour on this page is nearer than this one. The mean robustness of its \
         cluster is {}",
        of_cluster(report, place)
    )
}

fn share(report: &Report, number: usize, medoid: &MedoidEntry) -> Markup {
    let whole = report.individuals.len() as u64;
    let part = percent(medoid.cluster_size, whole);
    let members = format!(
        "{} of {} are nearer to this behaviour than to any other on this page",
        grouped(medoid.cluster_size),
        counted(whole, "individual")
    );
    let robust = report.robust_trials(medoid);
    let name = report.card_name(number - 1);
    let class = report.name_of(number - 1);
    let colour = class.and_then(|class| class.colour.map(|colour| colour.to_string()));
    html! {
        div.name {
            h3 id={ "name-" (number) } { (heading(number, name.as_ref(), colour.as_deref())) }
            p title=(members) { (measures(&part, report.purity(number - 1), robust)) }
        }
        @if let Some(carried) = report.name_of(number - 1).and_then(|name| name.carried) {
            p.judged {
                "Name carried over from behaviour " (carried.place + 1) " of version " (carried.version) " of the taxonomy: "
                (grouped(carried.shared)) " of its " (counted(carried.of, "individual")) " are here."
                @if let Some(verdict) = report.judged.medoids.get(number - 1) {
                    @if verdict.name() != carried.class.key().as_str() { " " (verdict_in_words(*verdict)) }
                }
            }
        }
    }
}

fn verdict_in_words(verdict: Verdict) -> String {
    format!("The rule-based judge calls it {}.", verdict.words())
}

/// The share of a cluster in all individuals, in percent.
fn share_of(report: &Report, medoid: &MedoidEntry) -> String {
    let whole = report.individuals.len().max(1);
    format!("{:.2}", 100.0 * medoid.cluster_size as f64 / whole as f64)
}
