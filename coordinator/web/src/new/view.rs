//! The page that describes a new campaign.

use super::{
    super::{layout::layout_with, robot_editor, visitor::Visitor},
    draft::{Draft, EXAMPLES, Filled, REST, ROBOTS},
    every_field,
    fields::{Field, GROUPS, Kind, OWN_ROBOTS, fields},
    problems::Problem,
};
use maud::{Markup, html};
use murmuration_swarm::text::beginning;
use murmuration_swarm::{CampaignSpec, EmbedderSource, Feedback, counted, grouped};
use serde_json::json;
use std::collections::BTreeMap;

/// The page for a draft; `token` distinguishes the page from other pages. After a submission, the errors are at the top of the page.
pub(super) fn page(draft: &Draft, token: &str, was_sent: bool, visitor: &Visitor) -> Markup {
    let problems = draft.checked().err().unwrap_or_default();
    layout_with(
        "New campaign",
        visitor,
        &["new.js", "roboteditor.js"],
        html! {
            h1 { "New campaign" }
            @if was_sent && !problems.is_empty() { (refused(&problems, draft)) }
            p.lead {
                "Choose an example, or change the fields below. An empty field has the default that it shows in grey. The "
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
                    Draft::Fields(filled) => (as_fields(filled, &problems)),
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

/// The reasons why no campaign was started, with links to the wrong fields.
fn refused(problems: &[Problem], draft: &Draft) -> Markup {
    html! {
        div.problems role="alert" {
            p { strong { "The campaign was not started: " (counted(problems.len() as u64, "error")) "." } }
            ul { @for problem in problems { li { (linked(problem, draft)) } } }
        }
    }
}

/// An error with a link to its field.
fn linked(problem: &Problem, draft: &Draft) -> Markup {
    html! {
        @match (draft, place_of(problem)) {
            (Draft::Fields(_), Some((path, label))) => { a href={ "#" (path) } { (label) } " " (problem.brief()) },
            (Draft::File(_), _) => {
                a href="#text" { @match problem.line { Some(line) => { "Line " (line) }, None => { "The file" } } } ": " (problem.text)
            },
            (Draft::Fields(_), None) => (problem.text),
        }
    }
}

/// The id and the label of the part of the form with an error; `None` if the form has no such part.
fn place_of(problem: &Problem) -> Option<(String, String)> {
    if is_about_robots(problem) {
        let line = problem
            .line
            .map_or_else(String::new, |line| format!(", line {line}"));
        return Some((robot_editor::TEXT.to_owned(), format!("{OWN}{line}:")));
    }
    let field = fields().find(|field| problem.is_about(&field.path()))?;
    Some((field.path(), field.label.to_owned()))
}

/// Whether the error is about the text with the robots.
fn is_about_robots(problem: &Problem) -> bool {
    let section = problem.field.split(['.', '[']).next().unwrap_or_default();
    let is_of_text = problem.field.is_empty() && problem.line.is_some();
    is_of_text || section == ROBOTS || OWN_ROBOTS.contains(&section)
}

/// The cost of the campaign, or the errors in the draft. The script takes the defaults of the fields from it.
pub(super) fn outcome(draft: &Draft) -> Markup {
    let defaults = match draft {
        Draft::Fields(filled) => Some(json!(filled.defaults())),
        Draft::File(_) => None,
    };
    html! {
        section #outcome aria-live="polite" aria-label="What it costs" data-defaults=[defaults] {
            @match draft.checked() {
                Ok(spec) => (cost(&spec)),
                Err(problems) => (told(&problems, draft)),
            }
        }
    }
}

fn told(problems: &[Problem], draft: &Draft) -> Markup {
    html! {
        p { strong.error { "This cannot be started yet: " (counted(problems.len() as u64, "error")) "." } }
        ul.wrong {
            @for problem in problems {
                @let field = place_of(problem).map(|(path, _)| path);
                li.error data-line=[problem.line] data-field=[field] data-brief=(problem.brief()) {
                    @match draft {
                        Draft::Fields(_) => (linked(problem, draft)),
                        Draft::File(text) => (told_of_file(problem, text)),
                    }
                }
            }
        }
    }
}

/// Maximum number of characters of a quoted line.
const LONGEST_QUOTED: usize = 400;

/// An error of a campaign file, with its line.
fn told_of_file(problem: &Problem, text: &str) -> Markup {
    let is_quoted = problem.text.contains(" | ");
    let quoted = problem.line.filter(|_| !is_quoted);
    let quoted = quoted.and_then(|line| Some((line, text.lines().nth(line - 1)?)));
    html! {
        @if let Some(line) = problem.line { "Line " (line) ":" }
        pre { code { (problem.text) @if let Some((line, text)) = quoted { "\n" (line) " | " (beginning(text, LONGEST_QUOTED)) } } }
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

/// The name of the text that describes own robots.
const OWN: &str = "Own robots";

fn as_fields(filled: &Filled, problems: &[Problem]) -> Markup {
    let mut rest = filled.table.clone();
    for field in fields() {
        field.put(&mut rest, "");
    }
    let form = Form {
        filled,
        defaults: filled.defaults(),
        problems,
    };
    html! {
        input type="hidden" name=(REST) value=(rest);
        @for (place, (title, fields)) in GROUPS.iter().enumerate() { (group(&form, title, fields, place == 0)) }
    }
}

/// The content of the form, with its defaults and errors.
struct Form<'a> {
    filled: &'a Filled,
    /// The defaults of the fields, by path.
    defaults: BTreeMap<String, String>,
    problems: &'a [Problem],
}

impl Form<'_> {
    fn problem_of(&self, path: &str) -> Option<&Problem> {
        self.problems
            .iter()
            .find(|problem| !is_about_robots(problem) && problem.is_about(path))
    }

    /// Whether the form begins with the focus on this field, the first wrong one.
    fn has_focus(&self, path: &str) -> bool {
        let first = fields()
            .map(Field::path)
            .find(|path| self.problem_of(path).is_some());
        first.is_some_and(|first| first == path)
    }
}

/// A section of the form. It is open if one of its fields has a value or an error.
fn group(form: &Form<'_>, title: &str, fields: &[Field], has_robots: bool) -> Markup {
    let set = fields
        .iter()
        .filter(|field| !field.value(&form.filled.table).is_empty())
        .count();
    let is_wrong = fields
        .iter()
        .any(|field| form.problem_of(&field.path()).is_some());
    html! {
        details.group open[set > 0 || is_wrong || has_robots] {
            summary { (title) }
            fieldset {
                legend.unseen { (title) }
                @for field in fields {
                    (shown(field, form))
                    @if field.kind == Kind::Model { (own_robots(form)) }
                }
            }
        }
    }
}

/// The text that describes own robots, with the editor that writes it.
fn own_robots(form: &Form<'_>) -> Markup {
    let robots = &form.filled.robots;
    let wrong: Vec<_> = form
        .problems
        .iter()
        .filter(|problem| is_about_robots(problem))
        .collect();
    html! {
        details.own-robots open[!robots.is_empty() || !wrong.is_empty()] {
            summary { (OWN) }
            p {
                "Choose “" (DESCRIBED) "” above, and describe the robots as in a campaign file: a " code { "[robot]" } ", or each "
                code { "[[species]]" } " with " code { "ratios" } "."
            }
            label for=(robot_editor::TEXT) { (OWN) " (TOML)" }
            textarea id=(robot_editor::TEXT) name=(ROBOTS) rows="8" spellcheck="false" autocomplete="off" autocapitalize="off"
                aria-describedby="about-robots" aria-invalid=[(!wrong.is_empty()).then_some("true")] { "\n" (robots) }
            p #about-robots { strong.error { @for problem in wrong { span { (problem.brief()) } } } }
            (robot_editor::editor())
        }
    }
}

/// The choice of robots that the form describes itself.
const DESCRIBED: &str = "described below";

/// A field with its explanation and its error.
fn shown(field: &Field, form: &Form<'_>) -> Markup {
    let (path, value) = (field.path(), field.value(&form.filled.table));
    let message = format!("about-{path}");
    let wrong = form.problem_of(&path);
    let invalid = wrong.map(|_| "true");
    html! {
        div.field {
            label for=(path) { (field.label) }
            @match field.kind {
                Kind::Flag => {
                    input #(path) name=(path) type="checkbox" value="true" checked[value == "true"] aria-describedby=(message)
                        aria-invalid=[invalid];
                },
                Kind::Model | Kind::Method => {
                    select #(path) name=(path) aria-describedby=(message) aria-invalid=[invalid] {
                        @for choice in field.choices() { option selected[choice == value] { (choice) } }
                        @if field.kind == Kind::Model { option value="" selected[value.is_empty()] { (DESCRIBED) } }
                    }
                },
                Kind::Text | Kind::Number => {
                    input #(path) name=(path) value=(value) autocomplete="off" aria-describedby=(message)
                        placeholder=[form.defaults.get(&path)] inputmode=[(field.kind == Kind::Number).then_some("numeric")]
                        aria-invalid=[invalid] autofocus[form.has_focus(&path)];
                },
            }
            p id=(message) {
                (field.meaning) " " span.reason { (field.explanation()) } " "
                strong.error { @if let Some(wrong) = wrong { (field.label) " " (wrong.brief()) } }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sent(fields: &[(&str, &str)]) -> String {
        let fields = fields.iter();
        let form = fields
            .map(|(name, value)| ((*name).to_owned(), (*value).to_owned()))
            .collect();
        let draft = Draft::of_form(&form).unwrap();
        page(&draft, "t", true, &Visitor::ANYBODY).into_string()
    }

    #[test]
    fn every_wrong_field_is_marked_at_once_in_an_open_section() {
        let page = sent(&[
            ("model", "single-sensor"),
            ("method", "latent"),
            ("search.population", "-4"),
            ("world.agents", "abc"),
            ("feedback.rounds", "x"),
        ]);
        assert_eq!(page.matches("aria-invalid=\"true\"").count(), 3, "{page}");
        assert_eq!(page.matches(" autofocus").count(), 1, "{page}");
        assert_eq!(
            page.matches("<details class=\"group\" open>").count(),
            3,
            "{page}"
        );
        for said in [
            "The campaign was not started: 3 errors.",
            "<a href=\"#search.population\">Population</a> must be a whole number from 1 to 100000, not -4",
            "<strong class=\"error\">Number of robots must be a whole number from 1 to 10000, not &quot;abc&quot;</strong>",
        ] {
            assert!(page.contains(said), "{said}: {page}");
        }
    }

    #[test]
    fn an_empty_form_shows_defaults_and_only_its_first_section() {
        let page = page(&Draft::usual(), "t", false, &Visitor::ANYBODY).into_string();
        assert_eq!(
            page.matches("<details class=\"group\" open>").count(),
            1,
            "{page}"
        );
        assert!(page.contains("name=\"search.population\" value=\"\""), "{page}");
        assert!(page.contains("placeholder=\"100\""), "{page}");
    }

    #[test]
    fn wrong_own_robots_are_told_at_their_text() {
        let page = sent(&[
            ("model", ""),
            ("method", "random"),
            ("robots", "[robot]\nsensors = [{ fov = 1 }]"),
        ]);
        assert!(
            page.contains("<a href=\"#robot\">Own robots, line 2:</a>"),
            "{page}"
        );
        assert!(page.contains("half of the field of view"), "{page}");
        assert!(page.contains("<details class=\"own-robots\" open>"), "{page}");
    }
}
