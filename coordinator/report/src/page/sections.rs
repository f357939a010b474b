//! The sections under the taxonomy: map, novelty, filter, specification, and how to read the report.

use super::{copyable, image_names};
use crate::{
    Files, Report, again,
    names::Named,
    numbers::{counted, grouped, percent, short},
    plots::{self, Curves, Frame, Line},
    scripts,
};
use maud::{Markup, PreEscaped, html};
use murmuration_model::colours;
use murmuration_sim::features::FEATURE_STEPS;
use murmuration_swarm::{BehaviourSpace, Choice, FEATURE_NAMES, Method, Preset};
use serde::Serialize;
use serde_json::json;

pub(super) fn map(report: &Report, files: Files) -> Markup {
    let [across, up] = &report.map.axis_titles;
    let (count, shown) = (report.individuals.len(), super::data::shown_points(report).len());
    html! {
        section #map aria-labelledby="map-title" {
            h2 #map-title { "Map of the behaviour space" }
            p.lead {
                "Every point is one controller. Colours show the clusters, and numbers the behaviours above. The behaviour space has "
                (counted(dimensions(report) as u64, "dimension"))
                "; the map shows the two directions in which it varies most, both at the same scale. The titles of the axes say how "
                "much of the variance they hold; points that are close here may be far apart in the rest. "
                @if shown < count { (grouped(shown as u64)) " of " (counted(count as u64, "point")) " are drawn, evenly chosen. " }
                span.scripted {
                    "Point at a cluster, a number or a card to highlight its cluster. Point at a point to see its picture, and click to \
                     see it large, with the command that replays it. Zoom by the buttons or Ctrl and the wheel, and drag to move. With \
                     keys: arrows go from point to point, Enter shows one, + and − zoom, Home shows the whole map."
                    (pictures(report, shown))
                }
            }
            p.lead { (space(report)) }
            div.map.scripted {
                canvas #space role="application" aria-roledescription="map" tabindex="0" aria-label={
                    "Map of " (counted(count as u64, "controller")) " in " (counted(report.medoids.len() as u64, "cluster"))
                    "; across: "
                    (across) ", up: " (up) ". Arrow keys go from point to point, Enter shows one."
                } {}
                div #pins.pins {}
                div.zoom role="group" aria-label="Zoom" { (scripts::zoom_buttons()) }
                div #tip role="status" hidden { canvas aria-hidden="true" {} div.lines {} }
                p.across { (across) }
                p.up { (up) }
                (chosen())
            }
            noscript { p {
                "The map needs JavaScript. "
                @match files {
                    Files::Beside => { "map.svg beside this page shows the same map." },
                    Files::Absent => { (files_by_command(report)) " writes the same map as map.svg." },
                }
            } }
            ul.legend aria-label="Clusters" {
                @for place in 0..report.medoids.len() {
                    li { a href={ "#behaviour-" (place + 1) } data-place=(place)
                        style={ "--cluster:" (colours::hex(colours::cluster(place))) } {
                        span.swatch { (place + 1) }
                        @if let Some(name) = report.name_of(place) { (name.in_words()) " · " }
                        (percent(report.medoids[place].cluster_size, count as u64))
                    } }
                }
            }
        }
    }
}

/// Says how many points have their own picture, unless all points have one.
fn pictures(report: &Report, shown: usize) -> Markup {
    let pictured = report.pictured.indices.len();
    html! {
        @if pictured < shown {
            " " (grouped(pictured as u64)) " of the points, evenly chosen, have a picture of their own; another shows that of its medoid."
        }
    }
}

/// The panel of the individual chosen on the map; a script fills it.
fn chosen() -> Markup {
    html! {
        section #chosen aria-labelledby="chosen-title" hidden {
            div.heading {
                h3 #chosen-title tabindex="-1" {}
                button.close type="button" aria-label="Close the chosen individual" { "Close" }
            }
            canvas.large role="img" aria-label="Its picture" {}
            p.whose {}
            dl {}
            h4 { "Controller" }
            (copyable("controller of the chosen individual", ""))
            h4 { "Replay" }
            (copyable("command of the chosen individual", ""))
            p.elsewhere {}
        }
    }
}

/// Dimensions of the behaviour space.
fn dimensions(report: &Report) -> usize {
    let space = report.spec.space();
    let embedding = if space.embeds() {
        report.embedding_dimensions()
    } else {
        0
    };
    embedding
        + if space.has_features() {
            FEATURE_NAMES.len()
        } else {
            0
        }
}

/// Explains how behaviours are compared.
fn space(report: &Report) -> Markup {
    let method = report.spec.method();
    let steps = FEATURE_STEPS.min(report.spec.world().horizon());
    let features = FEATURE_NAMES.map(|name| {
        let words = name.replace('_', " ");
        words.replace(" x20", " (times 20, as in the authors' simulator)")
    });
    let network = match method {
        Method::Untrained => ", a network as it was initialised,",
        _ => "",
    };
    let embedding = html! {
        (counted(report.embedding_dimensions() as u64, "number")) " that checkpoint " code { (report.checkpoint) } (network)
        " computes from a " (image_names(report)[1])
    };
    let features = html! {
        "the five hand-crafted features of Brown et al. (Table 1 of Mattson and Brown), each its mean over the last "
        (counted(steps.into(), "step")) ": " (features.join(", "))
    };
    html! {
        "Behaviours are compared by "
        @match report.spec.space() {
            BehaviourSpace::Both => {
                "the " (embedding) ", and by " (features) ". Each of the two parts is scaled to a total variance of 1 in the first \
                 generation, and each feature to a fifth of that"
            },
            BehaviourSpace::Embedding => { "the " (embedding) },
            BehaviourSpace::Features => { (features) },
        }
        ". The distance between two behaviours is Euclidean."
    }
}

/// The section of the names of behaviours; empty if no behaviour has a name.
pub(super) fn names(report: &Report, files: Files) -> Markup {
    let names = &report.names;
    let named = names.named();
    html! {
        @if !names.classes.is_empty() {
            section #names aria-labelledby="names-title" {
                h2 #names-title { "Names" }
                p.lead {
                    "Of " (counted(report.evaluated(), "individual")) ", annotators have named " (grouped(named.people))
                    @if named.machine > 0 {
                        " and the rule-based judge, a program, has named another " (grouped(named.machine))
                    }
                    ". A card shows the name of its own behaviour; other members of its cluster may have other names. "
                    @if report.medoids.iter().any(|medoid| medoid.carried.is_some()) {
                        "Where nobody has named that behaviour, the card shows the name that the cluster has from an earlier version of the \
                         taxonomy. "
                    }
                    @match files {
                        Files::Beside => {
                            "classes.csv beside this page lists these colours, and archive.csv every name."
                        },
                        Files::Absent => {
                            (files_by_command(report)) " writes these colours to classes.csv, and every name to archive.csv."
                        },
                    }
                }
                ul.legend aria-label="Classes" {
                    @for class in &names.classes {
                        @let Named { people, machine } = names.individuals(class);
                        li { span.class style={ "--class:" (class.colour) } {
                            (class.name.shown()) " · " (grouped(people + machine))
                            @if machine > 0 && people == 0 { ", named only by the rule-based judge" }
                            @else if machine > 0 { ", " (grouped(machine)) " of them only by the rule-based judge" }
                        } }
                    }
                }
            }
        }
    }
}

pub(super) fn novelty(report: &Report) -> Markup {
    let ends = report.generations.first().zip(report.generations.last());
    html! {
        section #novelty aria-labelledby="novelty-title" {
            h2 #novelty-title { "Novelty over generations" }
            p.lead {
                "Novelty when evaluated is the mean distance of a behaviour to its "
                (counted(report.spec.search().neighbours().into(), "nearest neighbour")) " in the archive as it was after its generation. It "
                "tends to fall as the archive fills. The lines show the best and the mean value of each generation."
                @if let Some((first, last)) = ends {
                    " The mean is " (short(first.mean_novelty)) " in the first generation and " (short(last.mean_novelty)) " in the last."
                }
            }
            @if report.repetition.has_moved() { p.lead { (moved(report)) } }
            (plot("Best and mean novelty over generations", |size| plots::novelty(&report.generations, size)))
        }
    }
}

/// Explains how a change of the embedding affects values of novelty.
fn moved(report: &Report) -> Markup {
    html! {
        "The embedding changed during this campaign: "
        @match report.repetition.rounds.len() as u64 {
            0 => {},
            rounds => { "it was fine-tuned on labels in " (counted(rounds, "round")) },
        }
        @if report.repetition.adopted {
            @if !report.repetition.rounds.is_empty() { ", and " }
            "the campaign adopted another checkpoint"
        }
        ". After each change the novelty of all generations was computed again, so all values here are in the space of the last "
        "checkpoint. Generations before a change were bred by values in an earlier space, which are not stored."
    }
}

/// The section on proposals that the heuristic filter rejected.
pub(super) fn filtered(report: &Report) -> Markup {
    let away: u64 = report.generations.iter().map(|step| step.filtered).sum();
    let proposed = away + report.evaluated();
    html! {
        section #filtered aria-labelledby="filtered-title" {
            h2 #filtered-title { "Heuristic filter" }
            @if report.spec.filter() {
                p.lead {
                    "The heuristic filter examines a controller before it is simulated, and rejects controllers that are too slow, "
                    "spin in place, or ignore their sensors. It rejected "
                    strong { (grouped(away)) " of " (counted(proposed, "proposal")) } " (" (percent(away, proposed)) ")."
                }
                (plot("Proposals that the filter rejected, over generations", |size| plots::filtered(&report.generations, size)))
            } @else {
                p.lead { "The heuristic filter was off: every proposed controller was simulated." }
            }
        }
    }
}

/// A plot for wide pages and a plot for narrow pages; the style sheet shows the plot that fits. A script shows the values at the
/// pointer or at the generation that people choose with keys.
fn plot(name: &str, draw: impl Fn([f64; 2]) -> Curves) -> Markup {
    let (wide, narrow) = (draw(plots::WIDE), draw(plots::NARROW));
    html! {
        div.plot role="img" aria-label=(name) data-plot=(json!(PlotView::of(&wide, &narrow))) {
            div.wide { (PreEscaped(&wide.svg)) }
            div.narrow { (PreEscaped(&narrow.svg)) }
        }
        p.told.scripted { "Point at the plot, or focus it and press the arrow keys, to read its values." }
    }
}

/// The values of a plot, for the script that shows values, and the frames of the wide and the narrow picture.
#[derive(Debug, Serialize)]
struct PlotView {
    x: Vec<u32>,
    lines: Vec<LineView>,
    wide: Frame,
    narrow: Frame,
}

#[derive(Debug, Serialize)]
struct LineView {
    name: &'static str,
    /// The values of the line; a value that is not a number becomes `null` in JSON.
    values: Vec<f64>,
}

impl PlotView {
    fn of(wide: &Curves, narrow: &Curves) -> Self {
        let x = |line: &Line| line.2.iter().map(|(generation, _)| *generation).collect();
        let line = |line: &Line| LineView {
            name: line.0,
            values: line.2.iter().map(|(_, value)| *value).collect(),
        };
        Self {
            x: wide.lines.first().map_or_else(Vec::new, x),
            lines: wide.lines.iter().map(line).collect(),
            wide: wide.frame,
            narrow: narrow.frame,
        }
    }
}

/// The command that writes a report with all its files; a page without its files shows this command.
fn files_by_command(report: &Report) -> Markup {
    html! { code { "murmuration report " (report.campaign) } }
}

/// The section on the specification, and how to reproduce the archive.
pub(super) fn specification(report: &Report, files: Files) -> Markup {
    let needed = again::also_needed(report);
    html! {
        section #specification aria-labelledby="specification-title" {
            h2 #specification-title { "Specification" }
            @if report.repetition.is_by_specification() {
                p.lead {
                    @match files {
                        Files::Beside => { "spec.toml beside this page" },
                        Files::Absent => { "The text below, saved as spec.toml," },
                    }
                    " reproduces the archive, bit for bit, on any number of workers"
                    @if !report.checkpoint.is_empty() { " of one kind of processor" }
                    ":"
                }
                @for sentence in &needed { p { (sentence) } }
                (copyable("command", again::RUN_AGAIN))
            } @else {
                @for sentence in &needed { p { (sentence) } }
                @if again::is_by_commands(report) {
                    p {
                        "On machines with one kind of processor these commands reproduce the archive, if no answer has changed since "
                        "the round began:"
                    }
                    (copyable("command", &again::write_labels(report)))
                    @for command in again::TEACH_AGAIN { (copyable("command", command)) }
                } @else if !report.repetition.adopted {
                    p {
                        "Commands alone do not reproduce the archive: a round learns from the answers as they are when it begins, and an "
                        "export writes the answers as they are now."
                    }
                }
            }
            p { "With simulator version " (report.simulator_version) " the archive has this digest:" }
            (copyable("digest", &report.digest))
            @if !report.checkpoint.is_empty() {
                p { "This checkpoint computed the embeddings:" }
                (copyable("checkpoint", &report.checkpoint))
            }
            details {
                summary { "spec.toml" }
                pre tabindex="0" { code { (again::specification(report)) } }
            }
        }
    }
}

fn controller(report: &Report) -> Markup {
    let model = report.spec.model();
    match model.preset() {
        Some(Preset::SingleSensor) => html! {
            "The speeds of the left and right wheel while the sensor sees no robot, then while it sees one. Speeds are between −1 "
            "and 1."
        },
        Some(Preset::TwoSensor) => html! {
            "The speeds of the left and right wheel while neither sensor sees a robot, while the second does, the first, and both, "
            "followed by the angle of the second sensor in radians. Speeds are between −1 and 1."
        },
        Some(Preset::Flockbots | Preset::TurboPi) | None => html! {
            "The genes, in this order: " (model.gene_names().join(", ")) ". The digits say which sensors see something (1) or nothing "
            "(0), the first sensor first. Angles are in radians."
        },
    }
}

/// The section that explains the words and pictures of the report.
pub(super) fn reading(report: &Report) -> Markup {
    let entry = |word: &str, meaning: Markup| html! { div { dt { (word) } dd { (meaning) } } };
    html! {
        section #reading aria-labelledby="reading-title" {
            h2 #reading-title { "How to read this" }
            dl.words {
                (entry("Behaviour", html! {
                    @match report.spec.choice() {
                        Choice::Coverage => {
                            "A medoid: an individual that stands for its cluster. Medoids are chosen far from each other, so that "
                            "together they cover the behaviour space."
                        },
                        Choice::Medoids | Choice::ByClass => {
                            "A medoid: the individual whose distances to the other members of its cluster have the least sum."
                        },
                    }
                    " The cards are in the order of cluster size, those that show something new before the others."
                }))
                (entry("Cluster", html! {
                    "The individuals that are nearer to one medoid than to any other. The mean distance says how alike they are."
                }))
                (entry(image_names(report)[0], html! {
                    "The last " (counted(report.spec.image().window().min(report.spec.world().horizon()).into(), "step")) " as " (report.spec.image().resolution()) " × "
                    (report.spec.image().resolution()) " grey values"
                    @match report.spec.image().shape().channels() {
                        1 => { ", without colours" },
                        _ => { " of each species, shown in its colour" },
                    }
                    @if report.spec.space().embeds() { ": what the network sees of the swarm." } @else { ". This campaign measures nothing on it." }
                }))
                (entry("Controller", controller(report)))
                (entry("Novelty", html! {
                    "On a card, and in the table of the taxonomy: the mean distance of a behaviour to its "
                    (report.spec.search().neighbours()) " nearest neighbours in the whole archive. A high value means that few behaviours are near it."
                }))
                (entry("Novelty when evaluated", html! {
                    "On the map, over generations, and in the table of the archive: the same distance in the archive as it was after the "
                    "generation of the behaviour. It tends to be higher in early generations, when the archive is small. "
                    @match (report.spec.method(), report.repetition.has_moved()) {
                        _ if !report.spec.has_novelty() => { "It was not measured and is 0: which controllers come next does not depend on it." },
                        (Method::Random, _) => { "It had no effect: every controller was drawn at random." },
                        (_, false) => { "Each generation was bred by the values of the generation before it." },
                        (_, true) => { "It was computed again when the embedding changed: earlier generations were bred by other values." },
                    }
                }))
                (entry("Mean distance", html! {
                    "The mean distance of the members of a cluster from its medoid, which counts as a member, in the behaviour space. It is \
                     an average: some members may be far away even where it is low, and the card shows the farthest one. The distances of \
                     the whole archive add up to "
                    (short(report.loss)) "."
                }))
                @match report.spec.starts().get() {
                    1 => { (entry("A caution", html! {
                        "Each controller was simulated from one start. Another start can lead to another behaviour: try another seed "
                        "before you draw conclusions, or ask for several starts (" code { "[evaluation] starts" } ")."
                    })) },
                    starts => { (entry("Robustness", html! {
                        "Each controller was simulated from " (starts) " starts. Its features "
                        @if report.spec.space().embeds() { "and its embedding are means over these trials" } @else { "are means over these trials" }
                        "; its picture and its motion are of the first. Robustness is the share of its trials to which no "
                        "other behaviour on this page is nearer than its own. A low value means that the start, or noise, decides what the swarm does."
                    })) },
                }
            }
        }
    }
}
