//! The service for labels, classes, and the questions to ask next.

mod messages;

use super::{Streamed, as_taken, in_parts};
use crate::status::OrStatus as _;
use murmuration_engine::{
    blocking::in_background,
    campaign::CampaignError,
    queries::{Queries, QueryRequest},
    synthetic::SyntheticAnnotator,
};
use murmuration_model::{
    CampaignId, CampaignRecord,
    labels::{Action, Agreement, Annotator, Change, Entry, Labels, RequestId},
};
use murmuration_proto::v1;
use murmuration_store::{LabelBudget, LabelError, Store, StoreError};
use murmuration_swarm::Invalid;
use std::{
    sync::Arc,
    thread,
    time::{Duration, Instant, SystemTime, UNIX_EPOCH},
};
use tonic::{Request, Response, Status};

/// Maximum number of answers in one request.
const MAX_ANSWERS: usize = 50_000;
/// Number of entries in a part of the log: an entry with the longest names has some 500 bytes.
const LISTED_AT_ONCE: u64 = 2_000;
/// Maximum number of entries of a request that needs no rest.
const FEW_ENTRIES: usize = 100;
/// A request with many entries rests for `REST` times as long as it held the store, but at most for [`MOST_REST`].
const REST: u32 = 3;
const MOST_REST: Duration = Duration::from_secs(2);

/// Implements `murmuration.v1.LabelService`.
#[derive(Debug, Clone)]
pub struct LabelApi {
    pub store: Store,
    pub queries: Queries,
    /// The annotator that answers in place of a person.
    pub annotator: SyntheticAnnotator,
}

type Result<T> = std::result::Result<T, Status>;
type Answered<T> = Result<Response<T>>;

impl LabelApi {
    async fn add(&self, campaign: String, request: RequestId, changes: Vec<Change>) -> Result<Vec<Entry>> {
        let takes_back = |change: &Change| matches!(change.action, Action::Withdraw { .. });
        let count = changes.len();
        let wanted = if changes.iter().all(takes_back) { 0 } else { count };
        self.within_budget(campaign, request, wanted, move |store, id, request| {
            resting(|| store.add_labels(id, request, changes), |_| count)
        })
        .await
    }

    /// Runs `add`, which adds entries to a campaign's log, if the budget of the request's token has `wanted` entries left; 0
    /// entries are always allowed. A repeated request adds nothing, and costs nothing.
    async fn within_budget<T: Send + 'static>(
        &self,
        campaign: String,
        request: RequestId,
        wanted: usize,
        add: impl FnOnce(&Store, &CampaignId, &RequestId) -> std::result::Result<Vec<T>, LabelError>
        + Send
        + 'static,
    ) -> Result<Vec<T>> {
        let budget = LabelBudget::current();
        let add = move |store: &Store| -> std::result::Result<_, LabelError> {
            let id = store.campaign(&campaign)?.id;
            let budget = match budget {
                Some(budget) if store.request_entries(&id, &request)?.is_empty() => budget,
                _ => return add(store, &id, &request),
            };
            let reserved = budget.reserve(wanted)?;
            let added = add(store, &id, &request)?;
            reserved.settle(added.len());
            Ok(added)
        };
        self.store.run(add).await.or_status()
    }

    /// A campaign, and the entries that an earlier request with this id has added.
    async fn made(&self, campaign: String, request: RequestId) -> Result<(CampaignRecord, Vec<Entry>)> {
        let read = move |store: &Store| -> std::result::Result<_, StoreError> {
            let record = store.campaign(&campaign)?;
            let before = store.request_entries(&record.id, &request)?;
            Ok((record, before))
        };
        self.store.run(read).await.or_status()
    }

    async fn labels(&self, campaign: String) -> Result<Arc<Labels>> {
        self.store
            .run(move |store| store.labels_of(&campaign))
            .await
            .or_status()
    }

    async fn classes(&self, campaign: String) -> Result<v1::ListClassesResponse> {
        let labels = self.labels(campaign).await?;
        let listed = in_background(move |_| {
            let newest = labels.class_changes().next_back();
            v1::ListClassesResponse {
                classes: labels.classes().into_iter().map(Into::into).collect(),
                newest_change: newest.map(|(number, change)| messages::change_of_classes(number, change)),
            }
        });
        listed.await.or_status()
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
            // Check the budget before workers simulate.
            if let Some(budget) = LabelBudget::current() {
                budget.reserve(count).map_err(LabelError::from).or_status()?;
            }
            let done = Arc::default();
            let interrupt = self.queries.interrupt();
            let answers = self.annotator.answers(&record, strategy, count, done, interrupt);
            let answers = self.annotator.dispatch.while_staffed(answers).await.or_status()?;
            let answers = answers.map_err(CampaignError::from).or_status()?;
            self.add(record.id.to_string(), request, answers).await?
        } else {
            // The mirror may lack the entries of the first request, and this waits for it.
            self.store.reach_mirror().await.or_status()?;
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
        // Every annotator may also undo the latest answers of the synthetic annotator.
        let (request, annotator) = (request_id.parse()?, Annotator::known(&annotator)?);
        let undone = self
            .within_budget(campaign, request, 0, move |store, id, request| {
                let undo = || store.undo_labels(id, request, &annotator, now_ms());
                resting(undo, |undone| undone.as_ref().map_or(0, Vec::len))
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
        let seen = Arc::clone(&labels);
        let all = in_background(move |_| (seen.digest().to_string(), seen.standing_entries().collect()));
        let (digest, entries): (String, Vec<u64>) = all.await.or_status()?;
        let entries = Arc::new(entries);
        Ok(as_taken(move |begins| {
            let (labels, entries) = (Arc::clone(&labels), Arc::clone(&entries));
            let digest = if begins == 0 {
                digest.clone()
            } else {
                String::new()
            };
            async move {
                let made = in_background(move |_| {
                    let left = entries.get(begins as usize..).unwrap_or_default();
                    let listed = left.iter().take(LISTED_AT_ONCE as usize);
                    let labels = listed.filter_map(|entry| labels.given(*entry)).map(Into::into);
                    let part = v1::ListLabelsResponse {
                        labels: labels.collect(),
                        digest,
                    };
                    let more = left.len() as u64 > LISTED_AT_ONCE;
                    (part, more.then_some(begins + LISTED_AT_ONCE))
                });
                made.await.or_status()
            }
        }))
    }

    type ListLabelEntriesStream = Streamed<v1::ListLabelEntriesResponse>;

    async fn list_label_entries(
        &self,
        request: Request<v1::ListLabelEntriesRequest>,
    ) -> Answered<Self::ListLabelEntriesStream> {
        let campaign = request.into_inner().campaign;
        let record = self.store.run(move |store| store.campaign(&campaign)).await;
        let id = record.or_status()?.id;
        let store = self.store.clone();
        Ok(as_taken(move |begins| {
            let (store, id) = (store.clone(), id.clone());
            async move {
                let read = in_background(move |_| store.label_log_from(&id, begins, LISTED_AT_ONCE));
                let entries = read.await.or_status()?.or_status()?;
                let more = entries.len() as u64 == LISTED_AT_ONCE;
                let entries = entries.into_iter().map(Into::into).collect();
                let part = v1::ListLabelEntriesResponse { entries };
                Ok((part, more.then_some(begins + LISTED_AT_ONCE)))
            }
        }))
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
        let mut request: QueryRequest = message.try_into()?;
        request.holder.token = LabelBudget::current().map(|budget| budget.holder());
        let asked = self
            .queries
            .next(&campaign, request, Instant::now())
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
        let agreed = in_background(move |_| {
            for annotator in [&first, &second] {
                if !labels.annotators().any(|known| known == annotator) {
                    return Err(unknown(annotator, &labels));
                }
            }
            let agreement = Agreement::between(&labels.by(&first), &labels.by(&second));
            Ok(messages::agreed(agreement))
        });
        Ok(in_parts(agreed.await.or_status()??))
    }
}

/// The error for an annotator without answers.
fn unknown(annotator: &Annotator, labels: &Labels) -> Status {
    let known: Vec<&str> = labels.annotators().map(Annotator::as_str).collect();
    Status::not_found(match known.as_slice() {
        [] => format!("annotator \"{annotator}\" is unknown: nobody has given labels in this campaign"),
        known => format!(
            "annotator \"{annotator}\" has given no labels in this campaign; annotators who have: {}",
            known.join(", ")
        ),
    })
}

/// Applies a request to the store. A request with many entries (`count` of the outcome) rests before it ends. An annotator with
/// many such requests thus leaves most of the time to campaigns and to other annotators.
fn resting<T>(apply: impl FnOnce() -> T, count: impl FnOnce(&T) -> usize) -> T {
    let begun = Instant::now();
    let done = apply();
    if count(&done) > FEW_ENTRIES {
        thread::sleep((REST * begun.elapsed()).min(MOST_REST));
    }
    done
}

fn now_ms() -> u64 {
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0, |age| age.as_millis() as u64)
}
