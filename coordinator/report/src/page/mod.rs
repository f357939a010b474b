//! The page of a report: one self-contained HTML document.
//!
//! `maud` makes the markup and escapes every text in it. The page contains its style sheet and its scripts. Without scripts, the
//! page still shows every picture, number and command.

mod cards;
mod data;
mod robots;
mod sections;
mod world;

use super::{
    Document, Files, MedoidPictures, Report, answer,
    numbers::{counted, grouped, sample_in_words},
    scripts,
};
use base64::{Engine as _, engine::general_purpose::STANDARD};
use maud::{Markup, PreEscaped, html};
use murmuration_model::{Timestamp, generations_in_words};
use murmuration_swarm::{BehaviourSpace, Method, Starts};

const STYLE: &str = concat!(
    include_str!("style.css"),
    include_str!("../card.css"),
    include_str!("../pins.css"),
);
/// Each script has its own scope, so that a failure does not stop the others. The scripts run in this order.
const SCRIPTS: [[&str; 2]; 5] = [
    [scripts::INLINE, include_str!("data.js")],
    ["", include_str!("cards.js")],
    [include_str!("individual.js"), include_str!("map.js")],
    ["", include_str!("hover.js")],
    ["", include_str!("copy.js")],
];

pub(super) fn render(
    report: &Report,
    pictures: &[MedoidPictures],
    further: &[Vec<u8>],
    files: Files,
) -> String {
    let title = format!("{} · behaviours of {}", report.campaign, robots(report));
    let document = Document {
        title: &title,
        style: STYLE,
        scripts: true,
        pictures_beside: false,
    };
    document.with(&html! {
        a.skip href="#behaviours" { "Skip to the behaviours" }
        (header(report))
        main {
            (cards::behaviours(report, pictures, further, files))
            (sections::names(report, files))
            (sections::map(report, files))
            @if report.spec.has_novelty() { (sections::novelty(report)) }
            (sections::filtered(report))
            (sections::specification(report, files))
            (sections::reading(report))
        }
        (footer(report))
        (data::block(report))
        @for script in SCRIPTS {
            script { "{" @for part in script { (PreEscaped(part)) } "}" }
        }
    })
}

fn header(report: &Report) -> Markup {
    let agents = report.spec.world().agents();
    html! {
        header.page {
            p.eyebrow { "Taxonomy of behaviours · " (report.campaign) }
            h1 {
                @if agents == 1 {
                    "Which behaviours can " span.nowrap { (robots(report)) } " show?"
                } @else {
                    "Which collective behaviours can a swarm of " span.nowrap { (robots(report)) } " show?"
                }
            }
            (answer(&report.shown(), &report.judged))
            p.lead {
                @match report.repetition.rounds.last() {
                    None => { "No behaviour was defined beforehand. This campaign tried " },
                    Some(round) => {
                        "This campaign learned from " (round.learned_from()) " which behaviours are alike. It tried "
                    },
                }
                (counted(report.evaluated(), "controller")) " and sorted the behaviours of their swarms into "
                (counted(report.medoids.len() as u64, "cluster")) "."
                @if let Some(coverage) = sample_in_words(&report.spec) { " " (coverage) }
                @if !report.judged.medoids.is_empty() {
                    " The judge is a program that knows the classes of the paper and some patterns. It makes mistakes, and it cannot name \
                     what is new: look at the cards."
                }
            }
            (facts(report))
        }
    }
}

fn facts(report: &Report) -> Markup {
    let spec = &report.spec;
    let method = match spec.method() {
        Method::Random => "uniform random sampling",
        Method::HandCrafted | Method::Latent | Method::Untrained => "novelty search",
        Method::Exhaustive => "every controller of a space or an even sample",
    };
    let compared = match spec.space() {
        BehaviourSpace::Features => "five hand-crafted features",
        BehaviourSpace::Embedding => "a learned embedding",
        BehaviourSpace::Both => "five hand-crafted features and a learned embedding",
    };
    let compared = match spec.method() {
        Method::Untrained => compared.replace("a learned embedding", "the embedding of an untrained network"),
        _ => compared.to_owned(),
    };
    let fact = |name: &str, value: Markup| html! { div { dt { (name) } dd { (value) } } };
    html! {
        dl.facts {
            (fact("Model", html! { (spec.model()) }))
            (fact("Method", html! { (method) ", compared on " (compared) }))
            (fact("Filter", html! { @if spec.filter() { "on" } @else { "off" } }))
            @let differences = world::differences(spec.world());
            @if !differences.is_empty() { (fact("World", html! { (differences.join("; ")) })) }
            @if spec.starts() != Starts::ONE { (fact("Starts of each", html! { (spec.starts().get()) })) }
            (fact("Individuals", html! { (grouped(report.evaluated())) }))
            (fact("Generations", html! { (generations(report)) }))
            @if !report.checkpoint.is_empty() {
                (fact("Checkpoint", html! { code title=(report.checkpoint) { (shortened(&report.checkpoint)) } }))
            }
            (fact("Archive digest", html! { code title=(report.digest) { (shortened(&report.digest)) } }))
        }
    }
}

/// The number of generations, and why it exceeds the number in the specification.
fn generations(report: &Report) -> String {
    let (count, rounds) = (
        report.generations.len() as u32,
        report.repetition.rounds.len() as u32,
    );
    match generations_in_words(&report.spec, count, rounds) {
        Some(why) => format!("{} ({why})", grouped(count.into())),
        None => grouped(count.into()),
    }
}

fn footer(report: &Report) -> Markup {
    html! {
        footer.page {
            p {
                "Campaign " (report.campaign) ", created " (Timestamp::from_ms(report.created_ms).day()) ", simulator version "
                (report.simulator_version) ". Made with Murmuration after Mattson and Brown, "
                cite { "Leveraging Human Feedback to Evolve and Discover Novel Emergent Behaviors in Robot Swarms" }
                ", GECCO 2023."
            }
        }
    }
}

/// The robots in words: `24 single-sensor robots`, `24 robots with 3 sensors`, or `24 robots of the species a and b`.
fn robots(report: &Report) -> String {
    let model = report.spec.model();
    let agents = report.spec.world().agents();
    match (model.preset(), model.species()) {
        (Some(preset), _) if agents == 1 => format!("one {preset} robot"),
        (Some(preset), _) => format!("{} {preset} robots", grouped(agents.into())),
        (None, [alone]) => {
            let sensors = counted(alone.robot().sensors().len() as u64, "sensor");
            format!("{} with {sensors}", counted(agents.into(), "robot"))
        }
        (None, species) => {
            let names: Vec<_> = species.iter().map(|species| species.name().as_str()).collect();
            format!(
                "{} of the species {}",
                counted(agents.into(), "robot"),
                names.join(" and ")
            )
        }
    }
}

/// The first twelve characters of a digest.
fn shortened(digest: &str) -> String {
    let start: String = digest.chars().take(12).collect();
    if start.len() < digest.len() {
        format!("{start}…")
    } else {
        start
    }
}

fn inline_png(file: &[u8]) -> String {
    format!("data:image/png;base64,{}", STANDARD.encode(file))
}

/// The page's words for the images: at the beginning of a sentence, and within a sentence.
fn image_names(report: &Report) -> [&'static str; 2] {
    match report.spec.image().shape().channels() {
        1 => ["Grey image", "grey image"],
        _ => ["Coloured image", "coloured image"],
    }
}

/// A line of text with a button that copies it.
fn copyable(name: &str, text: &str) -> Markup {
    html! {
        div.copyable {
            code.line { (text) }
            button.copy type="button" aria-label={ "Copy " (name) } { "Copy" }
        }
    }
}
