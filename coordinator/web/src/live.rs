//! The event streams of pages: the coordinator sends the parts of a page again whenever they change.

use super::{
    Web, asked::Query, found::Wanted, layout::ArchiveState, list, page_error::PageError, pages, stages,
};
use axum::{
    extract::{Path, State},
    response::sse::{Event, KeepAlive, Sse},
};
use maud::Markup;
use murmuration_engine::campaign::CampaignError;
use murmuration_model::{CampaignState, Rounds};
use murmuration_service::Followed;
use murmuration_swarm::CheckpointDigest;
use serde::Serialize;
use serde_json::json;
use std::{
    convert::Infallible,
    sync::Arc,
    time::{Duration, Instant},
};
use tokio::sync::{Mutex, mpsc};
use tokio_stream::wrappers::ReceiverStream;

/// Minimum time between two messages to a page.
const INTERVAL: Duration = Duration::from_millis(250);
/// Maximum time between two looks at a page that takes long to make.
const MOST_SELDOM: Duration = Duration::from_secs(5);

pub(super) type Events = Sse<axum::response::sse::KeepAliveStream<ReceiverStream<Result<Event, Infallible>>>>;

pub(super) async fn campaigns(
    State(web): State<Web>,
    Query(parameters): Query<Vec<(String, String)>>,
) -> Result<Events, PageError> {
    let wanted = Wanted::try_from(parameters)?;
    let sights = web.sights.follow(format!("campaigns {wanted:?}"));
    // Kept while this page follows, so that the pages of all searches share one list.
    let kept = (
        web.heads.follow(String::new()),
        web.scalars.follow(wanted.order.name().to_owned()),
    );
    let look = move || {
        let (web, wanted, _kept) = (web.clone(), wanted.clone(), kept.clone());
        async move { Ok::<_, PageError>(list::table(&web, &wanted, INTERVAL).await?.into_string()) }
    };
    Ok(follow(sights, look))
}

pub(super) async fn campaign(State(web): State<Web>, Path(id): Path<String>) -> Result<Events, PageError> {
    let id = web.campaigns.status(&id).await?.record.id;
    let latest = Arc::<Mutex<Option<Rendered>>>::default();
    let sights = web.sights.follow(format!("campaign {id}"));
    let look = move || {
        let (web, id, latest) = (web.clone(), id.clone(), latest.clone());
        async move {
            let status = web.campaigns.status(id.as_str()).await?;
            let of = status.record.id.clone();
            let entries = web.store.run(move |store| store.label_entries(&of)).await?;
            let record = &status.record;
            let of = (
                ArchiveState::of(record),
                record.state,
                entries,
                record.rounds,
                record.embedder.next(),
            );
            let mut latest = latest.lock().await;
            let rendered = match latest.take() {
                Some(rendered) if rendered.of == of => rendered,
                _ => Rendered {
                    of,
                    cards: web.store.run(move |store| pages::cards_state(store, &id)).await?,
                    history: pages::rounds(&web, record).await?,
                },
            };
            let slots = pages::Slots {
                history: rendered.history.clone(),
                ..pages::Slots::of(&web, &status, rendered.cards.as_deref()).await
            };
            *latest = Some(rendered);
            Ok::<_, PageError>(slots.sent())
        }
    };
    Ok(follow(sights, look))
}

/// The parts of a campaign's page that are made again only if the archive or the labels have changed.
struct Rendered {
    /// Sources of the markup: the states of archive and campaign, the length of the label log, the rounds, and the
    /// checkpoint that the archive moves to.
    of: (ArchiveState, CampaignState, u64, Rounds, Option<CheckpointDigest>),
    /// See [`pages::cards_state`].
    cards: Option<String>,
    history: Markup,
}

/// The state of a campaign, for scripts.
#[derive(Debug, Serialize)]
struct ChangesView {
    /// The time at which the campaign was created, in milliseconds since 1970-01-01 UTC, and the number of its rollbacks, if any.
    created: String,
    archive_state: String,
    archive_version: String,
    individuals: u64,
    completed: bool,
    /// Number of entries of the label log.
    labels: u64,
    /// The current stage as a sentence.
    doing: Option<String>,
}

/// Sends the state of a campaign whenever it changes.
pub(super) async fn changes(State(web): State<Web>, Path(id): Path<String>) -> Result<Events, PageError> {
    let id = web.campaigns.status(&id).await?.record.id;
    let sights = web.sights.follow(format!("changes {id}"));
    let look = move || {
        let (web, id) = (web.clone(), id.clone());
        async move {
            let status = web.campaigns.status(id.as_str()).await?;
            let doing = status.active.then(|| stages::doing(&status));
            let record = status.record;
            let entries = web.store.run(move |store| store.label_entries(&id)).await?;
            let archive = ArchiveState::of(&record);
            let seen = json!(ChangesView {
                created: record.archive_version().origin(),
                archive_state: archive.word(),
                archive_version: archive.version.to_string(),
                individuals: record.sampled(),
                completed: archive.completed,
                labels: entries,
                doing,
            });
            Ok::<_, CampaignError>(seen.to_string())
        }
    };
    Ok(follow(sights, look))
}

/// Sends the result of `look` whenever the result changes, for as long as the client is connected. `look` runs several times a
/// second for all followers of `sights` together, so that its cost must not grow with the archive. If `look` takes up to
/// 1.25 s, it runs for at most a fifth of the time.
pub(super) fn follow<Look, Looked, E>(sights: Followed<String>, look: Look) -> Events
where
    Look: Fn() -> Looked + Send + 'static,
    Looked: Future<Output = Result<String, E>> + Send,
    E: Send,
{
    let (events, stream) = mpsc::channel(1);
    tokio::spawn(async move {
        let mut seen = None;
        // The first result must be new, even if other pages already follow `sights`.
        let mut age = Duration::ZERO;
        loop {
            let begun = Instant::now();
            let Ok(sight) = sights.within(age, look()).await else {
                return;
            };
            age = (4 * begun.elapsed()).clamp(INTERVAL, MOST_SELDOM);
            if seen.as_ref() != Some(&sight) {
                seen = Some(sight.clone());
                if events.send(Ok(Event::default().data(sight))).await.is_err() {
                    return;
                }
            }
            tokio::select! {
                () = events.closed() => return,
                () = tokio::time::sleep(age) => {}
            }
        }
    });
    Sse::new(ReceiverStream::new(stream)).keep_alive(KeepAlive::default())
}
