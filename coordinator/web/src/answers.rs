//! The standing answers: people look through all answers, and change or withdraw their own answers.

use super::{
    Web, keys,
    layout::{Part, campaign_page},
    of_campaign::OfCampaign,
    page_error::{PageError, Refused},
    parts, teach,
};
use axum::{
    Json,
    extract::{Path, State},
};
use maud::{Markup, html};
use murmuration_engine::blocking::in_background;
use murmuration_model::labels::{Annotator, Answer, ClassName, Label, Labels};
use murmuration_proto::v1::{self, label_service_server::LabelService as _};
use murmuration_report::picture::columns::column;
use murmuration_service::OrStatus as _;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use tonic::Request;

/// Numbers in the column of answers for an answer that names no class.
const NOT_SURE: u16 = u16::MAX;
const SKIP: u16 = u16::MAX - 1;

const KEYS: [(&str, &str); 4] = [
    keys::CLASSES,
    ("Tab", "go from picture to picture"),
    ("Space", "select the picture, or take it out of the selection"),
    ("Escape", "select nothing"),
];

pub(super) async fn page(OfCampaign { record, visitor, .. }: OfCampaign) -> Result<Markup, PageError> {
    let content = html! {
        div.wide-bar {
            h1 { "Answers" }
            (keys::list(&KEYS, keys::Page::Answers))
            div.choices.once-named.scripted {
                label { "By " select #by { option value="" { "everybody" } } }
                label { "Answer " select #given { option value="" { "any" } } }
            }
        }
        (parts::who())
        p.lead.once-named.scripted {
            "The current answers, newest first. Click pictures to select them, then choose another class, or withdraw your answers. "
            "You change only answers of your own."
        }
        div.columns.sheeted.once-named {
            section.sight.scripted aria-label="Answers" {
                p #counted.reason role="status" { "…" }
                div #answers.answers role="group" aria-label="Pictures" {}
                p.empty hidden {}
                button.plain #more type="button" hidden { "Show more" }
            }
            section.side aria-label="Your answer" {
                (parts::stage("Motion of the behaviour that you selected last", record.spec.world()))
                p #selected.reason.scripted role="status" { "Nothing is selected." }
                div.others.scripted {
                    button.plain #all type="button" { "Select all shown" }
                    button.plain #withdraw type="button" disabled { "Withdraw " (keys::mark("withdraw")) }
                }
                (parts::palette(record.spec.world(), false))
                (parts::status_line())
                (parts::downloads(&record))
            }
        }
        (parts::confirm())
    };
    Ok(campaign_page(&record, Part::Answers, &visitor, content))
}

/// The standing answers, as columns.
#[derive(Debug, Serialize)]
pub(super) struct AnswersView {
    classes: Vec<teach::ClassView>,
    annotators: Vec<String>,
    individual: String,
    /// The annotators, as places in `annotators`.
    annotator: String,
    /// The answers: places in `classes`, [`NOT_SURE`] or [`SKIP`].
    answer: String,
    /// The times, in milliseconds since 1970-01-01 UTC.
    time: String,
}

pub(super) async fn standing(
    State(web): State<Web>,
    Path(campaign): Path<String>,
) -> Result<Json<AnswersView>, Refused> {
    let labels = web.store.run(move |store| store.labels_of(&campaign)).await;
    let labels = labels.or_status()?;
    let told = in_background(move |_| columns(&labels)).await.or_status()?;
    Ok(Json(told))
}

fn columns(labels: &Labels) -> AnswersView {
    let classes = labels.classes();
    let place: BTreeMap<&ClassName, u16> = classes.iter().map(|class| &class.name).zip(0..).collect();
    let standing: Vec<Label> = labels.standing().collect();
    let mut people: BTreeMap<&Annotator, u16> = BTreeMap::new();
    for label in &standing {
        let next = people.len() as u16;
        people.entry(&label.annotator).or_insert(next);
    }
    let message = |answer: &Answer| match answer {
        Answer::Class(class) => place.get(class).copied().unwrap_or(NOT_SURE),
        Answer::NotSure => NOT_SURE,
        Answer::Skip => SKIP,
    };
    let mut names: Vec<(&Annotator, u16)> = people.iter().map(|(name, place)| (*name, *place)).collect();
    names.sort_by_key(|(_, place)| *place);
    let person = |label: &Label| people.get(&label.annotator).copied().unwrap_or_default();
    AnswersView {
        classes: classes.iter().map(Into::into).collect(),
        annotators: names.iter().map(|(name, _)| name.to_string()).collect(),
        individual: column(standing.iter().map(|label| (label.index as u32).to_le_bytes())),
        annotator: column(standing.iter().map(|label| person(label).to_le_bytes())),
        answer: column(standing.iter().map(|label| message(&label.answer).to_le_bytes())),
        time: column(standing.iter().map(|label| (label.time_ms as f64).to_le_bytes())),
    }
}

/// A request to withdraw answers of one annotator.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Withdraw {
    request_id: String,
    annotator: String,
    individuals: Vec<u64>,
}

/// Withdraws answers, and responds with the updated classes.
pub(super) async fn withdraw(
    State(web): State<Web>,
    Path(campaign): Path<String>,
    Json(posted): Json<Withdraw>,
) -> Result<Json<teach::ClassesView>, Refused> {
    let request = v1::WithdrawLabelsRequest {
        campaign: campaign.clone(),
        request_id: posted.request_id,
        annotator: posted.annotator,
        indices: posted.individuals,
    };
    web.labels.withdraw_labels(Request::new(request)).await?;
    teach::classes(&web, campaign).await
}
