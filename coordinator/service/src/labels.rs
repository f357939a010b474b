//! The service for people who teach: labels, classes, what to ask next.

mod messages;

use super::{Streamed, in_parts};
use crate::status::{IntoStatus, OrStatus as _};
use murmuration_engine::{
    blocking::{blocking, in_background},
    campaign::CampaignError,
    queries::{Queries, QueryRequest},
    synthetic::SyntheticAnnotator,
};
use murmuration_model::{
    CampaignRecord,
    labels::{Action, Agreement, Annotator, Change, Entry, Labels, RequestId},
};
use murmuration_proto::{Invalid, parts::parts, v1};
use murmuration_store::{LabelError, Store, StoreError};
use std::{
    sync::Arc,
    time::{Instant, SystemTime, UNIX_EPOCH},
};
use tonic::{Request, Response, Status};

/// Most answers in one request.
const MAX_ANSWERS: usize = 50_000;

/// Implements `murmuration.v1.LabelService`.
#[derive(Debug, Clone)]
pub struct LabelApi {
    pub store: Store,
    pub queries: Queries,
    /// Who answers in a person's place.
    pub annotator: SyntheticAnnotator,
}

type Result<T> = std::result::Result<T, Status>;
type Answered<T> = Result<Response<T>>;

impl LabelApi {
    /// Runs `work` on the store where it does not hold up the network.
    async fn with<T: Send + 'static, E: IntoStatus + Send + 'static>(
        &self,
        work: impl FnOnce(&Store) -> std::result::Result<T, E> + Send + 'static,
    ) -> Result<T> {
        let store = self.store.clone();
        blocking(move || work(&store)).await.or_status()?.or_status()
    }

    async fn add(&self, campaign: String, request: RequestId, changes: Vec<Change>) -> Result<Vec<Entry>> {
        self.with(move |store| -> std::result::Result<_, LabelError> {
            let id = store.campaign(&campaign)?.id;
            store.add_labels(&id, &request, changes)
        })
        .await
    }

    /// A campaign, and what a request has added to its log.
    async fn made(&self, campaign: String, request: RequestId) -> Result<(CampaignRecord, Vec<Entry>)> {
        self.with(move |store| -> std::result::Result<_, StoreError> {
            let record = store.campaign(&campaign)?;
            let before = store.request_entries(&record.id, &request)?;
            Ok((record, before))
        })
        .await
    }

    async fn labels(&self, campaign: String) -> Result<Arc<Labels>> {
        self.with(move |store| store.labels_of(&campaign)).await
    }

    async fn classes(&self, campaign: String) -> Result<v1::ListClassesResponse> {
        let labels = self.labels(campaign).await?;
        let newest = labels.class_changes().next_back();
        Ok(v1::ListClassesResponse {
            classes: labels.classes().into_iter().map(Into::into).collect(),
            newest_change: newest.map(|(number, change)| messages::change_of_classes(number, change)),
        })
    }
}

#[tonic::async_trait]
impl v1::label_service_server::LabelService for LabelApi {
    type AppendLabelsStream = Streamed<v1::AppendLabelsResponse>;

    async fn append_labels(
        &self,
        request: Request<v1::AppendLabelsRequest>,
    ) -> Answered<Self::AppendLabelsStream> {
        let v1::AppendLabelsRequest {
            campaign,
            request_id,
            answers,
        } = request.into_inner();
        if !(1..=MAX_ANSWERS).contains(&answers.len()) {
            let allowed = format!("1 to {MAX_ANSWERS} answers");
            return Err(Invalid::new("answers", answers.len(), allowed).into());
        }
        let now = now_ms();
        let changes = answers
            .into_iter()
            .enumerate()
            .map(|(place, answer)| {
                messages::change(answer, now).map_err(|error| error.within(&format!("answers[{place}]")))
            })
            .collect::<std::result::Result<_, _>>()?;
        let entries = self.add(campaign, request_id.parse()?, changes).await?;
        Ok(in_parts(messages::appended(entries)))
    }

    type AppendSyntheticLabelsStream = Streamed<v1::AppendLabelsResponse>;

    async fn append_synthetic_labels(
        &self,
        request: Request<v1::AppendSyntheticLabelsRequest>,
    ) -> Answered<Self::AppendSyntheticLabelsStream> {
        let message = request.into_inner();
        let (strategy, count) = (message.strategy().try_into()?, message.count as usize);
        let request: RequestId = message.request_id.parse()?;
        if !(1..=MAX_ANSWERS).contains(&count) {
            let allowed = format!("a whole number from 1 to {MAX_ANSWERS}");
            return Err(Invalid::new("count", count, allowed).into());
        }
        let (record, before) = self.made(message.campaign, request.clone()).await?;
        messages::check_synthetic(&before, &request).or_status()?;
        let entries = if before.is_empty() {
            let done = Arc::default();
            let interrupt = self.queries.interrupt();
            let answers = self.annotator.answers(&record, strategy, count, done, interrupt);
            let answers = self.annotator.dispatch.while_staffed(answers).await.or_status()?;
            let answers = answers.map_err(CampaignError::from).or_status()?;
            self.add(record.id.to_string(), request, answers).await?
        } else {
            before
        };
        Ok(in_parts(messages::appended(entries)))
    }

    type UndoLabelsStream = Streamed<v1::UndoLabelsResponse>;

    async fn undo_labels(&self, request: Request<v1::UndoLabelsRequest>) -> Answered<Self::UndoLabelsStream> {
        let v1::UndoLabelsRequest {
            campaign,
            request_id,
            annotator,
        } = request.into_inner();
        // Whoever may answer may also undo what the synthetic annotator answered last.
        let (request, annotator) = (request_id.parse()?, Annotator::known(&annotator)?);
        let undone = self
            .with(move |store| -> std::result::Result<_, LabelError> {
                let id = store.campaign(&campaign)?.id;
                store.undo_labels(&id, &request, &annotator, now_ms())
            })
            .await?;
        Ok(in_parts(messages::undone(undone)))
    }

    type WithdrawLabelsStream = Streamed<v1::AppendLabelsResponse>;

    async fn withdraw_labels(
        &self,
        request: Request<v1::WithdrawLabelsRequest>,
    ) -> Answered<Self::WithdrawLabelsStream> {
        let v1::WithdrawLabelsRequest {
            campaign,
            request_id,
            annotator,
            indices,
        } = request.into_inner();
        let (request, annotator) = (request_id.parse()?, annotator.parse::<Annotator>()?);
        if !(1..=MAX_ANSWERS).contains(&indices.len()) {
            let allowed = format!("1 to {MAX_ANSWERS} individuals");
            return Err(Invalid::new("indices", indices.len(), allowed).into());
        }
        if let Some(twice) = messages::repeated(&indices) {
            return Err(Invalid::new("indices", twice, "each individual once").into());
        }
        let now = now_ms();
        let withdraw = |index| Change {
            annotator: annotator.clone(),
            time_ms: now,
            action: Action::Withdraw { index },
        };
        let changes = indices.into_iter().map(withdraw).collect();
        let entries = self.add(campaign, request, changes).await?;
        Ok(in_parts(messages::appended(entries)))
    }

    type ListLabelsStream = Streamed<v1::ListLabelsResponse>;

    async fn list_labels(&self, request: Request<v1::ListLabelsRequest>) -> Answered<Self::ListLabelsStream> {
        let labels = self.labels(request.into_inner().campaign).await?;
        Ok(in_parts(messages::listed(&labels)))
    }

    type ListLabelEntriesStream = Streamed<v1::ListLabelEntriesResponse>;

    async fn list_label_entries(
        &self,
        request: Request<v1::ListLabelEntriesRequest>,
    ) -> Answered<Self::ListLabelEntriesStream> {
        let (store, campaign) = (self.store.clone(), request.into_inner().campaign);
        let read = in_background(move |_| store.label_log(&store.campaign(&campaign)?.id));
        let log = read.await.or_status()?.or_status()?;
        let entries = log.into_iter().map(v1::LabelEntry::from);
        let part = |entries| v1::ListLabelEntriesResponse { entries };
        Ok(in_parts(parts(entries, part)))
    }

    async fn list_classes(
        &self,
        request: Request<v1::ListClassesRequest>,
    ) -> Answered<v1::ListClassesResponse> {
        Ok(Response::new(self.classes(request.into_inner().campaign).await?))
    }

    async fn change_class(
        &self,
        request: Request<v1::ChangeClassRequest>,
    ) -> Answered<v1::ListClassesResponse> {
        let v1::ChangeClassRequest {
            campaign,
            request_id,
            annotator,
            change,
        } = request.into_inner();
        let change = change.ok_or_else(|| Invalid::missing("change", "a change of a class"))?;
        let change = Change {
            annotator: annotator.parse()?,
            time_ms: now_ms(),
            action: change.try_into()?,
        };
        self.add(campaign.clone(), request_id.parse()?, vec![change])
            .await?;
        Ok(Response::new(self.classes(campaign).await?))
    }

    async fn next_queries(
        &self,
        request: Request<v1::NextQueriesRequest>,
    ) -> Answered<v1::NextQueriesResponse> {
        let message = request.into_inner();
        let campaign = message.campaign.clone();
        let wish: QueryRequest = message.try_into()?;
        let asked = self
            .queries
            .next(&campaign, wish, Instant::now())
            .await
            .or_status()?;
        Ok(Response::new(asked.into()))
    }

    type GetAgreementStream = Streamed<v1::Agreement>;

    async fn get_agreement(
        &self,
        request: Request<v1::GetAgreementRequest>,
    ) -> Answered<Self::GetAgreementStream> {
        let v1::GetAgreementRequest {
            campaign,
            first,
            second,
        } = request.into_inner();
        let annotator = |field: &str, name: String| -> Result<Annotator> {
            let named = Annotator::known(&name).map_err(|error| Invalid {
                field: field.to_owned(),
                ..error
            });
            Ok(named?)
        };
        let (first, second) = (annotator("first", first)?, annotator("second", second)?);
        let labels = self.labels(campaign).await?;
        for annotator in [&first, &second] {
            if !labels.annotators().any(|known| known == annotator) {
                return Err(unknown(annotator, &labels));
            }
        }
        let agreement = Agreement::between(&labels.by(&first), &labels.by(&second));
        Ok(in_parts(messages::agreed(agreement)))
    }
}

/// Nobody of that name has answered.
fn unknown(annotator: &Annotator, labels: &Labels) -> Status {
    let known: Vec<&str> = labels.annotators().map(Annotator::as_str).collect();
    Status::not_found(match known.as_slice() {
        [] => format!("annotator \"{annotator}\" has given no labels in this campaign, and nobody else has"),
        known => format!(
            "annotator \"{annotator}\" has given no labels in this campaign; annotators who have: {}",
            known.join(", ")
        ),
    })
}

fn now_ms() -> u64 {
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0, |age| age.as_millis() as u64)
}
