//! The page on which people compare behaviours: which of two is more like a third.

use super::{
    Web, keys,
    layout::{Part, campaign_page},
    learning,
    page_error::PageError,
    parts,
    refused::Refused,
    teach,
    visitor::Visitor,
};
use axum::{
    Json,
    extract::{Path, State},
};
use maud::{Markup, html};
use murmuration_model::labels::Preference;
use murmuration_proto::v1::{self, label_service_server::LabelService as _};
use serde::Deserialize;
use serde_json::{Value, json};
use tonic::Request;

type Told = Result<Json<Value>, Refused>;

/// The three behaviours from left to right: the id of the place, its name, and the button below it with its answer.
const PLACES: [(&str, &str, (&str, Preference)); 3] = [
    ("left", "Left", ("Left is more like it", Preference::Left)),
    ("reference", "Reference", ("Neither", Preference::Neither)),
    ("right", "Right", ("Right is more like it", Preference::Right)),
];

/// The page.
pub(super) async fn page(
    State(web): State<Web>,
    Path(id): Path<String>,
    visitor: Visitor,
) -> Result<Markup, PageError> {
    let record = web.campaigns.status(&id).await?.record;
    let content = html! {
        div.wide-bar {
            h1 { "Which is more like the reference?" }
            (keys::list(&[], keys::Page::Comparisons))
            p.counted.once-named.scripted { span #count { "…" } span #others {} }
        }
        (parts::who())
        p.lead.once-named.scripted {
            "Compare what the swarms do, not where they are or which way they turn. If neither is more like the reference, or both are, choose "
            "Neither: "
            "the campaign learns nothing from that answer."
            @if !record.spec.method().embeds() {
                " This campaign has no embedding, so it learns from no comparison. Comparisons are stored and exported."
            }
        }
        div.triple.once-named.scripted role="group" aria-label="Three behaviours" {
            @for (place, name, (said, preference)) in PLACES {
                figure.player #(place) {
                    figcaption { strong { (name) } " " span.which {} }
                    div.stage {
                        (parts::shape(record.spec.world()))
                        canvas role="img" aria-label={ (name) ": motion of the behaviour" } {}
                        p.waiting hidden {}
                    }
                    button.plain type="button" data-preference=(preference.name()) { (said) " " (keys::mark(preference.name())) }
                }
            }
        }
        div.once-named.scripted {
            p #question.reason aria-live="polite" { "…" }
            div.choices {
                button.plain #undo type="button" { "Withdraw the last " (keys::mark("withdraw-last")) }
                button.plain #several type="button" disabled { "Withdraw several…" }
                button.plain #rest type="button" aria-pressed="false" { "Pause" }
                (parts::rename())
            }
            (parts::status_line())
            (learning::button(&web, &record).await?)
        }
        dialog #withdraw aria-labelledby="withdraw-title" {
            h2 #withdraw-title { "Withdraw your last comparisons" }
            form method="dialog" {
                label.field { "How many " input name="count" type="number" min="1" step="1" required; }
                p #effect role="status" {}
                button.plain type="button" data-do="back" { "Go back" }
                button value="yes" { "Withdraw" }
            }
        }
    };
    Ok(campaign_page(
        &record,
        Part::Comparisons,
        &visitor,
        "comparisons.js",
        content,
    ))
}

/// A request for a question.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Ask {
    annotator: String,
}

/// The question that an annotator is asked now.
pub(super) async fn ask(State(web): State<Web>, Path(campaign): Path<String>, Json(ask): Json<Ask>) -> Told {
    Ok(Json(question(&web, campaign, ask.annotator).await?))
}

/// An answer to a question.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Answer {
    request_id: String,
    annotator: String,
    reference: u64,
    left: u64,
    right: u64,
    preference: String,
}

/// Stores an answer; responds with the classes, as all requests that change the log do, and the next question.
pub(super) async fn answer(
    State(web): State<Web>,
    Path(campaign): Path<String>,
    Json(said): Json<Answer>,
) -> Told {
    let preference: Preference = said.preference.parse()?;
    let comparison = v1::Comparison {
        triple: Some(v1::Triple {
            reference: said.reference,
            left: said.left,
            right: said.right,
        }),
        preference: v1::Preference::from(preference).into(),
    };
    let request = v1::AnswerComparisonRequest {
        campaign: campaign.clone(),
        request_id: said.request_id,
        annotator: said.annotator.clone(),
        comparison: Some(comparison),
        time_ms: 0,
    };
    web.labels.answer_comparison(Request::new(request)).await?;
    told(&web, campaign, said.annotator).await
}

/// A request to withdraw the last comparison of an annotator.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Withdraw {
    request_id: String,
    annotator: String,
}

/// Withdraws a comparison; responds as [`answer`] does, with the question that was withdrawn as the next one.
pub(super) async fn withdraw(
    State(web): State<Web>,
    Path(campaign): Path<String>,
    Json(said): Json<Withdraw>,
) -> Told {
    let request = v1::WithdrawComparisonRequest {
        campaign: campaign.clone(),
        request_id: said.request_id,
        annotator: said.annotator.clone(),
    };
    let withdrawn = web
        .labels
        .withdraw_comparison(Request::new(request))
        .await?
        .into_inner();
    let Json(mut told) = told(&web, campaign, said.annotator).await?;
    if let Some(triple) = told.get_mut("triple") {
        *triple = shown(withdrawn.withdrawn.and_then(|comparison| comparison.triple));
    }
    Ok(Json(told))
}

/// The classes and the next question, which is left out if there is none for now: what was said is stored, whatever becomes of it.
async fn told(web: &Web, campaign: String, annotator: String) -> Told {
    let next = question(web, campaign.clone(), annotator).await;
    let mut told = next.unwrap_or_else(|_| json!({}));
    let Json(classes) = teach::classes(web, campaign).await?;
    told["classes"] = classes["classes"].clone();
    Ok(Json(told))
}

async fn question(web: &Web, campaign: String, annotator: String) -> Result<Value, Refused> {
    let request = v1::NextComparisonRequest { campaign, annotator };
    let asked = web
        .labels
        .next_comparison(Request::new(request))
        .await?
        .into_inner();
    Ok(json!({
        "triple": shown(asked.triple),
        "own": asked.own,
        "comparisons": asked.comparisons,
        "individuals": asked.individuals,
    }))
}

fn shown(triple: Option<v1::Triple>) -> Value {
    triple.map_or(
        Value::Null,
        |triple| json!({ "reference": triple.reference, "left": triple.left, "right": triple.right }),
    )
}
