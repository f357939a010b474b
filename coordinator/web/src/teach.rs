//! Labels and questions for the scripts of pages. The module translates between JSON and the label service, which checks the
//! requests and decides about them.

use super::{Web, page_error::Refused};
use axum::{
    Json,
    extract::{Path, State},
};
use murmuration_engine::blocking::in_background;
use murmuration_model::labels::{Annotator, Class, ClassName, Labels};
use murmuration_proto::{
    parts::whole,
    v1::{self, label_service_server::LabelService as _},
};
use murmuration_report::picture::columns::column;
use murmuration_service::OrStatus as _;
use murmuration_swarm::Strategy;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use tonic::Request;

type Told<T> = Result<Json<T>, Refused>;

/// A request for questions; the message `NextQueriesRequest` explains the fields.
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

/// The questions that a window of a browser has.
#[derive(Debug, Serialize)]
pub(super) struct QueriesView {
    queries: Vec<QueryView>,
    /// Numbers of individuals with an answer by anybody, by this annotator, and by the rule-based judge alone.
    answered: u64,
    own: u64,
    synthetic: u64,
    individuals: u64,
}

#[derive(Debug, Serialize)]
struct QueryView {
    index: u64,
    reason: String,
}

pub(super) async fn ask(
    State(web): State<Web>,
    Path(campaign): Path<String>,
    Json(ask): Json<Ask>,
) -> Told<QueriesView> {
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
    let query = |v1::Query { index, reason }| QueryView { index, reason };
    Ok(Json(QueriesView {
        queries: asked.queries.into_iter().map(query).collect(),
        answered: asked.answered,
        own: asked.own,
        synthetic: asked.synthetic,
        individuals: asked.individuals,
    }))
}

/// A request with answers of one annotator.
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
    Json(posted): Json<Answers>,
) -> Told<ClassesView> {
    let answers = posted.answers.into_iter().map(|answer| v1::Answer {
        index: answer.index,
        answer: answer.answer,
        time_ms: 0,
        annotator: posted.annotator.clone(),
    });
    let request = v1::AppendLabelsRequest {
        campaign: campaign.clone(),
        request_id: posted.request_id,
        answers: answers.collect(),
    };
    web.labels.append_labels(Request::new(request)).await?;
    classes(&web, campaign).await
}

/// A request to undo the answers of an annotator's newest request.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Undo {
    request_id: String,
    annotator: String,
}

/// Undoes the answers of an annotator's newest request, and responds with their individuals, newest first.
pub(super) async fn undo(
    State(web): State<Web>,
    Path(campaign): Path<String>,
    Json(posted): Json<Undo>,
) -> Told<ClassesView> {
    let request = v1::UndoLabelsRequest {
        campaign: campaign.clone(),
        request_id: posted.request_id,
        annotator: posted.annotator,
    };
    let undone = web.labels.undo_labels(Request::new(request)).await?;
    let undone = whole(undone.into_inner()).await?;
    let answers = undone.undone.into_iter().filter_map(|label| label.answer);
    let individuals = answers.map(|answer| answer.index).collect();
    let Json(view) = classes(&web, campaign).await?;
    Ok(Json(ClassesView {
        individuals: Some(individuals),
        ..view
    }))
}

/// The classes after a request.
#[derive(Debug, Serialize)]
pub(super) struct ClassesView {
    classes: Vec<ClassView>,
    /// The individuals of the undone answers, if the request was to undo answers.
    individuals: Option<Vec<u64>>,
}

/// A class of the campaign.
#[derive(Debug, Serialize)]
pub(super) struct ClassView {
    name: String,
    /// The colour of the class, as `#rrggbb`.
    colour: String,
    /// The key that a person chose for the class.
    shortcut: Option<String>,
    /// Number of standing answers that name the class.
    labels: u64,
    /// Names of classes with nearly the same name.
    near: Vec<String>,
}

pub(super) async fn classes(web: &Web, campaign: String) -> Told<ClassesView> {
    let request = v1::ListClassesRequest { campaign };
    let classes = web
        .labels
        .list_classes(Request::new(request))
        .await?
        .into_inner()
        .classes;
    Ok(Json(ClassesView {
        classes: classes.into_iter().map(Into::into).collect(),
        individuals: None,
    }))
}

impl From<v1::LabelClass> for ClassView {
    fn from(class: v1::LabelClass) -> Self {
        Self {
            name: class.name,
            colour: class.colour,
            shortcut: (!class.shortcut.is_empty()).then_some(class.shortcut),
            labels: class.labels,
            near: class.near,
        }
    }
}

impl From<&Class> for ClassView {
    fn from(class: &Class) -> Self {
        Self {
            name: class.name.to_string(),
            colour: class.colour.to_string(),
            shortcut: class.shortcut.map(|key| key.to_string()),
            labels: class.labels,
            near: class.near.iter().map(ToString::to_string).collect(),
        }
    }
}

/// The classes, and the individuals that have a class, as columns.
#[derive(Debug, Serialize)]
pub(super) struct LabelsView {
    classes: Vec<ClassView>,
    annotators: Vec<String>,
    /// Columns with a value for each individual: its index, the place of its class in `classes`, and whether only the rule-based
    /// judge gave the class.
    individual: String,
    class: String,
    machine: String,
}

pub(super) async fn labels(State(web): State<Web>, Path(campaign): Path<String>) -> Told<LabelsView> {
    let labels = web.store.run(move |store| store.labels_of(&campaign)).await;
    let labels = labels.or_status()?;
    Ok(Json(
        in_background(move |_| in_columns(&labels)).await.or_status()?,
    ))
}

fn in_columns(labels: &Labels) -> LabelsView {
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
    LabelsView {
        classes: classes.iter().map(Into::into).collect(),
        annotators: people.map(Annotator::to_string).collect(),
        individual: column(placed.iter().map(|(index, ..)| (*index as u32).to_le_bytes())),
        class: column(placed.iter().map(|(_, class, _)| class.to_le_bytes())),
        machine: column(placed.iter().map(|(.., by_machine)| [u8::from(*by_machine)])),
    }
}
