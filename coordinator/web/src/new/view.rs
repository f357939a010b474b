//! The page that describes a new campaign.

use super::{
    super::{layout::layout_with, visitor::Visitor},
    draft::{Draft, EXAMPLES, Problem},
    every_field,
    fields::{Field, GROUPS, Kind, fields},
};
use maud::{Markup, html};
use murmuration_swarm::{CampaignSpec, EmbedderSource, Feedback, counted, grouped};
use toml::Table;

/// The page for a draft; `token` distinguishes the page from other pages. After a submission, an error is at the top of the page.
pub(super) fn page(draft: &Draft, token: &str, was_sent: bool, visitor: &Visitor) -> Markup {
    let problem = draft.checked().err();
    layout_with(
        "New campaign",
        visitor,
        &["new.js"],
        html! {
            h1 { "New campaign" }
            @if let Some(problem) = problem.as_ref().filter(|_| was_sent) { (refused(problem, draft)) }
            p.lead {
                "Choose an example, or change the fields below. Every field that is left empty has its default. The "
                a href="/glossary" { "glossary" } " explains the words. "
                @match draft {
                    Draft::Fields(_) => { a href="/new?as=file" { "Write or paste a campaign file instead" } },
                    Draft::File(_) => { a href="/new" { "Use a form instead" } },
                }
            }
            details.presets {
                summary { "Examples" }
                ul { @for (name, what, _) in EXAMPLES { li { a href={ "/new?example=" (name) } { (name) } " " span.about { (what) } } } }
            }
            form #new method="post" action="/new" {
                input type="hidden" name="request" value=(token);
                @match draft {
                    Draft::Fields(table) => (as_fields(table, problem.as_ref())),
                    Draft::File(text) => (as_file(text)),
                }
                (outcome(draft))
                div.actions {
                    button name="step" value="start" { "Start the campaign" }
                    button.plain name="step" value="check" { "Check it" }
                    @match draft {
                        Draft::Fields(_) => button.plain name="step" value="file" { "Edit all fields, as a file" },
                        Draft::File(_) => button.plain name="step" value="fields" { "Show as a form" },
                    }
                }
            }
            (every_field::list())
        },
    )
}

/// The reason why no campaign was started, with a link to the wrong field.
fn refused(problem: &Problem, draft: &Draft) -> Markup {
    let field = fields().find(|field| problem.is_about(&field.path()));
    html! {
        div.problems role="alert" {
            p { strong { "The campaign was not started." } @if let Some(line) = problem.line { " Line " (line) " of the file is wrong." } }
            @match (draft, field) {
                (Draft::Fields(_), Some(field)) => p { a href={ "#" (field.path()) } { (field.label) } ": " (problem.text) },
                (Draft::File(_), _) => p { a href="#text" { "The file" } ": " (problem.text) },
                (Draft::Fields(_), None) => p { (problem.text) },
            }
        }
    }
}

/// The cost of the campaign, or the error in the draft.
pub(super) fn outcome(draft: &Draft) -> Markup {
    html! {
        section #outcome aria-live="polite" aria-label="What it costs" {
            @match draft.checked() {
                Ok(spec) => (cost(&spec)),
                Err(problem) => (told(&problem, draft)),
            }
        }
    }
}

fn told(problem: &Problem, draft: &Draft) -> Markup {
    html! {
        div.error data-line=[problem.line] data-field=(problem.field) {
            p { strong { "This cannot be started yet." } @if let Some(line) = problem.line { " Line " (line) ":" } }
            pre { code { (problem.text) } }
            @if let (Draft::File(text), Some(line)) = (draft, problem.line)
                && !problem.text.contains(" | ")
                && let Some(shown) = text.lines().nth(line - 1)
            { pre { code { (line) " | " (shown) } } }
        }
    }
}

fn cost(spec: &CampaignSpec) -> Markup {
    let fact = |name: &str, value: String| html! { div { dt { (name) } dd { (value) } } };
    let (search, starts) = (spec.search(), spec.starts().get() as u64);
    let dataset = match spec.embedder() {
        Some(EmbedderSource::Trained { dataset, .. }) => dataset.pictures(),
        Some(EmbedderSource::Published(_)) | None => 0,
    };
    let evaluations = spec.evaluations();
    let simulations = evaluations * starts + dataset;
    let rounds = spec.feedback().map_or(0, Feedback::rounds);
    html! {
        h2 { "What it costs" }
        dl.facts {
            (fact("Evaluations", format!("{} ({} of {})", grouped(evaluations), counted(evaluations / u64::from(search.population()), "generation"), grouped(search.population().into()))))
            (fact("Simulations, dataset included", grouped(simulations)))
            (fact("Each simulation", format!("{} for {}", counted(spec.world().agents().into(), "robot"), counted(spec.world().horizon().into(), "step"))))
            @if let Some(EmbedderSource::Trained { training, .. }) = spec.embedder() {
                (fact("Training", format!("at most {}, by a trainer", counted(training.recipe().epochs(), "epoch"))))
            }
            @if rounds > 0 { (fact("Unattended rounds", format!("{}, each with a training", grouped(rounds.into())))) }
        }
    }
}

fn as_file(text: &str) -> Markup {
    html! {
        label.file {
            "Campaign file (TOML)"
            textarea #text name="text" rows="24" spellcheck="false" autocapitalize="off" aria-describedby="outcome" { (text) }
        }
        label.scripted { "Read it from a file: " input #file type="file" accept=".toml,text/plain"; }
    }
}

fn as_fields(table: &Table, problem: Option<&Problem>) -> Markup {
    let mut rest = table.clone();
    for field in fields() {
        field.put(&mut rest, "");
    }
    let has_own_robots = ["robot", "species"].iter().any(|name| table.contains_key(*name));
    html! {
        input type="hidden" name="rest" value=(rest);
        @for (title, fields) in GROUPS {
            fieldset {
                legend { (title) }
                @for field in fields { (shown(field, table, has_own_robots, problem)) }
            }
        }
    }
}

/// A field with its explanation and its error.
fn shown(field: &Field, table: &Table, has_own_robots: bool, problem: Option<&Problem>) -> Markup {
    let (path, value) = (field.path(), field.value(table));
    let message = format!("about-{path}");
    let wrong = problem.filter(|problem| problem.is_about(&path));
    html! {
        div.field {
            label for=(path) { (field.label) }
            @match field.kind {
                Kind::Flag => {
                    input #(path) name=(path) type="checkbox" value="true" checked[value == "true"] aria-describedby=(message);
                },
                Kind::Model | Kind::Method => {
                    select #(path) name=(path) aria-describedby=(message) {
                        @if field.kind == Kind::Model && has_own_robots { option value="" selected[value.is_empty()] { "as in the file" } }
                        @for choice in field.choices() { option selected[choice == value] { (choice) } }
                    }
                },
                Kind::Text | Kind::Number => {
                    input #(path) name=(path) value=(value) autocomplete="off" aria-describedby=(message)
                        inputmode=[(field.kind == Kind::Number).then_some("numeric")] aria-invalid=[wrong.map(|_| "true")]
                        autofocus[wrong.is_some()];
                },
            }
            p id=(message) {
                (field.meaning) " " span.reason { (field.explanation()) }
                @if let Some(wrong) = wrong { strong.error { " " (wrong.text) } }
            }
        }
    }
}
