//! Labels and questions for the scripts: translates between JSON and the label service, which validates and decides.

use super::{Web, page_error::Refused};
use axum::{
    Json,
    extract::{Path, State},
};
use murmuration_engine::blocking::{blocking, in_background};
use murmuration_model::labels::{Annotator, Class, ClassName, Labels};
use murmuration_proto::{
    Strategy,
    parts::whole,
    v1::{self, label_service_server::LabelService as _},
};
use murmuration_report::picture::columns::column;
use murmuration_service::OrStatus as _;
use serde::Deserialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use tonic::Request;

type Told = Result<Json<Value>, Refused>;

/// A request for questions; see `NextQueriesRequest`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Ask {
    annotator: String,
    session: String,
    strategy: String,
    count: u32,
    agreement: bool,
    again: Vec<u64>,
}

pub(super) async fn ask(State(web): State<Web>, Path(campaign): Path<String>, Json(ask): Json<Ask>) -> Told {
    let strategy: Strategy = ask.strategy.parse()?;
    let request = v1::NextQueriesRequest {
        campaign,
        annotator: ask.annotator,
        session: ask.session,
        strategy: v1::QueryStrategy::from(strategy) as i32,
        count: ask.count,
        agreement: ask.agreement,
        again: ask.again,
    };
    let asked = web.labels.next_queries(Request::new(request)).await?.into_inner();
    let query = |query: &v1::Query| json!({ "index": query.index, "reason": query.reason });
    Ok(Json(json!({
        "queries": asked.queries.iter().map(query).collect::<Vec<_>>(),
        "answered": asked.answered,
        "own": asked.own,
        "synthetic": asked.synthetic,
        "individuals": asked.individuals,
    })))
}

/// Answers of one annotator.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Answers {
    request_id: String,
    annotator: String,
    answers: Vec<Answer>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Answer {
    index: u64,
    answer: String,
}

pub(super) async fn answer(
    State(web): State<Web>,
    Path(campaign): Path<String>,
    Json(said): Json<Answers>,
) -> Told {
    let answers = said.answers.into_iter().map(|answer| v1::Answer {
        index: answer.index,
        answer: answer.answer,
        time_ms: 0,
        annotator: said.annotator.clone(),
    });
    let request = v1::AppendLabelsRequest {
        campaign: campaign.clone(),
        request_id: said.request_id,
        answers: answers.collect(),
    };
    web.labels.append_labels(Request::new(request)).await?;
    classes(&web, campaign).await
}

/// A request to undo the last act of an annotator.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Undo {
    request_id: String,
    annotator: String,
}

/// Responds with the individuals whose answers were undone, newest first.
pub(super) async fn undo(
    State(web): State<Web>,
    Path(campaign): Path<String>,
    Json(said): Json<Undo>,
) -> Told {
    let request = v1::UndoLabelsRequest {
        campaign: campaign.clone(),
        request_id: said.request_id,
        annotator: said.annotator,
    };
    let undone = web.labels.undo_labels(Request::new(request)).await?;
    let undone = whole(undone.into_inner()).await?;
    let answers = undone.undone.into_iter().filter_map(|label| label.answer);
    let individuals: Vec<u64> = answers.map(|answer| answer.index).collect();
    let Json(mut told) = classes(&web, campaign).await?;
    told["individuals"] = json!(individuals);
    Ok(Json(told))
}

pub(super) async fn classes(web: &Web, campaign: String) -> Told {
    let request = v1::ListClassesRequest { campaign };
    let classes = web
        .labels
        .list_classes(Request::new(request))
        .await?
        .into_inner()
        .classes;
    let class = |class: &v1::LabelClass| json!({ "name": class.name, "colour": class.colour, "shortcut": class.shortcut, "labels": class.labels, "near": class.near });
    Ok(Json(
        json!({ "classes": classes.iter().map(class).collect::<Vec<_>>() }),
    ))
}

pub(super) fn class(class: &Class) -> Value {
    let near: Vec<&str> = class.near.iter().map(ClassName::as_str).collect();
    json!({
        "name": class.name.as_str(),
        "colour": class.colour.to_string(),
        "shortcut": class.shortcut.map(|key| key.to_string()),
        "labels": class.labels,
        "near": near,
    })
}

/// The classes, and as columns the index of each individual with a class, the place of its class, and whether only the
/// rule-based judge gave it.
pub(super) async fn labels(State(web): State<Web>, Path(campaign): Path<String>) -> Told {
    let store = web.store.clone();
    let read = move || store.labels_of(&campaign);
    let labels = blocking(read).await.or_status()?.or_status()?;
    Ok(in_background(move |_| in_columns(&labels)).await.or_status()?)
}

fn in_columns(labels: &Labels) -> Json<Value> {
    let classes = labels.classes();
    let place: BTreeMap<&ClassName, u16> = classes.iter().map(|class| &class.name).zip(0..).collect();
    let given = labels.given_classes();
    let placed: Vec<(u64, u16, bool)> = given
        .iter()
        .filter_map(|(index, given)| Some((*index, *place.get(&given.class)?, given.by_machine)))
        .collect();
    let people = labels
        .annotators()
        .filter(|annotator| labels.answered_by(annotator) > 0);
    Json(json!({
        "classes": classes.iter().map(class).collect::<Vec<_>>(),
        "annotators": people.map(Annotator::as_str).collect::<Vec<_>>(),
        "individual": column(placed.iter().map(|(index, ..)| (*index as u32).to_le_bytes())),
        "class": column(placed.iter().map(|(_, class, _)| class.to_le_bytes())),
        "machine": column(placed.iter().map(|(.., by_machine)| [u8::from(*by_machine)])),
    }))
}
