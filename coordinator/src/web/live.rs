//! Pages that follow what happens: the parts that change, sent again whenever they do.

use super::{Web, pages, wrong::Wrong};
use crate::{
    campaign::{CampaignError, CampaignState, blocking},
    service::Seat,
};
use axum::{
    extract::{Path, State},
    response::sse::{Event, KeepAlive, Sse},
};
use serde_json::json;
use std::{convert::Infallible, time::Duration};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;

/// Least time between two messages to one page.
const INTERVAL: Duration = Duration::from_millis(250);

type Events = Sse<axum::response::sse::KeepAliveStream<ReceiverStream<Result<Event, Infallible>>>>;

pub(super) async fn campaigns(State(web): State<Web>) -> Result<Events, Wrong> {
    let seat = seat(&web)?;
    let look = move || {
        let web = web.clone();
        async move { Ok(pages::table(&web.campaigns.list().await?).into_string()) }
    };
    Ok(follow(seat, look, |table| async { Ok(table) }))
}

pub(super) async fn campaign(State(web): State<Web>, Path(id): Path<String>) -> Result<Events, Wrong> {
    let id = web.campaigns.status(&id).await?.record.id;
    let seat = seat(&web)?;
    let (looking, looked_at) = (web.clone(), id.clone());
    let look = move || {
        let (web, id) = (looking.clone(), looked_at.clone());
        async move { Ok(pages::figures(&web.campaigns.status(id.as_str()).await?).into_string()) }
    };
    Ok(follow(seat, look, move |_| {
        let (web, id) = (web.clone(), id.clone());
        async move {
            let status = web.campaigns.status(id.as_str()).await?;
            Ok(pages::standing(&web, &status).await?.into_string())
        }
    }))
}

/// For scripts: which edition the archive is of, how many it holds, whether it has a taxonomy, how long its label log is,
/// what is being done with it; whoever shows any of these looks again when it changes.
pub(super) async fn changes(State(web): State<Web>, Path(id): Path<String>) -> Result<Events, Wrong> {
    let id = web.campaigns.status(&id).await?.record.id;
    let seat = seat(&web)?;
    let look = move || {
        let (web, id) = (web.clone(), id.clone());
        async move {
            let status = web.campaigns.status(id.as_str()).await?;
            let doing = status.active.then(|| pages::doing(&status));
            let record = status.record;
            let entries = blocking(move || web.store.label_entries(&id)).await??;
            let seen = json!({
                "edition": record.edition().to_string(),
                "individuals": record.individuals(),
                "completed": record.state == CampaignState::Completed,
                "labels": entries,
                "doing": doing,
            });
            Ok(seen.to_string())
        }
    };
    Ok(follow(seat, look, |seen| async { Ok(seen) }))
}

fn seat(web: &Web) -> Result<Seat, Wrong> {
    let seat = web.archive.seats.watch();
    seat.map_err(|status| Wrong::Busy(status.message().to_owned()))
}

/// Sends what `draw` makes of what `look` sees, whenever that is not what it was before, for as long as somebody listens.
fn follow<Look, Looked, Draw, Drawn>(seat: Seat, look: Look, draw: Draw) -> Events
where
    Look: Fn() -> Looked + Send + 'static,
    Looked: Future<Output = Result<String, CampaignError>> + Send,
    Draw: Fn(String) -> Drawn + Send + 'static,
    Drawn: Future<Output = Result<String, CampaignError>> + Send,
{
    let (events, stream) = mpsc::channel(1);
    tokio::spawn(async move {
        let _seat = seat;
        let mut seen = None;
        while let Ok(sight) = look().await {
            if seen.as_ref() != Some(&sight) {
                seen = Some(sight.clone());
                let Ok(part) = draw(sight).await else { return };
                if events.send(Ok(Event::default().data(part))).await.is_err() {
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
