//! The sections under the taxonomy: map, novelty, filter, specification, how to read it.

use super::copyable;
use crate::{
    Files, Report, ReportError, again, commands,
    names::Named,
    numbers::{counted, grouped, percent, short},
    plots,
};
use maud::{Markup, PreEscaped, html};
use murmuration_model::colours;
use murmuration_proto::{FEATURE_NAMES, Method};
use murmuration_worker::features::FEATURE_STEPS;

/// The behaviour space in two dimensions.
pub(super) fn map(report: &Report, files: Files) -> Markup {
    let [across, up] = &report.map.axis_titles;
    let (count, shown) = (report.individuals.len(), super::data::shown_points(report).len());
    html! {
        section #map aria-labelledby="map-title" {
            h2 #map-title { "Map of the behaviour space" }
            p.lead {
                "Every point is one controller that was tried. Colours are clusters, numbers the behaviours above. The space has "
                (counted(dimensions(report) as u64, "dimension"))
                " and is flattened to the two in which it varies most: points that lie close here may be far apart in it. One unit is as "
                "long across as it is up. "
                @if shown < count { "Of " (counted(count as u64, "point")) ", " (grouped(shown as u64)) " are drawn, evenly chosen. " }
                span.scripted { "Point at a cluster, a number or a card to bring one cluster out." }
            }
            p.lead { (space(report)) }
            div.map.scripted {
                canvas #space role="img" aria-label={
                    "Map of " (counted(count as u64, "controller")) " in " (counted(report.medoids.len() as u64, "cluster"))
                    "; across: "
                    (across) ", up: " (up)
                } {}
                div #pins {}
                div #tip role="status" hidden {}
                p.across { (across) }
                p.up { (up) }
            }
            noscript { p {
                "The map needs JavaScript. "
                @match files {
                    Files::Beside => { "map.svg, which was written beside this page, shows the same." },
                    Files::Absent => { (files_by_command(report)) " writes the same as map.svg." },
                }
            } }
            ul.legend aria-label="Clusters" {
                @for place in 0..report.medoids.len() {
                    li { a href={ "#behaviour-" (place + 1) } data-place=(place)
                        style={ "--cluster:" (colours::hex(colours::cluster(place))) } {
                        span.swatch { (place + 1) }
                        @if let Some((_, class)) = report.names.of(report.medoids[place].index) {
                            (class.name)
                            @if report.names.is_by_machine(report.medoids[place].index) { " (by the rule-based judge)" }
                            " · "
                        }
                        (percent(report.medoids[place].cluster_size, count as u64))
                    } }
                }
            }
        }
    }
}

/// Dimensions of the behaviour space.
fn dimensions(report: &Report) -> usize {
    let method = report.spec.method();
    let embedding = if method.embeds() {
        report.embedding_dimensions()
    } else {
        0
    };
    embedding
        + if method.has_features() {
            FEATURE_NAMES.len()
        } else {
            0
        }
}

/// What behaviours are compared by.
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
        " makes of a grey image"
    };
    let features = html! {
        "the five hand-crafted features of Brown et al. (Table 1 of Mattson and Brown), each its mean over the last "
        (counted(steps.into(), "step")) ": " (features.join(", "))
    };
    html! {
        "Behaviours are compared by "
        @match (method.embeds(), method.has_features()) {
            (true, true) => { "the " (embedding) ", and by " (features) "; none of these numbers is scaled" },
            (true, false) => { "the " (embedding) },
            (false, _) => { (features) },
        }
        ". The distance of two behaviours is the Euclidean one."
    }
}

/// What the behaviours were called; nothing where nobody has said anything.
pub(super) fn names(report: &Report, files: Files) -> Markup {
    let names = &report.names;
    let named = names.named();
    html! {
        @if !names.classes.is_empty() {
            section #names aria-labelledby="names-title" {
                h2 #names-title { "What they were called" }
                p.lead {
                    "Of " (counted(report.individuals.len() as u64, "individual")) ", people have named " (grouped(named.people))
                    @if named.machine > 0 {
                        ", and the rule-based judge, a machine, another " (grouped(named.machine))
                    }
                    ". A card bears the name of its own behaviour; others of its cluster may have been given another. "
                    @match files {
                        Files::Beside => {
                            "classes.csv, which was written beside this page, has these colours, and archive.csv every name."
                        },
                        Files::Absent => {
                            (files_by_command(report)) " writes these colours as classes.csv, and every name in archive.csv."
                        },
                    }
                }
                ul.legend aria-label="Classes" {
                    @for class in &names.classes {
                        @let Named { people, machine } = names.individuals(class);
                        li { span.class style={ "--class:" (class.colour) } {
                            (class.name) " · " (grouped(people + machine))
                            @if machine > 0 && people == 0 { ", named by the rule-based judge alone" }
                            @else if machine > 0 { ", " (grouped(machine)) " of them by the rule-based judge alone" }
                        } }
                    }
                }
            }
        }
    }
}

/// Best and mean novelty over generations.
pub(super) fn novelty(report: &Report) -> Result<Markup, ReportError> {
    let ends = report.generations.first().zip(report.generations.last());
    Ok(html! {
        section #novelty aria-labelledby="novelty-title" {
            h2 #novelty-title { "Novelty over generations" }
            p.lead {
                "Novelty when evaluated: the mean distance of each behaviour to the "
                (counted(report.spec.search().neighbours().into(), "nearest one")) " in the archive as it stood after its generation. It tends to "
                "fall as the archive fills. The lines show the best and the mean of each generation."
                @if let Some((first, last)) = ends {
                    " The mean of the first is " (short(first.mean_novelty)) ", that of the last " (short(last.mean_novelty)) "."
                }
            }
            @if report.repetition.has_moved() { p.lead { (moved(report)) } }
            (plot("Best and mean novelty over generations", |size| plots::novelty(&report.generations, size))?)
        }
    })
}

/// What it means for novelty that the archive has been embedded anew.
fn moved(report: &Report) -> Markup {
    html! {
        "The embedding changed during this campaign: "
        @match report.repetition.rounds.len() as u64 {
            0 => {},
            rounds => { "it was fine-tuned on labels in " (counted(rounds, "round")) },
        }
        @if report.repetition.adopted {
            @if !report.repetition.rounds.is_empty() { ", and " }
            "the campaign was moved to another checkpoint"
        }
        ". After each change the novelty of all generations was measured again; all values here are in the space of the last "
        "checkpoint. Generations from before a change were bred by values in an earlier space, which are not kept."
    }
}

/// What the heuristic filter turned away.
pub(super) fn filtered(report: &Report) -> Result<Markup, ReportError> {
    let away: u64 = report.generations.iter().map(|step| step.filtered).sum();
    let proposed = away + report.individuals.len() as u64;
    Ok(html! {
        section #filtered aria-labelledby="filtered-title" {
            h2 #filtered-title { "What was filtered" }
            @if report.spec.filter() {
                p.lead {
                    "The heuristic filter looks at a controller alone, before it is simulated, and turns away those that are "
                    "unlikely to lead anywhere: too slow, spinning in place, or ignoring what they see. It turned away "
                    strong { (grouped(away)) " of " (counted(proposed, "proposal")) } " (" (percent(away, proposed)) ")."
                }
                (plot("Proposals turned away over generations", |size| plots::filtered(&report.generations, size))?)
            } @else {
                p.lead { "Nothing: the heuristic filter was off, and every proposed controller was simulated." }
            }
        }
    })
}

/// A plot for wide and for narrow pages; the style sheet shows the one that fits.
fn plot(name: &str, draw: impl Fn((u32, u32)) -> Result<String, ReportError>) -> Result<Markup, ReportError> {
    Ok(html! {
        div.plot role="img" aria-label=(name) {
            div.wide { (PreEscaped(draw(plots::WIDE)?)) }
            div.narrow { (PreEscaped(draw(plots::NARROW)?)) }
        }
    })
}

/// The command that writes the files which a page alone does not have.
fn files_by_command(report: &Report) -> Markup {
    html! { code { "murmuration report " (report.campaign) } }
}

/// What was asked for, and how to do it again.
pub(super) fn specification(report: &Report, files: Files) -> Markup {
    let needed = again::also_needed(report);
    html! {
        section #specification aria-labelledby="specification-title" {
            h2 #specification-title { "Specification" }
            @if report.repetition.is_by_specification() {
                p.lead {
                    @match files {
                        Files::Beside => { "spec.toml, which was written beside this page," },
                        Files::Absent => { "Saved as spec.toml, the text below" },
                    }
                    " gives the same archive again, bit for bit, on any number of workers"
                    @if !report.checkpoint.is_empty() { " of one kind of processor" }
                    ":"
                }
                @for sentence in &needed { p { (sentence) } }
                (copyable("command", commands::RUN_AGAIN))
            } @else {
                @for sentence in &needed { p { (sentence) } }
                @if again::is_by_commands(report) {
                    p {
                        "On machines of one kind of processor these commands lead to the same archive, if no answer has changed "
                        "since the round began:"
                    }
                    (copyable("command", &commands::write_labels(report)))
                    @for command in commands::TEACH_AGAIN { (copyable("command", command)) }
                } @else if !report.repetition.adopted {
                    p {
                        "Commands alone do not lead there: a round learns from the answers as they stand when it begins, and those "
                        "that are exported are today's."
                    }
                }
            }
            p { "With simulator version " (report.simulator_version) ", expect this archive digest:" }
            (copyable("digest", &report.digest))
            @if !report.checkpoint.is_empty() {
                p { "The embeddings are those of this checkpoint:" }
                (copyable("checkpoint", &report.checkpoint))
            }
            details {
                summary { "spec.toml" }
                pre tabindex="0" { code { (again::specification(report)) } }
            }
        }
    }
}

/// What the words and pictures mean.
pub(super) fn reading(report: &Report) -> Markup {
    let entry = |word: &str, meaning: Markup| html! { div { dt { (word) } dd { (meaning) } } };
    html! {
        section #reading aria-labelledby="reading-title" {
            h2 #reading-title { "How to read this" }
            dl.words {
                (entry("Behaviour", html! {
                    "A medoid: the individual of its cluster with the least sum of distances to the others. The cards are ordered "
                    "by the size of the cluster."
                }))
                (entry("Cluster", html! {
                    "The individuals that are nearer to this medoid than to any other. How alike they are, the mean distance says."
                }))
                (entry("Grey image", html! {
                    "The last " (counted(report.spec.image().window().into(), "step")) " as " (report.spec.image().resolution()) " × "
                    (report.spec.image().resolution()) " grey values, without colours"
                    @if report.spec.method().embeds() { ": what the network sees of the swarm." } @else { ". Here nothing is measured on it." }
                }))
                (entry("Controller", html! {
                    "Left and right wheel speed when the sensor sees nobody, then when it sees another robot"
                    @if report.spec.model().angles() > 0 {
                        "; with two sensors, the four pairs are none, second, first and both, followed by the angle of the second "
                        "sensor in radians"
                    }
                    ". Speeds go from −1 to 1."
                }))
                (entry("Novelty", html! {
                    "On a card, and in the table of the taxonomy: the mean distance of a behaviour to its "
                    (report.spec.search().neighbours()) " nearest neighbours in the whole archive. High means that few lie near it."
                }))
                (entry("Novelty when evaluated", html! {
                    "On the map, over generations, and in the table of the archive: the same distance in the archive as it stood after the "
                    "generation of the behaviour. It tends to be higher where the archive was emptier. "
                    @match (report.spec.method(), report.repetition.has_moved()) {
                        (Method::Random, _) => { "Nothing was bred by it: every controller was drawn by lot." },
                        (_, false) => { "Each generation was bred by that of the generation before it." },
                        (_, true) => { "It was measured again when the embedding changed: earlier generations were bred by other values." },
                    }
                }))
                (entry("Mean distance", html! {
                    "How far the members of a cluster are from its medoid on average, the medoid itself included. Low means that the picture speaks for all "
                    "of them; high, that the cluster is mixed. Over the whole archive these distances add up to "
                    (short(report.loss)) "."
                }))
                (entry("A caution", html! {
                    "One start was simulated for each controller. Another start can lead to another behaviour: try another seed "
                    "before you draw conclusions."
                }))
            }
        }
    }
}
