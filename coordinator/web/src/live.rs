//! Pages that follow what happens: the parts that change, sent again whenever they do.

use super::{Web, page_error::PageError, pages};
use axum::{
    extract::{Path, State},
    response::sse::{Event, KeepAlive, Sse},
};
use murmuration_engine::{blocking::blocking, campaign::CampaignError};
use murmuration_model::{ArchiveVersion, CampaignRecord, CampaignState};
use murmuration_service::Permit;
use serde_json::json;
use std::{convert::Infallible, sync::Arc, time::Duration};
use tokio::sync::{Mutex, mpsc};
use tokio_stream::wrappers::ReceiverStream;

/// Least time between two messages to one page.
const INTERVAL: Duration = Duration::from_millis(250);

type Events = Sse<axum::response::sse::KeepAliveStream<ReceiverStream<Result<Event, Infallible>>>>;

pub(super) async fn campaigns(State(web): State<Web>) -> Result<Events, PageError> {
    let seat = seat(&web)?;
    let look = move || {
        let web = web.clone();
        async move { Ok(pages::table(&web.campaigns.list().await?).into_string()) }
    };
    Ok(follow(seat, look))
}

pub(super) async fn campaign(State(web): State<Web>, Path(id): Path<String>) -> Result<Events, PageError> {
    let id = web.campaigns.status(&id).await?.record.id;
    let seat = seat(&web)?;
    let shown = Arc::<Mutex<Option<Shown>>>::default();
    let look = move || {
        let (web, id, shown) = (web.clone(), id.clone(), shown.clone());
        async move {
            let status = web.campaigns.status(id.as_str()).await?;
            let of = stands(&status.record);
            let mut shown = shown.lock().await;
            let taxonomy = match shown.take() {
                Some((version, taxonomy)) if version == of => taxonomy,
                _ => pages::taxonomy(&web, &status.record).await?.into_string(),
            };
            let part = format!("{}{taxonomy}", pages::figures(&status).into_string());
            *shown = Some((of, taxonomy));
            Ok(part)
        }
    };
    Ok(follow(seat, look))
}

/// A taxonomy as a page shows it, and of which archive: it is read again when that is another.
type Shown = (Stands, String);

/// What archive there is, and whether it has a taxonomy.
type Stands = (ArchiveVersion, u64, bool);

fn stands(record: &CampaignRecord) -> Stands {
    let completed = record.state == CampaignState::Completed;
    (record.archive_version(), record.individuals(), completed)
}

/// For scripts: which archive version the archive is of, how many it holds, whether it has a taxonomy, how long its label log is,
/// what is being done with it; whoever shows any of these looks again when it changes.
pub(super) async fn changes(State(web): State<Web>, Path(id): Path<String>) -> Result<Events, PageError> {
    let id = web.campaigns.status(&id).await?.record.id;
    let seat = seat(&web)?;
    let look = move || {
        let (web, id) = (web.clone(), id.clone());
        async move {
            let status = web.campaigns.status(id.as_str()).await?;
            let doing = status.active.then(|| pages::doing(&status));
            let record = status.record;
            let entries = blocking(move || web.store.label_entries(&id)).await??;
            let (archive_version, individuals, completed) = stands(&record);
            let seen = json!({
                "archive_version": archive_version.to_string(),
                "individuals": individuals,
                "completed": completed,
                "labels": entries,
                "doing": doing,
            });
            Ok(seen.to_string())
        }
    };
    Ok(follow(seat, look))
}

fn seat(web: &Web) -> Result<Permit, PageError> {
    let seat = web.archive.permits.watch();
    seat.map_err(|status| PageError::Busy(status.message().to_owned()))
}

/// Sends what `look` sees, whenever that is not what it was before, for as long as somebody listens. It is called several
/// times a second: what it reads must not grow with the archive.
fn follow<Look, Looked>(seat: Permit, look: Look) -> Events
where
    Look: Fn() -> Looked + Send + 'static,
    Looked: Future<Output = Result<String, CampaignError>> + Send,
{
    let (events, stream) = mpsc::channel(1);
    tokio::spawn(async move {
        let _seat = seat;
        let mut seen = None;
        while let Ok(sight) = look().await {
            if seen.as_ref() != Some(&sight) {
                seen = Some(sight.clone());
                if events.send(Ok(Event::default().data(sight))).await.is_err() {
                    return;
                }
            }
            tokio::select! {
                () = events.closed() => return,
                () = tokio::time::sleep(INTERVAL) => {}
            }
        }
    });
    Sse::new(ReceiverStream::new(stream)).keep_alive(KeepAlive::default())
}
