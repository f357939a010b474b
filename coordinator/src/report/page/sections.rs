//! The sections under the taxonomy: map, novelty, filter, specification, how to read it.

use super::copyable;
use crate::{
    picture::colours,
    report::{
        Files, Report, ReportError, commands,
        numbers::{counted, grouped, percent, short},
        plots,
    },
};
use maud::{Markup, PreEscaped, html};

/// The behaviour space in two dimensions.
pub(super) fn map(report: &Report, files: Files) -> Markup {
    let [across, up] = &report.map.axis_titles;
    let embedding = report.embedding_dimensions();
    let features = if report.spec.method().has_features() { 5 } else { 0 };
    let (count, shown) = (report.individuals.len(), super::data::shown_points(report).len());
    html! {
        section #map aria-labelledby="map-title" {
            h2 #map-title { "Map of the behaviour space" }
            p.lead {
                "Every point is one controller that was tried; near points behaved alike. Colours are clusters, numbers the "
                "behaviours above. The space has " (counted((embedding + features) as u64, "dimension"))
                @match (embedding, features) {
                    (0, _) => {}
                    (_, 0) => { ", in which a network has learned to tell pictures of swarms apart," }
                    _ => { ", " (embedding) " of a network that looks at pictures of swarms and five hand-crafted," }
                }
                " and is flattened to two here, so that points that lie apart may look close. "
                @if shown < count { "Of " (counted(count as u64, "point")) ", " (grouped(shown as u64)) " are drawn, evenly chosen. " }
                span.scripted { "Point at a cluster, a number or a card to bring one cluster out." }
            }
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
                        @if let Some((_, class)) = report.names.of(report.medoids[place].index) { (class.name) " · " }
                        (percent(report.medoids[place].cluster_size, count as u64))
                    } }
                }
            }
        }
    }
}

/// What people called the behaviours; nothing where nobody has said anything.
pub(super) fn names(report: &Report, files: Files) -> Markup {
    let names = &report.names;
    html! {
        @if !names.classes.is_empty() {
            section #names aria-labelledby="names-title" {
                h2 #names-title { "What people called them" }
                p.lead {
                    "People have named " (grouped(names.by_individual.len() as u64)) " of "
                    (counted(report.individuals.len() as u64, "behaviour")) ". A card bears the name of its own behaviour; "
                    "others of its cluster may have been given another. "
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
                        li { span.class style={ "--class:" (class.colour) } {
                            (class.name) " · " (grouped(names.individuals(class) as u64))
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
                (counted(report.spec.search().neighbours().into(), "nearest one")) " in the archive as it stood after its generation. It falls as the archive fills: a late behaviour "
                "that is still novel is far from everything seen before."
                @if let Some((first, last)) = ends {
                    " The mean went from " (short(first.mean_novelty)) " to " (short(last.mean_novelty)) "."
                }
            }
            (plot("Best and mean novelty over generations", |size| plots::novelty(&report.generations, size))?)
        }
    })
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
    html! {
        section #specification aria-labelledby="specification-title" {
            h2 #specification-title { "Specification" }
            p.lead {
                "Everything that decides the outcome. "
                @match files {
                    Files::Beside => { "spec.toml, which was written beside this page," },
                    Files::Absent => { "Saved as spec.toml, the text below" },
                }
                " gives the same archive again, bit for bit, on any number of workers"
                @if !report.checkpoint.is_empty() { " of one kind of processor" }
                ":"
            }
            (copyable("command", commands::RUN_AGAIN))
            p { "With simulator version " (report.simulator_version) ", expect this archive digest:" }
            (copyable("digest", &report.digest))
            details {
                summary { "spec.toml" }
                pre tabindex="0" { code { (report.spec.to_toml()) } }
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
                    "A medoid: the one controller of its cluster that is nearest to all the others. The cards are ordered by the "
                    "size of the cluster."
                }))
                (entry("Grey image", html! {
                    "The last " (counted(report.spec.image().window().into(), "step")) " as " (report.spec.image().resolution()) " × "
                    (report.spec.image().resolution()) " grey values, without colours: what an algorithm sees of the swarm."
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
                    (report.spec.search().neighbours()) " nearest neighbours in the whole archive. High means rare."
                }))
                (entry("Novelty when evaluated", html! {
                    "On the map, over generations, and in the table of the archive: the same distance in the archive as it stood after the "
                    "generation of the behaviour. The search bred from it; it is higher where the archive was emptier."
                }))
                (entry("Mean distance", html! {
                    "How far the members of a cluster are from its medoid on average. Low means that the picture speaks for all "
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
